"""Evaluations that can be ordered: cube test, user test and test of the segmentation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from handcal.core.errors import FileError, HandcalError
from handcal.core.progress import Progress
from handcal.core.types import Rig
from handcal.hand.settings import SegmentSettings
from handcal.hand.shipped import make_finder
from handcal.io.files import make_folder, require_suffix, user_path
from handcal.io.images import write_png
from handcal.io.resources import resource_path
from handcal.lab.evaluate.cube_report import cube_report
from handcal.lab.evaluate.cube_summary import ErrorSummary, cube_summary
from handcal.lab.evaluate.cube_test import CubeTest, display_warp, judge_captures
from handcal.lab.evaluate.masked_frames import read_masked_frames, read_masked_names
from handcal.lab.evaluate.segmentation import evaluate_frame, evaluation
from handcal.lab.evaluate.segmentation_report import segmentation_report
from handcal.lab.evaluate.segmentation_sheet import contact_sheet, tile
from handcal.lab.evaluate.user_test import UserTestResult, evaluate_user_test, read_user_test
from handcal.lab.evaluate.user_test_report import user_test_report
from handcal.lab.settings import (
    CubeTestSettings,
    SegmentationTestSettings,
    UserTestSettings,
    output_folder,
)
from handcal.lab.study.store import free_of_studies
from handcal.report.document import Report
from handcal.report.html import write_report
from handcal.rig.cube import Cube, read_cube
from handcal.rig.displays.grid import Grid, grid_on
from handcal.rig.displays.homography import RotationWarp
from handcal.rig.formats import read_intrinsics
from handcal.rig.rig_file import read_rig
from handcal.sim.cube_captures import CaptureSettings, write_captures

# Shares of the time.
_READING, _RENDERING, _SEGMENTING = 0.7, 0.49, 0.95
_MOST_REASONS = 3


@dataclass(frozen=True, slots=True, eq=False)
class CubeTestResult:
    """The errors found in a cube test, and its report as it was written."""

    test: CubeTest
    summary: Mapping[str, Mapping[str, ErrorSummary]]
    """By the name of the drawn cube and of the error."""
    report: Report
    files: tuple[Path, ...]
    """The report as PDF and as HTML."""


@dataclass(frozen=True, slots=True, eq=False)
class UserTestRun:
    """The errors found in a user test, and its report as it was written."""

    result: UserTestResult
    report: Report
    files: tuple[Path, ...]
    """The report as PDF and as HTML."""


@dataclass(frozen=True, slots=True, eq=False)
class SegmentationRun:
    """The figures of a test of the segmentation, and its report."""

    figures: dict[str, Any]
    """As `evaluation` gives them."""
    report: Report
    files: tuple[Path, ...]
    """The report as PDF and as HTML, if it was written."""


def run_cube_test(settings: CubeTestSettings, progress: Progress = Progress()) -> CubeTestResult:
    """Evaluate the captures of a cube test, rendered ones without a folder, and write the report.

    Raises
    ------
    CancelledError
    HandcalError
        If a file cannot be used, the results would go into a study's folder, or no pair of captures
        can be evaluated.
    """
    output = free_of_studies(output_folder(settings.output))
    if settings.captures:
        folder = user_path(settings.captures)
        return _evaluate_captures(settings, folder, output, progress, 0.0)
    with TemporaryDirectory() as rendered:
        render_captures(settings, Path(rendered), progress.part(0.0, _RENDERING))
        return _evaluate_captures(settings, Path(rendered), output, progress, _RENDERING)


def render_captures(
    settings: CubeTestSettings, folder: Path, progress: Progress = Progress()
) -> None:
    """Render all captures of a cube test into a new or empty folder.

    Raises
    ------
    CancelledError
    HandcalError
        If the rig file cannot be used, or the folder is not empty or cannot be written.
    """
    chosen = CaptureSettings(
        seed=settings.seed,
        eye=settings.eye,
        poses=settings.poses,
        alignments=settings.alignments,
        prior=settings.prior,
    )
    write_captures(folder, _rig(settings), chosen, progress)


def run_user_test(settings: UserTestSettings, progress: Progress = Progress()) -> UserTestRun:
    """Evaluate the user test over sessions, and write the report.

    Raises
    ------
    CancelledError
    FileError
        If no session holds a trial, or the results would go into a study's folder.
    """
    output = free_of_studies(output_folder(settings.output))
    folders = [user_path(folder) for folder in settings.folders]
    test = read_user_test(folders, progress.part(0.0, _READING))
    result = evaluate_user_test(test)
    report = user_test_report(test, result)
    return UserTestRun(result, report, _write(output, report, progress))


def run_segmentation_test(
    settings: SegmentationTestSettings, progress: Progress = Progress()
) -> SegmentationRun:
    """Segment the hand in a folder of frames with true masks.

    Writes the report and the contact sheet, if they are wanted.

    Raises
    ------
    CancelledError
    FileError
        If a file cannot be used or written, or the report would go into a study's folder.
    """
    output = free_of_studies(output_folder(settings.output)) if settings.output else None
    sheet = user_path(settings.sheet) if settings.sheet else None
    if sheet is not None:  # before the long work, whose result would be lost
        require_suffix(sheet, ".png")
        make_folder(sheet.parent)
    folder = user_path(settings.folder)
    segmenting = SegmentSettings(roi=settings.roi)
    described = read_masked_names(folder)
    rows, tiles = [], []
    for shot in read_masked_frames(folder, described):
        row, mask = evaluate_frame(shot, lambda one: make_finder(segmenting).find(one))
        rows.append(row)
        tiles.append(tile(shot, mask, row))
        progress.at(_SEGMENTING * len(rows) / len(described), "Segmenting hands")
    if sheet is not None:
        write_png(sheet, contact_sheet(tiles))
    figures = evaluation(rows)
    report = segmentation_report(figures, tiles)
    files = (
        ()
        if output is None
        else write_report(output, report, progress.part(_SEGMENTING, 1.0, "Writing the report"))
    )
    return SegmentationRun(figures, report, files)


def cube_and_grid(settings: CubeTestSettings, folder: Path) -> tuple[Cube, Grid]:
    """Return the cube and the display's grid that the captures in a folder show.

    Raises
    ------
    HandcalError
        If a file is missing or wrong, or the display has no room for such a grid.
    """
    file = _file(settings.cube, folder / "cube.json")
    if not file.exists():
        raise FileError(
            f"there is no {file}: choose the description of the cube, or write one together with "
            "the cube's net by handcal evaluate cube net"
        )
    display = _rig(settings).eyes[settings.eye]
    return read_cube(file), grid_on(display.width_px, display.height_px, settings.square_px)


def position_warp(settings: CubeTestSettings, folder: Path, position: str) -> RotationWarp | None:
    """Return the warp of the live view at a position; None before its grid is captured.

    Raises
    ------
    HandcalError
        If the camera's intrinsics or the image of the grid cannot be used.
    """
    file = _file(settings.camera, folder / "camera.json")
    if not file.exists():
        raise FileError(f"there is no {file}: choose the file of the camera's intrinsics")
    camera = read_intrinsics(file)
    grid = cube_and_grid(settings, folder)[1]
    return display_warp(folder / position, camera, grid)


def _evaluate_captures(
    settings: CubeTestSettings, folder: Path, output: Path, progress: Progress, begun: float
) -> CubeTestResult:
    cube, grid = cube_and_grid(settings, folder)
    camera = read_intrinsics(_file(settings.camera, folder / "camera.json"))
    test = judge_captures(folder, cube, camera, grid, progress.part(begun, _READING))
    if not test.rows:
        reasons = [f"{name}: {why}" for name, why in test.left_out.items()]
        shown = "; ".join(reasons[:_MOST_REASONS])
        raise HandcalError(f"no pair of captures can be evaluated ({shown})")
    summary = cube_summary(test.rows)
    report = cube_report(test, summary, cube, camera)
    return CubeTestResult(test, summary, report, _write(output, report, progress))


def _write(folder: Path, report: Report, progress: Progress) -> tuple[Path, ...]:
    return write_report(folder, report, progress.part(_READING, 1.0, "Writing the report"))


def _rig(settings: CubeTestSettings) -> Rig:
    return read_rig(_file(settings.rig, resource_path("example_rig.yaml")))


def _file(chosen: str, otherwise: Path) -> Path:
    return user_path(chosen) if chosen else otherwise
