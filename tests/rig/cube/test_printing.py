import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.io.images import read_image
from handcal.rig.cube import Cube, net_rectangles_m, write_cube_pdf

CUBE = Cube(ids=(7, 11, 2, 33, 4, 5))


def test_the_net_shows_every_marker_upright_on_its_face() -> None:
    scale = 4000  # pixels a metre: cells of whole pixels
    image = np.full((round(0.2 * scale), round(0.27 * scale)), 255, np.uint8)
    for left, top, right, bottom in np.rint((net_rectangles_m(CUBE) + 0.008) * scale).astype(int):
        image[top:bottom, left:right] = 0
    corners, ids, _ = cv2.aruco.ArucoDetector(CUBE.marker_dictionary).detectMarkers(image)
    first = {
        int(marker): (found.reshape(4, 2)[0] / scale - 0.008) / CUBE.side_m
        for marker, found in zip(ids.ravel(), corners, strict=True)
    }
    columns_rows = {33: (0, 1), 7: (1, 1), 11: (2, 1), 2: (3, 1), 4: (1, 0), 5: (1, 2)}
    assert first.keys() == columns_rows.keys()
    for marker, place in columns_rows.items():
        np.testing.assert_allclose(first[marker], np.array(place) + 0.125, atol=0.01)


@pytest.mark.process
def test_the_printed_net_has_its_true_size(tmp_path: Path) -> None:
    if shutil.which("pdftoppm") is None:
        pytest.skip("pdftoppm is not installed")
    write_cube_pdf(tmp_path / "net.pdf", CUBE)
    command = ["pdftoppm", "-r", "101.6", "-gray", "-png", "-singlefile", "net.pdf", "net"]
    subprocess.run(command, cwd=tmp_path, check=True)
    image = read_image(tmp_path / "net.png", cv2.IMREAD_GRAYSCALE)
    corners, _, _ = cv2.aruco.ArucoDetector(CUBE.marker_dictionary).detectMarkers(image)
    sides_mm = [
        np.linalg.norm(found.reshape(4, 2)[1] - found.reshape(4, 2)[0]) / 4 for found in corners
    ]
    assert len(sides_mm) == 6
    np.testing.assert_allclose(sides_mm, 45.0, atol=0.4)


def test_a_net_larger_than_the_paper_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="more than a4 has"):
        write_cube_pdf(tmp_path / "net.pdf", Cube(side_m=0.08))
