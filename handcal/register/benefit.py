"""The benefit of a calibration: the error expected without it and with it.

The error of an eye is the mean distance, in arcminutes, between the corners of the user test's
target as they are drawn and as they should be, at its three distances. Around the offline
calibration it is linear in φ: with the Jacobian J of the drawn corners, drawing with φ for an eye
at φ' is wrong by J (φ - φ') there. Its expectation over a Gaussian has no closed form, so it
is averaged over a fixed set of samples: equal input gives equal output.

The error in depth is the distance along the viewing direction by which an object at the working
distance must move to cover its drawing: (1 - z φ4) |φ3 - φ3'| by the model of registration
(`handcal.register.model`), with φ4 the inverse distance of the focal plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from scipy.special import ndtri

from handcal.core.display import TARGET_DEPTHS_M, arcmin_from_px, eye_projection, target_corners_m
from handcal.core.geometry import project
from handcal.core.types import EyeDisplay, EyeShift, Float64

WORKING_DISTANCE_M = TARGET_DEPTHS_M[1]
"""Distance at which the error in depth is expected."""

DISTANCES_M = (0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 5.0)
"""Distances of the error against distance."""
BY_DISTANCE = (
    "Only the eye's place is uncertain here: an error of the rig itself, such as a focal length or "
    "a distance of the virtual screen that is wrong, comes on top, and matters most far away."
)
"""The assumption of the error against distance."""
_INTERVAL = (0.025, 0.975)
_STEP_M = 1e-5

# Direction numbers (9, 3) and shift (3,) of a scrambled Sobol sequence, in units of 2^-30.
_DIRECTIONS = np.array(
    [
        (673096586, 917181856, 620559025),
        (531968120, 778357951, 986714182),
        (144802939, 1036247871, 346770696),
        (106393622, 572734319, 556359821),
        (60247633, 876853389, 855782661),
        (18685518, 758528844, 421130711),
        (13502531, 1071340902, 650831322),
        (7096701, 568060893, 992322302),
        (2254756, 915708970, 399225896),
    ]
)
_SHIFT = np.array([440180019, 1035216202, 920899910])


@dataclass(frozen=True, slots=True)
class DepthBenefit:
    """The error in depth of one eye, at `WORKING_DISTANCE_M`; the fields are as in `Benefit`."""

    before_m: float
    without_m: float
    after_m: float
    probability_better: float

    def __str__(self) -> str:
        """Return the errors without the calibration and with it, and the probability."""
        errors = f"{1e3 * self.without_m:.1f} → {1e3 * self.after_m:.1f} mm"
        return f"{errors}, {percent(self.probability_better)} sure to be better"


@dataclass(frozen=True, slots=True)
class ErrorAt:
    """The error of one eye at one distance, by what the alignments say about the wearer.

    Only φ is uncertain: the display, the distance of its focal plane and the depth camera's pose
    count as those of the rig. So nothing errs at the focal plane, wherever the eye is.
    """

    distance_m: float
    without_arcmin: float
    without_low_arcmin: float
    without_high_arcmin: float
    """Expected with the offline calibration, and the interval that holds it for 95 % of eyes."""
    after_arcmin: float
    after_low_arcmin: float
    after_high_arcmin: float
    """The same with the solved φ."""

    @property
    def texts(self) -> tuple[str, str]:
        """Return the errors without the calibration and with it, each with its interval."""
        low, high = self.without_low_arcmin, self.without_high_arcmin
        without = f"{self.without_arcmin:.1f} ({low:.1f}–{high:.1f})"
        low, high = self.after_low_arcmin, self.after_high_arcmin
        return without, f"{self.after_arcmin:.1f} ({low:.1f}–{high:.1f})"


@dataclass(frozen=True, slots=True)
class Benefit:
    """The error of one eye without the calibration and with it."""

    before_arcmin: float
    """Expected with the offline calibration, before anything is known about the wearer."""
    without_arcmin: float
    """Expected with the offline calibration, from what the alignments say about the wearer."""
    after_arcmin: float
    """Expected with the solved φ."""
    probability_better: float
    """Probability that the solved φ errs less than the offline calibration."""
    depth: DepthBenefit
    by_distance: tuple[ErrorAt, ...]
    """At `DISTANCES_M`."""


def percent(probability: float) -> str:
    """Return a probability in percent, with a no-break space.

    Rounded down, so that a refused value never reads as the limit, and at most 99: nothing is
    certain.
    """
    return f"{min(99, int(100.0 * probability))}\u00a0%"


def expected_arcmin(display: EyeDisplay, mean_m: Float64, covariance_m2: Float64) -> float:
    """Return the expected error of drawing with φ = 0 for an eye at a Gaussian φ, arcmin."""
    return float(_errors_arcmin(display, _samples(mean_m, covariance_m2)).mean())


def expected_error_arcmin(display: EyeDisplay, shift: EyeShift) -> float:
    """Return the expected error of drawing with a solved φ, from its covariance, arcmin."""
    return expected_arcmin(display, np.zeros(3), shift.covariance_m2)


def benefit(
    display: EyeDisplay,
    prior_mean_m: Float64,
    prior_covariance_m2: Float64,
    shift_m: Float64,
    covariance_m2: Float64,
) -> Benefit:
    """Return the benefit of drawing with φ instead of the offline calibration.

    Parameters
    ----------
    display : EyeDisplay
    prior_mean_m, prior_covariance_m2 : (3,), (3, 3) float64
        φ of the eye before the alignments.
    shift_m, covariance_m2 : (3,), (3, 3) float64
        φ of the eye after the alignments; the former is drawn with.
    """
    before_m = _samples(prior_mean_m, prior_covariance_m2)
    eyes_m = _samples(shift_m, covariance_m2)
    after = _errors_arcmin(display, eyes_m - shift_m)
    without = _errors_arcmin(display, eyes_m)
    depth_after_m = depth_error_m(display, eyes_m - shift_m)
    depth_without_m = depth_error_m(display, eyes_m)
    return Benefit(
        before_arcmin=float(_errors_arcmin(display, before_m).mean()),
        without_arcmin=float(without.mean()),
        after_arcmin=float(after.mean()),
        probability_better=float((after < without).mean()),
        depth=DepthBenefit(
            before_m=float(depth_error_m(display, before_m).mean()),
            without_m=float(depth_without_m.mean()),
            after_m=float(depth_after_m.mean()),
            probability_better=float((depth_after_m < depth_without_m).mean()),
        ),
        by_distance=_by_distance(display, eyes_m, shift_m),
    )


def _by_distance(display: EyeDisplay, eyes_m: Float64, shift_m: Float64) -> tuple[ErrorAt, ...]:
    """Return the errors at `DISTANCES_M` for samples of the eye (N, 3) and the φ drawn with."""
    found = []
    for distance_m in DISTANCES_M:
        without, after = (
            _errors_arcmin(display, difference_m, (distance_m,))
            for difference_m in (eyes_m, eyes_m - shift_m)
        )
        found.append(ErrorAt(distance_m, *_summary(without), *_summary(after)))
    return tuple(found)


def _summary(errors_arcmin: Float64) -> tuple[float, float, float]:
    low, high = np.quantile(errors_arcmin, _INTERVAL).tolist()
    return float(errors_arcmin.mean()), low, high


def depth_error_m(display: EyeDisplay, difference_m: Float64) -> Float64:
    """Return the errors in depth (...) of drawing with φ, for its differences (..., 3) from φ'."""
    along_m: Float64 = np.abs(difference_m[..., 2])
    return along_m * (1.0 - WORKING_DISTANCE_M / display.z_C0_S_m)


