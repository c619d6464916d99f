"""The tutorial's commands, as they stand there."""

from __future__ import annotations

import importlib.util
import re
import shlex
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree as ET

import pytest

from handcal.cli.main import main, parse
from tests.helpers import ROOT, slow_simulator, write_small_rig

TUTORIAL = (ROOT / "docs" / "tutorial.md").read_text("utf-8")


def commands(kind: str) -> list[str]:
    blocks = re.findall(rf"```{kind}\n(.*?)```", TUTORIAL, re.DOTALL)
    return [line for block in blocks for line in block.splitlines()]


@pytest.mark.process
@pytest.mark.parametrize("views", [8, pytest.param(20, marks=pytest.mark.slow)])
def test_every_command_runs_on_rendered_images_and_the_simulator(
    views: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A whole offline calibration and a wearer, as a reader would do it; 20 views as written."""
    monkeypatch.chdir(tmp_path)
    slow_simulator(monkeypatch)
    small = write_small_rig(tmp_path / "small.yaml")
    for command in commands("bash"):
        command = command.replace("--views 20", f"--views {views}")
        if views < 20:  # a quarter of the pixels, too
            command = command.replace("handcal demo", f"handcal demo --rig {small}")
        if "SESSION" in command:
            newest = max((tmp_path / "sessions").iterdir())
            command = command.replace("SESSION", newest.name)
        monkeypatch.setattr(sys, "argv", shlex.split(command))
        main()  # a failure is a SystemExit
    for made in ("rig.yaml", "board.pdf", "acceptance/report.pdf", "report/report.pdf"):
        assert (tmp_path / made).stat().st_size > 0


def test_the_commands_for_devices_are_understood() -> None:
    devices = [one for one in commands("text") if one.startswith("handcal ")]
    assert len(devices) >= 6
    for command in devices:
        parse(shlex.split(command)[1:])


@pytest.fixture(scope="module")
def drawings() -> ModuleType:
    spec = importlib.util.spec_from_file_location("drawings", ROOT / "docs" / "drawings.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["drawings"] = module
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "dont_write_bytecode", True)  # docs/ is packaged as it is
        spec.loader.exec_module(module)
    return module


def test_the_mount_is_a_closed_body_of_the_right_volume(drawings: ModuleType) -> None:
    mount = drawings.Mount(tilt_deg=0.0)
    triangles = drawings.mount_triangles(mount)
    edges = Counter((a, b) for t in triangles for a, b in zip(t, (*t[1:], t[0]), strict=True))
    assert all(edges[b, a] == count for (a, b), count in edges.items())
    volume = sum(
        (
            a[0] * (b[1] * c[2] - b[2] * c[1])
            - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
        )
        / 6
        for a, b, c in triangles
    )
    foot = mount.width_mm * mount.depth_mm * mount.thick_mm
    plate = mount.thick_mm * (
        mount.width_mm * mount.height_mm - 2 * mount.screw_mm * mount.height_mm / 2
    )
    assert volume == pytest.approx(foot + plate)


def test_impossible_mounts_are_refused(drawings: ModuleType) -> None:
    for wrong in ({"holes_mm": 95.0}, {"tilt_deg": 60.0}, {"thick_mm": 0.0}, {"height_mm": 6.0}):
        with pytest.raises(ValueError, match=r"must|within|lower"):
            drawings.Mount(**wrong)


def test_the_drawings_are_those_of_the_script(drawings: ModuleType) -> None:
    pictures = ROOT / "docs" / "pictures"
    made = {name: drawings.arrangement_svg(name) for name in drawings.ARRANGEMENTS}
    made["mount"] = drawings.mount_svg(drawings.Mount())
    for name, svg in made.items():
        ET.fromstring(svg)
        assert (pictures / f"{name}.svg").read_text("utf-8") == svg
        assert f"pictures/{name}.svg" in TUTORIAL
    for name, draw in drawings.METHOD.items():
        assert (pictures / f"{name}.svg").read_text("utf-8") == draw()
        ET.fromstring(draw())
