"""Folders of images as Open3D and TUM RGB-D store them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.camera.folder import ImageFolderCamera
from handcal.camera.recordings import open_recording
from handcal.core.errors import CameraEndError, CameraError
from handcal.core.types import Frame

DEPTH = np.arange(480 * 640, dtype=np.uint16).reshape(480, 640)
COLOR = np.zeros((480, 640, 3), np.uint8)
COLOR[..., 2] = 200  # red, as OpenCV stores it


def put(path: Path, image: np.ndarray[tuple[int, ...], np.dtype[np.uint8 | np.uint16]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(cv2.imencode(".png", image)[1].tobytes())


def open3d(folder: Path, name: str = "camera_intrinsic.json", **values: float) -> Path:
    matrix = [600.0, 0.0, 0.0, 0.0, 610.0, 0.0, 315.0, 245.0, 1.0]
    camera = {"width": 640, "height": 480, "intrinsic_matrix": matrix} | values
    folder.mkdir()
    (folder / name).write_text(json.dumps(camera))
    for number in range(3):
        put(folder / f"depth/{number:06}.png", DEPTH + number)
    put(folder / "color/000001.png", COLOR)
    return folder


def tum(folder: Path, lines: str = "1.0 depth/a.png\n1.1 depth/b.png\n") -> Path:
    put(folder / "depth/a.png", DEPTH)
    put(folder / "depth/b.png", DEPTH)
    put(folder / "rgb/c.png", COLOR)
    (folder / "depth.txt").write_text(f"# depth maps\n{lines}")
    (folder / "rgb.txt").write_text("0.9 rgb/none.png\n1.115 rgb/c.png\n")
    return folder


def read_all(folder: Path) -> list[Frame]:
    def frames() -> Iterator[Frame]:
        with open_recording(folder) as camera:
            assert isinstance(camera, ImageFolderCamera)
            while True:
                try:
                    yield camera.read()
                except CameraEndError:
                    return

    return list(frames())


def test_a_folder_of_open3d_is_played(tmp_path: Path) -> None:
    frames = read_all(open3d(tmp_path / "a"))
    assert [frame.color is not None for frame in frames] == [False, True, False]
    assert np.array_equal(frames[2].depth, DEPTH + 2)
    assert frames[1].color is not None
    assert frames[1].color[0, 0].tolist() == [200, 0, 0]
    lens = frames[0].depth_intrinsics
    assert (lens.fx, lens.fy, lens.cx, lens.cy) == (600.0, 610.0, 315.0, 245.0)
    assert frames[0].depth_scale_m == 1e-3
    own = read_all(open3d(tmp_path / "b", "intrinsic.json", depth_scale=4000.0, fps=10.0))
    assert own[0].depth_scale_m == 1 / 4000
    assert own[1].t_camera_ns == 100_000_000


def test_a_folder_of_tum_is_played(tmp_path: Path) -> None:
    folder = tum(tmp_path)
    frames = read_all(folder)
    assert [frame.color is not None for frame in frames] == [False, True]
    assert [frame.t_camera_ns for frame in frames] == [1_000_000_000, 1_100_000_000]
    assert (frames[0].depth_scale_m, frames[0].depth_intrinsics.fx) == (1 / 5000, 525.0)
    with open_recording(folder) as camera:
        assert "TUM's usual intrinsics" in camera.notes[0]
        camera.seek(0.05)
        assert camera.read().t_camera_ns == 1_100_000_000


@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (lambda path: tum(path, "1.0 ../a.png\n"), "is no image of this folder"),
        (lambda path: tum(path, "1.0 /etc/a.png\n"), "is no image of this folder"),
        (lambda path: tum(path, "1.0\n"), "a time and a file's name on each line"),
        (lambda path: tum(path, "nan depth/a.png\n"), "a time and a file's name on each line"),
        (lambda path: tum(path, ""), "has 0 depth images"),
        (lambda path: tum(path, "1.0 depth/x.png\n"), "x.png"),
        (lambda path: open3d(path / "o", depth_scale=0.001), "depth_scale is 0.001"),
        (lambda path: open3d(path / "o", intrinsic_matrix=1.0), "must give intrinsic_matrix"),
        (lambda path: open3d(path / "o", width=320), "is 640x480 pixels"),
        (lambda path: path, "no camera_intrinsic.json beside color and depth"),
    ],
)
def test_what_cannot_be_played_is_one_line(
    tmp_path: Path, make: Callable[[Path], Path], problem: str
) -> None:
    with (
        pytest.raises(CameraError, match=problem) as caught,
        open_recording(make(tmp_path)) as camera,
    ):
        camera.read()
    assert "\n" not in str(caught.value)
