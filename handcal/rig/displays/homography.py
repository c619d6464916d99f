"""Calibration of one eye's display, from a grid on it seen by the viewpoint camera behind it.

The display is a plane S in front of the camera, so a homography takes the camera's pixels to the
display's. Combined with the camera's lens matrix and its pose in the headset it is the off-axis
projection K H0 from the viewpoint C0 (Hu et al. 2021, homography-corrected off-axis model).

A camera is never exactly parallel to the display, but objects aligned in its image must also be
aligned on the display. So frames are undistorted and warped by the rotation between the two
(`RotationWarp`; Hu et al. 2021, assessment with eye-replacement camera).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.frozen import freeze
from handcal.core.geometry import camera_matrix, invert
from handcal.core.types import EyeDisplay, Float64, Intrinsics, UInt8
from handcal.rig.boards.views import ViewsError, require_size
from handcal.rig.displays.grid import GridView
from handcal.rig.lens.fit import CalibrationVerdict, clustered_covariance, rms
from handcal.rig.lens.lens import undistort
from handcal.rig.lens.viewpoint import ViewpointPose, plane_pose
from handcal.rig.plausible import MAX_DEVICE_SIDE_PX

# Relative standard deviation of the display's distance, or of its pixels' size.
_DISTANCE_SIGMA = 0.01
# Root mean square reprojection error in the camera: good up to the first, rejected from the second.
_GOOD_PX, _BAD_PX = 0.5, 2.0
# Largest standard deviation of the display's corners, px.
_GOOD_SIGMA_PX = 0.3
# Limit of the angle between the axes of the display and of V.
_LARGEST_TURN_RAD = 0.05
# Limit of the distance from C0 to V: the eye box.
_LARGEST_OFFSET_M = 0.02
DISPLAY_PARAMETERS = ("t_C0_V_x_m", "t_C0_V_y_m", "t_C0_V_z_m", "z_C0_S_m")
"""Parameters of `DisplayCalibration.covariance`."""


@dataclass(frozen=True, slots=True, eq=False)
class Screen:
    """The data of one eye's display that the headset itself reports."""

    width_px: int
    height_px: int
    T_V_H: Float64
    """(4, 4); from the headset rig to the rendering camera."""

    def __post_init__(self) -> None:
        freeze(self, "T_V_H", np.float64, 4, 4)
        if not (
            0 < self.width_px <= MAX_DEVICE_SIDE_PX and 0 < self.height_px <= MAX_DEVICE_SIDE_PX
        ):
            raise ValueError(f"a display has 1 to {MAX_DEVICE_SIDE_PX} pixels along each side")


@dataclass(frozen=True, slots=True)
class DisplaySettings:
    """Distance of the display, as measured or by the size of its pixels."""

    distance_m: float | None = None
    """z(C0→S) as measured, for example by the focus of the viewpoint camera."""
    pixel_m: float | None = None
    """Size of a display's pixel on S, to solve z(C0→S) from the grid: see `pixel_size_m`. Either
    this or `distance_m`."""

    def __post_init__(self) -> None:
        if (self.distance_m is None) == (self.pixel_m is None):
            raise ValueError(
                "give either the measured distance of the display or the size of its pixels"
            )
        if not (self.distance_m or self.pixel_m or 0.0) > 0.0:
            raise ValueError("the display's distance, or the size of its pixels, must be positive")


@dataclass(frozen=True, slots=True, eq=False)
class DisplayHomography:
    """The display's plane in the viewpoint camera's undistorted image."""

    H_C_S: Float64
    """(3, 3); pixels of the camera from those of the display."""
    residuals_px: Mapping[str, float]
    """Root mean square error of each view, px of the camera."""
    rms_px: float
    sigma_px: float
    """Standard deviation of the least certain corner of the display, px of the display."""

    def __post_init__(self) -> None:
        freeze(self, "H_C_S", np.float64, 3, 3)
        object.__setattr__(self, "residuals_px", MappingProxyType(dict(self.residuals_px)))


@dataclass(frozen=True, slots=True, eq=False)
class DisplayCalibration:
    """One eye's display, calibrated."""

    display: EyeDisplay
    homography: DisplayHomography
    R_S_C: Float64
    """(3, 3); from the viewpoint camera's axes to the display's."""
    turn_rad: float
    """Angle between the display's axes and V's; H0 takes it up."""
    covariance: Float64
    """(4, 4); of `DISPLAY_PARAMETERS`."""
    verdict: CalibrationVerdict

    def __post_init__(self) -> None:
        freeze(self, "R_S_C", np.float64, 3, 3)
        freeze(self, "covariance", np.float64, 4, 4)


