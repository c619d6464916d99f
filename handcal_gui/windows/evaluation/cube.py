"""The cube test, over captures in a folder or over rendered ones."""

from __future__ import annotations

import tempfile
from pathlib import Path

from handcal.errors import FileError, HandcalError
from handcal.io.resources import resource_path
from handcal.lab.evaluate.cube_folder import CapturePlan
from handcal.lab.evaluate.cube_report import cube_report
from handcal.lab.evaluate.cube_summary import cube_summary
from handcal.lab.evaluate.cube_test import judge_captures
from handcal.report.document import Report
from handcal.rig.cube import Cube
from handcal.rig.cube_file import read_cube
from handcal.rig.formats import read_intrinsics
from handcal.rig.grid import Grid
from handcal.rig.rig_file import read_rig
from handcal.sim.cube_captures import CaptureSettings, write_captures
from handcal.types import Rig
from handcal_gui.evaluation_entries import CubeEntries
from handcal_gui.windows.evaluation.work import Checkpoint

_RENDERING_SHARE = 0.7


def evaluate_cube(entries: CubeEntries, checkpoint: Checkpoint) -> Report:
    """Return the report, as ``handcal evaluate cube`` makes it.

    Raises
    ------
    HandcalError
        If a file cannot be used, or no capture can be evaluated.
    """
    if entries.captures:
        return _judge(Path(entries.captures).expanduser(), entries, checkpoint)
    with tempfile.TemporaryDirectory() as rendered:
        write_captures(
            Path(rendered),
            _rig(entries),
            CaptureSettings(seed=entries.seed, eye=entries.eye),
            lambda doing, share: checkpoint(f"Rendering {doing}", _RENDERING_SHARE * share),
        )

        def judging(doing: str, share: float) -> None:
            checkpoint(doing, _RENDERING_SHARE + (1.0 - _RENDERING_SHARE) * share)

        return _judge(Path(rendered), entries, judging)


def read_cube_and_grid(entries: CubeEntries, folder: Path) -> tuple[Cube, Grid]:
    """Return what is looked for in the captures of a folder.

    Raises
    ------
    HandcalError
        If a file is missing or wrong, or the display has no room for such a grid.
    """
    file = _file(entries.cube, folder / "cube.json")
    if not file.exists():
        raise FileError(
            f"there is no {file}: choose the cube's description, or make it with its net, by "
            "handcal evaluate cube net"
        )
    display = _rig(entries).eyes[entries.eye]
    try:
        return read_cube(file), Grid(display.width_px, display.height_px, entries.square_px)
    except ValueError as error:
        raise HandcalError(str(error)) from error


def capture_plan(entries: CubeEntries) -> CapturePlan:
    """Return what shall be captured; ValueError if a name is wrong."""
    return CapturePlan(
        _names(entries.positions), entries.poses, _names(entries.drawn), entries.with_grid
    )


def _judge(folder: Path, entries: CubeEntries, checkpoint: Checkpoint) -> Report:
    cube, grid = read_cube_and_grid(entries, folder)
    camera = read_intrinsics(_file(entries.camera, folder / "camera.json"))
    test = judge_captures(
        folder, cube, camera, grid, lambda what, share: checkpoint(f"Looking at {what}", share)
    )
    if not test.rows:
        reasons = "; ".join(f"{name}: {why}" for name, why in list(test.left_out.items())[:3])
        raise HandcalError(f"no pair of captures can be evaluated ({reasons})")
    return cube_report(test, cube_summary(test.rows), cube, camera)


def _rig(entries: CubeEntries) -> Rig:
    return read_rig(_file(entries.rig, resource_path("example_rig.yaml")))


def _names(text: str) -> tuple[str, ...]:
    return tuple(filter(None, map(str.strip, text.split(","))))


def _file(entered: str, otherwise: Path) -> Path:
    return Path(entered).expanduser() if entered else otherwise
