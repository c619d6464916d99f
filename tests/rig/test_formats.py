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
    has_pose,
    read_camera,
    read_identity,
    read_intrinsics,
    read_pose,
    read_stereo,
    read_tracked,
    stereo_json,
    write_intrinsics,
    write_pose,
    write_tracked,
)
from handcal.rig.lens.camera import calibrate_camera
from handcal.rig.lens.lens import Camera, FisheyeIntrinsics
from handcal.rig.lens.stereo import calibrate_stereo
from handcal.rig.rig_file import MAX_STORAGE_BYTES
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
        ("{}", "no camera and seems to be JSON of another kind; handcal reads"),
        ("%YAML 1.2\n---\n" + "[" * 4000, "not valid YAML or XML"),
        ("%YAML 1.2\n---\na: " + "[" * MAX_STORAGE_BYTES, "nested too deeply"),
        (ROS.replace("plumb_bob", "omni"), "lens model omni is not known; OpenCV"),
        (ROS.replace("cols: 5", "cols: 4"), "distortion must have rows times cols"),
        (ROS.replace("[500, 0,", "[-5, 0,"), "fx is -5 px, but must lie between 64 and 6400"),
        (ROS.replace("image_width: 640", "image_width: 99999"), "between 1 and 16384"),
        ('{"handcal_camera": 1, "width": [[1], [1, 2]]}', "width must be a whole number"),
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
        ("T_H_D", (2 * np.eye(4)).tolist(), "pose must be rigid"),
        ("covariance", (-np.eye(6)).tolist(), "negative variances"),
        ("rms_px", -1.0, "must not be negative"),
        ("worst", {"name": "a", "rms_px": -0.2, "why": ""}, "must not be negative"),
        ("depth", [], "depth must be an object"),
        ("verdict", {"name": "perfect"}, "verdict.name"),
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


D455 = (0.01192, 0.7232, 0.00036, -0.00038, -2.467)
ONE = Intrinsics(1280, 720, 898.29, 901.07, 649.37, 362.53, D455)
KALIBR = Intrinsics(
    2064, 1544, 1307.1793378428877, 1301.0605358699895, 1038.7247645586372, 810.1779283469755,
    (-0.19324774955872565, 0.0658473291152598, 0.00029907018930053344, -0.0001662129018857859),
)  # fmt: skip
AZURE = (0.41, -2.5, -0.0002, 0.0004, 1.4, 0.29, -2.3, 1.36)
ECHOED = (-0.05624309927225113, 0.06353731453418732, -0.0007865713560022414,
          0.0005391784361563623, -0.020239178091287613)  # fmt: skip
T265 = (-0.000712347915396094, 0.0346902199089527, -0.0326500199735165, 0.00464539602)
EUROC = (-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05)
ECHO_1 = (383.15728759765625, 383.15728759765625, 319.8735046386719, 241.6318359375)
ECHO_2 = (642.4718627929688, 641.7909545898438, 640.6505126953125, 363.3234558105469)


@pytest.fixture
def rigfiles(shared_data: Path) -> Path:
    return shared_data / "field" / "rigfiles"


@pytest.mark.parametrize(
    ("name", "camera"),
    [
        ("opencv_sample.xml", ONE),
        ("opencv_sample.yml", ONE),
        ("opencv_calib_sample_names.yml", ONE),
        ("rs_intrinsics.json", ONE),
        ("open3d.json", Intrinsics(1280, 720, 898.29, 901.07, 649.37, 362.53)),
        ("kalibr_camchain.yaml", KALIBR),
        ("euroc_sensor.yaml", Intrinsics(752, 480, 458.654, 457.296, 367.215, 248.375, EUROC)),
        ("ros_echo.yaml", Intrinsics(640, 480, *ECHO_1, (0.0,) * 5)),
        ("ros2_echo.yaml", Intrinsics(1280, 720, *ECHO_2, ECHOED)),
        ("ros_equi.yaml", FisheyeIntrinsics(848, 800, 284.77, 285.84, 427.82, 405.81, T265)),
        ("k4a.json", Intrinsics(4096, 3072, 2015.232, 2015.232, 2059.788, 1557.004, AZURE)),
    ],
)
def test_cameras_by_other_programs(rigfiles: Path, name: str, camera: Camera) -> None:
    found = read_camera(rigfiles / name)
    assert type(found) is type(camera)
    assert (found.width, found.height) == (camera.width, camera.height)
    numbers = [found.fx, found.fy, found.cx, found.cy, *found.distortion]
    assert numbers == pytest.approx(
        [camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion], rel=1e-12
    )


