"""Bundle adjustment of cameras, their relative pose, and the boards that they see.

Levenberg-Marquardt on the normal equations, reduced to the shared parameters by the Schur
complement (Triggs et al., "Bundle adjustment: a modern synthesis", 2000). Single corners whose
residuals differ from those beside them are left out. A wrong lens model does not look like that:
its residuals change smoothly over the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from handcal.geometry import rigid
from handcal.rig.board import BoardView
from handcal.rig.fit import marginal_covariance
from handcal.rig.lens import (
    Camera,
    LensModel,
    parameters,
    predict,
    solved_parameters,
    with_parameters,
)
from handcal.types import Float64

_MAX_STEPS = 100
_LEAST_GAIN = 1e-8
_STRAY_SIGMAS = 10.0
# Of a view, and of all: more indicate a fault of the view or of the lens model.
_MAX_STRAY_SHARES = 0.1, 0.01
_LEAST_SIGMA_PX = 0.01
_NEIGHBOURS = 6
_ROUNDS = 3
_COEFFICIENT_SIGMA = 10.0


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
    """(P,); which shared parameters are a lens's coefficients."""

    @property
    def rms_px(self) -> float:
        """Root mean square distance between detected and predicted corners, of those kept."""
        square = np.concatenate([self.off_px[n][kept] for n, kept in enumerate(self.kept)])
        return float(np.sqrt(np.mean(np.sum(square**2, axis=1))))

    @property
    def left_out(self) -> int:
        """Number of corners left out."""
        return int(sum((~kept).sum() for kept in self.kept))

    def covariance(self) -> Float64 | None:
        """Return the covariance of the shared parameters; None if they are not determined.

        They are the second camera's pose and the solved parameters of each camera, in this order.
        A coefficient that the views do not determine is taken as 0 ± `_COEFFICIENT_SIGMA`.
        """
        residuals = np.concatenate([block[2] for block in self.blocks])
        sigma_px = float(np.sqrt(np.mean(residuals**2)))
        prior = np.where(self.is_coefficient, sigma_px / _COEFFICIENT_SIGMA, 0.0)
        blocks = [block[:2] for block in self.blocks]
        return marginal_covariance(
            [*blocks, (np.diag(prior), np.empty((len(prior), 0)))], residuals
        )


