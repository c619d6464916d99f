"""Fusion of several alignments of two eyes into one estimate.

An alignment measures one hand displacement: three numbers. With one eye open they are that eye's φ.
With both eyes open the wearer moves the hand to where the errors of both eyes balance: by least
squares in the image, at ``φ_seen = W_left φ_left + W_right φ_right`` with
``W_e = (N_left + N_right)^-1 N_e``, where N_e is the normal matrix, in common axes, of the cursor's
pixels in eye e with respect to a displacement of the hand. Three measurements do not determine six
unknowns, so a prior limits how far the two eyes differ. Everything is Gaussian, so this is one
linear system, in which the alignments add up, weighted by their covariances.

Wearers differ in how precisely they align, by more than can be neglected: an estimate that assumes
a usual wearer is far too certain about a careless one. So the precision is unknown too, one of
`FuseSettings.wearer_scales`, and the estimate is the mean over them, weighted by how well each
explains the alignments. One alignment says little about it, several say much by their scatter.

An error of the measured depth, known from the depth check (`DepthCheck`), is common to all
observations of a wearer: it is added to the covariance of the estimate, and more alignments do not
reduce it. Without a depth check it is taken as zero.

A verification, in which the wearer moves the drawing of the resting hand until it covers the hand
(`handcal.register.nudge`), is one more observation of one eye's φ, more precise than an alignment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from scipy.linalg import block_diag
from scipy.special import softmax

from handcal.core.display import eye_projection
from handcal.core.geometry import project, transform
from handcal.core.types import (
    EYES,
    Alignment,
    Bool,
    Eye,
    EyeDisplay,
    EyeDistance,
    EyeShift,
    Float64,
    Rig,
    Verification,
)
from handcal.register.prior import (
    EyePrior,
    Observed,
    PriorSettings,
    depth_covariance_m2,
    eye_prior,
    eye_slice,
    posterior,
    shift_by_depth,
    with_eye_distance,
)
from handcal.register.surface import describe_surface

# The cursor's outline is found in this many of its points.
_OUTLINE_FROM_POINTS = 1500
# Far less than that of one point; it keeps the weights defined for a cursor outside the display.
_NORMAL_FLOOR = 1e-3
# Place of the hand, in E, that a verification to come is expected to have.
_VERIFIED_AT_M = 0.0, 0.0, 0.5


@dataclass(frozen=True, slots=True)
class FuseSettings:
    """Priors on φ, and the precision of a wearer's alignment."""

    prior: PriorSettings = field(default_factory=PriorSettings)
    lateral_sigma_arcmin: float = 4.0
    """Standard deviation of a usual wearer's overlay in each of two directions."""
    depth_sigma: float = 0.004
    """Relative standard deviation of the depth, by matching the size. With these errors,
    the paper's method has the error of the paper's user test."""
    verified_sigma_arcmin: float = 2.0
    """Standard deviation of a verification by a usual wearer in each of two directions."""
    verified_depth_sigma: float = 0.005
    """Relative standard deviation of its size; people judge a position better than a size."""
    wearer_scales: tuple[float, ...] = (1.0, 2.0, 3.0, 4.0, 8.0)
    """Errors of a wearer's overlay, relative to a usual wearer's."""
    wearer_weights: tuple[float, ...] = (0.7, 0.16, 0.08, 0.05, 0.01)
    """Probability of each of `wearer_scales`."""

    def __post_init__(self) -> None:
        if not self.wearer_scales or len(self.wearer_scales) != len(self.wearer_weights):
            raise ValueError("wearer_scales and wearer_weights must have the same length")
        if min(self.wearer_scales) <= 0.0 or min(self.wearer_weights) <= 0.0:
            raise ValueError("wearer_scales and wearer_weights must be positive")


