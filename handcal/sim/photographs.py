"""Rendered photographs of an offline calibration and its acceptance, in folders of real ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handcal.core.display import view_of_eye
from handcal.core.geometry import invert, rigid
from handcal.core.types import EYES, Intrinsics, Rig, UInt8
from handcal.io.files import make_folder
from handcal.io.images import write_png
from handcal.rig.boards.board import Board
from handcal.rig.displays.grid import Grid, draw_grid
from handcal.rig.formats import write_intrinsics, write_tracked
from handcal.sim.boards import BoardPainter, PictureSettings, board_poses
from handcal.sim.viewpoint import photograph_display

BOARD = Board(squares=(8, 6))
# Small, to save time.
DEPTH_CAMERA = Intrinsics(640, 360, 502.0, 502.0, 319.5, 179.5, (0.05, -0.1, 0.001, 0.0, 0.0))
HEADSET_CAMERA = Intrinsics(640, 360, 520.0, 521.0, 322.0, 176.0, (-0.08, 0.05, 0.0, 0.001, 0.0))
VIEWPOINT_CAMERA = Intrinsics(
    640, 360, 900.0, 898.5, 322.0, 177.5, (-0.08, 0.05, 0.0004, -0.0003, 0.0)
)
_TURN_RAD = 0.02
_TRACKED, _GRIDS = 8, 3


def write_photographs(
    folder: Path, rig: Rig, views: int, rng: np.random.Generator, samples: int = 1
) -> None:
    """Write images of `BOARD` by the three cameras, and of both displays.

    Folders ``depth`` and ``headset`` hold pairs, ``viewpoint`` the viewpoint camera's images;
    ``grid-left``, ``board-left`` and ``tracked-left.json`` hold the images from the left eye's
    viewpoint and the board's poses; likewise for the right.

    Parameters
    ----------
    folder : Path
    rig : Rig
        The truth, except for the depth camera's intrinsics, which are `DEPTH_CAMERA`.
    views : int
        Number of views for each camera.
    rng : Generator
    samples : int
        Rays along each side of a pixel of the boards' images.
    """
    depth, headset, viewpoint = (
        BoardPainter(BOARD, camera, PictureSettings(samples=samples))
        for camera in (DEPTH_CAMERA, HEADSET_CAMERA, VIEWPOINT_CAMERA)
    )
    pairs = board_poses(BOARD, DEPTH_CAMERA, views, rng, others=((rig.T_H_D, HEADSET_CAMERA),))
    for number, T_D_B in enumerate(pairs, 1):
        _write(folder / "depth", number, depth.paint(T_D_B, rng))
        _write(folder / "headset", number, headset.paint(rig.T_H_D @ T_D_B, rng))
    for number, T_C_B in enumerate(board_poses(BOARD, VIEWPOINT_CAMERA, views, rng), 1):
        _write(folder / "viewpoint", number, viewpoint.paint(T_C_B, rng))
    for eye in EYES:
        display, T_E_C = rig.eyes[eye], rigid(rng.normal(0.0, _TURN_RAD, 3))
        shown = draw_grid(Grid(display.width_px, display.height_px))
        for number in range(1, _GRIDS + 1):
            seen = photograph_display(shown, display, T_E_C[:3, :3], VIEWPOINT_CAMERA, rng)
            _write(folder / f"grid-{eye}", number, seen)
        T_H_C = invert(view_of_eye(display, np.eye(4))) @ T_E_C
        tracked = {}
        for number, T_C_B in enumerate(board_poses(BOARD, VIEWPOINT_CAMERA, _TRACKED, rng), 1):
            name = _write(folder / f"board-{eye}", number, viewpoint.paint(T_C_B, rng))
            tracked[name] = T_H_C @ T_C_B
        write_tracked(folder / f"tracked-{eye}.json", tracked)


def _write(folder: Path, number: int, image: UInt8) -> str:
    """Write an image; return the name of its file."""
    name = f"{folder.name}-{number:03}.png"
    write_png(make_folder(folder) / name, image)
    return name


_PLACE_M = 0.002
_CANDIDATES = 40


def write_acceptance(
    folder: Path, rig: Rig, views: int, rng: np.random.Generator, samples: int = 2
) -> None:
    """Write the images for `handcal rig accept` of a rig as it is now.

    Parameters
    ----------
    folder : Path
    rig : Rig
        The truth, except for the depth camera's intrinsics, which are `DEPTH_CAMERA`.
    views : int
        Places of `BOARD` for each eye.
    rng : Generator
    samples : int
        Rays along each side of a pixel.
    """
    write_intrinsics(make_folder(folder) / "camera.json", VIEWPOINT_CAMERA, "json")
    write_intrinsics(folder / "depth.json", DEPTH_CAMERA, "json")
    settings = PictureSettings(samples=samples)
    viewpoint, depth = (
        BoardPainter(BOARD, camera, settings) for camera in (VIEWPOINT_CAMERA, DEPTH_CAMERA)
    )
    for eye in EYES:
        display = rig.eyes[eye]
        T_E_C = rigid(rng.normal(0.0, _TURN_RAD, 3), rng.normal(0.0, _PLACE_M, 3))
        grid = draw_grid(Grid(display.width_px, display.height_px))
        seen = photograph_display(
            grid, display, T_E_C[:3, :3], VIEWPOINT_CAMERA, rng, shift_m=T_E_C[:3, 3]
        )
        write_png(make_folder(folder / eye) / "grid.png", seen)
        T_D_C = invert(view_of_eye(display, np.eye(4)) @ rig.T_H_D) @ T_E_C
        candidates = board_poses(
            BOARD, VIEWPOINT_CAMERA, _CANDIDATES, rng, others=((T_D_C, DEPTH_CAMERA),)
        )
        by_distance = sorted(candidates, key=lambda T_C_B: float(T_C_B[2, 3]))
        tracked = {}
        poses = [by_distance[i] for i in np.linspace(0, _CANDIDATES - 1, views).astype(int)]
        for number, T_C_B in enumerate(poses, 1):
            name = f"{number:03}.png"
            write_png(make_folder(folder / eye / "viewpoint") / name, viewpoint.paint(T_C_B, rng))
            write_png(make_folder(folder / eye / "depth") / name, depth.paint(T_D_C @ T_C_B, rng))
            tracked[name] = rig.T_H_D @ T_D_C @ T_C_B
        write_tracked(folder / eye / "tracked.json", tracked)
