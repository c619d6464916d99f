"""Conversion of librealsense's frames and lenses, live or recorded, to handcal's values."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.camera.sdk_devices import librealsense
from handcal.core.errors import CameraError
from handcal.core.geometry import rigid
from handcal.core.types import Float64, Frame, Intrinsics, UInt8

_COLUMNS, _ROWS = 33, 19
_LARGEST_ERROR_PX = 0.25


def opencv_distortion(camera: Any) -> tuple[float, ...]:
    """Return OpenCV's k1, k2, p1, p2, k3 for an SDK stream; empty without distortion.

    Only Brown-Conrady is a model of OpenCV. RealSense colour is labelled "inverse Brown-Conrady"
    and documented as undistorting, but librealsense uses it as a distortion, also to align depth to
    colour. So the coefficients are fitted to librealsense's own projection, linearly, at rays
    across the image.

    Raises
    ------
    CameraError
        If no coefficients agree with librealsense's projection within 0.25 px.
    """
    if not any(camera.coeffs):
        return ()
    if camera.model == librealsense().distortion.brown_conrady:
        return tuple(camera.coeffs)
    pinhole = camera.width, camera.height, camera.fx, camera.fy, camera.ppx, camera.ppy
    coefficients, error_px = _fit(camera.model, pinhole, tuple(camera.coeffs))
    if error_px > _LARGEST_ERROR_PX:
        raise CameraError(
            f"this camera's lens model, {camera.model.name}, is unknown to OpenCV: "
            f"the best fit is {error_px:.1f} px off",
            "choose another camera",
        )
    return coefficients


@lru_cache(maxsize=16)  # called for every frame
def _fit(
    model: Any, pinhole: tuple[int, int, float, float, float, float], coeffs: tuple[float, ...]
) -> tuple[tuple[float, ...], float]:
    """Return the best-fitting coefficients of a lens model, and their largest error in pixels."""
    rs = librealsense()
    camera = rs.intrinsics()
    camera.width, camera.height, camera.fx, camera.fy, camera.ppx, camera.ppy = pinhole
    camera.model, camera.coeffs = model, list(coeffs)
    u, v = np.meshgrid(
        np.linspace(0, camera.width - 1, _COLUMNS), np.linspace(0, camera.height - 1, _ROWS)
    )
    focal_px, center_px = np.array([camera.fx, camera.fy]), np.array([camera.ppx, camera.ppy])
    rays = (np.stack([u.ravel(), v.ravel()], axis=1) - center_px) / focal_px
    distorted_px = [rs.rs2_project_point_to_pixel(camera, [x, y, 1.0]) for x, y in rays.tolist()]
    moved = (np.array(distorted_px) - center_px) / focal_px - rays
    scale_px = np.repeat(focal_px, len(rays))
    columns = scale_px[:, None] * _displacements(rays)
    wanted_px = scale_px * moved.T.ravel()
    found = np.linalg.lstsq(columns, wanted_px)[0]
    return tuple(found.tolist()), float(np.abs(columns @ found - wanted_px).max())


def _displacements(rays: Float64) -> Float64:
    """Return the derivatives of (N, 2) rays by the coefficients: (2N, 5), x before y."""
    x, y = rays.T
    r2 = x * x + y * y
    along_x = [x * r2, x * r2**2, 2 * x * y, r2 + 2 * x * x, x * r2**3]
    along_y = [y * r2, y * r2**2, r2 + 2 * y * y, 2 * x * y, y * r2**3]
    columns: Float64 = np.concatenate([np.transpose(along_x), np.transpose(along_y)])
    return columns


def frame_of(depth: Any, intrinsics: Intrinsics) -> Frame:
    """Return a frame without colour from a depth frame that has just arrived."""
    return Frame(
        index=depth.get_frame_number(),
        t_camera_ns=round(depth.get_timestamp() * 1e6),
        t_host_ns=time.monotonic_ns(),
        depth=np.array(depth.get_data(), np.uint16),
        depth_scale_m=depth.get_units(),
        depth_intrinsics=intrinsics,
    )


def with_color(frame: Frame, color: Any, T_C_D: Float64) -> Frame:
    """Return `frame` with the image of a colour frame; unchanged if the format is not colour."""
    image = _rgb(color)
    if image is None:
        return frame
    return replace(frame, color=image, color_intrinsics=intrinsics_of(color.profile), T_C_D=T_C_D)


def apart_ms(one: Any, other: Any) -> float:
    """Return the time between two SDK frames; infinite if their clocks differ."""
    if one.get_frame_timestamp_domain() != other.get_frame_timestamp_domain():
        return math.inf
    return abs(float(one.get_timestamp() - other.get_timestamp()))


def intrinsics_of(profile: Any) -> Intrinsics:
    """Return a stream's intrinsics, distortion included.

    Raises
    ------
    CameraError
        If OpenCV has no matching lens model.
    """
    camera = profile.as_video_stream_profile().get_intrinsics()
    return Intrinsics(
        camera.width,
        camera.height,
        camera.fx,
        camera.fy,
        camera.ppx,
        camera.ppy,
        opencv_distortion(camera),
    )


def extrinsics_between(source: Any, target: Any) -> Float64:
    """Return ``T_target_source`` of two streams, (4, 4)."""
    extrinsics = source.get_extrinsics_to(target)
    return rigid(np.reshape(extrinsics.rotation, (3, 3)).T, extrinsics.translation)  # column-major


def _rgb(color: Any) -> UInt8 | None:
    """Copy a colour frame as RGB; None for a format that is not colour."""
    image: NDArray[Any] = np.asanyarray(color.get_data())
    match color.profile.format().name:
        case "rgb8":
            return np.array(image)
        case "bgr8":
            return np.array(image[..., ::-1])
        case "yuyv":
            packed = image.view(np.uint8).reshape(*image.shape[:2], 2)
            return np.array(cv2.cvtColor(packed, cv2.COLOR_YUV2RGB_YUYV), np.uint8)
        case _:
            return None