def adjust(
    sightings: Sequence[Sighting],
    setup: Setup,
    lenses: Sequence[LensModel | None],
    *,
    solve_place: bool = True,
    steps: int = _MAX_STEPS,
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
    """
    kept = [np.ones(len(one.seen.pixels), np.bool_) for one in sightings]
    beside = [_beside(one.seen) for one in sightings]
    problem = _Problem(sightings, lenses, solve_place and setup.place is not None)
    for _ in range(_ROUNDS):
        setup = problem.minimised(setup, kept, steps)
        off_px = problem.residuals(setup)
        before, kept = kept, _regular(off_px, beside)
        if all(np.array_equal(old, new) for old, new in zip(before, kept, strict=True)):
            break
    return Adjusted(
        setup,
        tuple(off_px),
        tuple(before),
        problem.blocks(setup, before),
        problem.is_coefficient,
    )


def linearised(
    sightings: Sequence[Sighting], setup: Setup, lenses: Sequence[LensModel | None]
) -> tuple[tuple[Float64, Float64, Float64], ...]:
    """Return `Adjusted.blocks` of a setup as it is, with the second camera's pose as unknown."""
    kept = [np.ones(len(one.seen.pixels), np.bool_) for one in sightings]
    return _Problem(sightings, lenses, setup.place is not None).blocks(setup, kept)


def _beside(seen: BoardView) -> NDArray[np.int64]:
    """Return the numbers of the corners nearest to each corner, (N, K)."""
    count = min(_NEIGHBOURS, len(seen.pixels) - 1)
    return np.asarray(cKDTree(seen.pixels).query(seen.pixels, k=count + 1)[1])[:, 1:]


def _regular(
    off_px: Sequence[Float64], beside: Sequence[NDArray[np.int64]]
) -> list[NDArray[np.bool_]]:
    """Return which corners to keep: all if too many are far off."""
    alone_px = [
        off - np.median(off[near], axis=1) for off, near in zip(off_px, beside, strict=True)
    ]
    sigma_px = 1.4826 * float(np.median(np.abs(np.concatenate(alone_px))))
    limit_px = _STRAY_SIGMAS * max(_LEAST_SIGMA_PX, sigma_px)
    strays = [np.linalg.norm(alone, axis=1) > limit_px for alone in alone_px]
    of_view, of_all = _MAX_STRAY_SHARES
    is_few = np.concatenate(strays).mean() <= of_all
    return [~(stray & is_few & (stray.mean() <= of_view)) for stray in strays]


class _Problem:
    """The sightings, and which parameters of a setup are free."""

    def __init__(
        self, sightings: Sequence[Sighting], lenses: Sequence[LensModel | None], has_place: bool
    ) -> None:
        self._sightings = sightings
        self._has_place = has_place
        self._free = [[] if lens is None else solved_parameters(lens) for lens in lenses]
        ends = np.cumsum([6 * has_place, *(len(free) for free in self._free)])
        self._columns = [slice(a, b) for a, b in pairwise(ends)]
        self._count = int(ends[-1])
        coefficients = [number >= 4 for free in self._free for number in free]
        self.is_coefficient = np.array([False] * (6 * has_place) + coefficients, np.bool_)

    def minimised(self, setup: Setup, kept: Sequence[NDArray[np.bool_]], steps: int) -> Setup:
        """Return the setup of least squares."""
        cost = _cost(self.residuals(setup), kept)
        damping = 1e-3
        for _ in range(steps):
            normal = self._normal(setup, kept)
            while damping < 1e10:
                trial = self._moved(setup, *_step(*normal, damping))
                gain = cost - _cost(self.residuals(trial), kept)
                if gain >= 0.0:
                    break
                damping *= 10.0
            else:
                return setup
            setup, cost, damping = trial, cost - gain, max(damping / 10.0, 1e-12)
            if gain <= _LEAST_GAIN * cost:
                break
        return setup

    def residuals(self, setup: Setup) -> list[Float64]:
        """Return detected minus predicted corners, (N, 2) each."""
        return [
            one.seen.pixels
            - predict(
                one.seen.points_m, board_in(setup, one.frame, one.camera), setup.cameras[one.camera]
            )[0]
            for one in self._sightings
        ]

    def blocks(
        self, setup: Setup, kept: Sequence[NDArray[np.bool_]]
    ) -> tuple[tuple[Float64, Float64, Float64], ...]:
        """Return `Adjusted.blocks`."""
        parts: list[list[tuple[Float64, Float64, Float64]]] = [[] for _ in setup.poses]
        for one, keep in zip(self._sightings, kept, strict=True):
            shared, own, off_px = self._linear(setup, one)
            rows = np.repeat(keep, 2)
            parts[one.frame].append((shared[rows], own[rows], off_px.ravel()[rows]))
        return tuple(
            (
                np.vstack([a for a, _, _ in part]),
                np.vstack([b for _, b, _ in part]),
                np.concatenate([c for _, _, c in part]),
            )
            for part in parts
        )

    def _linear(self, setup: Setup, one: Sighting) -> tuple[Float64, Float64, Float64]:
        """Return derivatives by the shared parameters and the frame's pose, and residuals."""
        camera = setup.cameras[one.camera]
        pixels, by = predict(one.seen.points_m, board_in(setup, one.frame, one.camera), camera)
        shared = np.zeros((len(by), self._count))
        own = by[:, :6]
        if one.camera > 0 and setup.place is not None:
            by_board, by_place = _composed(setup.poses[one.frame], setup.place)
            if self._has_place:
                shared[:, :6] = own @ by_place
            own = own @ by_board
        free = [6 + number for number in self._free[one.camera]]
        shared[:, self._columns[one.camera]] = by[:, free]
        return shared, own, one.seen.pixels - pixels

    def _normal(
        self, setup: Setup, kept: Sequence[NDArray[np.bool_]]
    ) -> tuple[Float64, Float64, Float64, Float64, Float64]:
        """Return the blocks of the normal equations, and the gradients."""
        frames, count = len(setup.poses), self._count
        U, V = np.zeros((count, count)), np.zeros((frames, 6, 6))
        W, g_shared, g_own = np.zeros((frames, count, 6)), np.zeros(count), np.zeros((frames, 6))
        for one, keep in zip(self._sightings, kept, strict=True):
            shared, own, off_px = self._linear(setup, one)
            rows = np.repeat(keep, 2)
            shared, own, residuals = shared[rows], own[rows], off_px.ravel()[rows]
            U += shared.T @ shared
            W[one.frame] += shared.T @ own
            V[one.frame] += own.T @ own
            g_shared += shared.T @ residuals
            g_own[one.frame] += own.T @ residuals
        return U, W, V, g_shared, g_own

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
        return replace(setup, cameras=tuple(cameras), poses=poses, place=place)


def board_in(setup: Setup, frame: int, camera: int) -> Float64:
    """Return the board's pose (6,) in a camera's frame."""
    board = setup.poses[frame]
    if camera == 0 or setup.place is None:
        return board
    rotation, translation = cv2.composeRT(board[:3], board[3:], setup.place[:3], setup.place[3:])[
        :2
    ]
    return np.concatenate([rotation.ravel(), translation.ravel()])


def _step(
    U: Float64, W: Float64, V: Float64, g_shared: Float64, g_own: Float64, damping: float
) -> tuple[Float64, Float64]:
    """Return the damped step of the shared parameters and of each frame's pose."""
    V = V + damping * V * np.eye(6) + 1e-12 * np.eye(6)
    solved = np.linalg.solve(V, np.concatenate([W.swapaxes(1, 2), g_own[:, :, None]], axis=2))
    by_shared, by_own = solved[:, :, :-1], solved[:, :, -1]
    if not len(g_shared):
        return g_shared, by_own
    reduced = U + damping * np.diag(np.diag(U)) - np.einsum("fpk,fkq->pq", W, by_shared)
    right = g_shared - np.einsum("fpk,fk->p", W, by_own)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(U), 1e-30))
    scaled = reduced * np.outer(scale, scale)
    shared = scale * np.linalg.lstsq(scaled, scale * right, rcond=1e-15)[0]
    return shared, by_own - by_shared @ shared


