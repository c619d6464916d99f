"""Rendered photographs of an offline calibration, in the folders of a real one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handcal.core.display import view_of_eye
from handcal.core.geometry import invert, rigid
from handcal.core.types import EYES, Intrinsics, Rig, UInt8
from handcal.io.files import make_folder
from handcal.io.images import write_png
from handcal.rig.boards.board import Board
from handcal.rig.boards.tracked_file import write_tracked
from handcal.rig.displays.grid import Grid, draw_grid
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
