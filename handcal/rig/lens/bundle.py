"""Bundle adjustment of cameras, their relative pose, and the boards that they see.

Levenberg-Marquardt on the normal equations, reduced to the shared parameters by the Schur
complement (Triggs et al., "Bundle adjustment: a modern synthesis", 2000).

Single corners whose residuals differ from those beside them are left out. A wrong lens model does
not look like that: its residuals change smoothly over the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lstsq

from handcal.core.geometry import rigid
from handcal.core.types import Float64
from handcal.rig.boards.board import BoardView
from handcal.rig.lens.fit import marginal_covariance
from handcal.rig.lens.lens import (
    Camera,
    LensModel,
    derivatives_at,
    parameters,
    solved_parameters,
    with_parameters,
)


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """A board seen by one camera in one frame."""

    frame: int
    camera: int
    seen: BoardView


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """Cameras, and the boards that they see; the first camera's frame is the common one."""

    cameras: tuple[Camera, ...]
    poses: tuple[Float64, ...]
    """each (6,); of the board of each frame in the first camera's frame: rotation vector, m."""
    place: Float64 | None = None
    """(6,); from the first to the second camera's frame: rotation vector, m."""
    shape: Float64 = field(default_factory=lambda: np.empty(0))
    """(K,); how much of each of a problem's modes the board has."""


class _Corners(NamedTuple):
    """All corners that one camera sees, sighting after sighting."""

    points_m: Float64
    modes_m: Float64
    """(N, 3, K); by how much each mode of the board moves each corner."""
    pixels: Float64
    frame: NDArray[np.int64]
    parts: list[tuple[int, int, slice]]
    """Number of each sighting, its frame, and its corners."""
    free: list[int]
    """Numbers of the camera's parameters that are solved for."""
    used: NDArray[np.int64]
    """(Q,); numbers of the shared parameters that concern this camera."""
    is_even: bool
    """True if it sees equally many corners in each frame, once."""

    def of_frames(self, rows: Float64, matrices: Float64) -> Float64:
        """Return rows (N, 3), or two for each corner, times the matrix (3, 3) of their frame."""
        if self.is_even:  # one call; many small ones take longer than the products
            even: Float64 = rows.reshape(len(matrices), -1, 3) @ matrices
            return even.reshape(-1, 3)
        found, each = np.empty_like(rows), len(rows) // max(len(self.points_m), 1)
        for _, frame, part in self.parts:
            of_part = slice(each * part.start, each * part.stop)
            found[of_part] = rows[of_part] @ matrices[frame]
        return found


