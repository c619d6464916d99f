"""Whether a solved eye shift may be used: accept, repeat the alignment, or implausible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handcal.geometry import invert, transform
from handcal.types import EYES, Eye, EyeShift, Rig, Verdict


@dataclass(frozen=True, slots=True)
class VerdictSettings:
    """Limits.

    Attributes
    ----------
    eye_box_m : float
        Longest plausible φ.
    eye_distance_min_m, eye_distance_max_m : float
        Plausible distances between the eyes (adults, ANSUR II: 52 to 78 mm).
    sigma_max_m : float
        Largest standard deviation of any component of φ. The literature's error of
        alignment-based eye positions is 4 mm (paper, section on the simulation).
    rms_max_m : float
    inlier_ratio_min : float
    """

    eye_box_m: float = 0.020
    eye_distance_min_m: float = 0.050
    eye_distance_max_m: float = 0.080
    sigma_max_m: float = 0.004
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
    return {eye: _judge(shift, apart_m, settings) for eye, shift in shifts.items()}


def _judge(shift: EyeShift, apart_m: float | None, settings: VerdictSettings) -> Verdict:
    length_m = float(np.linalg.norm(shift.shift_m))
    sigma_m = float(np.sqrt(np.diag(shift.covariance_m2).max()))
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
    if sigma_m > settings.sigma_max_m:
        return Verdict(
            "repeat",
            f"still uncertain by {1e3 * sigma_m:.1f} mm; align once more with less rotation",
        )
    return Verdict(
        "accept",
        f"registered within {1e3 * shift.rms_m:.1f} mm, φ known within {1e3 * sigma_m:.1f} mm",
    )
