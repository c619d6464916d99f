import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.io.images import MAX_SIDE_PX, read_image
from handcal.rig.boards.board import Board
from handcal.rig.boards.finder import find_board
from handcal.rig.boards.printing import draw_board, write_board_pdf


def test_an_image_too_large_is_refused() -> None:
    with pytest.raises(ValueError, match=str(MAX_SIDE_PX)):
        draw_board(Board(), 1000)


@pytest.mark.process
@pytest.mark.parametrize("kind", ["charuco", "checkerboard"])
def test_the_printed_board_has_its_true_size(tmp_path: Path, kind: str) -> None:
    if shutil.which("pdftoppm") is None:
        pytest.skip("pdftoppm is not installed")
    board = Board(kind=kind)  # type: ignore[arg-type]
    write_board_pdf(tmp_path / "board.pdf", board)
    page = tmp_path / "page"
    dpi = 127  # five pixels a millimetre
    command = ["pdftoppm", "-r", str(dpi), "-gray", "-png", "-singlefile", "board.pdf", page.name]
    subprocess.run(command, cwd=tmp_path, check=True)
    image = read_image(page.with_suffix(".png"), cv2.IMREAD_GRAYSCALE)
    assert image.shape == pytest.approx((0.210 / 0.0254 * dpi, 0.297 / 0.0254 * dpi), abs=1)
    found = find_board(image, board)
    across_m = np.ptp(found.points_m[:, :2], axis=0)
    np.testing.assert_allclose(np.ptp(found.pixels, axis=0) / dpi * 0.0254, across_m, rtol=5e-4)
    ruler = image[-30:-5] < 128
    line = ruler[ruler.sum(axis=1).argmax()]
    first = np.flatnonzero(line)[0]
    assert np.flatnonzero(~line[first:])[0] / dpi * 25.4 == pytest.approx(100, abs=0.3)


def test_a_board_larger_than_the_paper_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="510×197 mm, more than a4 has"):
        write_board_pdf(tmp_path / "board.pdf", Board(squares=(20, 7)))
    with pytest.raises(ValueError, match="unknown paper a9"):
        write_board_pdf(tmp_path / "board.pdf", Board(), "a9")  # type: ignore[arg-type]
