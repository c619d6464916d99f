"""Jobs of the rig wizard: the steps of `handcal.rig`, with their results as rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from handcal.core.errors import HandcalError
from handcal.core.types import Eye, Rig
from handcal.io.files import write_json
from handcal.rig.assemble import with_display, with_stereo
from handcal.rig.boards.board import square_m
from handcal.rig.boards.views import BoardImage, WorstView
from handcal.rig.formats import camera_json, read_intrinsics
from handcal.rig.lens.camera import CameraSettings, calibrate_camera, tilt
from handcal.rig.lens.lens import Camera, first_pose
from handcal.rig.lens.uncertainty import ProjectionUncertainty
from handcal.rig.steps import (
    calibrate_depth_camera,
    calibrate_eye_display,
    calibrate_viewpoint,
    identity_in,
    intrinsics_in,
    pose_in,
)
from handcal.rig.verdict import CalibrationVerdict
from handcal_gui.app.translation import tr
from handcal_gui.rig.project_folder import (
    DisplayEntries,
    StereoEntries,
    ViewpointEntries,
    entered_path,
)
from handcal_gui.rig.rows import camera_rows, display_rows, lens_rows, stereo_rows
from handcal_gui.rig.shots import Shot, excluding
from handcal_gui.widgets.table import Row

CAMERA_MISSING = tr("the viewpoint camera's intrinsics are missing: solve its step first")


@dataclass(frozen=True, slots=True)
class SolvedPart:
    """The result of a step."""

    verdict: CalibrationVerdict
    rows: tuple[Row, ...]
    """The numbers with their standard deviations."""
    residuals_px: Mapping[str, float]
    tilts_rad: Mapping[str, float] = field(default_factory=dict)
    """By image; the tilt is the angle between the board's normal and the line of sight."""
    worst: WorstView | None = None
    uncertainties: tuple[ProjectionUncertainty | None, ...] = ()
    """Of each camera of the step; None if it was not solved."""
    lenses: tuple[Row, ...] = ()
    """The lens models compared."""
    add_to: Callable[[Rig], Rig] | None = None
    """Returns a rig with this part added; None if it is bad or not part of a rig."""


def solve_stereo(shots: Sequence[Shot], entries: StereoEntries) -> SolvedPart:
    """Solve the pose of the depth camera, like ``handcal rig stereo`` and ``make``."""
    pairs = [(first, second) for first, second in excluding(shots, entries.dropped)]
    result = calibrate_depth_camera(
        pairs,
        entries.lens,
        entered_path(entries.depth_intrinsics),
        entered_path(entries.headset_intrinsics),
    )
    add_to = partial(
        with_stereo,
        stereo=result,
        depth_intrinsics=intrinsics_in(entered_path(entries.imager_intrinsics)),
        T_C_D=pose_in(entered_path(entries.depth_to_color)),
        depth_camera=identity_in(entered_path(entries.imager_intrinsics)),
    )
    return SolvedPart(
        result.verdict,
        stereo_rows(result, _square_m(pairs)),
        result.residuals_px,
        _tilts([first for first, _ in pairs], result.depth),
        result.worst,
        tuple(None if one is None else one.uncertainty for one in result.solved),
        tuple(
            row
            for which, one in zip((tr("Depth"), tr("Headset")), result.solved, strict=True)
            if one is not None
            for row in lens_rows(one, which)
        ),
        None if result.verdict.name == "bad" else add_to,
    )


def solve_viewpoint(shots: Sequence[Shot], entries: ViewpointEntries, output: Path) -> SolvedPart:
    """Solve the viewpoint camera's intrinsics, and write them to a file unless bad."""
    views = [view for (view,) in excluding(shots, entries.dropped)]
    result = calibrate_camera(views, CameraSettings(lens=entries.lens))
    if result.verdict.name != "bad":
        write_json(output, camera_json(result))
    return SolvedPart(
        result.verdict,
        camera_rows(result),
        result.residuals_px,
        _tilts(views, result.intrinsics),
        result.worst,
        (result.uncertainty,),
        lens_rows(result),
    )


def solve_display(
    grid_shots: Sequence[Shot],
    board_shots: Sequence[Shot],
    entries: DisplayEntries,
    eye: Eye,
    rig: Rig,
    camera_file: Path,
) -> tuple[SolvedPart, SolvedPart]:
    """Calibrate an eye's display; return its result and the viewpoint camera's pose."""
    if not camera_file.exists():
        raise HandcalError(CAMERA_MISSING)
    camera = read_intrinsics(camera_file)
    stereo, tracked = entered_path(entries.stereo), entered_path(entries.tracked)
    boards = [] if stereo else [view for (view,) in excluding(board_shots, entries.dropped_board)]
    pose = calibrate_viewpoint(boards, camera, stereo, tracked)
    of_pose = SolvedPart(pose.verdict, (), pose.residuals_px, _tilts(boards, camera))
    grids = [view for (view,) in excluding(grid_shots, entries.dropped_grid)]
    result = calibrate_eye_display(rig, eye, grids, camera, pose, entries.inputs)
    add_to = partial(with_display, eye=eye, calibration=result)
    solved = SolvedPart(
        result.verdict,
        display_rows(result),
        result.homography.residuals_px,
        add_to=None if result.verdict.name == "bad" else add_to,
    )
    return solved, of_pose


def _square_m(pairs: Sequence[tuple[BoardImage, BoardImage]]) -> float:
    """Return the side of the board's squares as entered; the pairs were solved, so one is found."""
    return next(square_m(view.found.points_m) for pair in pairs for view in pair if view.found)


def _tilts(views: Sequence[BoardImage], camera: Camera) -> dict[str, float]:
    found = {view.name: view.found for view in views if view.found}
    poses = {name: first_pose(seen, camera) for name, seen in found.items()}
    return {name: tilt(T, found[name]) for name, T in poses.items() if T is not None}
