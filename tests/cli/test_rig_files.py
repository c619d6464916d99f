"""The commands on rig files, as a person calls them."""

from __future__ import annotations

import json
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
from tests.helpers import DATA

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
    with pytest.raises(HandcalError, match="1 of 19 findings"):
        run("check", path)
    assert "left and right are exchanged" in capsys.readouterr().out


@pytest.mark.parametrize(("version", "missing"), [(1, 7), (2, 4), (3, 7)])
def test_migrating_a_rig_file_reports_missing_parts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], version: int, missing: int
) -> None:
    old = DATA / f"rig-v{version}.yaml"
    if version == 3:
        old = tmp_path / "old.yaml"
        write_rig(old, RIG)
    assert f"handcal_rig: {version}\n" in old.read_text()
    run("migrate", old, "--output", tmp_path / "new.yaml")
    assert "handcal_rig: 3\n" in (tmp_path / "new.yaml").read_text()
    assert read_rig(tmp_path / "new.yaml").name == read_rig(old).name
    lines = capsys.readouterr().out.split("missing: ")[1:]
    assert len(lines) == missing
    assert "serial number are not known: connect it" in " ".join(lines[0].split())


def recorded(folder: Path, identity: CameraIdentity, camera: Intrinsics) -> Path:
    depth = np.zeros((camera.height, camera.width), np.uint16)
    record_folder(folder, [Frame(1, 1, 0, depth, 1e-3, camera)], identity)
    return folder


def test_the_serial_number_is_taken_from_the_rig_s_own_camera_only(tmp_path: Path) -> None:
    old, new = DATA / "rig-v2.yaml", tmp_path / "new.yaml"
    lens, d415 = read_rig(old).depth_intrinsics, CameraIdentity("Intel RealSense D415", "123", "5")
    own = recorded(tmp_path / "own", d415, lens)
    run("migrate", old, "--output", new, "--camera", own)
    assert read_rig(new).depth_camera == d415
    run("migrate", new, "--output", new, "--camera", own)
    nameless = recorded(tmp_path / "nameless", CameraIdentity(), lens)
    other = recorded(tmp_path / "other", replace(d415, serial_number="456"), lens)
    longer = recorded(tmp_path / "longer", d415, replace(lens, fx=1.04 * lens.fx))
    before = new.read_bytes()
    for rig, source, problem in (
        (old, nameless, "reports no serial number"),
        (new, other, "another serial number: 456, not 123"),
        (old, longer, "focal length 4.0 % longer"),
        (old, tmp_path / "nothing", "there is no recording"),
    ):
        with pytest.raises(HandcalError, match=problem):
            run("migrate", rig, "--output", new, "--camera", source)
    assert new.read_bytes() == before


def test_the_depth_camera_is_checked_and_the_rig_file_keeps_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rng = np.random.default_rng(1)
    painter = BoardPainter(board_frames.BOARD, board_frames.COLOR, PICTURES)
    made = board_frames.frames(
        board_frames.poses(6, rng, 0.33, 0.52), rng, offset_m=0.01, painter=painter
    )
    record_folder(tmp_path / "take", made)
    rig, new = tmp_path / "rig.yaml", tmp_path / "new.yaml"
    write_rig(rig, replace(RIG, depth_intrinsics=board_frames.DEPTH))
    board = ("--squares", 8, 6, "--square-mm", 30, "--marker-mm", 22)
    run("depth", tmp_path / "take", "--stills", *board, "--rig", rig, "--output", new)
    check = read_rig(new).depth_check
    assert check is not None
    assert check.views == 6
    assert check.bias_m(0.5)[0] == pytest.approx(0.01, abs=0.0015)
    said = " ".join(capsys.readouterr().out.split())
    assert "doubtful: +" in said
    assert "calibrate the sensor" in said
    with pytest.raises(HandcalError, match="1 of 19 findings"):
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
    with pytest.raises(HandcalError, match="not realsense"):
        run(*make, "--factory", "realsense")
    with pytest.raises(HandcalError, match="a headset is hololens2:HOST, not"):
        run(*make, "--factory", "hololens2:127.0.0.1,realsense=rig.yaml")
    with pytest.raises(HandcalError, match="either --stereo or --factory"):
        run(*make)
