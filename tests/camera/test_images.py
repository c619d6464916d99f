"""Frames from image files, good and bad."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from handcal.camera.images import read_frame
from handcal.core.errors import FileError

INTRINSICS = {
    "width": 40,
    "height": 30,
    "fx": 35.5,
    "fy": 36,
    "cx": 19.5,
    "cy": 14.5,
    "depth_scale": 0.00025,
}
DEPTH = np.arange(1200, dtype=np.uint16).reshape(30, 40) * 50
COLOR = np.random.default_rng(0).integers(0, 255, (30, 40, 3), np.uint8)


def write(path: Path, image: np.ndarray[Any, Any]) -> Path:
    assert cv2.imwrite(str(path), image)
    return path


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path, Path]:
    intrinsics = tmp_path / "intrinsics.json"
    intrinsics.write_text(json.dumps(INTRINSICS))
    color = write(tmp_path / "color.png", COLOR[..., ::-1])
    return color, write(tmp_path / "depth.png", DEPTH), intrinsics


def test_frame_holds_what_the_files_hold(files: tuple[Path, Path, Path]) -> None:
    frame = read_frame(*files)
    np.testing.assert_array_equal(frame.depth, DEPTH)
    np.testing.assert_array_equal(frame.color, COLOR)
    camera = frame.depth_intrinsics
    assert (camera.width, camera.height, camera.fx, camera.cy) == (40, 30, 35.5, 14.5)
    assert frame.color_intrinsics == camera
    assert frame.depth_scale_m == 0.00025
    np.testing.assert_array_equal(frame.T_C_D, np.eye(4))


@pytest.mark.parametrize("missing", range(3))
def test_missing_file_is_named(files: tuple[Path, Path, Path], missing: int) -> None:
    files[missing].unlink()
    with pytest.raises(FileError, match=f"cannot read .*{files[missing].name}"):
        read_frame(*files)


@pytest.mark.parametrize(
    "image", [DEPTH.astype(np.uint8), np.repeat(DEPTH[..., None], 3, axis=2)], ids=["8bit", "rgb"]
)
def test_depth_must_be_16_bit_grey(
    files: tuple[Path, Path, Path], image: np.ndarray[Any, Any]
) -> None:
    write(files[1], image)
    with pytest.raises(FileError, match="16-bit image of one channel"):
        read_frame(*files)


@pytest.mark.parametrize(("which", "image"), [(0, COLOR[:20]), (1, DEPTH[:, :20])])
def test_sizes_must_agree(
    files: tuple[Path, Path, Path], which: int, image: np.ndarray[Any, Any]
) -> None:
    write(files[which], np.ascontiguousarray(image))
    with pytest.raises(FileError, match=r"pixels, but its camera's intrinsics say 40x30"):
        read_frame(*files)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("fx", None),
        ("fx", "500"),
        ("fx", True),
        ("fx", 0),
        ("fy", float("nan")),
        ("cx", 1e9),
        ("cy", [1]),
        ("width", 40.5),
        ("width", -1),
        ("height", 10**9),
        ("depth_scale", 0),
        ("depth_scale", 1.0),
    ],
)
def test_nonsense_intrinsics_are_refused(
    files: tuple[Path, Path, Path], key: str, value: object
) -> None:
    files[2].write_text(json.dumps(INTRINSICS | {key: value}))
    with pytest.raises(FileError, match=rf"intrinsics\.json.*{key}"):
        read_frame(*files)
