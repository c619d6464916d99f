"""Grids, patterns and the calibration of displays, on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.cli.main import parse
from handcal.core.display import eye_projection, view_of_eye
from handcal.core.errors import FileError, HandcalError
from handcal.core.geometry import invert, rigid
from handcal.core.types import Intrinsics
from handcal.rig.boards.board import Board
from handcal.rig.boards.views import ViewsError
from handcal.rig.compare import compare_rigs
from handcal.rig.example import FOCAL_PX, example_rig
from handcal.rig.formats import write_intrinsics, write_tracked
from handcal.rig.rig_file import read_rig
from handcal.sim.boards import BoardPainter, PictureSettings, board_poses, pixel_rays
from handcal.sim.viewpoint import photograph_display

RIG = example_rig()
CAMERA = Intrinsics(960, 540, 1350.0, 1348.0, 482.0, 267.0, (-0.08, 0.05, 0.0004, -0.0003, 0.0))
PICTURES = PictureSettings(samples=1)
T_E_C = rigid([0.03, -0.02, 0.05])


def run(*words: object) -> None:
    arguments = parse(["rig", *map(str, words)])
    arguments.command(arguments)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Photographs of a grid and a tracked board by a camera at the left C0."""
    folder = tmp_path_factory.mktemp("display")
    run("grid", "--png", folder / "grid.png")
    shown = cv2.imread(str(folder / "grid.png"), cv2.IMREAD_GRAYSCALE)
    rng = np.random.default_rng(1)
    display = RIG.eyes["left"]
    (folder / "grids").mkdir()
    image = photograph_display(
        np.asarray(shown, np.uint8), display, T_E_C[:3, :3], CAMERA, rng, settings=PICTURES
    )
    cv2.imwrite(str(folder / "grids" / "1.png"), image)
    (folder / "boards").mkdir()
    T_H_C = invert(view_of_eye(display, np.eye(4))) @ T_E_C
    painter, poses = BoardPainter(Board(), CAMERA, PICTURES), {}
    for number, T_C_B in enumerate(board_poses(Board(), CAMERA, 4, rng)):
        cv2.imwrite(str(folder / "boards" / f"{number}.png"), painter.paint(T_C_B, rng))
        poses[f"{number}.png"] = T_H_C @ T_C_B
    write_tracked(folder / "poses.json", poses)
    write_intrinsics(folder / "camera.json", CAMERA, "json")
    return folder


def calibrate(folder: Path, output: Path, *more: object, images: Path | None = None) -> None:
    run(
        *("display", images or folder / "grids", "--eye", "left", "--output", output),
        *("--camera-intrinsics", folder / "camera.json", "--tracked", folder / "poses.json"),
        *("--board-images", folder / "boards", *more),
    )


def test_a_display_is_calibrated_from_photographs(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "new" / "rig.yaml"
    square_arcmin = 60.0 * np.degrees(2.0 * np.arctan(40.0 / FOCAL_PX))
    calibrate(folder, output, "--square-arcmin", square_arcmin)
    found, true = read_rig(output).eyes["left"], RIG.eyes["left"]
    assert found.z_C0_S_m == pytest.approx(true.z_C0_S_m, rel=0.002)
    np.testing.assert_allclose(found.t_C0_V_m, true.t_C0_V_m, atol=0.0003)
    assert read_rig(output).origins["left"].verdict in capsys.readouterr().out
    run("compare", output, output, "--json", tmp_path / "c.json")
    differences = json.loads((tmp_path / "c.json").read_text())["differences"]
    assert all(one["value"] < 1e-6 for one in differences)


def test_a_display_is_calibrated_by_gray_code(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = tmp_path / "seen"
    seen.mkdir()
    run("gray", "--output", tmp_path / "shown")
    P = eye_projection(RIG.eyes["left"])[:, :3] @ T_E_C[:3, :3]
    x, y, away = np.moveaxis(pixel_rays(CAMERA, 1) @ P.T.astype(np.float32), 2, 0)
    for path in sorted((tmp_path / "shown").glob("*.png")):
        shown = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        assert shown is not None
        image = cv2.remap(shown, x / away, y / away, cv2.INTER_LINEAR)
        cv2.imwrite(str(seen / path.name), image)
    output = tmp_path / "rig.yaml"
    calibrate(folder, output, "--distance-m", 2, "--gray-code", images=seen)
    differences = {one.name: one.value for one in compare_rigs(read_rig(output), RIG)}
    assert differences["left: largest move of a display pixel"] < 1.0
    assert "a flat screen leaves 0." in capsys.readouterr().out
    (seen / "x-3.png").unlink()
    with pytest.raises(FileError, match=r"1 of 32 images are missing, such as x-3\.png"):
        calibrate(folder, output, "--distance-m", 2, "--gray-code", images=seen)


def test_a_file_gives_the_rendering_camera(folder: Path, tmp_path: Path) -> None:
    T_V_H = rigid(translation_m=[0.001, 0.0, 0.0]) @ RIG.eyes["left"].T_V_H
    np.savetxt(tmp_path / "view.txt", T_V_H)
    calibrate(folder, tmp_path / "a.yaml", "--distance-m", 2)
    calibrate(folder, tmp_path / "b.yaml", "--distance-m", 2, "--view", tmp_path / "view.txt")
    a, b = (read_rig(tmp_path / name).eyes["left"] for name in ("a.yaml", "b.yaml"))
    np.testing.assert_allclose(b.T_V_H, T_V_H, atol=1e-12)
    np.testing.assert_allclose(b.t_C0_V_m - a.t_C0_V_m, [-0.001, 0.0, 0.0], atol=1e-9)


def test_a_missing_pose_is_named(folder: Path, tmp_path: Path) -> None:
    poses = tmp_path / "poses.json"
    write_tracked(poses, {"0.png": np.eye(4)})
    with pytest.raises(ViewsError, match=r"no tracked pose for 1\.png, 2\.png, 3\.png"):
        calibrate(folder, tmp_path / "rig.yaml", "--distance-m", 2, "--tracked", poses)


def test_a_display_too_small_for_the_squares_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(HandcalError, match="no room"):
        run("grid", "--display", 200, 200, "--png", tmp_path / "grid.png")
