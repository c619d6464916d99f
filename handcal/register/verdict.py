"""The verdict on a solved eye shift: accept, repeat the alignment, or implausible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handcal.display import arcmin_from_px, eye_projection, target_corners_m
from handcal.geometry import invert, project, transform
from handcal.types import EYES, Eye, EyeDisplay, EyeShift, Float64, Rig, Verdict


@dataclass(frozen=True, slots=True)
class VerdictSettings:
    """Limits of the verdict."""

    eye_box_m: float = 0.020
    """Longest plausible φ."""
    eye_distance_min_m: float = 0.050
    eye_distance_max_m: float = 0.080
    """Plausible distances between the eyes (adults, ANSUR II: 52 to 78 mm)."""
    error_max_arcmin: float = 15.0
    """Largest expected error in the display. Published methods have medians of 10 to 17′ (paper,
    table of reprojection errors)."""
    rms_max_m: float = 0.005
    inlier_ratio_min: float = 0.6


def eye_distance_m(rig: Rig, shifts: Mapping[Eye, EyeShift]) -> float | None:
    """Return the distance between the solved eyes, or None unless both are solved."""
    if set(shifts) != set(EYES):
        return None
    places = []
    for eye in EYES:
        display = rig.eyes[eye]
        eye_V = shifts[eye].shift_m - display.t_C0_V_m
        places.append(transform(invert(display.T_V_H), eye_V[None])[0])
    return float(np.linalg.norm(places[1] - places[0]))


def judge(
    rig: Rig, shifts: Mapping[Eye, EyeShift], settings: VerdictSettings
) -> dict[Eye, Verdict]:
    """Judge every solved eye; the first reason that applies is given."""
    apart_m = eye_distance_m(rig, shifts)
    return {eye: _judge(shift, rig.eyes[eye], apart_m, settings) for eye, shift in shifts.items()}


def expected_error_arcmin(display: EyeDisplay, shift: EyeShift) -> float:
    """Return the root mean square error expected from φ's covariance, in arcmin.

    Evaluated at the corners of the user test's target at half a metre.
    """
    corners_m = target_corners_m(0.5)

    def drawn_px(shift_m: Float64) -> Float64:
        return project(eye_projection(display, shift_m), corners_m)

    steps_m = 1e-5 * np.eye(3)
    J = np.stack(
        [
            (drawn_px(shift.shift_m + step) - drawn_px(shift.shift_m - step)) / 2e-5
            for step in steps_m
        ],
        axis=-1,
    )
    variance_px2 = np.einsum("nij,jk,nik->n", J, shift.covariance_m2, J)
    return float(arcmin_from_px(display, np.sqrt(variance_px2.mean())))


def _judge(
    shift: EyeShift, display: EyeDisplay, apart_m: float | None, settings: VerdictSettings
) -> Verdict:
    length_m = float(np.linalg.norm(shift.shift_m))
    error_arcmin = expected_error_arcmin(display, shift)
    if length_m > settings.eye_box_m:
        return Verdict(
            "implausible",
            f"the eye would lie {1e3 * length_m:.0f} mm from the rig's viewpoint, beyond the "
            f"{1e3 * settings.eye_box_m:.0f} mm eye box; check how the headset sits and the rig",
        )
    if apart_m is not None and not (
        settings.eye_distance_min_m <= apart_m <= settings.eye_distance_max_m
    ):
        return Verdict(
            "implausible",
            f"the eyes would lie {1e3 * apart_m:.0f} mm apart; "
            "check the rig, or align one eye at a time",
        )
    if not shift.converged:
        return Verdict("repeat", f"the registration did not converge ({shift.stop_reason})")
    if shift.inlier_ratio < settings.inlier_ratio_min:
        return Verdict(
            "repeat",
            f"only {100 * shift.inlier_ratio:.0f} % of the hand found its place on the cursor; "
            "hold the hand in the cursor's shape",
        )
    if shift.rms_m > settings.rms_max_m:
        return Verdict(
            "repeat",
            f"hand and cursor differ by {1e3 * shift.rms_m:.1f} mm; "
            "hold the hand in the cursor's shape",
        )
    if error_arcmin > settings.error_max_arcmin:
        return Verdict(
            "repeat",
            f"still uncertain by {error_arcmin:.0f}′ in the display; align once more",
        )
    return Verdict("accept", f"expected error {error_arcmin:.1f}′ in the display")
