"""The cube test: errors in all its captures, one row for each pair."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import TypeAlias

import numpy as np

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.core.types import Intrinsics, UInt8
from handcal.io.images import read_grey
from handcal.lab.evaluate.cube import CubeMisalignment, compare_cubes
from handcal.lab.evaluate.cube_folder import GRID, find_captures, images_in
from handcal.rig.boards.board import BoardError
from handcal.rig.boards.views import ViewsError
from handcal.rig.cube import Cube, CubeError, find_cube
from handcal.rig.displays.grid import Grid, find_grid
from handcal.rig.displays.homography import RotationWarp, fit_homography, pose_before

CubeRow: TypeAlias = dict[str, float | int | str]
"""Errors of one pair of captures; units are in the names."""

_UNUSABLE = (CubeError, BoardError, ViewsError, FileError, ValueError)


@dataclass(frozen=True, slots=True)
class CubeTest:
    """The errors found in captures."""

    rows: list[CubeRow]
    """`cube_row` of each pair, and whose it is: ``position``, ``pose``, ``drawn``."""
    left_out: dict[str, str]
    """Reasons, by the name of the capture that could not be used."""


def judge_captures(
    folder: Path,
    cube: Cube,
    camera: Intrinsics,
    grid: Grid,
    progress: Progress = Progress(),
) -> CubeTest:
    """Find and compare the cubes in all captures; missing and failed ones are left out.

    Captures are undistorted and, where the position has an image of the display's grid, turned to
    the display's axes (Hu et al. 2021), as an eye is: errors are along these.

    Parameters
    ----------
    folder : Path
        Laid out as in `handcal.lab.evaluate.cube_folder`.
    cube : Cube
    camera : Intrinsics
        The eye-replacement camera, lens included.
    grid : Grid
        The grid that the display shows in the grid images.
    progress : Progress

    Raises
    ------
    FileError
        If there are no captures, or too many.
    """
    poses, left_out = find_captures(folder)
    straight = replace(camera, distortion=())
    rows: list[CubeRow] = []
    for position, of_position in groupby(poses, key=lambda pose: pose.position):
        with _noted(left_out, f"{position}/{GRID}"):
            warp = display_warp(folder / position, camera, grid)
            if warp is None:
                warp = RotationWarp(camera, np.eye(3))
            for pose in of_position:
                name = f"{position}/{pose.pose}"
                progress.at(poses.index(pose) / len(poses), f"Looking at {name}")
                with _noted(left_out, f"{name}/{pose.real.name}"):
                    real_px = find_cube(warp.warp(_read(pose.real)), cube)
                    for drawn, path in pose.virtual.items():
                        with _noted(left_out, f"{name}/{path.name}"):
                            virtual_px = find_cube(warp.warp(_read(path)), cube)
                            errors = cube_row(compare_cubes(real_px, virtual_px, cube, straight))
                            whose = {"position": position, "pose": pose.pose, "drawn": drawn}
                            rows.append(whose | errors)
    return CubeTest(rows, left_out)


def display_warp(position: Path, camera: Intrinsics, grid: Grid) -> RotationWarp | None:
    """Return the warp of a position's images to the display's axes; None without its grid.

    Parameters
    ----------
    position : Path
        Folder of the position.
    camera : Intrinsics
    grid : Grid

    Raises
    ------
    FileError, BoardError, ViewsError, ValueError
        If the image of the grid cannot be used.
    """
    path = images_in(position).get(GRID) if position.is_dir() else None
    if path is None:
        return None
    size = grid.width_px, grid.height_px
    homography = fit_homography({GRID: find_grid(_read(path), grid)}, camera, *size)
    return RotationWarp(camera, pose_before(homography, camera, *size)[0])


def cube_row(found: CubeMisalignment) -> CubeRow:
    """Return the errors as the paper defines them: magnitudes, corners averaged.

    ``err_t_xy`` is the mean length of the corners' offsets in the image, ``err_R`` the angle.
    """
    x_mm, y_mm = 1e3 * np.abs(found.offset_m).mean(axis=0)
    x_arcmin, y_arcmin = 60.0 * np.degrees(np.abs(found.offset_rad).mean(axis=0))
    turn_deg = np.degrees(found.rotation_rad)
    row = {
        "depth_mm": 1e3 * found.depth_m,
        "err_t_x_mm": x_mm,
        "err_t_y_mm": y_mm,
        "err_t_z_mm": 1e3 * abs(found.along_m),
        "err_t_xy_mm": 1e3 * np.linalg.norm(found.offset_m, axis=1).mean(),
        "err_t_x_arcmin": x_arcmin,
        "err_t_y_arcmin": y_arcmin,
        "err_t_xy_arcmin": 60.0 * np.degrees(np.linalg.norm(found.offset_rad, axis=1).mean()),
        "err_R_x_deg": abs(turn_deg[0]),
        "err_R_y_deg": abs(turn_deg[1]),
        "err_R_z_deg": abs(turn_deg[2]),
        "err_R_deg": np.linalg.norm(turn_deg),
    }
    return {"faces": found.faces, **{name: float(value) for name, value in row.items()}}


@contextmanager
def _noted(left_out: dict[str, str], name: str) -> Iterator[None]:
    """Record the reason of a HandcalError, and continue after the block."""
    try:
        yield
    except _UNUSABLE as error:
        left_out[name] = str(error)


def _read(path: Path) -> UInt8:
    return read_grey(path)
