"""The final calibration as the configuration of a North Star headset.

Monado's driver reads it (``ns_hmd.c``, ``u_distortion_mesh.c``; release 24 and later). It renders
both eyes with one field of view, and looks up the tangents of the ray that each point of a display
shows: from a polynomial, which Esky reads too, or else from a mesh.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyvander2d
from scipy.spatial.transform import Rotation

from handcal.core.conventions import opengl_transform, pose
from handcal.core.errors import FileError
from handcal.core.geometry import invert, rigid
from handcal.core.types import EYES, Eye, Float64
from handcal.export.outcome import SessionOutcome
from handcal.export.tools import from_head
from handcal.io.files import MAX_JSON_BYTES, read_json, read_limited, write_atomic, write_json

_GRID = 65
_FOV_MARGIN = 1.02
_UNITY = np.diag([1.0, 1.0, -1.0, 1.0])
"""Unity's z axis points forward, OpenXR's backward."""
_REPLACED = frozenset(
    {"leftEye", "rightEye", "type", "version", "num_grid_points_x", "num_grid_points_y"}
    | {"left", "right", "baseline", "ipd", "IPD", "fov", "FOV", "handcal"}
    | {f"{eye}_uv_to_rect_{axis}" for eye in EYES for axis in "xy"}
)
"""Fields that the driver reads as a calibration; of several kinds it takes the first."""
_TRACKERS = (
    ("leapTracker", "localPose"),
    ("leapTracker", "P_middleofeyes_to_trackingcenter_oxr"),
    ("t265", "P_middleofeyes_to_trackingcenter_oxr"),
    ("depthaiDevice", "P_middleofeyes_to_imu_oxr"),
)
"""Poses in the head's frame, all but Unity's `localPose` in OpenXR's axes."""


def write_northstar(folder: Path, outcome: SessionOutcome, into: Path | None = None) -> None:
    """Write ``northstar.json``, with the polynomials, and ``northstar_mesh.json``.

    The driver's head frame N has both eyes on its x axis, looking along -z. It is placed into the
    solved eyes, so the rays of a plane projection are exact at the mesh's nodes, and within
    10⁻³ arcmin by the polynomials.

    Parameters
    ----------
    folder : Path
    outcome : SessionOutcome
    into : Path, optional
        A configuration whose other contents are kept. Its trackers' poses become those in N: they
        are taken to be in the headset rig, or in the frame N of an earlier export.

    Raises
    ------
    FileError
        If `into` cannot be read.
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
    T_H_N = opengl_transform(rigid(R_H_N, 0.5 * (eyes_H_m["left"] + eyes_H_m["right"])))
    kept = {} if into is None else _in_frame(read_json(into), T_H_N, into)
    rays = {eye: _rays(outcome, eye, R_H_N) for eye in EYES}
    tangents = np.concatenate([grid.reshape(-1, 2) for grid in rays.values()])
    low, high = tangents.min(axis=0), tangents.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * _FOV_MARGIN * (high - low)
    left, right = np.arctan(middle[0] + half[0] * np.array([-1.0, 1.0]))
    # The driver looks tangents up in the rendered image as if it were turned over.
    up = float(np.arctan(np.abs(middle[1]) + half[1]))
    head = {
        "fov": [float(left), float(right), up, -up],
        "handcal": {
            "session": outcome.name,
            "simulated": outcome.record.simulated,
            "rig_from_head": T_H_N.tolist(),
        },
    }
    polynomials = {
        f"{eye}_uv_to_rect_{axis}": coefficients
        for eye in EYES
        for axis, coefficients in _polynomials(rays[eye]).items()
    }
    mesh: dict[str, object] = {
        "type": "meshgrid",
        "version": 2,
        "num_grid_points_x": _GRID,
        "num_grid_points_y": _GRID,
        **{eye: {"grid": rays[eye].tolist()} for eye in EYES},
    }
    distance_mm = 1e3 * distance_m
    write_json(folder / "northstar.json", kept | polynomials | {"baseline": distance_mm} | head)
    write_json(folder / "northstar_mesh.json", kept | mesh | {"ipd": distance_mm} | head)


def replace_configuration(path: Path, new: Path) -> Path:
    """Replace a configuration by a new one, and return where the former one is kept.

    Raises
    ------
    FileError
        If a file cannot be read or written.
    """
    kept = path.with_name(f"{path.name}.before")
    if not kept.exists():
        write_atomic(kept, read_limited(path, MAX_JSON_BYTES))
    write_atomic(path, read_limited(new, MAX_JSON_BYTES))
    return kept


def _rays(outcome: SessionOutcome, eye: Eye, R_H_N: Float64) -> Float64:
    """Return each node's ray as its tangents to the right and down, (rows, columns, 2)."""
    display = outcome.record.rig.eyes[eye]
    u_px = np.linspace(-0.5, display.width_px - 0.5, _GRID)
    v_px = np.linspace(-0.5, display.height_px - 0.5, _GRID)
    pixels = np.stack([*np.meshgrid(u_px, v_px), np.ones((_GRID, _GRID))], axis=-1)
    rays = pixels @ (R_H_N.T @ np.linalg.inv(from_head(outcome, eye)[:, :3])).T
    tangents: Float64 = rays[..., :2] / rays[..., 2:]
    return tangents