def pixel_size_m(angle_rad: float, pixels: float, distance_m: float) -> float:
    """Return the size on S of a pixel of a grid whose angular size is known.

    Parameters
    ----------
    angle_rad : float
        Angle subtended by the grid, or by a single pixel, at the display's nominal eye point.
    pixels : float
        Number of pixels that subtend this angle.
    distance_m : float
        Distance of S from the nominal eye point, as specified by the manufacturer.
    """
    if not (0.0 < angle_rad < np.pi and pixels > 0.0 and distance_m > 0.0):
        raise ValueError("angle, pixels and distance must be positive, the angle below 180°")
    return float(2.0 * distance_m * np.tan(angle_rad / 2.0) / pixels)


def fit_homography(
    views: Mapping[str, GridView], camera: Intrinsics, width_px: int, height_px: int
) -> DisplayHomography:
    """Find the plane-induced homography between the display and a fixed camera.

    Parameters
    ----------
    views : mapping of name to GridView
    camera : Intrinsics
        The viewpoint camera; its distortion is removed first.
    width_px, height_px : int
        Size of the display.

    Raises
    ------
    ViewsError
        If there is no view, or one of another size than the camera's images.
    """
    if not views:
        raise ViewsError("no image shows the grid: darken the room, or focus on the display")
    require_size({name: view.size for name, view in views.items()}, camera)
    display_px = np.concatenate([view.display_px for view in views.values()])
    pixels = np.concatenate([undistort(view.pixels, camera) for view in views.values()])
    of_view = np.repeat(np.arange(len(views)), [len(view.pixels) for view in views.values()])
    H = np.asarray(cv2.findHomography(display_px, pixels, 0)[0], dtype=np.float64)
    off_px: Float64 = cv2.perspectiveTransform(display_px[None], H)[0] - pixels
    return DisplayHomography(
        H_C_S=H,
        residuals_px={name: rms(off_px[of_view == number]) for number, name in enumerate(views)},
        rms_px=rms(off_px),
        sigma_px=_corner_sigma_px(H, display_px, off_px, width_px, height_px),
    )


def calibrate_display(
    homography: DisplayHomography,
    camera: Intrinsics,
    viewpoint: ViewpointPose,
    screen: Screen,
    settings: DisplaySettings,
) -> DisplayCalibration:
    """Calibrate one eye's display at the viewpoint camera's place, C0.

    Parameters
    ----------
    homography : DisplayHomography
    camera : Intrinsics
        The viewpoint camera.
    viewpoint : ViewpointPose
        Its pose while it saw the grid.
    screen : Screen
    settings : DisplaySettings
    """
    T_V_C = screen.T_V_H @ viewpoint.T_H_C
    R_S_C, C0_S_px = pose_before(homography, camera, screen.width_px, screen.height_px)
    focal_px = -float(C0_S_px[2])  # C0's distance from S, in the display's pixels
    K = np.array(
        [
            [focal_px, 0.0, (screen.width_px - 1) / 2.0],
            [0.0, focal_px, (screen.height_px - 1) / 2.0],
            [0.0, 0.0, 1.0],
        ]
    )
    off_axis = np.linalg.solve(homography.H_C_S, camera_matrix(camera)) @ invert(T_V_C)[:3, :3]
    z_C0_S_m = focal_px * settings.pixel_m if settings.pixel_m else settings.distance_m
    assert z_C0_S_m is not None, "DisplaySettings sees to it"
    display = EyeDisplay(
        K=K,
        H0=np.linalg.solve(K, off_axis / off_axis[2, 2]),
        t_C0_V_m=-T_V_C[:3, 3],
        z_C0_S_m=z_C0_S_m,
        width_px=screen.width_px,
        height_px=screen.height_px,
        T_V_H=screen.T_V_H,
    )
    turn_rad = float(Rotation.from_matrix(R_S_C @ invert(T_V_C)[:3, :3]).magnitude())
    covariance = np.zeros((4, 4))
    R_V_H = screen.T_V_H[:3, :3]
    covariance[:3, :3] = R_V_H @ viewpoint.covariance[3:, 3:] @ R_V_H.T
    covariance[3, 3] = (_DISTANCE_SIGMA * z_C0_S_m) ** 2
    return DisplayCalibration(
        display=display,
        homography=homography,
        R_S_C=R_S_C,
        turn_rad=turn_rad,
        covariance=0.5 * (covariance + covariance.T),
        verdict=_judge(display, homography, viewpoint.verdict, turn_rad),
    )


def pose_before(
    homography: DisplayHomography, camera: Intrinsics, width_px: int, height_px: int
) -> tuple[Float64, Float64]:
    """Return R_S_C by PnP, and the camera's position in S: in pixels, from the display's first."""
    width, height = width_px - 1.0, height_px - 1.0
    corners_px = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    seen_px = cv2.perspectiveTransform(corners_px[None], homography.H_C_S)[0]
    undistorted = replace(camera, distortion=())
    points_px = np.column_stack([corners_px, np.zeros(4)])
    T_S_C = invert(plane_pose(points_px, seen_px, undistorted))
    return T_S_C[:3, :3], T_S_C[:3, 3]


