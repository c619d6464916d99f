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
`_WEARER_SCALES`, and the estimate is the mean over them, weighted by how well each
explains the alignments. One alignment says little about it, several say much by their scatter.

What is wrong in all observations of a sitting alike does not average out, so it is unknown too
(`handcal.register.sitting`).

A verification, in which the wearer moves the drawing of the resting hand until it covers the hand
(`handcal.register.model`), is one more observation of one eye's φ, more precise than an alignment.
One in which nothing was moved is none: a wearer who does not look says the same. Verifications of
one eye that contradict each other count less.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, combinations
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri, softmax

from handcal.core.display import eye_projection, is_on_display
from handcal.core.geometry import project, transform
from handcal.core.types import (
    EYES,
    Alignment,
    Eye,
    EyeDistance,
    EyeShift,
    Float64,
    Rig,
    Verification,
)
from handcal.hand.outline import edges_of
from handcal.register.benefit import expected_arcmin
from handcal.register.prior import (
    EyePrior,
    Observed,
    PriorSettings,
    eye_prior,
    eye_slice,
    posterior,
    shift_by_depth,
    stacked,
    with_eye_distance,
    with_sitting,
)
from handcal.register.sitting import (
    OUTLINE,
    SittingPrior,
    SittingSettings,
    shift_by_sitting,
    sitting_prior,
)
from handcal.register.surface import describe_surface

# Standard deviation of a verification by a usual wearer in each of two directions, and of its size,
# relative: people judge a position better than a size.
_VERIFIED_SIGMA_ARCMIN, _VERIFIED_DEPTH_SIGMA = 2.0, 0.005
# Errors of a wearer's overlay, relative to a usual wearer's, and the probability of each.
_WEARER_SCALES, _WEARER_WEIGHTS = (1.0, 2.0, 3.0, 4.0, 8.0), (0.7, 0.16, 0.08, 0.05, 0.01)
# The cursor's outline is found in this many of its points.
_OUTLINE_FROM_POINTS = 1500
# Far less than that of one point; it keeps the weights defined for a cursor outside the display.
_NORMAL_FLOOR = 1e-3
# Place of the hand, in E, that a verification to come is expected to have.
_VERIFIED_AT_M = 0.0, 0.0, 0.5
# Share of a usual wearer's pairs of verifications that contradict each other by chance.
_CONTRADICTING = 0.05
# Probability that a drawn outline which nobody has measured is wrong by this many times its σ.
_WRONG, _WRONG_SCALE = 0.1, 4.0
# The limit of `Misfit`, over that for data as the priors say: the eyes of wearers differ less than
# the default prior allows. Measured on plain wearers (docs/studies.md).
_MISFIT = 0.85


@dataclass(frozen=True, slots=True)
class FuseSettings:
    """Priors on φ, and the precision of a wearer's alignment."""

    prior: PriorSettings = field(default_factory=PriorSettings)
    lateral_sigma_arcmin: float = 4.0
    """Standard deviation of a usual wearer's overlay in each of two directions."""
    depth_sigma: float = 0.004
    """Relative standard deviation of the depth, by matching the size. With these errors,
    the paper's method has the error of the paper's user test."""
    sitting: SittingSettings = field(default_factory=SittingSettings)


@dataclass(frozen=True, slots=True, eq=False)
class Fused:
    """Estimates from several alignments, for each eye that any of them has."""

    shifts: Mapping[Eye, EyeShift]
    prior: EyePrior
    """Prior of the eyes and of the errors of the sitting, with the eye distance if it was
    measured."""
    observed: tuple[Observation, ...]
    """The displacement measured by each alignment."""
    wearer_scale: float
    """Expected error of the wearer's overlays, relative to a usual wearer's."""
    verified: Mapping[Eye, tuple[Observation, ...]] = field(default_factory=dict)
    """The φ found by each eye's verifications."""
    verifiable: Mapping[Eye, Observation] = field(default_factory=dict)
    """The verification to expect of each solved eye; its φ is zero."""
    apart_arcmin: Mapping[Eye, float] = field(default_factory=dict)
    """Distance between the verifications of each eye whose verifications contradict each other."""
    misfit: Misfit | None = None
    """Fit of the eyes and a usual wearer to what was observed."""

    @property
    def all_observed(self) -> tuple[Observation, ...]:
        """The observations of the alignments, then those of the verifications."""
        return (*self.observed, *chain.from_iterable(self.verified.values()))

    def foreseen_m2(
        self, upcoming: Sequence[Sequence[Eye]], then: Sequence[Observation] = ()
    ) -> Float64:
        """Return the covariance of the unknowns to expect after alignments and other observations.

        The alignments, each with some eyes open, are taken to be as precise as those so far on
        average; without any, as the verifications.
        """
        known = [one.at(self.wearer_scale) for one in self.all_observed]
        aligned, verified = known[: len(self.observed)], known[len(self.observed) :]
        alike = aligned or verified
        noise_m2 = np.mean([covariance_m2 for _, _, covariance_m2 in alike], axis=0)
        for eyes in upcoming:
            H = np.mean([H for H, _, _ in alike], axis=0)
            H[:, :6] = 0.0
            for eye in eyes:
                H[:, eye_slice(eye)] = np.eye(3) / len(eyes)
            known.append((H, np.zeros(3), noise_m2))
        known += [one.at(self.wearer_scale) for one in then]
        excess = 1.0 if self.misfit is None else max(1.0, self.misfit.ratio)
        return excess * posterior(self.prior, known)[1]


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
    by_sitting: Float64 = field(default_factory=lambda: np.zeros((3, 6)))
    """(3, 6); derivatives of the displacement by the errors of the sitting."""

    def at(self, scale: float) -> Observed:
        """Return H with `by_sitting` (3, 12), displacement and covariance for a precision."""
        covariance_m2 = self.registration_m2 + scale**2 * self.wearer_m2
        return np.hstack([self.H, self.by_sitting]), self.seen_m, covariance_m2