@dataclass(frozen=True, slots=True, eq=False)
class Fused:
    """Estimates from several alignments, for each eye that any of them has."""

    shifts: Mapping[Eye, EyeShift]
    prior: EyePrior
    """Prior of the eyes before the alignments, with the eye distance if it was measured."""
    observed: tuple[Observation, ...]
    """The displacement measured by each alignment."""
    wearer_scale: float
    """Expected error of the wearer's overlays, relative to a usual wearer's."""
    verified: Mapping[Eye, tuple[Observation, ...]] = field(default_factory=dict)
    """The φ found by each eye's verifications."""
    verifiable: Mapping[Eye, Observation] = field(default_factory=dict)
    """The verification to expect of each solved eye; its φ is zero."""
    by_depth_m2: Float64 = field(default_factory=lambda: np.zeros((6, 6)))
    """(6, 6); part of the covariance by errors of the depth camera."""

    @property
    def all_observed(self) -> tuple[Observation, ...]:
        """The observations of the alignments, then those of the verifications."""
        return (*self.observed, *(one for found in self.verified.values() for one in found))

    def covariance_after_m2(self, eyes: Sequence[Eye], count: int) -> Float64:
        """Return the covariance (6, 6) to expect after more alignments with some eyes open."""
        return self.foreseen_m2([eyes] * count)

    def foreseen_m2(
        self, upcoming: Sequence[Sequence[Eye]], then: Sequence[Observation] = ()
    ) -> Float64:
        """Return the covariance (6, 6) to expect after alignments and other observations.

        The alignments, each with some eyes open, are taken to be as precise as those so far on
        average; without any, as the verifications.
        """
        known = [one.at(self.wearer_scale) for one in self.all_observed]
        aligned, verified = known[: len(self.observed)], known[len(self.observed) :]
        noise_m2 = np.mean([covariance_m2 for _, _, covariance_m2 in aligned or verified], axis=0)
        for eyes in upcoming:
            H = np.zeros((3, 6))
            for eye in eyes:
                H[:, eye_slice(eye)] = np.eye(3) / len(eyes)
            known.append((H, np.zeros(3), noise_m2))
        known += [one.at(self.wearer_scale) for one in then]
        return posterior(self.prior, known)[1] + self.by_depth_m2


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """The displacement measured by one alignment, in the axes of the left eye's E."""

    H: Float64
    """(3, 6); the displacement is H [φ_left; φ_right]."""
    seen_m: Float64
    """(3,)."""
    registration_m2: Float64
    """(3, 3); covariance of the registration."""
    wearer_m2: Float64
    """(3, 3); covariance of a usual wearer's overlay."""
    by_depth: Float64 = field(default_factory=lambda: np.zeros((3, 2)))
    """(3, 2); derivatives of the displacement by scale and offset, m, of the measured depth."""

    def at(self, scale: float) -> Observed:
        """Return H, displacement and covariance for a wearer of a precision."""
        return self.H, self.seen_m, self.registration_m2 + scale**2 * self.wearer_m2


def fuse_alignments(
    solved: Sequence[tuple[Alignment, Mapping[Eye, EyeShift]]],
    rig: Rig,
    settings: FuseSettings,
    eye_distance: EyeDistance | None = None,
    verified: Mapping[Eye, Verification] = MappingProxyType({}),
) -> Fused:
    """Fuse solved alignments into one estimate for each eye that any of them has.

    Parameters
    ----------
    solved : sequence of (Alignment, mapping of eye to EyeShift)
        As returned by `solve_alignment`, without prior.
    rig : Rig
    settings : FuseSettings
    eye_distance : EyeDistance, optional
        The wearer's, if it was measured.
    verified : mapping of eye to Verification
        Each is one more observation of its eye, if it says where the hand was.

    Raises
    ------
    ValueError
        If there is nothing to fuse.
    HandError
        If all points of a cursor lie at cut edges.
    """
    observations = {
        eye: tuple(
            verified_observation(rig, eye, one.after_m, one.hand_E_m, settings)
            for one in (*newest.earlier, newest)
            if one.hand_E_m is not None
        )
        for eye, newest in verified.items()
    }
    verifications = {eye: found for eye, found in observations.items() if found}
    if not solved and not verifications:
        raise ValueError("at least one alignment is needed")
    observed = tuple(_observe(alignment, shifts, rig, settings) for alignment, shifts in solved)
    prior = with_eye_distance(eye_prior(settings.prior), rig, eye_distance)
    known = (*observed, *(one for found in verifications.values() for one in found))
    weights = _scale_weights(prior, known, settings)
    found = [posterior(prior, [o.at(scale) for o in known]) for scale in settings.wearer_scales]
    estimate_m = sum(weight * mean_m for weight, (mean_m, _) in zip(weights, found, strict=True))
    joint_m2 = sum(
        weight * (covariance_m2 + np.outer(mean_m - estimate_m, mean_m - estimate_m))
        for weight, (mean_m, covariance_m2) in zip(weights, found, strict=True)
    )
    wearer_scale = float(np.sqrt(weights @ np.square(settings.wearer_scales)))
    by_depth_m2 = depth_covariance_m2(
        rig.depth_check,
        prior,
        [one.at(wearer_scale) for one in known],
        [one.by_depth for one in known],
    )
    joint_m2 = joint_m2 + by_depth_m2
    of_eye = {
        eye: found_shifts
        for eye in EYES
        if (found_shifts := [shifts[eye] for _, shifts in solved if eye in shifts])
        or eye in verifications
    }
    return Fused(
        shifts={
            eye: _summarise(
                shifts, estimate_m[eye_slice(eye)], joint_m2[eye_slice(eye), eye_slice(eye)]
            )
            for eye, shifts in of_eye.items()
        },
        prior=prior,
        observed=observed,
        wearer_scale=wearer_scale,
        verified=verifications,
        verifiable={
            eye: verified_observation(rig, eye, (0.0, 0.0, 0.0), _VERIFIED_AT_M, settings)
            for eye in of_eye
        },
        by_depth_m2=by_depth_m2,
    )


