"""``handcal rig board``, ``camera``, ``stereo`` and ``convert`` as their user meets them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.geometry import rigid
from handcal.core.types import Float64, Intrinsics
from handcal.io.images import read_image
from handcal.rig.boards.board import Board
from handcal.rig.boards.finder import find_board
from handcal.rig.formats import read_intrinsics, read_pose, write_intrinsics, write_pose
from handcal.sim.boards import BoardPainter, board_poses

BOARD = Board(kind="checkerboard")
CAMERA = Intrinsics(480, 360, 400.0, 401.0, 238.0, 181.0, (-0.1, 0.05, 0.0, 0.0, 0.0))
T_H_D = rigid([-0.1, 0.0, 0.0], [-0.02, -0.03, 0.01])
CHECKERBOARD = ("--kind", "checkerboard")


@pytest.fixture
def rig(handcal: Callable[..., None]) -> Callable[..., None]:
    """Run ``handcal rig`` in this process."""
    return partial(handcal, "rig")


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return folders of images of one board by the depth and the headset's camera."""
    rng = np.random.default_rng(1)
    painter = BoardPainter(BOARD, CAMERA)
    poses = board_poses(BOARD, CAMERA, 5, rng, others=((T_H_D, CAMERA),))
    made = []
    for name, T_C_D in (("depth", np.eye(4)), ("headset", T_H_D)):
        folder = tmp_path_factory.mktemp(name)
        for number, T_D_B in enumerate(poses):
            image = painter.paint(T_C_D @ T_D_B, rng)
            cv2.imwrite(str(folder / f"{name}{number}.png"), image)
        made.append(folder)
    return made[0], made[1]


def _angle_deg(T: Float64) -> float:
    R = T[:3, :3] @ T_H_D[:3, :3].T
    return float(np.degrees(np.arccos(min((np.trace(R) - 1) / 2, 1.0))))


def test_a_board_to_put_up(
    rig: Callable[..., None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig("board", "--pdf", tmp_path / "new" / "b.pdf", "--png", tmp_path / "b.png")
    assert (tmp_path / "new" / "b.pdf").read_bytes().startswith(b"%PDF-")
    image = read_image(tmp_path / "b.png", cv2.IMREAD_GRAYSCALE)
    assert len(find_board(image, Board()).ids) == 54
    assert "print at 100 %" in capsys.readouterr().out


def test_camera_then_stereo_then_conversion(
    rig: Callable[..., None],
    folders: tuple[Path, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    depth, headset = folders
    camera, stereo = tmp_path / "camera.yaml", tmp_path / "stereo.json"
    dropped = "depth2.png"
    rig(
        *("camera", depth, *CHECKERBOARD, "--lens", "radial"),
        *("--drop", dropped, "--output", camera, "--format", "ros"),
    )
    said = capsys.readouterr().out
    assert f"{dropped} (left out)" in said
    assert "needs more views: 4 views, 20 are better" in said
    assert read_intrinsics(camera).fx == pytest.approx(CAMERA.fx, rel=0.005)

    rig(
        *("stereo", "--depth", depth, "--headset", headset, *CHECKERBOARD),
        *("--depth-intrinsics", camera, "--headset-intrinsics", camera, "--output", stereo),
    )
    assert "needs more views: 5 pairs" in capsys.readouterr().out
    assert json.loads(stereo.read_text())["rms_px"] < 0.3
    found = read_pose(stereo)
    assert _angle_deg(found) < 0.2
    np.testing.assert_allclose(found[:3, 3], T_H_D[:3, 3], atol=1e-3)

    for source, kind in ((camera, "json"), (stereo, "opencv")):
        rig("convert", source, "--output", tmp_path / "converted", "--format", kind)
    np.testing.assert_allclose(read_pose(tmp_path / "converted"), found, atol=1e-12)


def test_what_other_programs_wrote_is_converted(
    rig: Callable[..., None], shared_data: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    files, output = shared_data / "field" / "rigfiles", tmp_path / "camera.json"
    rig("convert", files / "kalibr_camchain.yaml", "--output", output, "--format", "json")
    assert read_intrinsics(output).fx == 1307.1793378428877
    assert "camera cam0 is used, of cam0, cam1" in caplog.text
    to_ros = "--format", "ros", "--camera", "cam1"
    rig("convert", files / "kalibr_camchain.yaml", "--output", output, *to_ros)
    assert read_intrinsics(output).fx == 1313.9722271268822
    to_opencv = "--format", "opencv", "--size", 1280, 720
    rig("convert", files / "opencv_KD.yml", "--output", output, *to_opencv)
    assert read_intrinsics(output).cx == 649.37
    with pytest.raises(SystemExit):
        rig("convert", files / "stereo_extrinsics_mm.yml", "--output", output, "--format", "json")


def test_what_is_bad_is_not_written(
    fails: Callable[..., tuple[int, str]], folders: tuple[Path, Path], tmp_path: Path
) -> None:
    depth, headset = folders
    for number in range(5):  # paired with one another's
        shutil.copy(headset / f"headset{number}.png", tmp_path / f"{(number + 1) % 5}.png")
    write_intrinsics(tmp_path / "camera.json", CAMERA, "json")
    given = [f"--{one}-intrinsics" for one in ("depth", "headset")]
    code, error = fails(
        *("rig", "stereo", "--depth", depth, "--headset", tmp_path, *CHECKERBOARD),
        *(word for option in given for word in (option, tmp_path / "camera.json")),
        *("--output", tmp_path / "stereo.json"),
    )
    assert (code, "bad: corners are" in error) == (1, True)
    assert not (tmp_path / "stereo.json").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("board", "--png", "b.txt"), "b.txt must end in .png"),
        (("camera", "nowhere"), "no PNG, JPEG, TIFF, BMP or PGM images"),
        (
            ("camera", "no.png", *CHECKERBOARD, "--drop", "x.png"),  # before any image is read
            "there is no image x.png to drop",
        ),
        (
            ("stereo", "--depth", "{depth}", "--headset", "{depth}", *CHECKERBOARD),
            "both cameras' images are the same",
        ),
        (("camera", "{depth}"), "found in 0 of 5 images used, at least 3 are needed; mostly: a"),
        (("convert", "{depth}/depth0.png", "--output", "out", "--format", "json"), "depth0.png"),
    ],
)
def test_what_is_wrong_is_one_line(
    fails: Callable[..., tuple[int, str]],
    folders: tuple[Path, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    write_pose(tmp_path / "pose.json", T_H_D, "json")
    filled = [one.format(depth=folders[0], pose=tmp_path / "pose.json") for one in arguments]
    code, error = fails("rig", *filled)
    assert (code, said in error) == (1, True)
    assert not (tmp_path / "out").exists()