class Problem:
    """The sightings, and which parameters of a setup are free.

    Parameters
    ----------
    sightings : sequence of Sighting
    lenses : sequence of LensModel or None
        Of each camera, the model whose parameters are solved for; None if they are given.
    has_place : bool
        True if the pose between the cameras is solved for.
    modes_m : (N, 3, K) float64, optional
        Ways in which the board may differ, by corners' numbers: the places are moved by
        ``modes_m @ shape``, with a prior of 0 ± 1 for each number in `Setup.shape`.
    noise_px : float
        Of a corner along each axis; weighs the prior.
    """

    def __init__(
        self,
        sightings: Sequence[Sighting],
        lenses: Sequence[LensModel | None],
        has_place: bool,
        modes_m: Float64 | None = None,
        noise_px: float = 0.0,
    ) -> None:
        self._noise_px = noise_px
        self._shape = 0 if modes_m is None else modes_m.shape[2]
        self._sightings = sightings
        self._has_place = has_place
        self._free = [[] if lens is None else solved_parameters(lens) for lens in lenses]
        ends = np.cumsum([6 * has_place, *(len(free) for free in self._free)])
        self._columns = [slice(a, b) for a, b in pairwise(ends)]
        self._count = int(ends[-1]) + self._shape
        self._frames = 1 + max(one.frame for one in sightings)
        self._corners = [
            _corners_of(
                sightings,
                camera,
                free,
                np.r_[0 : 6 * (has_place and camera > 0), columns, ends[-1] : self._count],
                self._frames,
                modes_m,
            )
            for camera, (free, columns) in enumerate(zip(self._free, self._columns, strict=True))
        ]
        coefficients = [number >= 4 for free in self._free for number in free]
        self.is_coefficient = np.array([False] * (6 * has_place) + coefficients, np.bool_)

    def minimised(
        self, setup: Setup, steps: int, least_gain: float, linear: list[Float64] | None = None
    ) -> tuple[Setup, list[Float64]]:
        """Return the setup of least squares, and `linear` of it.

        Parameters
        ----------
        setup : Setup
        steps : int
        least_gain : float
        linear : list of float64, optional
            Of the given setup, if known.
        """
        linear = self.linear(setup) if linear is None else linear
        cost, damping = self._cost(linear, setup), 1e-3
        for _ in range(steps):
            normal, enough = self._normal(linear, setup), max(damping / 10.0, 1e-12)
            while damping < 1e10:
                trial = self._moved(setup, *_step(*normal, damping))
                of_trial = self.linear(trial)
                gain = cost - self._cost(of_trial, trial)
                if gain >= 0.0:
                    break
                # Less would be refused the next time, too.
                damping = enough = 10.0 * damping
            else:
                return setup, linear
            setup, linear, cost, damping = trial, of_trial, cost - gain, enough
            if gain <= least_gain * cost:
                break
        return setup, linear

    def residuals(self, linear: Sequence[Float64]) -> list[Float64]:
        """Return detected minus predicted corners, (N, 2) each."""
        found = {}
        for corners, of_camera in zip(self._corners, linear, strict=True):
            for sighting, _, part in corners.parts:
                found[sighting] = of_camera[_rows(part), -1].reshape(-1, 2)
        return [found[number] for number in range(len(found))]

    def blocks(self, linear: Sequence[Float64]) -> tuple[tuple[Float64, Float64, Float64], ...]:
        """Return `Adjusted.blocks`."""
        parts: list[list[Float64]] = [[] for _ in range(self._frames)]
        for corners, of_camera in zip(self._corners, linear, strict=True):
            wide = np.zeros((len(of_camera), self._count + 7))
            wide[:, [*corners.used, *range(self._count, self._count + 7)]] = of_camera
            for _, frame, part in corners.parts:
                parts[frame].append(wide[_rows(part)])
        of_frames = [np.vstack(part) for part in parts]
        return tuple((one[:, :-7], one[:, -7:-1], one[:, -1]) for one in of_frames)

    def linear(self, setup: Setup) -> list[Float64]:
        """Return for each camera, (2 N, Q + 7), of each corner's x and y the derivatives.

        By the shared parameters that concern the camera and by the frame's pose; in the last column
        detected minus predicted.
        """
        found = []
        boards = np.stack(setup.poses)
        turns = boards[:, :3] if setup.place is None else np.vstack([boards, setup.place])[:, :3]
        R, J = _rotations(turns)
        for number, (camera, corners) in enumerate(zip(setup.cameras, self._corners, strict=True)):
            rows = np.empty((2 * len(corners.pixels), len(corners.used) + 7))
            found.append(rows)
            if not len(rows):
                continue
            # Board to first camera to second camera; the chain rule goes back the same way.
            of_boards = R[: len(boards)].swapaxes(1, 2)
            on_board_m = corners.points_m + corners.modes_m @ setup.shape[: self._shape]
            turned_m = corners.of_frames(on_board_m, of_boards)
            points_m = turned_m + boards[corners.frame, 3:]
            place = setup.place if number > 0 else None
            if place is not None:
                R_place, J_place = R[-1], J[-1]
                replaced_m = points_m @ R_place.T
                points_m = replaced_m + place[3:]
            pixels, by_point, by_parameters = derivatives_at(points_m, camera)
            of_place = 6 if self._has_place and place is not None else 0
            rows[:, of_place : -7 - self._shape] = by_parameters[:, corners.free]
            if place is not None:
                if of_place:
                    rows[:, :3] = _crossed(replaced_m, by_point) @ J_place
                    rows[:, 3:6] = by_point
                by_point = by_point @ R_place
            rows[:, -7:-4] = corners.of_frames(_crossed(turned_m, by_point), J[: len(boards)])
            rows[:, -4:-1] = by_point
            if self._shape:
                by_place = corners.of_frames(by_point, R[: len(boards)]).reshape(-1, 2, 3)
                by_shape = (by_place @ corners.modes_m).reshape(-1, self._shape)
                rows[:, -7 - self._shape : -7] = by_shape
            rows[:, -1] = (corners.pixels - pixels).ravel()
        return found

    def _normal(
        self, linear: Sequence[Float64], setup: Setup
    ) -> tuple[Float64, Float64, Float64, Float64, Float64]:
        """Return the blocks of the normal equations, and the gradients."""
        count = self._count
        U, W = np.zeros((count, count)), np.zeros((self._frames, count, 6))
        V, g_own = np.zeros((self._frames, 6, 6)), np.zeros((self._frames, 6))
        g_shared = np.zeros(count)
        for corners, of_camera in zip(self._corners, linear, strict=True):
            used = corners.used
            shared = of_camera[:, : len(used)].T @ of_camera
            U[np.ix_(used, used)] += shared[:, : len(used)]
            g_shared[used] += shared[:, -1]
            if corners.is_even:
                rows = of_camera.reshape(self._frames, -1, of_camera.shape[1])
                own = rows[:, :, -7:-1].swapaxes(1, 2) @ rows
            else:
                own = np.zeros((self._frames, 6, of_camera.shape[1]))
                for _, frame, part in corners.parts:
                    rows = of_camera[_rows(part)]
                    own[frame] += rows[:, -7:-1].T @ rows
            W[:, used] += own[:, :, : len(used)].swapaxes(1, 2)
            V += own[:, :, -7:-1]
            g_own += own[:, :, -1]
        if self._shape:
            places = np.arange(count - self._shape, count)
            U[places, places] += self._noise_px**2
            g_shared[places] -= self._noise_px**2 * setup.shape
        return U, W, V, g_shared, g_own

    def _cost(self, linear: Sequence[Float64], setup: Setup) -> float:
        """Return the sum of squared residuals; infinite if a prediction is not finite."""
        cost = sum(float(one[:, -1] @ one[:, -1]) for one in linear)
        if self._shape:
            cost += self._noise_px**2 * float(setup.shape @ setup.shape)
        return cost if np.isfinite(cost) else np.inf

    def foreseen(self, setup: Setup) -> tuple[Float64, Float64]:
        """Return what `foreseen` does; all detected pixels are 0."""
        count, frames = self._count, self._frames
        normal, shares = np.zeros((frames, count + 6, count + 6)), []
        for camera, corners, rows in zip(
            setup.cameras, self._corners, self.linear(setup), strict=True
        ):
            pixels = -rows[:, -1].reshape(-1, 2)
            seen = ((pixels > 0) & (pixels < [camera.width - 1, camera.height - 1])).all(axis=1)
            rows[np.repeat(~seen, 2)] = 0.0
            own = rows[:, :-1].reshape(frames, -1, rows.shape[1] - 1)
            columns = np.array([*corners.used, *range(count, count + 6)])
            normal[:, columns[:, None], columns] += own.swapaxes(1, 2) @ own
            shares.append(seen.reshape(frames, -1).mean(axis=1))
        mixed = normal[:, count:, :count]
        # A frame that shows nothing has no pose either.
        by_shared = np.linalg.solve(normal[:, count:, count:] + 1e-12 * np.eye(6), mixed)
        information = normal[:, :count, :count] - mixed.swapaxes(1, 2) @ by_shared
        return information, np.stack(shares, axis=1)

    def _moved(self, setup: Setup, shared: Float64, own: Float64) -> Setup:
        cameras = []
        for camera, free, columns in zip(setup.cameras, self._free, self._columns, strict=True):
            values = parameters(camera)
            values[free] += shared[columns]
            cameras.append(with_parameters(camera, values))
        place = setup.place
        if place is not None and self._has_place:
            place = place + shared[:6]
        poses = tuple(pose + move for pose, move in zip(setup.poses, own, strict=True))
        shape = setup.shape
        if self._shape:
            shape = shape + shared[-self._shape :]
        return Setup(tuple(cameras), poses, place, shape)