def _scale_weights(
    prior: EyePrior, observed: Sequence[Observation], settings: FuseSettings
) -> Float64:
    """Return the probability of each precision of the wearer, by how well it predicts them all.

    The displacements of all alignments are jointly Gaussian, given the precision.
    """
    H = np.concatenate([one.H for one in observed])
    surprise_m = np.concatenate([one.seen_m for one in observed]) - H @ prior.mean_m
    common_m2 = H @ prior.covariance_m2 @ H.T
    logarithms = []
    for scale, weight in zip(settings.wearer_scales, settings.wearer_weights, strict=True):
        noise_m2 = block_diag(*[one.at(scale)[2] for one in observed])
        total_m2 = common_m2 + noise_m2
        _, log_determinant = np.linalg.slogdet(total_m2)
        fit = float(surprise_m @ np.linalg.solve(total_m2, surprise_m))
        logarithms.append(np.log(weight) - 0.5 * (log_determinant + fit))
    return np.asarray(softmax(logarithms))


def _observe(
    alignment: Alignment, shifts: Mapping[Eye, EyeShift], rig: Rig, settings: FuseSettings
) -> Observation:
    """Return the displacement measured by an alignment.

    The wearer sees the part of the cursor's outline that lies within the display.
    """
    surface = describe_surface(alignment.cursor_m, alignment.cursor_is_cut, _OUTLINE_FROM_POINTS)
    H, wearer_m2 = seen_by(
        alignment.cursor_m,
        surface.points_m[surface.outline],
        alignment.T_E_W,
        alignment.drawn_shift_m,
        tuple(shifts),
        rig,
        settings,
    )
    R_W_A = _common_axes(alignment.T_E_W)
    seen_m, by_depth = np.zeros(3), np.zeros((3, 2))
    registrations = []
    middle_m = alignment.cursor_m.mean(axis=0)
    for eye, shift in shifts.items():
        R_A_E = R_W_A.T @ alignment.T_E_W[eye][:3, :3].T
        registrations.append(R_A_E @ shift.covariance_m2 @ R_A_E.T)
        seen_m += H[:, eye_slice(eye)] @ shift.shift_m
        middle_E_m = transform(alignment.T_E_W[eye], middle_m[None])[0]
        by_depth += H[:, eye_slice(eye)] @ shift_by_depth(middle_E_m, rig.eyes[eye], rig)
    registration_m2 = np.mean(registrations, axis=0) + alignment.time_sigma_m**2 * np.eye(3)
    return Observation(H, seen_m, registration_m2, wearer_m2, by_depth)


