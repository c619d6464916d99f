"""Conversion of librealsense's frames, live or recorded, to handcal's values."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.camera.distortion import opencv_distortion
from handcal.core.geometry import rigid
from handcal.core.types import Float64, Frame, Intrinsics, UInt8


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
