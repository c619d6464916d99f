"""The final calibration as the configuration of a North Star headset."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handcal.core.conventions import opengl_transform
from handcal.core.geometry import rigid
from handcal.core.types import EYES, Eye, Float64
from handcal.export.outcome import SessionOutcome
from handcal.export.tools import from_head
from handcal.io.files import write_json

_GRID = 65
_FOV_MARGIN = 1.02
_OPENGL_AXES = np.diag([1.0, -1.0, -1.0])


def write_northstar(path: Path, outcome: SessionOutcome) -> None:
    """Write the mesh of bearings that Monado's North Star driver reads (`ns_mt_parse`).

    Monado's head has both eyes on its x axis and parallel to it. That frame N is placed into the
    solved eyes, so the bearings of a plane projection are exact at the mesh's nodes.
    """
    eyes_H_m: dict[Eye, Float64] = {}
    axes = []
    for eye in EYES:
        P_H = from_head(outcome, eye)
        eyes_H_m[eye] = -np.linalg.inv(P_H[:, :3]) @ P_H[:, 3]
        axes.append(P_H[2, :3] / np.linalg.norm(P_H[2, :3]))
    between_m = eyes_H_m["right"] - eyes_H_m["left"]
    distance_m = float(np.linalg.norm(between_m))
    x = between_m / distance_m
    z = np.mean(axes, axis=0)
    z = z - (z @ x) * x
    z /= np.linalg.norm(z)
    R_H_N = np.column_stack([x, np.cross(z, x), z])
    bearings = {eye: _bearings(outcome, eye, R_H_N) for eye in EYES}
    edges = np.concatenate([grid.reshape(-1, 2) for grid in bearings.values()])
    low, high = edges.min(axis=0), edges.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * _FOV_MARGIN * (high - low)
    (left, down), (right, up) = np.arctan(middle - half), np.arctan(middle + half)
    T_H_N = rigid(R_H_N, 0.5 * (eyes_H_m["left"] + eyes_H_m["right"]))
    write_json(
        path,
        {
            "type": "Moses Turner's distortion correction",
            "version": 2,
            "num_grid_points_x": _GRID,
            "num_grid_points_y": _GRID,
            "ipd": 1e3 * distance_m,
            "fov": [left, right, up, down],
            "left": {"grid": bearings["left"].tolist()},
            "right": {"grid": bearings["right"].tolist()},
            "handcal": {
                "session": outcome.name,
                "rig_from_head": opengl_transform(T_H_N).tolist(),
            },
        },
    )


def _bearings(outcome: SessionOutcome, eye: Eye, R_H_N: Float64) -> Float64:
    """Return x and y of each node's ray at z = -1, y up, (rows, columns, 2)."""
    display = outcome.record.rig.eyes[eye]
    u_px = np.linspace(-0.5, display.width_px - 0.5, _GRID)
    v_px = np.linspace(-0.5, display.height_px - 0.5, _GRID)
    pixels = np.stack([*np.meshgrid(u_px, v_px), np.ones((_GRID, _GRID))], axis=-1)
    back = _OPENGL_AXES @ R_H_N.T @ np.linalg.inv(from_head(outcome, eye)[:, :3])
    rays = pixels @ back.T
    bearings: Float64 = rays[..., :2] / -rays[..., 2:]
    return bearings