def seen_by(
    cursor_m: Float64,
    outline_m: Float64,
    T_E_W: Mapping[Eye, Float64],
    drawn_shift_m: Mapping[Eye, Float64],
    eyes: Sequence[Eye],
    rig: Rig,
    settings: FuseSettings,
) -> tuple[Float64, Float64]:
    """Return H (3, 6) and a usual wearer's covariance (3, 3) for a cursor and the open eyes.

    Parameters
    ----------
    cursor_m, outline_m : (N, 3), (M, 3) float64
        The cursor and the points of its outline, in W.
    T_E_W : mapping of eye to (4, 4) float64
    drawn_shift_m : mapping of eye to (3,) float64
        φ that the cursor is drawn with.
    eyes : sequence of eye
    rig : Rig
    settings : FuseSettings
    """
    R_W_A = _common_axes(T_E_W)
    normals: dict[Eye, Float64] = {}
    wearers = []
    for eye in eyes:
        display = rig.eyes[eye]
        R_A_E = R_W_A.T @ T_E_W[eye][:3, :3].T
        outline_E = transform(T_E_W[eye], outline_m)
        shown = _is_shown(outline_E, display, drawn_shift_m[eye])
        normals[eye] = R_A_E @ _pixel_normal(outline_E[shown]) @ R_A_E.T
        depth_m = float(transform(T_E_W[eye], cursor_m)[:, 2].mean())
        sigmas = settings.lateral_sigma_arcmin, settings.depth_sigma
        wearer = _wearer_covariance(depth_m, display.z_C0_S_m, *sigmas)
        wearers.append(R_A_E @ wearer @ R_A_E.T)
    total = np.sum(list(normals.values()), axis=0)
    H = np.zeros((3, 6))
    for eye in eyes:
        weight = np.linalg.solve(total, normals[eye]) @ R_W_A.T @ T_E_W[eye][:3, :3].T
        H[:, eye_slice(eye)] = weight
    return H, np.mean(wearers, axis=0)


def verified_observation(
    rig: Rig,
    eye: Eye,
    shift_m: Sequence[float],
    hand_E_m: Sequence[float],
    settings: FuseSettings,
) -> Observation:
    """Return the observation of one eye's φ by a verification, with the hand at a place of E."""
    R_A_E = rig.eyes["left"].T_V_H[:3, :3] @ rig.eyes[eye].T_V_H[:3, :3].T
    sigmas = settings.verified_sigma_arcmin, settings.verified_depth_sigma
    wearer_m2 = _wearer_covariance(hand_E_m[2], rig.eyes[eye].z_C0_S_m, *sigmas)
    H = np.zeros((3, 6))
    H[:, eye_slice(eye)] = R_A_E
    return Observation(
        H,
        R_A_E @ np.asarray(shift_m),
        np.zeros((3, 3)),
        R_A_E @ wearer_m2 @ R_A_E.T,
        R_A_E @ shift_by_depth(np.asarray(hand_E_m, np.float64), rig.eyes[eye], rig),
    )


def _common_axes(T_E_W: Mapping[Eye, Float64]) -> Float64:
    """Return the rotation (3, 3) to W from the axes in which observations are expressed.

    The left eye's E is as good as any, and the same for every position of the head.
    """
    return next(T_E_W[eye] for eye in EYES if eye in T_E_W)[:3, :3].T


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


def _wearer_covariance(
    depth_m: float, distance_m: float, lateral_sigma_arcmin: float, depth_sigma: float
) -> Float64:
    """Return the covariance (3, 3) of φ from a wearer's overlay of a hand at a depth."""
    lateral_m = depth_m * np.radians(lateral_sigma_arcmin / 60.0)
    along_m = depth_m * depth_sigma
    gain = 1.0 / (1.0 - depth_m / distance_m)
    return np.diag(np.square([gain * lateral_m, gain * lateral_m, gain * along_m]))


def _summarise(shifts: Sequence[EyeShift], shift_m: Float64, covariance_m2: Float64) -> EyeShift:
    """Return an eye's estimate, with a summary of its alignments; there may be none."""
    return EyeShift(
        shift_m=shift_m,
        covariance_m2=covariance_m2,
        rms_m=float(np.sqrt(np.mean([shift.rms_m**2 for shift in shifts]))) if shifts else 0.0,
        residuals_m=np.concatenate([np.empty(0), *(shift.residuals_m for shift in shifts)]),
        inlier_ratio=float(np.mean([shift.inlier_ratio for shift in shifts])) if shifts else 1.0,
        iterations=sum(shift.iterations for shift in shifts),
        converged=all(shift.converged for shift in shifts),
        stop_reason="; ".join(dict.fromkeys(shift.stop_reason for shift in shifts)),
        history_m2=np.concatenate([np.empty(0), *(shift.history_m2 for shift in shifts)]),
        method="fused",
    )
