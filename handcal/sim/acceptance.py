"""Rendered images of an acceptance, in the folders of a real one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handcal.core.display import view_of_eye
from handcal.core.geometry import invert, rigid
from handcal.core.types import EYES, Rig
from handcal.io.files import make_folder
from handcal.io.images import write_png
from handcal.rig.displays.grid import Grid, draw_grid
from handcal.rig.formats import write_intrinsics, write_tracked
from handcal.sim.boards import BoardPainter, PictureSettings, board_poses
from handcal.sim.photographs import BOARD, DEPTH_CAMERA, VIEWPOINT_CAMERA
from handcal.sim.viewpoint import photograph_display

_TURN_RAD, _PLACE_M = 0.02, 0.002
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