def _step(
    U: Float64, W: Float64, V: Float64, g_shared: Float64, g_own: Float64, damping: float
) -> tuple[Float64, Float64]:
    """Return the damped step of the shared parameters and of each frame's pose."""
    V = V + damping * V * np.eye(6) + 1e-12 * np.eye(6)
    solved = np.linalg.solve(V, np.concatenate([W.swapaxes(1, 2), g_own[:, :, None]], axis=2))
    by_shared, by_own = solved[:, :, :-1], solved[:, :, -1]
    if not len(g_shared):
        return g_shared, by_own
    wide = W.transpose(1, 0, 2).reshape(len(g_shared), -1)
    reduced = U + damping * np.diag(np.diag(U)) - wide @ by_shared.reshape(-1, len(g_shared))
    right = g_shared - wide @ by_own.ravel()
    scale = 1.0 / np.sqrt(np.maximum(np.diag(U), 1e-30))
    scaled = reduced * np.outer(scale, scale)
    try:
        shared = scale * np.linalg.solve(scaled, scale * right)
    except np.linalg.LinAlgError:  # a parameter that nothing depends on
        shared = scale * np.linalg.lstsq(scaled, scale * right, rcond=1e-15)[0]
    return shared, by_own - by_shared @ shared


def _corners_of(
    sightings: Sequence[Sighting],
    camera: int,
    free: list[int],
    used: NDArray[np.int64],
    frames: int,
    modes_m: Float64 | None,
) -> _Corners:
    chosen = [(number, one) for number, one in enumerate(sightings) if one.camera == camera]
    ends = np.cumsum([0, *(len(one.seen.pixels) for _, one in chosen)]).tolist()
    parts = [
        (number, one.frame, slice(*part))
        for (number, one), part in zip(chosen, pairwise(ends), strict=True)
    ]
    ids = np.concatenate([np.empty(0, np.int64), *(one.seen.ids for _, one in chosen)])
    return _Corners(
        np.concatenate([np.empty((0, 3)), *(one.seen.points_m for _, one in chosen)]),
        np.empty((len(ids), 3, 0)) if modes_m is None else modes_m[ids],
        np.concatenate([np.empty((0, 2)), *(one.seen.pixels for _, one in chosen)]),
        np.repeat(np.array([one.frame for _, one in chosen], np.int64), np.diff(ends)),
        parts,
        free,
        used,
        len({part.stop - part.start for _, _, part in parts}) == 1
        and [frame for _, frame, _ in parts] == list(range(frames)),
    )


