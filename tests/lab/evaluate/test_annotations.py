import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.io.images import read_image
from handcal.lab.evaluate.annotations import Photo, read_annotations

HAND = {"box": [10, 20, 30, 60], "quad": [[10, 20], [30, 20], [30, 60], [10, 60]], "large": True}


def write(folder: Path, content: object) -> Path:
    path = folder / "annotations.json"
    path.write_text(json.dumps(content))
    return path


def photo(path: Path, width: int, height: int) -> Photo:
    return Photo(path, width, height, np.empty((0, 4)), np.empty((0, 4, 2)), np.empty(0, bool))


def test_reads_what_the_data_set_says(tmp_path: Path) -> None:
    entry = {"width": 100, "height": 80, "hands": [HAND]}
    [photo] = read_annotations(tmp_path, write(tmp_path, {"a.jpg": entry}))
    assert photo.path == tmp_path / "a.jpg"
    assert photo.boxes.tolist() == [[9.5, 19.5, 29.5, 59.5]]  # the file counts pixels from 1
    assert photo.quads.shape == (1, 4, 2)
    assert photo.large.tolist() == [True]
    assert photo.relative_sizes == pytest.approx(np.sqrt(20 * 40 / 8000))


def test_a_photograph_may_hold_no_hand(tmp_path: Path) -> None:
    entry = {"width": 100, "height": 80, "hands": []}
    [photo] = read_annotations(tmp_path, write(tmp_path, {"a.jpg": entry}))
    assert photo.boxes.shape == (0, 4)
    assert photo.relative_sizes.shape == (0,)


@pytest.mark.parametrize(
    "entry",
    [
        [],
        {"width": 100, "height": 80},
        {"width": "wide", "height": 80, "hands": []},
        {"width": 100, "height": 80, "hands": [HAND | {"box": [1, 2, 3]}]},
        {"width": 0, "height": 80, "hands": []},
        {"width": float("inf"), "height": 80, "hands": []},
        *(
            {"width": 100, "height": 80, "hands": [HAND | {"box": box}]}
            for box in (
                [0, 0, float("nan"), 9],
                [60, 10, 10, 60],
                [60, 60, 10, 10],
                [30, 30, 30, 30],
                [120, 10, 140, 60],
                [0, 0, 1e12, 1e12],
            )
        ),
        {"width": 100, "height": 80, "hands": [HAND | {"large": []}]},
        {"width": 100, "height": 80, "hands": [HAND | {"large": "false"}]},
    ],
)
def test_refuses_other_files(tmp_path: Path, entry: object) -> None:
    with pytest.raises(FileError, match="not a file of hand annotations"):
        read_annotations(tmp_path, write(tmp_path, {"a.jpg": entry}))


@pytest.mark.parametrize("name", ["a\0.png", "\ud800.png", "/a.png", "../a.png", "b/../../a.png"])
def test_refuses_photographs_elsewhere(tmp_path: Path, name: str) -> None:
    entry = {"width": 100, "height": 80, "hands": []}
    with pytest.raises(FileError, match="not a file of hand annotations"):
        read_annotations(tmp_path, write(tmp_path, {name: entry}))


def test_an_oriented_photograph_is_seen_as_it_was_annotated(tmp_path: Path) -> None:
    half = np.zeros((16, 16, 3), np.uint8)
    half[:8] = 255
    data = cv2.imencode(".jpg", half)[1].tobytes()
    # Exif whose one entry, 0x0112, says: turned by 180°.
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0"
    segment = b"\xff\xe1" + (len(exif) + 2).to_bytes(2) + exif
    (tmp_path / "turned.jpg").write_bytes(data[:2] + segment + data[2:])
    assert read_image(tmp_path / "turned.jpg", cv2.IMREAD_COLOR).mean((1, 2))[0] < 10
    assert photo(tmp_path / "turned.jpg", 16, 16).read().mean((1, 2))[0] > 245


def test_reads_photographs_as_rgb(tmp_path: Path) -> None:
    red = np.zeros((4, 5, 3), np.uint8)
    red[..., 0] = 255
    cv2.imwrite(str(tmp_path / "red.png"), red[..., ::-1])
    assert (photo(tmp_path / "red.png", 5, 4).read() == red).all()
    with pytest.raises(FileError, match="5x4 pixels, annotated as 50x40"):
        photo(tmp_path / "red.png", 50, 40).read()