@pytest.mark.parametrize(
    "name", ["opencv_KD.yml", "opencv_cameraMatrix.yml", "pycalib.json", "stereo_intrinsics.yml"]
)
def test_files_without_the_size_of_the_images(rigfiles: Path, name: str) -> None:
    with pytest.raises(FileError, match="not the size of the images: add image_width"):
        read_camera(rigfiles / name)
    assert read_camera(rigfiles / name, size=(1280, 720)) == ONE


def test_one_of_several_cameras(rigfiles: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert read_camera(rigfiles / "kalibr_camchain.yaml") == KALIBR
    assert "camera cam0 is used, of cam0, cam1" in caplog.text
    assert read_camera(rigfiles / "kalibr_camchain.yaml", "cam1").fx == 1313.9722271268822
    with pytest.raises(FileError, match="no camera cam2, but cam0, cam1"):
        read_camera(rigfiles / "kalibr_camchain.yaml", "cam2")
    assert read_camera(rigfiles / "stereo_intrinsics.yml", "2", (1280, 720)) == ONE


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("colmap_cameras.txt", "seems to be COLMAP's cameras.txt; handcal reads .* OpenCV"),
        ("np.npz", "seems to be a NumPy archive; handcal reads"),
        ("stereo_extrinsics.yml", "a pose, but no camera"),
        ("view_unity.txt", "no camera; handcal reads"),
    ],
)
def test_what_holds_no_camera_is_named(rigfiles: Path, name: str, said: str) -> None:
    with pytest.raises(FileError, match=said):
        read_camera(rigfiles / name)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("% Intrinsic Camera Parameters\nfc = [ 657.3 ; 657.7 ];\n", "a MATLAB file"),
        (' Intrinsic of "Depth" / 640x480 / {Z16}\n  PPX: 320\n', "rs-enumerate-devices"),
    ],
)
def test_texts_without_fields_are_named(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "camera.txt"
    path.write_text(text)
    with pytest.raises(FileError, match=said):
        read_camera(path)


def test_poses_by_other_programs(rigfiles: Path) -> None:
    assert has_pose(rigfiles / "stereo_extrinsics.yml")
    T = read_pose(rigfiles / "stereo_extrinsics.yml")
    assert T[:3, 3].tolist() == [-0.0751, 0.0012, -0.0007]
    assert T[0, :3].tolist() == [0.99935007582979452, -0.029893012156105903, 0.020145316160805754]
    assert has_pose(rigfiles / "stereo_extrinsics_mm.yml")
    with pytest.raises(FileError, match=r"75.11 m long.*in millimetres, divide it by 1000"):
        read_pose(rigfiles / "stereo_extrinsics_mm.yml")
    with pytest.raises(FileError, match="mirrored one, as with the axes of Unity or OpenGL"):
        read_pose(rigfiles / "view_unity.txt")


K = [[500, 0, 320], [0, 501, 240], [0, 0, 1]]
PLAIN = Intrinsics(640, 480, 500.0, 501.0, 320.0, 240.0)
SIZE = {"image_width": 640, "image_height": 480}


@pytest.mark.parametrize(
    ("values", "camera"),
    [
        ({"size": [640, 480], "mtx": K, "dist": []}, PLAIN),
        ({"imageSize": [640, 480], "intrinsics": np.transpose(K).ravel().tolist()}, PLAIN),
        ({"depth": {"width": 640, "height": 480, "fx": 500, "fy": 501, "ppx": 320, "ppy": 240,
                    "model": "distortion.none", "coeffs": []}}, PLAIN),
        (SIZE | {"right": {"camera_matrix": K}, "left": {"camera_matrix": K}}, PLAIN),
        (SIZE | {"camera_matrix_left": K, "dist_coeffs_left": [0.1, 0.2, 0, 0, 0]},
         Intrinsics(640, 480, 500.0, 501.0, 320.0, 240.0, (0.1, 0.2, 0.0, 0.0, 0.0))),
        ({"Camera.width": 640, "Camera.height": 480, "Camera.type": "PinHole", "Camera.fx": 500,
          "Camera.fy": 501, "Camera.cx": 320, "Camera.cy": 240, "Camera.k1": 0.1,
          "Camera.k2": 0.2, "Camera.p1": 0.3, "Camera.p2": 0.4},
         Intrinsics(640, 480, 500.0, 501.0, 320.0, 240.0, (0.1, 0.2, 0.3, 0.4, 0.0))),
        (SIZE | {"intrinsics": {"fx": 500, "fy": 501, "cx": 320, "cy": 240},
                 "distortion": {"k1": 0.1, "k2": 0.2, "p1": 0, "p2": 0}},
         Intrinsics(640, 480, 500.0, 501.0, 320.0, 240.0, (0.1, 0.2, 0.0, 0.0, 0.0))),
        (SIZE | {"model_type": "PINHOLE", "distortion_parameters": {"k1": 0.1, "k2": 0.2},
                 "projection_parameters": {"fx": 500, "fy": 501, "cx": 320, "cy": 240}},
         Intrinsics(640, 480, 500.0, 501.0, 320.0, 240.0, (0.1, 0.2, 0.0, 0.0, 0.0))),
        ({"intrinsics": {"color": {"width": 640, "height": 480, "fx": 500, "fy": 501, "ppx": 320,
          "ppy": 240, "model": "RS2_DISTORTION_BROWN_CONRADY", "coeffs": [0.1, 0.2, 0, 0, 0]}}},
         Intrinsics(640, 480, 500.0, 501.0, 320.0, 240.0, (0.1, 0.2, 0.0, 0.0, 0.0))),
        (SIZE | {"model": "fisheye", "fx": 500, "fy": 501, "cx": 320, "cy": 240, "k1": 0.1,
                 "k4": 0.4},
         FisheyeIntrinsics(640, 480, 500.0, 501.0, 320.0, 240.0, (0.1, 0.0, 0.0, 0.4))),
        (SIZE | {"K": K, "D": T265, "distortion_model": "equidistant", "P1": [[1.0] * 4] * 3},
         FisheyeIntrinsics(640, 480, 500.0, 501.0, 320.0, 240.0, T265)),
        ({"camera_model": "OPENCV", "fl_x": 500, "fl_y": 501, "cx": 320, "cy": 240, "w": 640,
          "h": 480, "k1": 0.1, "k2": 0.2, "p1": 0, "p2": 0, "H": [[1, 0, 0]] * 3},
         Intrinsics(640, 480, 500.0, 501.0, 320.0, 240.0, (0.1, 0.2, 0.0, 0.0, 0.0))),
        ({"resolution": [640, 480], "camera_model": "pinhole", "distortion_model": "equidistant",
          "distortion_coeffs": T265, "intrinsics": [500, 501, 320, 240]},
         FisheyeIntrinsics(640, 480, 500.0, 501.0, 320.0, 240.0, T265)),
    ],
)  # fmt: skip
def test_names_of_fields_vary(tmp_path: Path, values: dict[str, object], camera: Camera) -> None:
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(values))
    assert read_camera(path) == camera


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"resolution": [640, 480], "camera_model": "omni", "intrinsics": [1, 500, 501, 3, 2]},
         "lens model omni is not known"),
        (SIZE | {"K": K, "D": [0.1] * 3}, "0, 4, 5, 8, 12 or 14"),
        (SIZE | {"K": K, "D": [0.1] * 5, "model": "fisheye"}, "a fisheye has 4 coefficients"),
        (SIZE | {"K": [500, 0, 0, 501, 3]}, "3×3"),
        (SIZE | {"K": [["a"] * 3] * 3}, "finite numbers"),
        ({"size": 640, "K": K}, "not the size of the images"),
        (SIZE | {"K": [[500, 0], [1]]}, "no camera"),
        (SIZE | {"K": K, "D": [[0.1], [1, 2]]}, "distortion must be finite numbers"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(tmp_path: Path, values: dict[str, object], said: str) -> None:
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(values))
    with pytest.raises(FileError, match=said):
        read_camera(path)