@dataclass(frozen=True, slots=True)
class Misfit:
    """Distance of all observations from what the priors and a usual wearer predict."""

    chi2: float
    numbers: int
    """Squared distance in standard deviations, and the number of numbers observed."""

    @property
    def ratio(self) -> float:
        """Of `chi2` to what 95 % of wearers with the usual errors reach at most."""
        return self.chi2 / (_MISFIT * float(chdtri(self.numbers, 0.05)))


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
    sitting = sitting_prior(rig, settings.sitting)
    prior = with_sitting(eye_prior(settings.prior), sitting)
    prior = with_eye_distance(prior, rig, eye_distance)
    observed = tuple(_observe(alignment, shifts, rig, settings) for alignment, shifts in solved)
    verifications, apart_arcmin = _observe_verifications(verified, rig, sitting)
    evidence = (*observed, *chain.from_iterable(verifications.values()))
    if not evidence:
        raise ValueError("at least one alignment is needed")
    cases = _cases(prior, rig)
    weights = _weights(cases, evidence)
    posteriors = [posterior(case.prior, [one.at(case.scale) for one in evidence]) for case in cases]
    mean_m, covariance_m2 = _mixed(weights, posteriors)
    misfit = Misfit(_surprise(prior, evidence, 1.0)[0], 3 * len(evidence))
    # What nothing explains may be wrong in anything (Birge 1932).
    covariance_m2 = max(1.0, misfit.ratio) * covariance_m2
    outline_scale = float(np.sqrt(weights @ [case.outline_scale**2 for case in cases]))
    alone = {eye: [shifts[eye] for _, shifts in solved if eye in shifts] for eye in EYES}
    eyes = [eye for eye in EYES if alone[eye] or eye in verifications]
    return Fused(
        shifts={
            eye: _summarise(alone[eye], mean_m[part], covariance_m2[part, part])
            for eye, part in zip(eyes, map(eye_slice, eyes), strict=True)
        },
        prior=_with_outline(prior, outline_scale),
        observed=observed,
        wearer_scale=float(np.sqrt(weights @ [case.scale**2 for case in cases])),
        verified=verifications,
        verifiable={
            eye: verified_observation(rig, eye, (0.0, 0.0, 0.0), _VERIFIED_AT_M) for eye in eyes
        },
        apart_arcmin=apart_arcmin,
        misfit=misfit,
    )


def _observe_verifications(
    verified: Mapping[Eye, Verification], rig: Rig, sitting: SittingPrior
) -> tuple[dict[Eye, tuple[Observation, ...]], dict[Eye, float]]:
    """Return what each eye's verifications observed, and how far contradicting ones are apart."""
    observations: dict[Eye, tuple[Observation, ...]] = {}
    apart_arcmin: dict[Eye, float] = {}
    for eye, newest in verified.items():
        moved = tuple(
            verified_observation(rig, eye, one.after_m, one.hand_E_m, one.outline_sigma_px)
            for one in (*newest.earlier, newest)
            if one.hand_E_m is not None and one.was_moved
        )
        if moved:
            observations[eye], apart_m = _reconciled(moved, sitting)
            if apart_m is not None:
                apart_arcmin[eye] = expected_arcmin(rig.eyes[eye], apart_m, np.zeros((3, 3)))
    return observations, apart_arcmin


