"""What the rig wizard's jobs do: a step of `handcal.rig` each, and what is shown of the result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from handcal.errors import HandcalError
from handcal.io.files import write_json
from handcal.rig.assemble import with_display, with_stereo
from handcal.rig.camera import CameraSettings, calibrate_camera, tilt
from handcal.rig.display import (
    DisplaySettings,
    Screen,
    calibrate_display,
    fit_homography,
    pixel_size_m,
)
from handcal.rig.formats import camera_json, read_intrinsics, read_pose, read_stereo
from handcal.rig.grid import Grid, on_display
from handcal.rig.stereo import StereoSettings, calibrate_stereo
from handcal.rig.tracked_file import read_tracked
from handcal.rig.verdict import CalibrationVerdict
from handcal.rig.viewpoint import (
    ViewpointPose,
    board_pose,
    viewpoint_from_stereo,
    viewpoint_from_tracked,
)
from handcal.rig.views import View, used
from handcal.rig.worst import WorstView
from handcal.types import Eye, Float64, Intrinsics, Rig
from handcal_gui.widgets.number_table import Row
from handcal_gui.windows.rig.rows import camera_rows, display_rows, stereo_rows
from handcal_gui.windows.rig.shots import Shot, without
from handcal_gui.windows.rig.work import DisplayEntries, StereoEntries, ViewpointEntries


@dataclass(frozen=True, slots=True)
class Solved:
    """What a step came to."""

    verdict: CalibrationVerdict
    rows: tuple[Row, ...]
    """The numbers, with how well they are known."""
    residuals_px: Mapping[str, float]
    tilts_rad: Mapping[str, float] = field(default_factory=dict)
    """Of each image; the tilt is between the board's normal and the line of sight."""
    worst: WorstView | None = None
    put: Callable[[Rig], Rig] | None = None
    """Returns a rig with this part in it; None if it is no part of a rig, or bad."""


def solve_stereo(shots: Sequence[Shot], entries: StereoEntries) -> Solved:
    """Solve where the depth camera is, as ``handcal rig stereo`` and ``make`` do."""
    pairs = [(first, second) for first, second in without(shots, entries.dropped)]
    result = calibrate_stereo(
        pairs,
        _intrinsics(entries.depth_intrinsics),
        _intrinsics(entries.headset_intrinsics),
        StereoSettings(camera=CameraSettings(lens=entries.lens)),
    )
    put = partial(
        with_stereo,
        stereo=result,
        depth_intrinsics=_intrinsics(entries.imager_intrinsics),
        T_C_D=_pose(entries.depth_to_color),
    )
    return Solved(
        result.verdict,
        stereo_rows(result),
        result.residuals_px,
        _tilts([first for first, _ in pairs], result.depth),
        result.worst,
        None if result.verdict.name == "bad" else put,
    )


def solve_viewpoint(shots: Sequence[Shot], entries: ViewpointEntries, output: Path) -> Solved:
    """Solve the viewpoint camera's intrinsics, and keep them in a file unless they are bad."""
    views = [view for (view,) in without(shots, entries.dropped)]
    result = calibrate_camera(views, CameraSettings(lens=entries.lens))
    if result.verdict.name != "bad":
        write_json(output, camera_json(result))
    return Solved(
        result.verdict,
        camera_rows(result),
        result.residuals_px,
        _tilts(views, result.intrinsics),
        result.worst,
    )


def solve_display(
    grid_shots: Sequence[Shot],
    board_shots: Sequence[Shot],
    entries: DisplayEntries,
    eye: Eye,
    screen: Screen,
    camera_file: Path,
) -> tuple[Solved, Solved]:
    """Calibrate an eye's display; return what came of it, and of the viewpoint camera's place."""
    if not camera_file.exists():
        raise HandcalError("the viewpoint camera's intrinsics are missing: solve its step first")
    camera = read_intrinsics(camera_file)
    view = _pose(entries.view)
    screen = screen if view is None else replace(screen, T_V_H=view)
    place, of_place = _place(board_shots, entries, camera)
    grid = grid_of(entries, screen.width_px, screen.height_px)
    views = [view for (view,) in without(grid_shots, entries.dropped_grid)]
    seen = {name: on_display(found, grid) for name, found in used(views, 1).items()}
    homography = fit_homography(seen, camera, screen.width_px, screen.height_px)
    result = calibrate_display(homography, camera, place, screen, _distance(entries))
    put = partial(with_display, eye=eye, calibration=result)
    solved = Solved(
        result.verdict,
        display_rows(result),
        homography.residuals_px,
        put=None if result.verdict.name == "bad" else put,
    )
    return solved, of_place


def grid_of(entries: DisplayEntries, width_px: int, height_px: int) -> Grid:
    """Return the grid that a display shows; HandcalError if it has no room for it."""
    try:
        return Grid(width_px, height_px, entries.square_px)
    except ValueError as error:
        raise HandcalError(str(error)) from error


def _place(
    shots: Sequence[Shot], entries: DisplayEntries, camera: Intrinsics
) -> tuple[ViewpointPose, Solved]:
    if entries.stereo:
        place = viewpoint_from_stereo(read_stereo(Path(entries.stereo).expanduser()))
        return place, Solved(place.verdict, (), place.residuals_px)
    if not entries.tracked:
        raise HandcalError("say where the board was tracked: the file of its poses is missing")
    poses = read_tracked(Path(entries.tracked).expanduser())
    views = [view for (view,) in without(shots, entries.dropped_board)]
    place = viewpoint_from_tracked(views, poses, camera)
    return place, Solved(place.verdict, (), place.residuals_px, _tilts(views, camera))


def _distance(entries: DisplayEntries) -> DisplaySettings:
    if entries.distance == "measured":
        return DisplaySettings(distance_m=entries.distance_m)
    angle_rad = float(np.radians(entries.square_arcmin / 60.0))
    return DisplaySettings(pixel_m=pixel_size_m(angle_rad, entries.square_px, entries.nominal_m))


def _tilts(views: Sequence[View], camera: Intrinsics) -> dict[str, float]:
    found = {view.name: view.found for view in views if view.found}
    return {name: tilt(board_pose(seen, camera), seen) for name, seen in found.items()}


def _intrinsics(path: str) -> Intrinsics | None:
    return read_intrinsics(Path(path).expanduser()) if path else None


def _pose(path: str) -> Float64 | None:
    return read_pose(Path(path).expanduser()) if path else None
