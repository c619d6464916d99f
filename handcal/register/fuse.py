"""Fusion of several alignments of two eyes into one estimate.

An alignment measures one hand displacement: three numbers. With one eye open they are that eye's φ.
With both eyes open the wearer moves the hand to where the errors of both eyes balance: by least
squares in the image, at ``φ_seen = W_left φ_left + W_right φ_right`` with
``W_e = (N_left + N_right)^-1 N_e``, where N_e is the normal matrix, in common axes, of the cursor's
pixels in eye e with respect to a displacement of the hand. Three measurements do not determine six
unknowns, so a prior limits how far the two eyes differ. Everything is Gaussian, so this is one
linear system, in which the alignments add up, weighted by their covariances.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from handcal.display import eye_projection
from handcal.geometry import project, transform
from handcal.register.surface import describe_surface
from handcal.types import EYES, Alignment, Bool, Eye, EyeDisplay, EyeShift, Float64, Rig

# The cursor's outline is found in this many of its points.
_OUTLINE_FROM_POINTS = 1500
# Far less than that of one point; it keeps the weights defined for a cursor outside the display.
_NORMAL_FLOOR = 1e-3

# H (3, 6), the displacement seen (3,), and its covariance (3, 3).
Observed: TypeAlias = tuple[Float64, Float64, Float64]


@dataclass(frozen=True, slots=True)
class FuseSettings:
    """Priors on φ, and the precision of a wearer's alignment."""

    eye_box_sigma_m: float = 0.010
    """Standard deviation of each component of φ: the eye box is about 2 cm wide (paper)."""
    eye_difference_sigma_m: tuple[float, float, float] = (0.0022, 0.0008, 0.0008)
    """Standard deviation of the right φ minus the left. x is the difference of the wearer's eye
    distance from the rig's: 2 mm if the headset is adjusted to the wearer; 3.6 mm among adults
    (Gordon et al. 2014, ANSUR II)."""
    lateral_sigma_arcmin: float = 3.0
    """Standard deviation of the overlay in each of two directions."""
    depth_sigma: float = 0.003
    """Relative standard deviation of the depth, by matching the size."""


@dataclass(frozen=True, slots=True, eq=False)
class Fused:
    """Estimates from several alignments, for each eye that any of them has."""

    shifts: Mapping[Eye, EyeShift]
    covariances_after_another_m2: Mapping[Eye, Float64]
    """each (3, 3); covariances to expect after one more alignment that is as informative as those
    so far are on average, and agrees with them as well."""


def with_eye_box(shift: EyeShift, settings: FuseSettings = FuseSettings()) -> EyeShift:
    """Return the estimate with the eye box as prior: uncertain components shrink towards C0."""
    prior = np.eye(3) / settings.eye_box_sigma_m**2
    covariance_m2 = np.asarray(np.linalg.inv(np.linalg.inv(shift.covariance_m2) + prior))
    return replace(
        shift,
        shift_m=covariance_m2 @ np.linalg.solve(shift.covariance_m2, shift.shift_m),
        covariance_m2=covariance_m2,
    )


def fuse_alignments(
    solved: Sequence[tuple[Alignment, Mapping[Eye, EyeShift]]], rig: Rig, settings: FuseSettings
) -> Fused:
    """Fuse solved alignments into one estimate for each eye that any of them has.

    Parameters
    ----------
    solved : sequence of (Alignment, mapping of eye to EyeShift)
        As returned by `solve_alignment`, without prior.
    rig : Rig
    settings : FuseSettings

    Raises
    ------
    ValueError
        If there is nothing to fuse.
    HandError
        If all points of a cursor lie at cut edges.
    """
    if not solved:
        raise ValueError("at least one alignment is needed")
    rows = [_observe(alignment, shifts, rig, settings) for alignment, shifts in solved]
    disagreement = _disagreement(rows, _combine(rows, 1.0, settings)[0])
    estimate_m, joint_m2 = _combine(rows, disagreement, settings)
    # One more average alignment adds as much information as this much less noise.
    less_noise = disagreement * len(rows) / (len(rows) + 1)
    _, after_another_m2 = _combine(rows, less_noise, settings)
    of_eye = {
        eye: found
        for eye in EYES
        if (found := [shifts[eye] for _, shifts in solved if eye in shifts])
    }
    return Fused(
        {
            eye: _summarise(shifts, estimate_m[_of(eye)], joint_m2[_of(eye), _of(eye)])
            for eye, shifts in of_eye.items()
        },
        {eye: after_another_m2[_of(eye), _of(eye)] for eye in of_eye},
    )


def _of(eye: Eye) -> slice:
    """Return an eye's components in [φ_left; φ_right]."""
    return slice(3 * EYES.index(eye), 3 * EYES.index(eye) + 3)


