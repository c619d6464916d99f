"""The filtered pose of a cube that is put down, stays there, and is moved again."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.frozen import freeze
from handcal.core.geometry import interpolate_pose, transform
from handcal.core.types import Float64
from handcal.rig.cube.cube import Cube, face_pose

_AROUND = 0.5 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
_SMOOTHING_S = 0.3
"""Time constant while the cube moves slowly, and at most that many seconds at rest."""
_JUMP_M, _JUMP_RAD = 0.01, 0.07
"""A measured pose this far from the filtered one starts the filter again."""
_REST_NS = 600_000_000
"""The cube is at rest if its measured poses stayed together for this time."""
_REST_M, _REST_RAD = 0.004, 0.03
"""Largest distance of a measured pose from the filtered one at rest."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackedCube:
    """The filtered pose of the cube at the time of one frame."""

    t_ns: int
    """On the camera's clock, whose intervals do not change while its latency is estimated."""
    T_W_T: Float64
    """(4, 4); from the cube's frame to the world."""
    is_at_rest: bool
    frames: int
    """Number of frames since the filter started."""

    def __post_init__(self) -> None:
        freeze(self, "T_W_T", np.float64, 4, 4)


class CubeFilter:
    """An exponential filter of poses that starts again when the cube has been moved.

    The n-th pose after a start has the weight 1/n, or that of the time constant if it is larger: a
    mean first, which then forgets.
    """

    def __init__(self) -> None:
        self._newest: TrackedCube | None = None
        self._recent: deque[tuple[int, Float64]] = deque()

    def take(self, T_W_T: Float64, t_ns: int) -> TrackedCube:
        """Return the filtered pose after a measured one, (4, 4); the time is the camera's."""
        before = self._newest
        if (
            before is None
            or t_ns < before.t_ns  # the camera has started again
            or not _near(T_W_T, before.T_W_T, _JUMP_M, _JUMP_RAD)
        ):
            self._recent.clear()
            filtered = TrackedCube(t_ns, T_W_T, False, 1)
        else:
            passed_s = 1e-9 * (t_ns - before.t_ns)
            weight = max(1.0 / (before.frames + 1), 1.0 - float(np.exp(-passed_s / _SMOOTHING_S)))
            pose = interpolate_pose(before.T_W_T, T_W_T, min(weight, 1.0))
            filtered = TrackedCube(t_ns, pose, False, before.frames + 1)
        self._recent.append((t_ns, T_W_T))
        while len(self._recent) > 1 and self._recent[1][0] <= t_ns - _REST_NS:
            self._recent.popleft()
        is_at_rest = t_ns - self._recent[0][0] >= _REST_NS and all(
            _near(T, filtered.T_W_T, _REST_M, _REST_RAD) for _, T in self._recent
        )
        self._newest = replace(filtered, is_at_rest=is_at_rest)
        return self._newest


def cube_corners_m(cube: Cube) -> Float64:
    """Return the cube's vertices, (8, 3) in its frame: the front face, then the back behind it."""
    around_m, inwards_m = cube.side_m * _AROUND, np.array([0.0, 0.0, 0.5 * cube.side_m])
    return np.concatenate([around_m - inwards_m, around_m + inwards_m])


def facing_corners_m(cube: Cube, T_E_T: Float64) -> Float64:
    """Return the vertices of the face that faces the origin of E most, (4, 3) in the cube's frame.

    In order around the face, from the upper left of its print.
    """

    def facing(marker: int) -> float:
        T_E_face = T_E_T @ face_pose(cube, marker)
        return float(T_E_face[:3, 2] @ T_E_face[:3, 3] / np.linalg.norm(T_E_face[:3, 3]))

    return transform(face_pose(cube, max(cube.ids, key=facing)), cube.side_m * _AROUND)


def _near(a: Float64, b: Float64, apart_m: float, apart_rad: float) -> bool:
    turned_rad = Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).magnitude()
    return bool(np.linalg.norm(a[:3, 3] - b[:3, 3]) <= apart_m and turned_rad <= apart_rad)
