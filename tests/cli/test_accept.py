import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.cli.main import parse
from handcal.core.errors import HandcalError
from handcal.core.geometry import rigid
from handcal.rig.example import example_rig
from handcal.rig.rig_file import write_rig
from handcal.sim.acceptance import write_acceptance


def accept(folder: Path, rig: Path, *more: object) -> None:
    words = "accept", folder, "--rig", rig, "--squares", 8, 6, "--output", folder / "page"
    arguments = parse(["rig", *map(str, (*words, *more))])
    arguments.command(arguments)


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("accept")
    write_acceptance(folder, example_rig(), 8, np.random.default_rng(1), samples=1)
    return folder


def test_a_right_rig_passes_and_a_turned_camera_fails(
    images: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rig, result = example_rig(), tmp_path / "result.json"
    write_rig(tmp_path / "rig.yaml", rig)
    accept(images, tmp_path / "rig.yaml", "--json", result)
    passed = json.loads(result.read_text())
    assert passed["passed"]
    assert all(one["worst_arcmin"] < 4.0 for one in passed["eyes"].values())
    assert (images / "page" / "report.pdf").read_bytes().startswith(b"%PDF")
    assert np.linalg.norm(passed["depth_camera"]["shift_mm"]) < 0.5
    turned = replace(rig, T_H_D=rig.T_H_D @ rigid([0.0, 0.008, 0.0]))
    write_rig(tmp_path / "turned.yaml", turned)
    with pytest.raises(HandcalError, match=r"depth camera turned by 0\.[45]\d°"):
        accept(images, tmp_path / "turned.yaml", "--json", result)
    assert not json.loads(result.read_text())["passed"]
    assert "FAILED" in (images / "page" / "report.html").read_text("utf-8")
    capsys.readouterr()


def test_the_images_to_practise_with_come_with_all_there_is_to_enter(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = parse(["rig", "simulate", str(tmp_path / "images"), "--views", "3"])
    arguments.command(arguments)
    told = " ".join(capsys.readouterr().out.split())
    for one in (
        "ChArUco, 8×6 squares of 25 mm, markers of 16 mm, DICT_5X5_100",
        "images in depth and headset, intrinsics in depth.json and headset.json",
        "images of the grid in grid-left, grid squares 80 px",
        "images of the board in board-right, its poses in tracked-right.json",
        "measured distance 2 m",
    ):
        assert one in told
