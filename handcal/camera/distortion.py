"""Conversion of librealsense's lens models to OpenCV's coefficients."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from handcal.camera.sdk_devices import librealsense
from handcal.core.errors import CameraError
from handcal.core.types import Float64

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
