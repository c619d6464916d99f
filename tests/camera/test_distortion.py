"""librealsense's lens models as OpenCV's, judged by librealsense's own projection."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from handcal.camera.sdk_frames import opencv_distortion
from handcal.core.errors import CameraError
from handcal.core.geometry import image_points
from handcal.core.types import Intrinsics

rs = pytest.importorskip("pyrealsense2")

# As a D455's colour, a wide lens, and a D415's, a long one.
WIDE = (-0.055, 0.066, -0.0005, 0.0005, -0.021)
LONG = (0.15, -0.5, 0.0008, -0.0004, 0.45)


def sdk_camera(model: Any, coefficients: tuple[float, ...], focal_px: float = 640.0) -> Any:
    camera = rs.intrinsics()
    camera.width, camera.height, camera.ppx, camera.ppy = 1280, 720, 642.0, 362.0
    camera.fx = camera.fy = focal_px
    camera.model, camera.coeffs = model, list(coefficients)
    return camera


@pytest.mark.parametrize(("coefficients", "focal_px"), [(WIDE, 640.0), (LONG, 925.0)])
def test_inverse_brown_conrady_projects_as_librealsense_does(
    coefficients: tuple[float, ...], focal_px: float
) -> None:
    camera = sdk_camera(rs.distortion.inverse_brown_conrady, coefficients, focal_px)
    opencv = Intrinsics(1280, 720, focal_px, focal_px, 642.0, 362.0, opencv_distortion(camera))
    pixels = [[u, v] for u in range(0, 1280, 127) for v in range(0, 720, 71)]
    points = [rs.rs2_deproject_pixel_to_point(camera, pixel, 0.5) for pixel in pixels]
    off_px = np.abs(image_points(points, opencv) - pixels).max()
    assert off_px < 0.02
    undistorted = Intrinsics(1280, 720, focal_px, focal_px, 642.0, 362.0)
    assert np.abs(image_points(points, undistorted) - pixels).max() > 1.0  # what leaving it out is


def test_brown_conrady_is_opencvs_own() -> None:
    camera = sdk_camera(rs.distortion.brown_conrady, WIDE)
    assert opencv_distortion(camera) == pytest.approx(WIDE, rel=1e-6)


def test_without_coefficients_there_is_no_distortion() -> None:
    assert opencv_distortion(sdk_camera(rs.distortion.inverse_brown_conrady, (0.0,) * 5)) == ()


def test_a_lens_that_opencv_cannot_describe_is_refused() -> None:
    fisheye = sdk_camera(rs.distortion.ftheta, (0.9, 0.0, 0.0, 0.0, 0.0), 300.0)
    with pytest.raises(CameraError, match=r"ftheta, is unknown to OpenCV: .* px off"):
        opencv_distortion(fisheye)
