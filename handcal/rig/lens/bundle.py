"""Bundle adjustment of cameras, their relative pose, and the boards that they see.

Single corners whose residuals differ from those beside them are left out. A wrong lens model does
not look like that: its residuals change smoothly over the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lstsq

from handcal.core.types import Float64
from handcal.rig.boards.board import BoardView
from handcal.rig.lens.fit import marginal_covariance
from handcal.rig.lens.lens import LensModel
from handcal.rig.lens.reprojection import Problem, Setup, Sighting

_MAX_STEPS = 100
# Least relative gain of a step, round by round; the first only finds corners to leave out.
_LEAST_GAINS = 1e-2, 1e-7, 1e-7
_STRAY_SIGMAS = 10.0
# Of a view, and of all: more indicate a fault of the view or of the lens model.
_MAX_STRAY_SHARES = 0.1, 0.01
_LEAST_SIGMA_PX = 0.01
_COEFFICIENT_SIGMA = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class Adjusted:
    """A setup that fits the sightings best."""

    setup: Setup
    off_px: tuple[Float64, ...]
    """each (N, 2); of each sighting, detected minus predicted."""
    kept: tuple[NDArray[np.bool_], ...]
    """each (N,); False for corners left out."""
    blocks: tuple[tuple[Float64, Float64, Float64], ...]
    """Of each frame, derivatives of its kept corners by the shared parameters, (M, P), and by its
    own pose, (M, 6), and their residuals, (M,)."""
    is_coefficient: NDArray[np.bool_]
    """(P - K,); which shared parameters are a lens's coefficients."""
    noise_px: float = 0.0
    """Noise of a corner along each axis, as the prior of the board's shape was weighed with."""

    @property
    def rms_px(self) -> float:
        """Root mean square distance between detected and predicted corners, of those kept."""
        square = np.concatenate([self.off_px[n][kept] for n, kept in enumerate(self.kept)])
        return float(np.sqrt(np.mean(np.sum(square**2, axis=1))))

    @property
    def left_out(self) -> int:
        """Number of corners left out."""
        return int(sum((~kept).sum() for kept in self.kept))

    @property
    def priors_px(self) -> Float64:
        """(P,); weight of each shared parameter's prior."""
        residuals = np.concatenate([block[2] for block in self.blocks])
        weak_px = float(np.sqrt(np.mean(residuals**2))) / _COEFFICIENT_SIGMA
        shapes = self.blocks[0][0].shape[1] - len(self.is_coefficient)
        return np.append(np.where(self.is_coefficient, weak_px, 0.0), shapes * [self.noise_px])

    def covariance(self) -> Float64 | None:
        """Return the covariance of the cameras' parameters; None if they are not determined.

        They are the second camera's pose and the solved parameters of each camera, in this order.
        A coefficient that the views do not determine is taken as 0 ± `_COEFFICIENT_SIGMA`. What is
        not known of the board's shape is contained.
        """
        whole, count = self.whole_covariance(), len(self.is_coefficient)
        return None if whole is None else whole[:count, :count]

    def whole_covariance(self) -> Float64 | None:
        """Return `covariance` with the board's shape as the last parameters."""
        residuals = np.concatenate([block[2] for block in self.blocks])
        blocks = [block[:2] for block in self.blocks]
        prior = np.diag(self.priors_px)
        return marginal_covariance([*blocks, (prior, np.empty((len(prior), 0)))], residuals)

    def held_out_px2(self, kept: Sequence[NDArray[np.bool_]]) -> Float64:
        """Return the mean square residual of each frame when left out, over the corners in `kept`.

        The shared parameters move by one Gauss-Newton step when the frame is left out; its own pose
        is then solved again. This is the prediction sum of squares (Allen 1974) by frames. All
        cameras see each frame, and the sightings are in the order of frames, then cameras.
        """
        reduced = []
        for shared, own, residuals in self.blocks:
            basis, _ = np.linalg.qr(own)
            reduced.append(
                (shared - basis @ (basis.T @ shared), residuals - basis @ (basis.T @ residuals))
            )
        information = sum(J.T @ J for J, _ in reduced) + np.diag(self.priors_px**2)
        scale = 1.0 / np.sqrt(np.diag(information))
        squares, each = [], len(self.kept) // len(self.blocks)
        for number, (J, residuals) in enumerate(reduced):
            of_frame = slice(each * number, each * (number + 1))
            mine, common = (np.concatenate(one[of_frame]) for one in (self.kept, kept))
            scaled = J * scale
            rest = information * np.outer(scale, scale) - scaled.T @ scaled
            move = lstsq(rest, scaled.T @ residuals, 1e-13, lapack_driver="gelsy")[0]
            off_px = (residuals + scaled @ move).reshape(-1, 2)
            squares.append(np.mean(np.sum(off_px**2, axis=1)[common[mine]]))
        return np.array(squares)


