"""Recordings as folders: exact, whole at any time, and refused when they are not."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.camera.folder import DESCRIPTION, LIST, FolderCamera, ImageFolderCamera, record_folder
from handcal.camera.playback import PlayedCamera
from handcal.camera.recordings import open_recording
from handcal.core.errors import CameraEndError, CameraError, FileError
from handcal.core.geometry import rigid
from handcal.core.types import Frame

MakeFrames = Callable[..., Iterator[Frame]]


def read_all(camera: PlayedCamera) -> Iterator[Frame]:
    while True:
        try:
            yield camera.read()
        except CameraEndError:
            return


@pytest.fixture
def folder(tmp_path: Path, make_frames: MakeFrames) -> Path:
    path = tmp_path / "deep" / "hand"
    assert record_folder(path, make_frames(12)) == 12
    return path


@pytest.mark.parametrize("with_color", [True, False])
def test_a_folder_plays_back_exactly_what_was_recorded(
    tmp_path: Path, make_frames: MakeFrames, with_color: bool
) -> None:
    recorded = list(make_frames(12, with_color))
    recorded[5] = replace(recorded[5], color=None, color_intrinsics=None, T_C_D=np.eye(4))
    record_folder(tmp_path / "hand", recorded)
    with FolderCamera(tmp_path / "hand") as camera:
        assert camera.depth_intrinsics == recorded[0].depth_intrinsics
        for got, want in zip(read_all(camera), recorded, strict=True):
            for name in ("index", "t_camera_ns", "depth_scale_m", "color_intrinsics"):
                assert getattr(got, name) == getattr(want, name)
            assert got.depth_intrinsics == want.depth_intrinsics
            np.testing.assert_array_equal(got.depth, want.depth)
            np.testing.assert_array_equal(got.T_C_D, want.T_C_D)
            if want.color is None:
                assert got.color is None
            else:
                np.testing.assert_array_equal(got.color, want.color)


def test_a_pose_is_played_back_exactly(tmp_path: Path, make_frames: MakeFrames) -> None:
    from_device = rigid([0.1, 0.2, 3.0]).astype(np.float32).astype(np.float64)
    poses = [rigid([0.1, -2.0, 0.3], [0.1, -1 / 3, 99.0]), None, from_device]
    frames = [
        replace(frame, T_W_D=T) for frame, T in zip(make_frames(3, False), poses, strict=True)
    ]
    record_folder(tmp_path / "hand", frames)
    with FolderCamera(tmp_path / "hand") as camera:
        for frame, T_W_D in zip(read_all(camera), poses, strict=True):
            np.testing.assert_array_equal(frame.T_W_D, T_W_D)
    with pytest.raises(ValueError, match="frame 1 is not from the camera"):
        record_folder(tmp_path / "late", [frames[1], frames[0]])


@pytest.mark.parametrize(
    "pose",
    [
        ",1 0 0 0 0 1 0 0 0 0 1 0,",
        "",
        ",1 0 0 0 0 1 0 0 0 0 1",
        ",1 0 0 0 0 1 0 0 0 0 1 x",
        ",1 0 0 0 0 1 0 0 0 0 1 nan",
        ",1 0 0 0 0 1 0 0 0 0 1 5e3",
        ",2 0 0 0 0 1 0 0 0 0 1 0",
        ",1 0 0 0 0 1 0 0 0 0 -1 0",
    ],
)
def test_a_damaged_pose_is_refused(folder: Path, pose: str) -> None:
    good = "1,2,0,1 0 0 0 0 1 0 0 0 0 1 0"
    (folder / LIST).write_text(f"index,t_camera_ns,has_color,T_W_D\n{good}\n2,3,0{pose}\n")
    with pytest.raises(CameraError, match=r"frames\.csv must .* rigid transform .* line 3 does"):
        FolderCamera(folder)


def test_frames_before_a_failure_are_kept(tmp_path: Path, make_frames: MakeFrames) -> None:
    def failing() -> Iterator[Frame]:
        yield from make_frames(12)
        raise RuntimeError("the program is killed")

    with pytest.raises(RuntimeError, match="killed"):
        record_folder(tmp_path / "hand", failing())
    with FolderCamera(tmp_path / "hand") as camera:
        assert 3 <= len(list(read_all(camera))) <= 12


def test_an_unfinished_line_is_left_out(folder: Path) -> None:
    listing = folder / LIST
    listing.write_bytes(listing.read_bytes()[:-3])
    with FolderCamera(folder) as camera:
        assert len(list(read_all(camera))) == 11


def test_lines_may_end_as_on_windows(folder: Path) -> None:
    listing = folder / LIST
    listing.write_bytes(listing.read_bytes().replace(b"\n", b"\r\n"))
    with FolderCamera(folder) as camera:
        assert len(list(read_all(camera))) == 12


def test_nothing_is_written_over(folder: Path, make_frames: MakeFrames) -> None:
    before = {path: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(FileError, match="is not empty; choose a new folder"):
        record_folder(folder, make_frames(1))
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("handcal_recording", 2, "is not a handcal recording of version 1"),
        ("depth", None, "must describe depth"),
        ("color", [], "must describe depth and"),
        ("depth_scale", 0, "depth_scale is 0"),
        ("depth_scale", 5000, "enter 0.0002 if a metre is 5000 units"),
        ("gate_m", [0.7, 0.2], "gate_m is 0.2, but must lie between 0.7"),
        ("gate_m", [0.2], "must give gate_m as a number"),
        ("T_C_D", [[1.0]], "must be a rigid transform"),
        ("device", "D415", "device must be an object"),
        ("device", {"serial_number": 123}, r"device\.serial_number must be one line"),
        ("T_C_D", "here", "must be a rigid transform"),
        ("T_C_D", np.diag([2.0, 1.0, 1.0, 1.0]).tolist(), "must be a rigid transform"),
    ],
)
def test_a_nonsense_description_is_refused(
    folder: Path, key: str, value: object, problem: str
) -> None:
    path = folder / DESCRIPTION
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(CameraError, match=problem):
        FolderCamera(folder)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "index\n1\n",
        "index,t_camera_ns,has_color\n1,2\n",
        "index,t_camera_ns,has_color\nx,2,1\n",
        f"index,t_camera_ns,has_color\n1,{2**63},1\n",
    ],
)
def test_a_nonsense_list_is_refused(folder: Path, text: str) -> None:
    (folder / LIST).write_text(text)
    with pytest.raises(CameraError, match=r"frames\.csv must"):
        FolderCamera(folder)


def test_a_missing_or_foreign_image_is_named(folder: Path) -> None:
    (folder / "depth-000001.png").unlink()
    (folder / "color-000002.png").write_bytes((folder / "depth-000002.png").read_bytes())
    with FolderCamera(folder) as camera:
        with pytest.raises(CameraError, match=r"cannot read .*depth-000001\.png"):
            camera.read()
        with pytest.raises(CameraError, match=r"color-000002\.png is 64x48 pixels"):
            camera.read()
        assert camera.read().index == 3


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


def read_images(folder: Path) -> list[Frame]:
    with open_recording(folder) as camera:
        assert isinstance(camera, ImageFolderCamera)
        return list(read_all(camera))


def test_a_folder_of_open3d_is_played(tmp_path: Path) -> None:
    frames = read_images(open3d(tmp_path / "a"))
    assert [frame.color is not None for frame in frames] == [False, True, False]
    assert np.array_equal(frames[2].depth, DEPTH + 2)
    assert frames[1].color is not None
    assert frames[1].color[0, 0].tolist() == [200, 0, 0]
    lens = frames[0].depth_intrinsics
    assert (lens.fx, lens.fy, lens.cx, lens.cy) == (600.0, 610.0, 315.0, 245.0)
    assert frames[0].depth_scale_m == 1e-3
    own = read_images(open3d(tmp_path / "b", "intrinsic.json", depth_scale=4000.0, fps=10.0))
    assert own[0].depth_scale_m == 1 / 4000
    assert own[1].t_camera_ns == 100_000_000


def test_a_folder_of_tum_is_played(tmp_path: Path) -> None:
    folder = tum(tmp_path)
    frames = read_images(folder)
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
