import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, Intrinsics
from handcal.rig.boards.board import Board
from handcal.rig.boards.views import BoardImage
from handcal.rig.formats import (
    CALIBRATION_FORMATS,
    CalibrationFormat,
    camera_json,
    read_identity,
    read_intrinsics,
    read_pose,
    read_stereo,
    stereo_json,
    write_intrinsics,
    write_pose,
)
from handcal.rig.lens.camera import calibrate_camera
from handcal.rig.lens.stereo import calibrate_stereo
from handcal.rig.storage import MAX_STORAGE_BYTES
from handcal.sim.boards import board_poses, board_view

FIVE = (0.1, -0.2, 1 / 3 * 1e-3, 0.002, 0.03)
CAMERA = Intrinsics(640, 480, 500.1, 1501 / 3, 320.5, 239.5, FIVE)
T_H_D = rigid([0.1, -0.2, 0.3], [0.01, -0.02, 0.03])
ROS = """image_width: 640   # as written by others
image_height: 480
camera_name: head/rgb
camera_matrix:
  rows: 3
  cols: 3
  data: [500, 0, 320,
         0, 501, 240, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data:
  - 0.1
  - -2.0e-01
  - 0
  - 0.0
  - 0.5
rectification_matrix:
  rows: 3
  cols: 3
  data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]
"""


def test_the_identity_of_a_camera_is_kept_as_json(tmp_path: Path) -> None:
    path, identity = tmp_path / "c.json", CameraIdentity("Intel RealSense D415", "123", "5.16")
    write_intrinsics(path, CAMERA, "json", identity)
    assert read_intrinsics(path) == CAMERA
    assert read_identity(path) == identity
    for kind in CALIBRATION_FORMATS:
        write_intrinsics(path, CAMERA, kind)
        assert read_identity(path) == CameraIdentity()
    for bad in (3, {"model": 3}, {"serial_number": "1\n2"}, {"firmware": "x" * 1000}):
        path.write_text(json.dumps({"handcal_camera": 1, "device": bad}))
        with pytest.raises(FileError, match=r"c\.json: device"):
            read_identity(path)


@pytest.mark.parametrize("kind", CALIBRATION_FORMATS)
@pytest.mark.parametrize("more", [(), (0.4, 0.5, 0.6)])
def test_intrinsics_survive_exactly(
    tmp_path: Path, kind: CalibrationFormat, more: tuple[float, ...]
) -> None:
    camera = Intrinsics(640, 480, 500.1, 1501 / 3, 320.5, 239.5, FIVE + more)
    write_intrinsics(tmp_path / "camera", camera, kind)
    assert read_intrinsics(tmp_path / "camera") == camera


@pytest.mark.parametrize("kind", ["opencv", "json"])
def test_the_pose_survives_exactly(tmp_path: Path, kind: CalibrationFormat) -> None:
    write_pose(tmp_path / "pose", T_H_D, kind)
    np.testing.assert_array_equal(read_pose(tmp_path / "pose"), T_H_D)


