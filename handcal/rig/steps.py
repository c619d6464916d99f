"""Steps of a headset's offline calibration, used by the commands and the rig wizard."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from handcal.core.errors import FileError, HandcalError
from handcal.core.types import CameraIdentity, Eye, Float64, Intrinsics, Rig
from handcal.rig.assemble import screen_of
from handcal.rig.boards.tracked_file import read_tracked
from handcal.rig.boards.views import BoardImage, used
from handcal.rig.check import check_view
from handcal.rig.displays.display import (
    DisplayCalibration,
    DisplaySettings,
    Screen,
    calibrate_display,
    fit_homography,
    pixel_size_m,
)
from handcal.rig.displays.grid import GridView, grid_on, on_display
from handcal.rig.formats import read_camera, read_identity, read_intrinsics, read_pose, read_stereo
from handcal.rig.lens.camera import CameraSettings, LensChoice
from handcal.rig.lens.stereo import StereoCalibration, StereoSettings, calibrate_stereo
from handcal.rig.lens.viewpoint import ViewpointPose, viewpoint_from_stereo, viewpoint_from_tracked

ASKED_GRIDS, ASKED_BOARDS = 3, 8
"""Images of the grid and of the tracked board that a display asks for; fewer are not *good*."""


@dataclass(frozen=True, slots=True)
class DisplayInputs:
    """Numbers and files for the calibration of one eye's display, besides the images."""

    square_px: int = 80
    """Side of the grid's squares."""
    distance_m: float | None = 2.0
    """z(C0→S) as measured, or None to solve it from `square_arcmin`."""
    square_arcmin: float = 112.0
    nominal_m: float = 2.0
    """Angle that a square subtends at the nominal distance of the virtual image."""
    pose_V_H: Path | None = None
    """File of T_V_H as reported by the headset, or None to use that of the rig."""

    @property
    def settings(self) -> DisplaySettings:
        """Settings with the distance of the display, or with the size of its pixels."""
        if self.distance_m is not None:
            return DisplaySettings(distance_m=self.distance_m)
        angle_rad = float(np.radians(self.square_arcmin / 60.0))
        return DisplaySettings(pixel_m=pixel_size_m(angle_rad, self.square_px, self.nominal_m))


def calibrate_depth_camera(
    pairs: Sequence[tuple[BoardImage, BoardImage]],
    lens: LensChoice,
    depth_intrinsics: Path | None,
    headset_intrinsics: Path | None,
) -> StereoCalibration:
    """Calibrate the pose of the depth camera in the headset from pairs of views of a board.

    Parameters
    ----------
    pairs : sequence of (BoardImage, BoardImage)
        By the depth camera and by the headset's.
    lens : LensChoice
        Lens model of intrinsics that are solved.
    depth_intrinsics, headset_intrinsics : Path or None
        Files; None to solve them from the images.
    """
    return calibrate_stereo(
        pairs,
        None if depth_intrinsics is None else read_camera(depth_intrinsics),
        None if headset_intrinsics is None else read_camera(headset_intrinsics),
        StereoSettings(camera=CameraSettings(lens=lens)),
    )


def calibrate_viewpoint(
    board_views: Sequence[BoardImage], camera: Intrinsics, stereo: Path | None, tracked: Path | None
) -> ViewpointPose:
    """Calibrate the pose of the viewpoint camera in the headset.

    Parameters
    ----------
    board_views : sequence of BoardImage
        By the viewpoint camera, of the tracked board; not used with `stereo`.
    camera : Intrinsics
        The viewpoint camera.
    stereo : Path or None
        Stereo calibration with the viewpoint camera as its depth camera.
    tracked : Path or None
        Poses of the board in `board_views`.

    Raises
    ------
    HandcalError
        If both files are missing, one cannot be read, or the views do not suffice.
    """
    if stereo is not None:
        return viewpoint_from_stereo(read_stereo(stereo))
    if tracked is None:
        raise HandcalError("tracked poses of the board are missing: choose their file")
    pose = viewpoint_from_tracked(board_views, read_tracked(tracked), camera)
    views = len(pose.residuals_px)
    return replace(
        pose, verdict=pose.verdict.unless_few(views, ASKED_BOARDS, "images of the board")
    )


def calibrate_eye_display(
    rig: Rig,
    eye: Eye,
    grid_views: Sequence[BoardImage],
    camera: Intrinsics,
    viewpoint: ViewpointPose,
    inputs: DisplayInputs,
) -> DisplayCalibration:
    """Calibrate one eye's display from views of its grid.

    Parameters
    ----------
    rig : Rig
        Gives the size of the display and, unless `inputs` does, T_V_H.
    eye : {"left", "right"}
    grid_views : sequence of BoardImage
        By the viewpoint camera, of the grid's board.
    camera : Intrinsics
        The viewpoint camera.
    viewpoint : ViewpointPose
        Pose of the viewpoint camera while it saw the grid.
    inputs : DisplayInputs

    Raises
    ------
    HandcalError
        If no view shows the grid, or the display has no room for it.
    """
    screen = screen_of(rig, eye)
    grid = grid_on(screen.width_px, screen.height_px, inputs.square_px)
    seen = {name: on_display(found, grid) for name, found in used(grid_views, 1).items()}
    display = _calibrated(screen, seen, camera, viewpoint, inputs)
    verdict = display.verdict.unless_few(len(seen), ASKED_GRIDS, "images of the grid")
    return replace(display, verdict=verdict)


def calibrate_by_gray_code(
    rig: Rig,
    eye: Eye,
    seen: GridView,
    camera: Intrinsics,
    viewpoint: ViewpointPose,
    inputs: DisplayInputs,
) -> DisplayCalibration:
    """Calibrate one eye's display from Gray-code patterns (`read_gray_code`) in place of the grid.

    Raises
    ------
    HandcalError
        If the images are not of the camera's size.
    """
    return _calibrated(screen_of(rig, eye), {"Gray code": seen}, camera, viewpoint, inputs)


def _calibrated(
    screen: Screen,
    seen: Mapping[str, GridView],
    camera: Intrinsics,
    viewpoint: ViewpointPose,
    inputs: DisplayInputs,
) -> DisplayCalibration:
    if inputs.pose_V_H is not None:
        screen = replace(screen, T_V_H=view_in(inputs.pose_V_H))
    homography = fit_homography(seen, camera, screen.width_px, screen.height_px)
    return calibrate_display(homography, camera, viewpoint, screen, inputs.settings)


def intrinsics_in(path: Path | None) -> Intrinsics | None:
    """Return the intrinsics in a file; None without one."""
    return None if path is None else read_intrinsics(path)


def identity_in(path: Path | None) -> CameraIdentity:
    """Return the identity of the camera in a file of its intrinsics; empty without one."""
    return CameraIdentity() if path is None else read_identity(path)


def view_in(path: Path) -> Float64:
    """Return T_V_H in a file; FileError if it cannot be read, or is implausible."""
    T_V_H = read_pose(path)
    try:
        check_view("T_V_H", T_V_H)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error
    return T_V_H


def pose_in(path: Path | None) -> Float64 | None:
    """Return the pose (4, 4) in a file; None without one."""
    return None if path is None else read_pose(path)