def _mixed(
    weights: Float64, posteriors: Sequence[tuple[Float64, Float64]]
) -> tuple[Float64, Float64]:
    """Return mean and covariance of a mixture of Gaussians; their scatter adds to the latter."""
    mean_m = sum(weight * mean for weight, (mean, _) in zip(weights, posteriors, strict=True))
    covariance_m2 = sum(
        weight * (covariance + np.outer(mean - mean_m, mean - mean_m))
        for weight, (mean, covariance) in zip(weights, posteriors, strict=True)
    )
    return np.asarray(mean_m), np.asarray(covariance_m2)


class _Case(NamedTuple):
    """One precision of the wearer, and of what is known of the drawn outline."""

    scale: float
    outline_scale: float
    weight: float
    prior: EyePrior


def _cases(prior: EyePrior, rig: Rig) -> list[_Case]:
    """Return the precisions with their probabilities; a measured outline has one."""
    is_measured = rig.depth_edges is not None
    outlines = [(1.0, 1.0)] if is_measured else [(1.0, 1.0 - _WRONG), (_WRONG_SCALE, _WRONG)]
    return [
        _Case(scale, outline, weight * share, _with_outline(prior, outline))
        for scale, weight in zip(_WEARER_SCALES, _WEARER_WEIGHTS, strict=True)
        for outline, share in outlines
    ]


def _with_outline(prior: EyePrior, scale: float) -> EyePrior:
    """Return the prior with another standard deviation of the drawn outline."""
    covariance_m2 = prior.covariance_m2.copy()
    covariance_m2[OUTLINE, OUTLINE] = scale**2
    return replace(prior, covariance_m2=covariance_m2)


def _weights(cases: Sequence[_Case], observed: Sequence[Observation]) -> Float64:
    """Return the probability of each case, by how well it predicts all observations.

    The displacements of all alignments are jointly Gaussian in each.
    """
    logarithms = []
    for case in cases:
        fit, log_determinant = _surprise(case.prior, observed, case.scale)
        logarithms.append(np.log(case.weight) - 0.5 * (log_determinant + fit))
    return np.asarray(softmax(logarithms))


def _surprise(
    prior: EyePrior, observed: Sequence[Observation], scale: float
) -> tuple[float, float]:
    """Return the squared distance of all observations from their prediction, and log det Σ."""
    H, seen_m, noise_m2 = stacked([one.at(scale) for one in observed], len(prior.mean_m))
    apart_m = seen_m - H @ prior.mean_m
    total_m2 = H @ prior.covariance_m2 @ H.T + noise_m2
    fit = float(apart_m @ np.linalg.solve(total_m2, apart_m))
    return fit, float(np.linalg.slogdet(total_m2)[1])


def _reconciled(
    observed: tuple[Observation, ...], sitting: SittingPrior
) -> tuple[tuple[Observation, ...], Float64 | None]:
    """Return the verifications of one eye, and how far apart two are that contradict each other.

    Those of a usual wearer contradict each other once in twenty times. They then count as much
    less as they are too far apart (Birge 1932).
    """
    pairs = list(combinations(observed, 2))
    worst, apart_m = float(chdtri(3, _CONTRADICTING / max(1, len(pairs)))), None
    for one, other in pairs:
        between_m, by = one.seen_m - other.seen_m, one.by_sitting - other.by_sitting
        expected_m2 = one.wearer_m2 + other.wearer_m2 + by @ sitting.covariance @ by.T
        chi2 = float(between_m @ np.linalg.solve(expected_m2, between_m))
        if chi2 > worst:
            worst, apart_m = chi2, between_m
    if apart_m is None:
        return observed, None
    return tuple(replace(one, wearer_m2=worst / 3.0 * one.wearer_m2) for one in observed), apart_m


def _observe(
    alignment: Alignment, shifts: Mapping[Eye, EyeShift], rig: Rig, settings: FuseSettings
) -> Observation:
    """Return the displacement measured by an alignment.

    The wearer sees the part of the cursor's outline that lies within the display.
    """
    surface = describe_surface(alignment.cursor_m, alignment.cursor_is_cut, _OUTLINE_FROM_POINTS)
    H, wearer_m2, by_sitting = seen_by(
        alignment.cursor_m,
        surface.points_m[surface.outline],
        alignment.T_E_W,
        alignment.drawn_shift_m,
        tuple(shifts),
        rig,
        settings,
        alignment.outline_sigma_px,
    )
    R_W_A = _common_axes(alignment.T_E_W)
    seen_m = np.zeros(3)
    registrations = []
    for eye, shift in shifts.items():
        R_A_E = R_W_A.T @ alignment.T_E_W[eye][:3, :3].T
        registrations.append(R_A_E @ shift.covariance_m2 @ R_A_E.T)
        seen_m += H[:, eye_slice(eye)] @ shift.shift_m
    registration_m2 = np.mean(registrations, axis=0) + alignment.time_sigma_m**2 * np.eye(3)
    return Observation(H, seen_m, registration_m2, wearer_m2, by_sitting)


