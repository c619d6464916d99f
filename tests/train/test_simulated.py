from pathlib import Path

import cv2
import numpy as np

from handcal.io.files import read_json
from handcal.train.simulated import CAMERA, render_hands


def test_boxes_are_about_the_hands(tmp_path: Path) -> None:
    render_hands(tmp_path, 3)
    boxes = read_json(tmp_path / "boxes.json")
    assert len(boxes) == 3
    for name, (x0, y0, x1, y1) in boxes.items():
        picture = cv2.imread(str(tmp_path / name), cv2.IMREAD_UNCHANGED)
        assert picture is not None
        assert picture.shape == (CAMERA.height, CAMERA.width, 4)
        rows, columns = np.nonzero(picture[..., 3])
        inside = (columns >= x0 - 1) & (columns <= x1 + 1) & (rows >= y0 - 1) & (rows <= y1 + 1)
        assert inside.mean() > 0.3
        if y0 >= 0:
            assert abs(rows[inside].min() - y0) <= 2


def test_pictures_that_are_there_are_not_drawn_again(tmp_path: Path) -> None:
    render_hands(tmp_path, 1)
    written = (tmp_path / "00000.png").stat().st_mtime_ns
    render_hands(tmp_path, 1)
    assert (tmp_path / "00000.png").stat().st_mtime_ns == written