def _rows(part: slice) -> slice:
    """Return the rows of a part's corners, two for each."""
    return slice(2 * part.start, 2 * part.stop)


def _rotations(vectors: Float64) -> tuple[Float64, Float64]:
    """Return rotation matrices (N, 3, 3) of rotation vectors (N, 3), and their left Jacobians.

    ``exp(r + δ) ≈ exp(J δ) exp(r)`` with ``J = I + (1 - cos θ)/θ² [r] + (θ - sin θ)/θ³ [r]²``
    (Chirikjian, Stochastic Models, Information Theory, and Lie Groups 2, 2012, section 10.6).
    """
    angle = np.linalg.norm(vectors, axis=1)
    small = angle < 1e-4  # the series' first terms are exact to rounding
    a = np.where(small, 1.0, angle)
    sine = np.where(small, 1.0 - angle**2 / 6.0, np.sin(a) / a)
    cosine = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(a)) / a**2)
    rest = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (a - np.sin(a)) / a**3)
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    square = cross @ cross
    sine, cosine, rest = (one[:, None, None] for one in (sine, cosine, rest))
    return (
        np.eye(3) + sine * cross + cosine * square,
        np.eye(3) + cosine * cross + rest * square,
    )


def _crossed(points: Float64, rows: Float64) -> Float64:
    """Return each point × its two rows: (N, 3), (2 N, 3) → (2 N, 3).

    A row of derivatives by a point becomes one by a small rotation of the point.
    """
    x, y, z = points.T[:, :, None]
    a, b, c = rows.reshape(-1, 2, 3).transpose(2, 0, 1)
    return np.stack([y * c - z * b, z * a - x * c, x * b - y * a], axis=-1).reshape(-1, 3)


def as_vector(T: Float64) -> Float64:
    """Return the rotation vector and translation (6,) of a transform (4, 4)."""
    return np.concatenate([cv2.Rodrigues(T[:3, :3])[0].ravel(), T[:3, 3]])


def as_transform(pose: Float64) -> Float64:
    """Return the transform (4, 4) of a rotation vector and translation (6,)."""
    return rigid(pose[:3], pose[3:])


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