def _polynomials(rays: Float64) -> dict[str, list[float]]:
    """Return 16 coefficients each for the tangents down ("x") and to the right ("y").

    Coefficient 4 i + j is that of u^i v^j, where u runs to the right and v up, from 0 to 1. The
    names are turned by a quarter because the format's calibrator gives rows as x.
    """
    u, v = np.meshgrid(np.linspace(0.0, 1.0, _GRID), np.linspace(1.0, 0.0, _GRID))
    powers = polyvander2d(u.ravel(), v.ravel(), [3, 3])
    to_right, down = np.linalg.lstsq(powers, rays.reshape(-1, 2))[0].T
    return {"x": down.tolist(), "y": to_right.tolist()}


def _in_frame(configuration: dict[str, Any], T_H_N: Float64, path: Path) -> dict[str, Any]:
    """Return what a configuration holds beside its calibration, with trackers posed in N."""
    kept = {key: value for key, value in configuration.items() if key not in _REPLACED}
    earlier = configuration.get("handcal", {})
    try:
        T_H_head = np.array(earlier.get("rig_from_head", np.eye(4)), dtype=np.float64)
        T_N_head = invert(T_H_N) @ _checked(T_H_head)
        for tracker, key in _TRACKERS:
            block = kept.get(tracker)
            if isinstance(block, Mapping) and key in block:
                axes = _UNITY if key == "localPose" else np.eye(4)
                T_head_tracker = axes @ _pose(block[key]) @ axes
                moved = _like(block[key], axes @ T_N_head @ T_head_tracker @ axes)
                kept[tracker] = {**block, key: moved}
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise FileError(
            f"{path} is not a North Star configuration: a tracker's pose needs position x, y, z "
            "and orientation x, y, z, w"
        ) from error
    return kept


def _checked(T: Float64) -> Float64:
    """Return a rigid transform; ValueError if it is none."""
    is_rigid = T.shape == (4, 4) and np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-6)
    if not is_rigid or not np.isfinite(T).all():
        raise ValueError("not rigid")
    return T


def _pose(value: Mapping[str, Any]) -> Float64:
    """Return a pose (4, 4) from its position and orientation, which Unity calls rotation."""
    position_m = [float(value["position"][axis]) for axis in "xyz"]
    turn = value[_turn_name(value)]
    R = Rotation.from_quat([float(turn[axis]) for axis in "xyzw"]).as_matrix()
    return _checked(rigid(R, position_m))


def _like(value: Mapping[str, Any], T: Float64) -> dict[str, Any]:
    """Return `value` with another pose."""
    new = pose(T)
    return {
        **value,
        "position": dict(zip("xyz", new.position_m.tolist(), strict=True)),
        _turn_name(value): dict(zip("xyzw", new.quaternion_xyzw.tolist(), strict=True)),
    }


def _turn_name(value: Mapping[str, Any]) -> str:
    return "rotation" if "rotation" in value else "orientation"
