"""A frame from image files: depth aligned to colour, and the camera's intrinsics as JSON."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from handcal.errors import FileError
from handcal.files import read_json
from handcal.image_file import MAX_SIDE_PX, read_image
from handcal.types import Frame, Intrinsics


def read_frame(color: Path, depth: Path, intrinsics: Path) -> Frame:
    """Read one frame whose depth is aligned to colour.

    Parameters
    ----------
    color : Path
        PNG or JPEG, 8 bits per channel.
    depth : Path
        16-bit grey PNG of the same size, 0 where there is no measurement.
    intrinsics : Path
        JSON with ``width``, ``height``, ``fx``, ``fy``, ``cx``, ``cy`` in pixels and
        ``depth_scale`` in metres per unit of depth.

    Raises
    ------
    FileError
        If a file is missing, malformed, too large, or they do not belong together.
    """
    camera, depth_scale_m = _read_intrinsics(intrinsics)
    depth_image = read_image(depth, cv2.IMREAD_UNCHANGED)
    if depth_image.dtype != np.uint16 or depth_image.ndim != 2:
        raise FileError(f"{depth} must be a 16-bit image of one channel")
    color_image = read_image(color, cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION)
    for path, image in ((depth, depth_image), (color, color_image)):
        height, width = image.shape[:2]
        if (width, height) != (camera.width, camera.height):
            raise FileError(
                f"{path} is {width}x{height} pixels, but {intrinsics} says "
                f"{camera.width}x{camera.height}"
            )
    return Frame(
        index=0,
        t_camera_ns=0,
        t_host_ns=0,
        depth=depth_image,
        depth_scale_m=depth_scale_m,
        depth_intrinsics=camera,
        color=color_image,
        color_intrinsics=camera,
    )


def _read_intrinsics(path: Path) -> tuple[Intrinsics, float]:
    values = read_json(path)
    width, height = (_number(values, path, key, 1, MAX_SIDE_PX) for key in ("width", "height"))
    if width != int(width) or height != int(height):
        raise FileError(f"{path}: width and height must be whole numbers")
    camera = Intrinsics(
        width=int(width),
        height=int(height),
        fx=_number(values, path, "fx", 1.0, 1e5),
        fy=_number(values, path, "fy", 1.0, 1e5),
        cx=_number(values, path, "cx", -width, 2 * width),
        cy=_number(values, path, "cy", -height, 2 * height),
    )
    return camera, _number(values, path, "depth_scale", 1e-6, 0.1)


def _number(values: dict[str, Any], path: Path, key: str, low: float, high: float) -> float:
    value = values.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise FileError(f"{path} must give {key} as a number")
    if not low <= value <= high:
        raise FileError(f"{path}: {key} is {value:g}, but must lie between {low:g} and {high:g}")
    return float(value)