def test_a_message_of_ros_with_empty_fields_and_a_second_message(tmp_path: Path) -> None:
    path = tmp_path / "info.yaml"
    text = "header: \n  frame_id: ''\nheight: 480\nwidth: 640\ndistortion_model: ''\nd: []\nk:\n"
    text += "".join(f"- {one}\n" for one in np.ravel(K)) + "roi:\n  do_rectify: false\n---\n"
    path.write_text(text + text.replace("640", "641"))
    assert read_camera(path) == PLAIN


def test_a_large_file_of_opencv_is_read(tmp_path: Path) -> None:
    path = tmp_path / "out_camera_data.xml"
    numbers = " ".join(f"{one}." for one in np.ravel(K))
    points = "<points><rows>1</rows><cols>20000</cols><dt>d</dt><data>" + "12.5 " * 20000
    path.write_text(
        '<?xml version="1.0"?>\n<opencv_storage>\n<image_width>640</image_width>\n'
        "<image_height>480</image_height>\n<camera_matrix><rows>3</rows><cols>3</cols><dt>d</dt>"
        f"<data>{numbers}</data></camera_matrix>\n{points}</data></points>\n</opencv_storage>\n"
    )
    assert read_camera(path) == PLAIN


@pytest.mark.parametrize("kind", ["opencv", "ros", "json"])
def test_a_fisheye_survives(tmp_path: Path, kind: str) -> None:
    camera = FisheyeIntrinsics(848, 800, 284.77, 285.84, 427.82, 405.81, T265)
    write_intrinsics(tmp_path / "camera", camera, kind)  # type: ignore[arg-type]
    assert read_camera(tmp_path / "camera") == camera