def adjust(
    sightings: Sequence[Sighting],
    setup: Setup,
    lenses: Sequence[LensModel | None],
    *,
    solve_place: bool = True,
    steps: int = _MAX_STEPS,
    modes_m: Float64 | None = None,
    noise_px: float = 0.0,
) -> Adjusted:
    """Minimise the reprojection error over all poses and what is free of the cameras.

    Parameters
    ----------
    sightings : sequence of Sighting
        Every frame has at least one.
    setup : Setup
        First estimate.
    lenses : sequence of LensModel or None
        Of each camera, the model whose parameters are solved for; None if they are given.
    solve_place : bool
        False if the pose between the cameras is given too.
    steps : int
        Limit.
    modes_m : (N, 3, K) float64, optional
    noise_px : float
        As for `Problem`; `setup.shape` then has K numbers.
    """
    has_place = solve_place and setup.place is not None

    def problem_of(some: Sequence[Sighting]) -> Problem:
        return Problem(some, lenses, has_place, modes_m, noise_px)

    counts = [len(one.seen.pixels) for one in sightings]
    beside = _beside(sightings)
    whole = problem_of(sightings)
    problem, kept, linear = whole, [np.ones(count, np.bool_) for count in counts], None
    for least_gain in _LEAST_GAINS:
        setup, linear = problem.minimised(setup, steps, least_gain, linear)
        off_px = whole.residuals(linear if problem is whole else whole.linear(setup))
        before, kept = kept, _regular(off_px, beside)
        if not all(np.array_equal(old, new) for old, new in zip(before, kept, strict=True)):
            problem = problem_of(kept_only(sightings, kept))
            linear = None
        elif least_gain == _LEAST_GAINS[-1]:
            break
    linear = problem.linear(setup) if linear is None else linear
    return Adjusted(
        setup, tuple(off_px), tuple(kept), problem.blocks(linear), whole.is_coefficient, noise_px
    )


def kept_only(sightings: Sequence[Sighting], kept: Sequence[NDArray[np.bool_]]) -> list[Sighting]:
    """Return the sightings with the corners that are kept, (N,) each."""
    return [
        replace(one, seen=one.seen.only(keep)) for one, keep in zip(sightings, kept, strict=True)
    ]


def kept_by_all(fits: Sequence[Adjusted]) -> list[NDArray[np.bool_]]:
    """Return the corners of each sighting, (N,), that no fit has left out."""
    return [np.logical_and.reduce(one) for one in zip(*(fit.kept for fit in fits), strict=True)]


def foreseen(
    points_m: Float64, setup: Setup, lenses: Sequence[LensModel | None]
) -> tuple[Float64, Float64]:
    """Return the information that frames of a setup would give, before they are taken.

    Parameters
    ----------
    points_m : (N, 3) float64
        The board's corners.
    setup : Setup
    lenses : sequence of LensModel or None

    Returns
    -------
    information : (F, P, P) float64
        Of each frame on its own, about the shared parameters, with 1 px of noise.
    seen_share : (F, C) float64
        Share of the corners that each camera has in its image.
    """
    ids, blank = np.arange(len(points_m)), np.zeros((len(points_m), 2))
    views = [BoardView(points_m, blank, (one.width, one.height), ids, 2.0) for one in setup.cameras]
    sightings = [
        Sighting(frame, number, seen)
        for number, seen in enumerate(views)
        for frame in range(len(setup.poses))
    ]
    problem = Problem(sightings, lenses, setup.place is not None)
    return problem.foreseen(setup)


def _beside(sightings: Sequence[Sighting]) -> NDArray[np.int64]:
    """Return the corners nearest to each corner, (N, K), counted over all sightings."""
    each = [one.seen.beside for one in sightings]
    least = min(near.shape[1] for near in each)
    starts = np.cumsum([0, *(len(near) for near in each[:-1])])
    return np.concatenate(
        [near[:, :least] + start for near, start in zip(each, starts, strict=True)]
    )


def _regular(off_px: Sequence[Float64], beside: NDArray[np.int64]) -> list[NDArray[np.bool_]]:
    """Return which corners to keep: all if too many are far off."""
    off = np.concatenate(off_px)
    alone_px = off - _median(off[beside])
    sigma_px = 1.4826 * float(np.median(np.abs(alone_px)))
    limit_px = _STRAY_SIGMAS * max(_LEAST_SIGMA_PX, sigma_px)
    is_stray = np.linalg.norm(alone_px, axis=1) > limit_px
    of_view, of_all = _MAX_STRAY_SHARES
    strays = np.split(is_stray, np.cumsum([len(one) for one in off_px[:-1]]))
    if not is_stray.any() or is_stray.mean() > of_all:
        return [np.ones(len(stray), np.bool_) for stray in strays]
    return [~stray if stray.mean() <= of_view else np.ones_like(stray) for stray in strays]


def _median(values: Float64) -> Float64:
    """Return `np.median` over the middle axis of (N, K, 2), for small K several times as fast."""
    count = values.shape[1]
    ordered = np.sort(values, axis=1)
    return 0.5 * (ordered[:, (count - 1) // 2] + ordered[:, count // 2])