def _corner_sigma_px(
    H: Float64, display_px: Float64, off_px: Float64, width_px: int, height_px: int
) -> float:
    """Propagate the corners' errors, repeated in every image, to the display's own corners."""
    same = np.unique(display_px, axis=0, return_inverse=True)[1].ravel()
    # The display's pixels are scaled to about 1: otherwise the normal equations lose precision.
    scale = float(max(width_px, height_px))
    H = H @ np.diag([scale, scale, 1.0])
    J = _jacobian(H, display_px / scale)
    covariance = clustered_covariance(J, off_px.ravel(), np.repeat(same, 2))
    corners_px = np.array([[x, y] for x in (0, width_px - 1) for y in (0, height_px - 1)])
    J = _jacobian(H, corners_px / scale).reshape(4, 2, 8)
    variances_px2 = np.einsum("kia,ab,kib->k", J, covariance, J)
    camera_px_per_px = np.linalg.norm(H[:2, :2]) / scale / np.sqrt(2.0) / H[2, 2]
    return float(np.sqrt(variances_px2.max()) / camera_px_per_px)


def _jacobian(H: Float64, points: Float64) -> Float64:
    """Return (2N, 8): derivatives of the mapped points by all elements of H except the last."""
    homogeneous = np.column_stack([points, np.ones(len(points))])
    mapped = homogeneous @ H.T
    weights = homogeneous / mapped[:, 2:]
    J = np.zeros((len(points), 2, 8))
    J[:, 0, 0:3] = J[:, 1, 3:6] = weights
    J[:, :, 6:8] = -(mapped[:, :2] / mapped[:, 2:])[:, :, None] * weights[:, None, :2]
    return J.reshape(-1, 8)


def _judge(
    display: EyeDisplay,
    homography: DisplayHomography,
    viewpoint: CalibrationVerdict,
    turn_rad: float,
) -> CalibrationVerdict:
    residuals_px = homography.residuals_px
    worst = max(residuals_px, key=lambda name: residuals_px[name])
    residual = f"residual {homography.rms_px:.2f} px ({worst} {residuals_px[worst]:.2f} px)"
    offset_m = float(np.linalg.norm(display.t_C0_V_m))
    if homography.rms_px > _BAD_PX:
        return CalibrationVerdict(
            "bad",
            f"the grid does not lie on a plane, {residual}: the camera moved between the images, "
            "or its intrinsics are not these",
        )
    if turn_rad > _LARGEST_TURN_RAD:
        return CalibrationVerdict(
            "bad",
            f"the display is turned by {np.degrees(turn_rad):.1f}° from the headset's own view: "
            "left and right exchanged, a mirrored image, or poses of another camera place",
        )
    if offset_m > _LARGEST_OFFSET_M:
        return CalibrationVerdict(
            "bad",
            f"the camera was {1e3 * offset_m:.0f} mm from the headset's own viewpoint: left and "
            "right exchanged, poses of another camera place, or a wrong side of the board's "
            "squares",
        )
    if viewpoint.name != "good":
        return viewpoint
    if homography.rms_px > _GOOD_PX or homography.sigma_px > _GOOD_SIGMA_PX:
        return CalibrationVerdict(
            "needs more views",
            f"the display's corners are known to {homography.sigma_px:.2f} px, {residual}: take "
            "more images of the grid, or show it on more of the display",
        )
    return CalibrationVerdict(
        "good", f"the display's corners are known to {homography.sigma_px:.2f} px; {residual}"
    )


class RotationWarp:
    """Undistorts and rotates frames of one camera; the pixel map is computed once.

    Parameters
    ----------
    camera : Intrinsics
        Intrinsics of the frames; warped frames have the same, without distortion.
    R_S_C : (3, 3) float64
        From the camera's axes to the display's.
    """

    def __init__(self, camera: Intrinsics, R_S_C: Float64) -> None:
        self._size = camera.height, camera.width
        K = camera_matrix(camera)
        self._x, self._y = cv2.initUndistortRectifyMap(
            K,
            np.array(camera.distortion),
            R_S_C,
            K,
            (camera.width, camera.height),
            cv2.CV_16SC2,
        )

    def warp(self, frame: UInt8) -> UInt8:
        """Return a frame, (H, W) or (H, W, 3) uint8, as seen along the display's axes.

        Raises
        ------
        ValueError
            If it does not have the camera's size.
        """
        if frame.shape[:2] != self._size:
            height, width = self._size
            raise ValueError(
                f"the frame is {frame.shape[1]}×{frame.shape[0]}, the camera {width}×{height}"
            )
        warped = cv2.remap(frame, self._x, self._y, cv2.INTER_LINEAR)
        return warped.astype(np.uint8, copy=False)
