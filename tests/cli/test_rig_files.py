"""The commands on rig files, as a person calls them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.camera.folder import record_folder
from handcal.camera.hl2ss import STREAMS
from handcal.cli.main import parse
from handcal.core.errors import HandcalError
from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, Frame, Intrinsics
from handcal.rig.example import example_rig
from handcal.rig.rig_file import read_rig, write_rig
from handcal.sim.ahat import ahat_rays
from handcal.sim.boards import BoardPainter, PictureSettings
from tests import board_frames
from tests.camera.hl2ss_server import Hl2ssServer, calibration_of

RIG = example_rig()
PICTURES = PictureSettings(samples=1)


def run(*words: object) -> None:
    arguments = parse(["rig", *map(str, words)])
    arguments.command(arguments)


def test_a_rig_in_doubt_fails_the_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "rig.yaml"
    write_rig(path, RIG)
    run("check", path, "--json", tmp_path / "found.json")
    assert "check" not in capsys.readouterr().out.split()
    assert all(
        one["is_fine"] for one in json.loads((tmp_path / "found.json").read_text())["findings"]
    )
    write_rig(path, replace(RIG, eyes={"left": RIG.eyes["right"], "right": RIG.eyes["left"]}))
    with pytest.raises(HandcalError, match="1 of 20 findings"):
        run("check", path)
    assert "left and right are exchanged" in capsys.readouterr().out


def recorded(folder: Path, identity: CameraIdentity, camera: Intrinsics) -> Path:
    depth = np.zeros((camera.height, camera.width), np.uint16)
    record_folder(folder, [Frame(1, 1, 0, depth, 1e-3, camera)], identity)
    return folder


def test_the_depth_of_another_camera_than_the_rig_s_is_not_checked(tmp_path: Path) -> None:
    rig, new = tmp_path / "rig.yaml", tmp_path / "new.yaml"
    lens, d415 = RIG.depth_intrinsics, CameraIdentity("Intel RealSense D415", "123", "5")
    write_rig(rig, replace(RIG, depth_camera=d415))
    other = recorded(tmp_path / "other", replace(d415, serial_number="456"), lens)
    longer = recorded(tmp_path / "longer", d415, replace(lens, fx=1.04 * lens.fx))
    for source, problem in (
        (other, "another serial number: 456, not 123"),
        (longer, "focal length 4.0 % longer"),
        (tmp_path / "nothing", "there is no recording"),
    ):
        with pytest.raises(HandcalError, match=problem):
            run("depth", source, "--stills", "--rig", rig, "--output", new)
    assert not new.exists()


def test_the_depth_camera_is_checked_and_the_rig_file_keeps_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(1)
    painter = BoardPainter(board_frames.BOARD, board_frames.COLOR, PICTURES)
    made = board_frames.frames(
        board_frames.poses(6, rng, 0.33, 0.52), rng, offset_m=0.01, painter=painter
    )
    d415 = CameraIdentity("Intel RealSense D415", "123", "5")
    record_folder(tmp_path / "take", made, d415)
    rig, new = tmp_path / "rig.yaml", tmp_path / "new.yaml"
    write_rig(rig, replace(RIG, depth_intrinsics=board_frames.DEPTH))
    board = ("--squares", 8, 6, "--square-mm", 30, "--marker-mm", 22)
    run("depth", tmp_path / "take", "--stills", *board, "--rig", rig, "--output", new)
    assert read_rig(new).depth_camera == d415
    check = read_rig(new).depth_check
    assert check is not None
    assert check.views == 6
    assert check.bias_m(0.5)[0] == pytest.approx(0.01, abs=0.0015)
    edges = read_rig(new).depth_edges
    assert edges is not None
    assert (edges.source, edges.views) == ("measured", 5)
    said = " ".join(capsys.readouterr().out.split())
    assert "doubtful: +" in said
    assert re.search(r"Edges outside the true ones: −\d\.\d ± 0\.3 px \(5 views, ", said)
    assert "calibrate the sensor" in said
    with pytest.raises(HandcalError, match="1 of 20 findings"):
        run("check", new)
    with pytest.raises(HandcalError, match=r"not the depth camera of this rig: images of 640x360"):
        run("depth", tmp_path / "take", "--stills", "--output", tmp_path / "other.yaml")
    assert not (tmp_path / "other.yaml").exists()


def test_a_headset_tells_the_pose_of_its_own_camera(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    T_H_D = rigid([0.2, 0.0, 0.1], [0.02, -0.03, 0.01])
    write_rig(tmp_path / "rig.yaml", RIG)
    make = "make", "--rig", tmp_path / "rig.yaml", "--output", tmp_path / "new.yaml"
    with Hl2ssServer(calibration_of(ahat_rays(), T_H_D), lambda: None) as server:
        ahat = replace(STREAMS["ahat"], port=server.port)
        monkeypatch.setitem(STREAMS, "ahat", ahat)
        run(*make, "--factory", "hololens2:127.0.0.1")
    made = read_rig(tmp_path / "new.yaml")
    np.testing.assert_allclose(made.T_H_D, T_H_D, atol=1e-6)
    assert made.depth_camera == CameraIdentity("HoloLens 2 AHAT")
    assert made.depth_intrinsics.width == 512
    assert "T_H_D" not in made.origins
    for misuse in (["--factory", "hololens2:127.0.0.1,realsense=rig.yaml"], []):
        with pytest.raises(SystemExit, match="2"):
            run(*make, *misuse)
