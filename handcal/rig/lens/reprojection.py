"""Reprojection errors of boards that cameras see, and their least squares.

Levenberg-Marquardt on the normal equations, reduced to the shared parameters by the Schur
complement (Triggs et al., "Bundle adjustment: a modern synthesis", 2000).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.geometry import rigid
from handcal.core.types import Float64
from handcal.rig.boards.board import BoardView
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