def test_opencv_reads_what_is_written_for_it(tmp_path: Path) -> None:
    write_intrinsics(tmp_path / "camera.yaml", CAMERA, "opencv")
    storage = cv2.FileStorage(str(tmp_path / "camera.yaml"), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(
        storage.getNode("distortion_coefficients").mat().ravel(), CAMERA.distortion
    )
    assert storage.getNode("camera_matrix").mat()[0, 0] == CAMERA.fx


def test_ros_files_by_others_are_read(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    path.write_text(ROS)
    expected = Intrinsics(640, 480, 500.0, 501.0, 320.0, 240.0, (0.1, -0.2, 0.0, 0.0, 0.5))
    assert read_intrinsics(path) == expected


def test_opencv_own_sample_is_read(shared_data: Path) -> None:
    camera = read_intrinsics(shared_data / "boards" / "opencv_stereo" / "left_intrinsics.yml")
    assert (camera.width, camera.height) == (640, 480)
    assert camera.fx == pytest.approx(535.91573396)
    assert len(camera.distortion) == 5


def test_a_whole_calibration_survives(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    board = Board()
    plain = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)
    pairs = [
        (
            BoardImage(f"d{number}", board_view(board, T, plain, rng, 0.1), dropped=number == 2),
            BoardImage(f"h{number}", board_view(board, T_H_D @ T, plain, rng, 0.1)),
        )
        for number, T in enumerate(board_poses(board, plain, 8, rng))
    ]
    stereo = calibrate_stereo(pairs, plain, plain)
    (tmp_path / "stereo.json").write_text(json.dumps(stereo_json(stereo)))
    again = read_stereo(tmp_path / "stereo.json")
    assert json.dumps(stereo_json(again)) == json.dumps(stereo_json(stereo))
    assert again.dropped == ("d2",)
    np.testing.assert_array_equal(read_pose(tmp_path / "stereo.json"), stereo.T_H_D)
    camera = calibrate_camera([first for first, _ in pairs])
    (tmp_path / "camera.json").write_text(json.dumps(camera_json(camera)))
    assert read_intrinsics(tmp_path / "camera.json") == camera.intrinsics


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "must be a map"),
        ("{", "not valid JSON"),
        ("{}", "no camera and seems to be JSON of another kind; handcal reads"),
        ("%YAML 1.2\n---\n" + "[" * 4000, "not valid YAML or XML"),
        ("%YAML 1.2\n---\na: " + "[" * MAX_STORAGE_BYTES, "nested too deeply"),
        ("\x00", "map|YAML"),
        (ROS.replace("plumb_bob", "omni"), "lens model omni is not known; OpenCV"),
        (ROS.replace("rows: 3", "rows: 1000000000"), "camera matrix must have rows times cols"),
        (ROS.replace("cols: 5", "cols: 4"), "distortion must have rows times cols"),
        (ROS.replace("[500, 0,", "[500, 1,"), "no skew"),
        (ROS.replace("[500, 0,", "[-5, 0,"), "fx is -5 px, but must lie between 64 and 6400"),
        (ROS.replace("[500, 0,", "[.nan, 0,"), "camera matrix must be finite"),
        (ROS.replace("image_width: 640", "image_width: 99999"), "between 1 and 16384"),
        (ROS.replace("image_height: 480", "image_height: a"), "width and height must be finite"),
        ('{"handcal_camera": 1, "width": 1e400}', "width must be a finite number"),
        ('{"handcal_camera": 1, "width": [[1], [1, 2]]}', "width must be a finite number"),
        ('{"handcal_camera": 2}', "the version known"),
    ],
)
def test_what_is_wrong_with_intrinsics_is_named(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "camera"
    path.write_text(text)
    with pytest.raises(FileError, match=said):
        read_intrinsics(path)


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("T_H_D", [[1.0]], "pose must be rigid"),
        ("T_H_D", (2 * np.eye(4)).tolist(), "pose must be rigid"),
        ("covariance", [[1.0]], "covariance"),
        ("covariance", "none", "covariance must hold finite numbers"),
        ("covariance", (-np.eye(6)).tolist(), "negative variances"),
        ("covariance", (np.ones((6, 6)) - 0.5 * np.eye(6)).tolist(), "negative variances"),
        ("rms_px", -1.0, "must not be negative"),
        ("residuals_px", {"a": -0.1}, "must not be negative"),
        ("spread_m", -1e-3, "must not be negative"),
        ("worst", {"name": "a", "rms_px": -0.2, "why": ""}, "must not be negative"),
        ("depth", [], "depth must be an object"),
        ("residuals_px", {"a": None}, "a must be a finite number"),
        ("verdict", {"name": "perfect"}, "verdict.name"),
        ("dropped", None, "dropped must be a list"),
    ],
)
def test_what_is_wrong_with_a_stereo_calibration_is_named(
    tmp_path: Path, field: str, value: object, said: str
) -> None:
    camera = {"width": 640, "height": 480, "fx": 500, "fy": 500, "cx": 320, "cy": 240}
    values = {
        "handcal_stereo": 1,
        "T_H_D": T_H_D.tolist(),
        "covariance": np.eye(6).tolist(),
        "depth": camera,
        "headset": camera,
        "rms_px": 0.2,
        "residuals_px": {"a": 0.2},
        "spread_rad": 0.1,
        "spread_m": 0.1,
        "dropped": [],
        "worst": {"name": "a", "rms_px": 0.2, "why": ""},
        "verdict": {"name": "good", "reason": ""},
    }
    path = tmp_path / "stereo.json"
    path.write_text(json.dumps(values))
    assert read_stereo(path).rms_px == 0.2
    path.write_text(json.dumps({**values, field: value}))
    with pytest.raises(FileError, match=said):
        read_stereo(path)


def test_what_a_format_cannot_hold_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="holds no pose"):
        write_pose(tmp_path / "pose", T_H_D, "ros")
    with pytest.raises(ValueError, match="rigid"):
        write_pose(tmp_path / "pose", np.diag([1.0, 1.0, -1.0, 1.0]), "json")
    fourteen = Intrinsics(640, 480, 500.0, 500.0, 320.0, 240.0, (0.1,) * 14)
    with pytest.raises(ValueError, match="5 or 8"):
        write_intrinsics(tmp_path / "camera", fourteen, "ros")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("separator", [", ", " ", "\n"])
def test_a_pose_is_read_from_a_plain_matrix(tmp_path: Path, separator: str) -> None:
    T = rigid([0.1, -0.2, 0.3], [0.03, 0.0, -0.05])
    path = tmp_path / "view.txt"
    path.write_text(str(T.tolist()).replace(", ", separator))
    np.testing.assert_array_equal(read_pose(path), T)
    path.write_text(str((2.0 * T).tolist()))
    with pytest.raises(FileError, match="must be rigid"):
        read_pose(path)
    path.write_text("1 2 3")
    with pytest.raises(FileError, match="4 rows of 4 numbers"):
        read_pose(path)