def _cost(off_px: Sequence[Float64], kept: Sequence[NDArray[np.bool_]]) -> float:
    """Return the sum of squares of the corners kept; infinite if a prediction is not finite."""
    cost = sum(float(np.sum(off[keep] ** 2)) for off, keep in zip(off_px, kept, strict=True))
    return cost if np.isfinite(cost) else np.inf


def _composed(board: Float64, place: Float64) -> tuple[Float64, Float64]:
    """Return the derivatives (6, 6) of the board's pose in the second camera by the two poses."""
    (_, _, r_r1, r_t1, r_r2, r_t2, t_r1, t_t1, t_r2, t_t2) = cv2.composeRT(
        board[:3], board[3:], place[:3], place[3:]
    )
    return np.block([[r_r1, r_t1], [t_r1, t_t1]]), np.block([[r_r2, r_t2], [t_r2, t_t2]])


def as_vector(T: Float64) -> Float64:
    """Return the rotation vector and translation (6,) of a transform (4, 4)."""
    return np.concatenate([cv2.Rodrigues(T[:3, :3])[0].ravel(), T[:3, 3]])


def as_transform(pose: Float64) -> Float64:
    """Return the transform (4, 4) of a rotation vector and translation (6,)."""
    return rigid(pose[:3], pose[3:])