def seen_by(
    cursor_m: Float64,
    outline_m: Float64,
    T_E_W: Mapping[Eye, Float64],
    drawn_shift_m: Mapping[Eye, Float64],
    eyes: Sequence[Eye],
    rig: Rig,
    settings: FuseSettings,
    outline_sigma_px: float | None = None,
) -> tuple[Float64, Float64, Float64]:
    """Return H (3, 6), a usual wearer's covariance (3, 3) and `by_sitting` of an alignment.

    Parameters
    ----------
    cursor_m, outline_m : (N, 3), (M, 3) float64
        The cursor and the points of its outline, in W.
    T_E_W : mapping of eye to (4, 4) float64
    drawn_shift_m : mapping of eye to (3,) float64
        φ that the cursor is drawn with.
    eyes : sequence of eye
        The open eyes.
    rig : Rig
    settings : FuseSettings
    outline_sigma_px : float, optional
        As in `Alignment`.
    """
    R_W_A = _common_axes(T_E_W)
    middle_m = cursor_m.mean(axis=0)
    normals: dict[Eye, Float64] = {}
    wearers = []
    for eye in eyes:
        display = rig.eyes[eye]
        R_A_E = R_W_A.T @ T_E_W[eye][:3, :3].T
        outline_E = transform(T_E_W[eye], outline_m)
        drawn_px = project(eye_projection(display, drawn_shift_m[eye]), outline_E)
        shown = is_on_display(display, drawn_px)
        normals[eye] = R_A_E @ _pixel_normal(outline_E[shown]) @ R_A_E.T
        depth_m = float(transform(T_E_W[eye], middle_m[None])[0, 2])
        sigmas = settings.lateral_sigma_arcmin, settings.depth_sigma
        wearer = _wearer_covariance(depth_m, display.z_C0_S_m, *sigmas)
        wearers.append(R_A_E @ wearer @ R_A_E.T)
    total = np.sum(list(normals.values()), axis=0)
    H, by_sitting = np.zeros((3, 6)), np.zeros((3, 6))
    for eye in eyes:
        weight = np.linalg.solve(total, normals[eye]) @ R_W_A.T @ T_E_W[eye][:3, :3].T
        H[:, eye_slice(eye)] = weight
        middle_E_m = transform(T_E_W[eye], middle_m[None])[0]
        by_sitting += weight @ _by_sitting(middle_E_m, eye, rig, outline_sigma_px)
    return H, np.mean(wearers, axis=0), by_sitting


def verified_observation(
    rig: Rig,
    eye: Eye,
    shift_m: Sequence[float],
    hand_E_m: Sequence[float],
    outline_sigma_px: float | None = None,
) -> Observation:
    """Return the observation of one eye's φ by a verification, with the hand at a place of E."""
    R_A_E = rig.eyes["left"].T_V_H[:3, :3] @ rig.eyes[eye].T_V_H[:3, :3].T
    sigmas = _VERIFIED_SIGMA_ARCMIN, _VERIFIED_DEPTH_SIGMA
    wearer_m2 = _wearer_covariance(hand_E_m[2], rig.eyes[eye].z_C0_S_m, *sigmas)
    H = np.zeros((3, 6))
    H[:, eye_slice(eye)] = R_A_E
    return Observation(
        H,
        R_A_E @ np.asarray(shift_m),
        np.zeros((3, 3)),
        R_A_E @ wearer_m2 @ R_A_E.T,
        R_A_E @ _by_sitting(np.asarray(hand_E_m, np.float64), eye, rig, outline_sigma_px),
    )


def _by_sitting(hand_E_m: Float64, eye: Eye, rig: Rig, outline_sigma_px: float | None) -> Float64:
    """Return the derivatives (3, 6), E axes, of the φ that is observed by a sitting's errors."""
    display = rig.eyes[eye]
    sigma_px = edges_of(rig).sigma_px if outline_sigma_px is None else outline_sigma_px
    return shift_by_sitting(
        hand_E_m,
        display.z_C0_S_m,
        sigma_px / rig.depth_intrinsics.fx,
        shift_by_depth(hand_E_m, display, rig),
    )


def _common_axes(T_E_W: Mapping[Eye, Float64]) -> Float64:
    """Return the rotation (3, 3) to W from the axes in which observations are expressed.

    The left eye's E is as good as any, and the same for every position of the head.
    """
    return next(T_E_W[eye] for eye in EYES if eye in T_E_W)[:3, :3].T


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
