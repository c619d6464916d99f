"""Poses and projections in the conventions of OpenGL, Unity, OpenXR and 3D Slicer.

handcal's own axes are OpenCV's, x right, y down, z forward, and its pixels have their centres at
whole numbers, so that a display's image runs from -0.5 to width - 0.5. The others:

========  ========================================  =======================================
system    axes                                      poses
========  ========================================  =======================================
OpenGL    x right, y up, z back                     column vectors
OpenXR    as OpenGL                                 quaternion and position
Unity     world x right, y up, z forward (left-     column vectors, or quaternion and position
          handed); camera space as OpenGL
Slicer    x right, y forward (anterior), z up       column vectors, mm
========  ========================================  =======================================
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from handcal.core.display import projections
from handcal.core.frozen import brief, freeze
from handcal.core.geometry import rigid
from handcal.core.types import Eye, Float64, Projection, Rig, Solved

# Each is its own inverse.
_OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
_UNITY_FROM_OPENCV = np.diag([1.0, -1.0, 1.0, 1.0])

_SLICER_FROM_OPENCV = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True, slots=True, eq=False)
class Pose:
    """A pose as OpenXR's XrPosef and Unity's Pose hold it.

    Attributes
    ----------
    position_m
        (3,); its origin.
    quaternion_xyzw
        (4,); unit length, w not negative.
    """

    position_m: Float64
    quaternion_xyzw: Float64

    def __post_init__(self) -> None:
        freeze(self, "position_m", np.float64, 3)
        freeze(self, "quaternion_xyzw", np.float64, 4)

    __repr__ = brief


@dataclass(frozen=True, slots=True)
class Fov:
    """OpenXR's XrFovf: angles from the forward axis; left and down are usually negative.

    Attributes
    ----------
    left_rad, right_rad, up_rad, down_rad
        Of the four edges of the image.
    """

    left_rad: float
    right_rad: float
    up_rad: float
    down_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class EyeCamera:
    """One eye as a camera of OpenGL or Unity; column vectors, clip space's z from -1 to +1.

    Attributes
    ----------
    projection
        (4, 4); clip space from V for OpenGL, from the eye for Unity, in OpenGL's axes of V. Its
        frustum is not symmetric.
    view_from_head
        (4, 4); V or the eye from the headset rig H, in the axes of the system.
    """

    projection: Float64
    view_from_head: Float64

    def __post_init__(self) -> None:
        freeze(self, "projection", np.float64, 4, 4)
        freeze(self, "view_from_head", np.float64, 4, 4)

    __repr__ = brief


def to_unity(
    rig: Rig, results: Solved, *, near_m: float = 0.1, far_m: float = 100.0
) -> dict[Eye, EyeCamera]:
    """Return both eyes as Unity's stereo cameras.

    `EyeCamera.projection` is for ``Camera.SetStereoProjectionMatrix``;
    `EyeCamera.view_from_head` times the head's ``worldToLocalMatrix`` is for
    ``Camera.SetStereoViewMatrix``. An eye that was not solved keeps its offline calibration.

    Parameters
    ----------
    rig : Rig
    results : Results
        From `handcal.solve`; anything with `eyes`, φ of each solved eye.
    near_m, far_m : float
        Clipping distances in front of the eye.

    Returns
    -------
    dict of eye to EyeCamera

    Raises
    ------
    ValueError
        Unless ``0 < near_m < far_m``, or if an eye would lie on or beyond its focal plane.

    Examples
    --------
    >>> import handcal
    >>> session = handcal.example_session()
    >>> unity = handcal.to_unity(session.rig, handcal.solve(session), near_m=0.2, far_m=20.0)
    >>> unity["right"].projection.shape, unity["right"].view_from_head.shape
    ((4, 4), (4, 4))
    """
    return {
        eye: unity_camera(projection, rig.eyes[eye].T_V_H, near_m, far_m)
        for eye, projection in _rendered(rig, results).items()
    }


def to_opengl(
    rig: Rig, results: Solved, *, near_m: float = 0.1, far_m: float = 100.0
) -> dict[Eye, EyeCamera]:
    """Return both eyes as OpenGL cameras: x right, y up, z back.

    The model-view matrix of a point in H is `EyeCamera.view_from_head`, from the headset rig in
    OpenGL's axes. `EyeCamera.projection` holds the eye's translation as well. Parameters and errors
    as `to_unity`.

    Examples
    --------
    >>> import handcal
    >>> session = handcal.example_session()
    >>> left = handcal.to_opengl(session.rig, handcal.solve(session))["left"]
    >>> clip = left.projection @ left.view_from_head @ [0.0, 0.0, -0.6, 1.0]
    >>> (clip[:3] / clip[3]).round(2)  # normalised device coordinates of a point in H
    array([0.13, 0.37, 0.69])
    """
    return {
        eye: EyeCamera(
            opengl_projection(projection, near_m, far_m), opengl_transform(rig.eyes[eye].T_V_H)
        )
        for eye, projection in _rendered(rig, results).items()
    }


def to_openxr(rig: Rig, results: Solved) -> dict[Eye, tuple[Pose, Fov]]:
    """Return both eyes as the pose and angles of OpenXR's XrView.

    Parameters
    ----------
    rig : Rig
    results : Results
        From `handcal.solve`; anything with `eyes`, φ of each solved eye.

    Returns
    -------
    dict of eye to (Pose, Fov)
        The pose in V, in OpenXR's axes (x right, y up, z back; metres), and the angles in rad.

    Raises
    ------
    ValueError
        If a projection has skew or rotation, which XrFovf cannot express, or an eye would lie on
        or beyond its focal plane.

    Examples
    --------
    >>> import handcal
    >>> session = handcal.example_session()
    >>> pose, fov = handcal.to_openxr(session.rig, handcal.solve(session))["left"]
    >>> (1e3 * pose.position_m).round(2)  # mm: the eye in V
    array([4.7 , 3.39, 1.09])
    """
    return {eye: openxr_view(one) for eye, one in _rendered(rig, results).items()}


def opengl_transform(T: Float64) -> Float64:
    """Convert a (4, 4) transform between OpenCV's and OpenGL's (or OpenXR's) axes, either way.

    ``F T F`` with F = diag(1, -1, -1, 1): for poses, view matrices (``T_V_W``) and UQ.
    """
    return _OPENGL_FROM_OPENCV @ T @ _OPENGL_FROM_OPENCV


def unity_world_to_camera(T_V_W: Float64) -> Float64:
    """Return Unity's ``Camera.worldToCameraMatrix``: from Unity's world to OpenGL's camera axes."""
    return _OPENGL_FROM_OPENCV @ T_V_W @ _UNITY_FROM_OPENCV


def unity_camera(projection: Projection, T_V_H: Float64, near_m: float, far_m: float) -> EyeCamera:
    """Return one eye as Unity's stereo camera, with the eye, P's centre, at the view's origin.

    The last number of its projection is 0: Unity's shaders take any other for an orthographic
    camera. Raises ValueError unless ``0 < near_m < far_m``.
    """
    P = projection.P
    eye_V_m = -np.linalg.solve(P[:, :3], P[:, 3])
    from_eye = replace(projection, P=np.column_stack([P[:, :3], np.zeros(3)]))
    view = unity_world_to_camera(rigid(translation_m=-eye_V_m) @ T_V_H)
    return EyeCamera(opengl_projection(from_eye, near_m, far_m), view)


def slicer_transform(T: Float64) -> Float64:
    """Convert a rigid (4, 4) transform to 3D Slicer's: mm, axes right, anterior, superior.

    Both of its frames are converted: right stays, forward is anterior, up is superior.
    """
    turn = rigid(_SLICER_FROM_OPENCV)
    turned = turn @ T @ turn.T
    turned[:3, 3] *= 1e3
    return turned


def slicer_points_mm(points_m: ArrayLike) -> Float64:
    """Return (N, 3) points in 3D Slicer's axes, in mm; see `slicer_transform`."""
    points: Float64 = 1e3 * np.asarray(points_m, dtype=np.float64) @ _SLICER_FROM_OPENCV.T
    return points


def opengl_projection(projection: Projection, near_m: float, far_m: float) -> Float64:
    """Return the OpenGL projection matrix; for Unity see `unity_camera`.

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


def _rendered(rig: Rig, results: Solved) -> dict[Eye, Projection]:
    return {
        eye: Projection(eye, P, rig.eyes[eye].width_px, rig.eyes[eye].height_px)
        for eye, P in projections(rig, results).items()
    }


def _metric(P: Float64) -> Float64:
    """Scale P so that its third row gives metres in front of the eye."""
    metric: Float64 = P / np.linalg.norm(P[2, :3])
    return metric