def foreseen_benefit(
    display: EyeDisplay, shift_m: Float64, later_m2: Float64
) -> tuple[float, float]:
    """Return the error to expect once φ is known better, and the probability of a benefit then.

    The estimate is as likely to move one way as another, so it is taken to stay where it is. Then
    whatever adds nothing leaves the probability as it is.

    Parameters
    ----------
    display : EyeDisplay
    shift_m : (3,) float64
        φ of the eye as estimated now.
    later_m2 : (3, 3) float64
        Its covariance then.
    """
    errors_m = _samples(np.zeros(3), later_m2)
    after = _errors_arcmin(display, errors_m)
    without = _errors_arcmin(display, shift_m + errors_m)
    return float(after.mean()), float((after < without).mean())


def _samples(mean_m: Float64, covariance_m2: Float64) -> Float64:
    """Return samples (N, 3) of a Gaussian; the covariance may be singular."""
    values, axes = np.linalg.eigh(covariance_m2)
    root = axes * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(mean_m + _standard_normal() @ root.T)


@cache
def _standard_normal() -> Float64:
    """Return samples (N, 3): a scrambled Sobol sequence and its mirror image.

    The sequence is that of ``MultivariateNormalQMC(np.zeros(3), rng=np.random.default_rng(0))`` of
    `scipy.stats.qmc`, whose import would keep the first solution waiting.
    """
    bits = len(_DIRECTIONS)
    index = np.arange(2**bits)
    gray = index ^ (index >> 1)
    chosen = (gray[:, None] >> np.arange(bits)) & 1
    sobol = _SHIFT ^ np.bitwise_xor.reduce(chosen[..., None] * _DIRECTIONS, axis=1)
    half = ndtri(0.5 + (1.0 - 1e-10) * (sobol / 2.0**30 - 0.5))
    samples = np.concatenate([half, -half])
    samples.flags.writeable = False
    return samples


def _errors_arcmin(
    display: EyeDisplay, difference_m: Float64, depths_m: tuple[float, ...] = TARGET_DEPTHS_M
) -> Float64:
    """Return the mean error over the corners (N,) for differences of φ (N, 3)."""
    J = _jacobian(display, depths_m)
    x_px, y_px = np.tensordot(J, difference_m.T, axes=1).transpose(1, 0, 2)
    return np.asarray(arcmin_from_px(display, np.hypot(x_px, y_px).mean(axis=0)))


@lru_cache(maxsize=16 * (1 + len(DISTANCES_M)))
def _jacobian(display: EyeDisplay, depths_m: tuple[float, ...]) -> Float64:
    """Return the derivative (4 depths, 2, 3) of the drawn corners with respect to φ, px/m."""
    corners_m = np.concatenate([target_corners_m(depth_m) for depth_m in depths_m])

    def drawn_px(shift_m: Float64) -> Float64:
        return project(eye_projection(display, shift_m), corners_m)

    steps_m = _STEP_M * np.eye(3)
    return np.stack([drawn_px(s) - drawn_px(-s) for s in steps_m], axis=-1) / (2.0 * _STEP_M)
