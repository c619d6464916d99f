"""Differences between two rigs, with their effect on the drawing, and from a live camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.display import (
    TARGET_DEPTHS_M,
    arcmin_from_px,
    projection_matrix,
    target_corners_m,
    view_of_eye,
)
from handcal.core.geometry import image_points, invert, project, transform
from handcal.core.types import EYES, CameraIdentity, Eye, EyeDisplay, Float64, Intrinsics, Rig

# Room for intrinsics that were solved from images. At 0.5 m, 0.1 m beside the axis, the first moves
# a point by 0.5 mm, the second by 1.5 mm. Another camera of the same model may lie within both.
_SAME_FOCAL = 0.005
_SAME_PX = 3.0


@dataclass(frozen=True, slots=True)
class RigDifference:
    """One difference."""

    name: str
    """Name of the difference."""
    value: float
    """Size of the difference; not negative."""
    unit: str
    """mm, °, px, ′ or %."""


def compare_rigs(a: Rig, b: Rig) -> tuple[RigDifference, ...]:
    """Return the differences between rig `b` and rig `a`, part by part.

    The last difference of each eye is the mean distance, seen from C0, between the user test's
    target as drawn by each rig when the depth camera tracks it.
    """
    differences = _between_poses("depth camera (T_H_D)", a.T_H_D, b.T_H_D)
    differences.append(
        RigDifference(
            "depth camera: largest move of a pixel",
            _pinhole_move_px(a.depth_intrinsics, b.depth_intrinsics),
            "px",
        )
    )
    for eye in EYES:
        ours, theirs = a.eyes[eye], b.eyes[eye]
        differences += _between_poses(f"{eye}: rendering camera (T_V_H)", ours.T_V_H, theirs.T_V_H)
        differences += [
            RigDifference(
                f"{eye}: viewpoint in the rendering camera",
                1e3 * _distance(ours.t_C0_V_m, theirs.t_C0_V_m),
                "mm",
            ),
            RigDifference(
                f"{eye}: distance of the virtual screen",
                100.0 * abs(theirs.z_C0_S_m / ours.z_C0_S_m - 1.0),
                "%",
            ),
            RigDifference(
                f"{eye}: largest move of a display pixel", _display_move_px(ours, theirs), "px"
            ),
            RigDifference(f"{eye}: target is drawn elsewhere", _drawn_apart(a, b, eye), "′"),
        ]
    return tuple(differences)


def compare_camera(
    rig: Rig, identity: CameraIdentity, intrinsics: Intrinsics | None = None
) -> tuple[str, ...]:
    """Return the differences of a live depth camera from the rig's, in words with numbers.

    Parameters
    ----------
    rig : Rig
    identity : CameraIdentity
        Of the live camera. Texts that either does not know are not compared; nor is firmware, which
        may be updated.
    intrinsics : Intrinsics, optional
        Of its depth image; None while it is not open.

    Returns
    -------
    tuple of str
        Empty for the rig's camera.
    """
    words = []
    for name, known, found in (
        ("model", rig.depth_camera.model, identity.model),
        ("serial number", rig.depth_camera.serial_number, identity.serial_number),
    ):
        if known and found and known != found:
            words.append(f"another {name}: {found}, not {known}")
    if intrinsics is None:
        return tuple(words)
    ours, theirs = rig.depth_intrinsics, intrinsics
    if (ours.width, ours.height) != (theirs.width, theirs.height):
        return (
            *words,
            f"images of {theirs.width}x{theirs.height} pixels, not {ours.width}x{ours.height}",
        )
    longer = max(theirs.fx / ours.fx - 1.0, theirs.fy / ours.fy - 1.0, key=abs)
    if abs(longer) > _SAME_FOCAL:
        words.append(
            f"focal length {100 * abs(longer):.1f} % {'longer' if longer > 0 else 'shorter'}"
        )
    centre_px = float(np.hypot(theirs.cx - ours.cx, theirs.cy - ours.cy))
    if centre_px > _SAME_PX:
        words.append(f"principal point {centre_px:.1f} px away")
    same_pinhole = replace(theirs, fx=ours.fx, fy=ours.fy, cx=ours.cx, cy=ours.cy)
    bent_px = _pinhole_move_px(ours, same_pinhole)
    if bent_px > _SAME_PX:
        words.append(f"lens distortion differs by up to {bent_px:.1f} px")
    return tuple(words)


def _between_poses(name: str, a: Float64, b: Float64) -> list[RigDifference]:
    turn = Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).magnitude()
    return [
        RigDifference(f"{name}: turned", float(np.degrees(turn)), "°"),
        RigDifference(f"{name}: moved", 1e3 * _distance(a[:3, 3], b[:3, 3]), "mm"),
    ]


def _distance(a: Float64, b: Float64) -> float:
    return float(np.linalg.norm(a - b))


def _pinhole_move_px(a: Intrinsics, b: Intrinsics) -> float:
    """Return the largest distance between the pixels of both for points in the image of `a`."""
    x = (np.linspace(0.0, a.width - 1.0, 9) - a.cx) / a.fx
    y = (np.linspace(0.0, a.height - 1.0, 9) - a.cy) / a.fy
    points_m = np.dstack([*np.meshgrid(x, y), np.ones((9, 9))]).reshape(-1, 3)
    off_px = image_points(points_m, a) - image_points(points_m, b)
    return float(np.linalg.norm(off_px, axis=1).max())


def _display_move_px(a: EyeDisplay, b: EyeDisplay) -> float:
    """Return the largest distance on the display between both pixels of the same ray from C0."""
    x, y = np.linspace(0.0, a.width_px - 1.0, 9), np.linspace(0.0, a.height_px - 1.0, 9)
    pixels = np.dstack([*np.meshgrid(x, y), np.ones((9, 9))]).reshape(-1, 3)
    rays = np.linalg.solve(a.K @ a.H0, pixels.T).T
    moved = rays @ (b.K @ b.H0).T
    return float(np.linalg.norm(moved[:, :2] / moved[:, 2:] - pixels[:, :2], axis=1).max())


def _drawn_apart(a: Rig, b: Rig, eye: Eye) -> float:
    """Return the mean distance, arcmin, between both drawings of a target for the eye of `a`."""
    target_E_m = np.concatenate([target_corners_m(depth_m) for depth_m in TARGET_DEPTHS_M])
    T_D_E = invert(view_of_eye(a.eyes[eye], np.eye(4)) @ a.T_H_D)
    target_D_m = transform(T_D_E, target_E_m)
    drawn_px = [
        project(projection_matrix(display), transform(display.T_V_H @ rig.T_H_D, target_D_m))
        for rig, display in ((a, a.eyes[eye]), (b, b.eyes[eye]))
    ]
    apart_px = np.linalg.norm(drawn_px[0] - drawn_px[1], axis=1)
    return float(arcmin_from_px(a.eyes[eye], apart_px.mean()))
