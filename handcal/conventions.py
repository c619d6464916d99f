"""Poses and projections in the conventions of OpenGL, Unity, WinRT and OpenXR.

handcal's own axes are OpenCV's, x right, y down, z forward, and its pixels have their centres at
whole numbers, so that a display's image runs from -0.5 to width - 0.5. The others:

========  ========================================  =======================================
system    axes                                      poses
========  ========================================  =======================================
OpenGL    x right, y up, z back                     column vectors
OpenXR    as OpenGL                                 quaternion and position
WinRT     as OpenGL                                 row vectors: the transpose
Unity     world x right, y up, z forward (left-     column vectors, or quaternion and position
          handed); camera space as OpenGL
========  ========================================  =======================================
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.geometry import rigid
from handcal.types import Float64, Projection, freeze

# Each is its own inverse.
_OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
_UNITY_FROM_OPENCV = np.diag([1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """A pose as OpenXR's XrPosef and Unity's Pose hold it."""

    position_m: Float64
    """(3,)."""
    quaternion_xyzw: Float64
    """(4,); unit length, w not negative."""

    def __post_init__(self) -> None:
        freeze(self, "position_m", np.float64, 3)
        freeze(self, "quaternion_xyzw", np.float64, 4)


@dataclass(frozen=True, slots=True)
class Fov:
    """OpenXR's XrFovf: angles from the forward axis; left and down are usually negative."""

    left_rad: float
    right_rad: float
    up_rad: float
    down_rad: float


def opengl_transform(T: Float64) -> Float64:
    """Convert a (4, 4) transform between OpenCV's and OpenGL's (or OpenXR's) axes, either way.

    ``F T F`` with F = diag(1, -1, -1, 1): for poses, view matrices (``T_V_W``) and UQ alike.
    """
    return _OPENGL_FROM_OPENCV @ T @ _OPENGL_FROM_OPENCV


def winrt_transform(T: Float64) -> Float64:
    """Convert a (4, 4) transform to WinRT's Matrix4x4: OpenGL's axes, row vectors."""
    return opengl_transform(T).T


def unity_transform(T: Float64) -> Float64:
    """Convert a (4, 4) transform between OpenCV's axes and Unity's left-handed ones, either way.

    ``G T G`` with G = diag(1, -1, 1, 1), which is ``S (F T F) S`` with S = diag(1, 1, -1, 1).
    """
    return _UNITY_FROM_OPENCV @ T @ _UNITY_FROM_OPENCV


def unity_world_to_camera(T_V_W: Float64) -> Float64:
    """Return Unity's ``Camera.worldToCameraMatrix``: from Unity's world to OpenGL's camera axes."""
    return _OPENGL_FROM_OPENCV @ T_V_W @ _UNITY_FROM_OPENCV


def opengl_projection(projection: Projection, near_m: float, far_m: float) -> Float64:
    """Return the OpenGL projection matrix, which Unity's stereo cameras take as well.

    Parameters
    ----------
    projection : Projection
    near_m, far_m : float
        Distances in front of the eye that map to z = -1 and +1 in normalised device coordinates.

    Returns
    -------
    (4, 4) float64
        From OpenGL's axes in V to clip space, including the eye's translation.

    Raises
    ------
    ValueError
        Unless ``0 < near_m < far_m``.
    """
    if not 0 < near_m < far_m < np.inf:
        raise ValueError(f"0 < near_m < far_m is needed, got {near_m} and {far_m}")
    u, v, depth = _metric(projection.P)
    z_scale = (far_m + near_m) / (far_m - near_m)
    z_offset = -2.0 * far_m * near_m / (far_m - near_m)
    clip = np.stack(
        [
            2.0 * (u + 0.5 * depth) / projection.width_px - depth,
            depth - 2.0 * (v + 0.5 * depth) / projection.height_px,
            z_scale * depth + [0.0, 0.0, 0.0, z_offset],
            depth,
        ]
    )
    return clip @ _OPENGL_FROM_OPENCV


def pose(T: Float64) -> Pose:
    """Split a rigid (4, 4) transform, already in the other system's axes, into a `Pose`."""
    rotation = Rotation.from_matrix(T[:3, :3])
    return Pose(T[:3, 3], rotation.as_quat(canonical=True))


def openxr_view(projection: Projection) -> tuple[Pose, Fov]:
    """Return an eye's view for OpenXR: its pose in V, in OpenXR's axes, and its field of view.

    OpenXR allows only a frustum that is perpendicular to its pose. The shifted eye of this model
    has one, at the centre of projection of P. A P with skew or rotation does not.

    Raises
    ------
    ValueError
        If P has skew or rotation, which XrFovf cannot express.
    """
    P = _metric(projection.P)
    K = P[:, :3]
    (fx, skew, cx), (v_from_x, fy, cy), (depth_from_x, depth_from_y, _) = K
    if not np.allclose([skew / fx, v_from_x / fy, depth_from_x, depth_from_y], 0.0, atol=1e-9):
        raise ValueError("OpenXR cannot express this projection: it has skew or rotation")
    eye_m = -np.linalg.solve(K, P[:, 3])
    fov = Fov(
        left_rad=float(np.arctan((-0.5 - cx) / fx)),
        right_rad=float(np.arctan((projection.width_px - 0.5 - cx) / fx)),
        up_rad=float(np.arctan((cy + 0.5) / fy)),
        down_rad=float(np.arctan((cy + 0.5 - projection.height_px) / fy)),
    )
    return pose(opengl_transform(rigid(translation_m=eye_m))), fov


def _metric(P: Float64) -> Float64:
    """Scale P so that its third row gives metres in front of the eye."""
    metric: Float64 = P / np.linalg.norm(P[2, :3])
    return metric
