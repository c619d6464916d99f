"""The cube test, over captures in a folder or over rendered ones."""

from __future__ import annotations

import tempfile
from pathlib import Path

from handcal.cube_file import read_cube
from handcal.errors import HandcalError
from handcal.evaluate.cube_report import cube_report
from handcal.evaluate.cube_summary import cube_summary
from handcal.evaluate.cube_test import judge_captures
from handcal.report.document import Report
from handcal.resources import resource_path
from handcal.rig.formats import read_intrinsics
from handcal.rig.grid import Grid
from handcal.rig.rig_file import read_rig
from handcal.sim.cube_captures import CaptureSettings, write_captures
from handcal.types import Rig
from handcal_gui.evaluation.entries import CubeEntries
from handcal_gui.evaluation.work import Checkpoint

_RENDERING_SHARE = 0.7


def evaluate_cube(entries: CubeEntries, checkpoint: Checkpoint) -> Report:
    """Return the report, as ``handcal evaluate cube`` makes it.

    Raises
    ------
    HandcalError
        If a file cannot be used, or no capture can be evaluated.
    """
    rig = read_rig(_file(entries.rig, resource_path("example_rig.yaml")))
    if entries.captures:
        return _judge(Path(entries.captures).expanduser(), rig, entries, checkpoint)
    with tempfile.TemporaryDirectory() as rendered:
        write_captures(
            Path(rendered),
            rig,
            CaptureSettings(seed=entries.seed, eye=entries.eye),
            lambda doing, share: checkpoint(f"Rendering {doing}", _RENDERING_SHARE * share),
        )

        def judging(doing: str, share: float) -> None:
            checkpoint(doing, _RENDERING_SHARE + (1.0 - _RENDERING_SHARE) * share)

        return _judge(Path(rendered), rig, entries, judging)


def _judge(folder: Path, rig: Rig, entries: CubeEntries, checkpoint: Checkpoint) -> Report:
    cube = read_cube(_file(entries.cube, folder / "cube.json"))
    camera = read_intrinsics(_file(entries.camera, folder / "camera.json"))
    display = rig.eyes[entries.eye]
    try:
        grid = Grid(display.width_px, display.height_px, entries.square_px)
    except ValueError as error:
        raise HandcalError(str(error)) from error
    test = judge_captures(
        folder, cube, camera, grid, lambda what, share: checkpoint(f"Looking at {what}", share)
    )
    if not test.rows:
        reasons = "; ".join(f"{name}: {why}" for name, why in list(test.left_out.items())[:3])
        raise HandcalError(f"no pair of captures can be evaluated ({reasons})")
    return cube_report(test, cube_summary(test.rows), cube, camera)


def _file(entered: str, otherwise: Path) -> Path:
    return Path(entered).expanduser() if entered else otherwise
