import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from handcal.core.geometry import rigid
from handcal.core.types import Intrinsics
from handcal.io.images import write_png
from handcal.rig.cube.cube import Cube
from handcal.rig.cube.cube_file import read_cube, write_cube
from handcal.rig.formats import write_intrinsics
from handcal.sim.boards import PictureSettings
from handcal.sim.cube import CubePainter

CAMERA = Intrinsics(640, 360, 900.0, 900.0, 320.0, 180.0)


@pytest.fixture
def captures(tmp_path: Path) -> Path:
    folder = tmp_path / "captures"
    pose = folder / "centre" / "pose-1"
    pose.mkdir(parents=True)
    write_cube(folder / "cube.json", Cube())
    write_intrinsics(folder / "camera.json", CAMERA, "json")
    painter = CubePainter(Cube(), CAMERA, PictureSettings(samples=1))
    T = rigid([0, 0, 0.1], [0, 0, 0.45]) @ rigid([0.5, 0, 0]) @ rigid([0, 0.7, 0])
    for name, aside_m in (("real", 0.0), ("virtual", 0.003)):
        seen = painter.paint(rigid(None, [aside_m, 0, 0]) @ T, np.random.default_rng(1))
        write_png(pose / f"{name}.png", seen)
    (folder / "centre" / "pose-2").mkdir()
    return folder


def test_a_net_is_made_with_its_description(
    handcal: Callable[..., None], fails: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    pdf, description = tmp_path / "out" / "net.pdf", tmp_path / "out" / "cube.json"
    sides = ("--side-mm", 50, "--marker-mm", 35, "--ids", 9, 8, 7, 6, 5, 4)
    handcal("evaluate", "cube", "net", "--pdf", pdf, "--cube", description, *sides)
    assert pdf.read_bytes().startswith(b"%PDF")
    assert read_cube(description) == Cube(0.05, 0.035, "DICT_4X4_50", (9, 8, 7, 6, 5, 4))
    assert "more than a4" in fails("evaluate", "cube", "net", "--pdf", pdf, "--side-mm", 75)[1]


def test_captures_are_reported(
    handcal: Callable[..., None],
    captures: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    output, figures = tmp_path / "report", tmp_path / "figures.json"
    handcal("evaluate", "cube", "report", captures, "--output", output, "--json", figures)
    assert (output / "report.pdf").is_file()
    assert (output / "report.html").is_file()
    found = json.loads(figures.read_text())
    assert found["errors"]["virtual"]["err_t_x_mm"]["spread"]["mean"] == pytest.approx(3.0, abs=0.2)
    assert len(found["pairs"]) == 1
    assert found["left_out"] == {"centre/pose-2": "there is no real.png"}
    said = capsys.readouterr().out
    assert "Left out: centre/pose-2: there is no real.png" in said
    assert "virtual" in said


def test_misuse_is_one_line(
    captures: Path, monkeypatch: pytest.MonkeyPatch, fails: Callable[..., tuple[int, str]]
) -> None:
    nowhere = captures / "nowhere"
    assert "cube.json" in fails("evaluate", "cube", "report", nowhere)[1]
    assert "not empty" in fails("evaluate", "cube", "simulate", captures)[1]
    monkeypatch.setattr("handcal.camera.viewpoint.list_viewpoints", lambda: [0, 2])
    assert "cameras 0, 2 are there" in fails("evaluate", "cube", "capture", captures)[1]
    wrong = fails("evaluate", "cube", "capture", captures, "--positions", "a/b")
    assert "letters, digits" in wrong[1]
