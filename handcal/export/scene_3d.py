"""An alignment as a scene in 3D: clouds, residuals, eyes and displays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handcal.core.geometry import invert, transform
from handcal.core.types import Eye, EyeDisplay, Float64
from handcal.export.outcome import SessionOutcome


@dataclass(frozen=True, slots=True, eq=False)
class Eye3d:
    """An eye and its display, in the scene's axes."""

    offline_m: Float64
    """(3,); C0, the viewpoint of the offline calibration."""
    eye_m: Float64
    """(3,); C1, the eye by its final φ; C0 where there is none."""
    display_m: Float64
    """(4, 3); corners of the display's image on its focal plane, clockwise."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene3d:
    """One alignment in the axes of its first eye's E at t_b: x right, y down, z forward."""

    title: str
    cursor_m: Float64
    """(N, 3)."""
    hand_m: Float64
    """(M, 3)."""
    residuals_m: Mapping[Eye, Float64]
    """each (M,); distance of each point of the hand from its partner, NaN for an outlier."""
    eyes: Mapping[Eye, Eye3d]


def make_scenes(outcome: SessionOutcome) -> dict[int, Scene3d]:
    """Return a scene for each alignment of a session, by number."""
    solved = outcome.results.alignments if outcome.results else {}
    return {number: _make_scene(outcome, number) for number in solved}


def _make_scene(outcome: SessionOutcome, number: int) -> Scene3d:
    assert outcome.results is not None
    alignment = outcome.record.alignments[number]
    T_scene_W = alignment.T_E_W[alignment.eyes[0]]
    eyes: dict[Eye, Eye3d] = {}
    for eye, T_E_W in alignment.T_E_W.items():
        corners_m = _display_corners_m(outcome.record.rig.eyes[eye])
        points_m = np.vstack([np.zeros(3), outcome.drawn[eye].shift_m, corners_m])
        placed_m = transform(T_scene_W @ invert(T_E_W), points_m)
        eyes[eye] = Eye3d(placed_m[0], placed_m[1], placed_m[2:])
    shifts = outcome.results.alignments[number]
    return Scene3d(
        title=f"alignment {number}",
        cursor_m=transform(T_scene_W, alignment.cursor_m),
        hand_m=transform(T_scene_W, alignment.hand_m),
        residuals_m={eye: shift.residuals_m for eye, shift in shifts.items()},
        eyes=eyes,
    )


def _display_corners_m(display: EyeDisplay) -> Float64:
    """Return the corners of a display's image on its focal plane, (4, 3), in E."""
    right, bottom = display.width_px - 0.5, display.height_px - 0.5
    corners_px = np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])
    rays = np.linalg.solve(display.K @ display.H0, np.vstack([corners_px.T, np.ones(4)])).T
    return np.asarray(display.z_C0_S_m * rays / rays[:, 2:])