def test_poses_come_back_exactly(tmp_path: Path) -> None:
    poses = {"a.png": rigid([0.1, 0.2, 0.3], [0.1, 0.2, 0.5]), "b.png": np.eye(4)}
    write_tracked(tmp_path / "poses.json", poses)
    found = read_tracked(tmp_path / "poses.json")
    assert list(found) == ["a.png", "b.png"]
    for name, T in poses.items():
        np.testing.assert_array_equal(found[name], T)


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ({"handcal_tracked": 2, "T_H_B": {}}, "handcal_tracked must be 1"),
        ({"handcal_tracked": 1, "T_H_B": {}}, "1 to 500 poses"),
        ({"handcal_tracked": 1, "T_H_B": {"a": [[1], [2, 3]]}}, "T_H_B of a"),
        ({"handcal_tracked": 1, "T_H_B": {"a": np.zeros((4, 4)).tolist()}}, "T_H_B of a"),
    ],
)
def test_what_is_no_set_of_poses_is_named(tmp_path: Path, content: object, problem: str) -> None:
    path = tmp_path / "poses.json"
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match=problem):
        read_tracked(path)


@pytest.mark.parametrize("text", ["", "{}"])
def test_another_file_says_which_to_choose(tmp_path: Path, text: str) -> None:
    (tmp_path / "depth.json").write_text(text)
    with pytest.raises(FileError, match="; choose the file of tracked poses"):
        read_tracked(tmp_path / "depth.json")