def _combine(
    rows: Sequence[Observed], inflation: float, settings: FuseSettings
) -> tuple[Float64, Float64]:
    """Return [φ_left; φ_right] (6,) and its covariance, with inflated observation noise."""
    information = np.kron(np.eye(2), np.eye(3) / settings.eye_box_sigma_m**2)
    apart = np.diag(1.0 / np.square(settings.eye_difference_sigma_m))
    information += np.kron([[1.0, -1.0], [-1.0, 1.0]], apart)
    state = np.zeros(6)
    for H, seen_m, covariance_m2 in rows:
        weighted = np.linalg.solve(inflation * covariance_m2, H).T
        information += weighted @ H
        state += weighted @ seen_m
    covariance_m2 = np.asarray(np.linalg.inv(information))
    return covariance_m2 @ state, covariance_m2


def _observe(
    alignment: Alignment, shifts: Mapping[Eye, EyeShift], rig: Rig, settings: FuseSettings
) -> Observed:
    """Return H (3, 6), the displacement seen (3,) in W's axes, and its covariance.

    The displacement is H [φ_left; φ_right]. The wearer sees the part of the cursor's outline that
    lies within the display.
    """
    surface = describe_surface(alignment.cursor_m, alignment.cursor_is_cut, _OUTLINE_FROM_POINTS)
    outline_m = surface.points_m[surface.outline]
    normals: dict[Eye, Float64] = {}
    noises: dict[Eye, Float64] = {}
    for eye, shift in shifts.items():
        display, T_E_W = rig.eyes[eye], alignment.T_E_W[eye]
        R_W_E = T_E_W[:3, :3].T
        cursor_E = transform(T_E_W, outline_m)
        shown = _is_shown(cursor_E, display, alignment.drawn_shift_m[eye])
        normals[eye] = R_W_E @ _pixel_normal(cursor_E[shown]) @ R_W_E.T
        depth_m = float(transform(T_E_W, alignment.cursor_m)[:, 2].mean())
        wearer = _wearer_covariance(depth_m, display.z_C0_S_m, settings)
        noises[eye] = R_W_E @ (shift.covariance_m2 + wearer) @ R_W_E.T
    total = np.sum(list(normals.values()), axis=0)
    H = np.zeros((3, 6))
    seen_m = np.zeros(3)
    for eye, shift in shifts.items():
        weight = np.linalg.solve(total, normals[eye]) @ alignment.T_E_W[eye][:3, :3].T
        H[:, _of(eye)] = weight
        seen_m += weight @ shift.shift_m
    return H, seen_m, np.mean(list(noises.values()), axis=0)


def _is_shown(points_E_m: Float64, display: EyeDisplay, drawn_shift_m: Float64) -> Bool:
    """Return (N,): True for points that the headset draws within the display."""
    pixels = project(eye_projection(display, drawn_shift_m), points_E_m)
    last_px = display.width_px - 0.5, display.height_px - 0.5
    return np.asarray(((pixels >= -0.5) & (pixels <= last_px)).all(axis=1))


def _pixel_normal(points_E_m: Float64) -> Float64:
    """Return Σ JᵀJ (3, 3) of pixels with respect to displacement, up to the focal length."""
    depth = points_E_m[:, 2]
    J = np.zeros((len(points_E_m), 2, 3))
    J[:, 0, 0] = J[:, 1, 1] = 1.0 / depth
    J[:, :, 2] = -points_E_m[:, :2] / depth[:, None] ** 2
    rows = J.reshape(-1, 3)
    return np.asarray(rows.T @ rows + _NORMAL_FLOOR * np.eye(3))


def _wearer_covariance(depth_m: float, distance_m: float, settings: FuseSettings) -> Float64:
    """Return the covariance (3, 3) of φ from a wearer's alignment of a hand at a depth."""
    lateral_m = depth_m * np.radians(settings.lateral_sigma_arcmin / 60.0)
    along_m = depth_m * settings.depth_sigma
    gain = 1.0 / (1.0 - depth_m / distance_m)
    return np.diag(np.square([gain * lateral_m, gain * lateral_m, gain * along_m]))


def _disagreement(rows: Sequence[Observed], estimate_m: Float64) -> float:
    """Return the Birge ratio, at least 1: scatter of alignments beyond their covariances."""
    chi_square = sum(
        float((seen_m - H @ estimate_m) @ np.linalg.solve(covariance_m2, seen_m - H @ estimate_m))
        for H, seen_m, covariance_m2 in rows
    )
    freedom = 3 * (len(rows) - 1)
    return max(1.0, chi_square / freedom) if freedom else 1.0


def _summarise(shifts: Sequence[EyeShift], shift_m: Float64, covariance_m2: Float64) -> EyeShift:
    return EyeShift(
        shift_m=shift_m,
        covariance_m2=covariance_m2,
        rms_m=float(np.sqrt(np.mean([shift.rms_m**2 for shift in shifts]))),
        residuals_m=np.concatenate([shift.residuals_m for shift in shifts]),
        inlier_ratio=float(np.mean([shift.inlier_ratio for shift in shifts])),
        iterations=sum(shift.iterations for shift in shifts),
        converged=all(shift.converged for shift in shifts),
        stop_reason="; ".join(dict.fromkeys(shift.stop_reason for shift in shifts)),
        history_m2=np.concatenate([shift.history_m2 for shift in shifts]),
        method="fused",
    )
