"""Frames read from image files, with the camera's intrinsics as JSON."""

from __future__ import annotations

import math
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.errors import FileError
from handcal.core.types import Frame, Intrinsics, UInt8, UInt16
from handcal.io.files import make_folder, write_atomic, write_json
from handcal.io.images import MAX_SIDE_PX, read_image, write_png
from handcal.rig.formats import read_fields, read_intrinsics

DEPTH_SCALES_M = 1e-6, 0.1
"""Least and largest plausible depth scale, metres per unit."""
DISTORTION_COUNTS = 0, 4, 5, 8, 12, 14
"""Numbers of coefficients of OpenCV's lens models."""


def read_frame(
    color: str | PathLike[str],
    depth: str | PathLike[str],
    intrinsics: str | PathLike[str],
    depth_scale_m: float | None = None,
) -> Frame:
    """Read one frame whose depth is aligned to colour.

    Parameters
    ----------
    color : path
        PNG, JPEG, TIFF, BMP or PPM.
    depth : path
        16-bit grey PNG, TIFF or PGM of the same size; 0 where there is no measurement.
    intrinsics : path
        JSON with ``width``, ``height``, ``fx``, ``fy``, ``cx``, ``cy`` in pixels and
        ``depth_scale`` in metres per unit of depth; ``distortion``, OpenCV's coefficients, if any.
        Or a file of another program, as `handcal.rig.formats.read_camera` reads it.
    depth_scale_m : float, optional
        In place of the file's ``depth_scale``.

    Returns
    -------
    Frame
        Depth (H, W) and colour (H, W, 3), RGB, of one camera; its times and index are 0.

    Raises
    ------
    FileError
        If a file is missing, malformed or too large, or if the files do not match.

    Examples
    --------
    A frame of the simulated camera, written and read:

    >>> import handcal
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from handcal.camera.images import write_frame
    >>> with TemporaryDirectory() as folder:
    ...     paths = write_frame(Path(folder), handcal.simulated_frame())
    ...     frame = handcal.read_frame(*paths)
    >>> frame.depth.shape, frame.depth.dtype, frame.color.shape
    ((720, 1280), dtype('uint16'), (720, 1280, 3))
    """
    color, depth, intrinsics = Path(color), Path(depth), Path(intrinsics)
    camera, values = read_intrinsics(intrinsics), read_fields(intrinsics)
    if depth_scale_m is not None:
        values["depth_scale"] = depth_scale_m
    if "depth_scale" not in values:
        raise FileError(
            f"{intrinsics} must give depth_scale, in metres per unit of depth",
            "add it, or use --depth-scale: 0.001 for millimetres",
        )
    depth_scale_m = depth_scale_from(values, intrinsics)
    depth_image = read_depth(depth, camera)
    color_image = read_color(color, camera)
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


def write_frame(folder: str | PathLike[str], frame: Frame) -> tuple[Path, Path, Path]:
    """Write a frame as `read_frame` reads it; return the paths that it takes, in its order.

    Parameters
    ----------
    folder : path
        Created if missing; gets ``color.png``, ``depth.png`` and ``intrinsics.json``.
    frame : Frame
        Its depth aligned to colour.

    Raises
    ------
    FileError
        If a file cannot be written.
    ValueError
        If the frame has no colour, or its depth is not aligned to it.
    """
    camera = frame.depth_intrinsics
    if frame.color is None or frame.color_intrinsics != camera or (np.eye(4) != frame.T_C_D).any():
        raise ValueError("the frame needs colour, and depth aligned to it")
    folder = make_folder(Path(folder))
    color, depth, intrinsics = (
        folder / name for name in ("color.png", "depth.png", "intrinsics.json")
    )
    write_png(color, frame.color)
    write_atomic(depth, cv2.imencode(".png", frame.depth)[1].tobytes())
    write_json(intrinsics, asdict(camera) | {"depth_scale": frame.depth_scale_m})
    return color, depth, intrinsics


def intrinsics_from(values: dict[str, Any], path: Path) -> Intrinsics:
    """Return intrinsics from JSON values: width, height, fx, fy, cx, cy, optionally distortion.

    Raises
    ------
    FileError
        If a value is missing or implausible; the message names `path`.
    """
    width, height = (number_from(values, path, key, 1, MAX_SIDE_PX) for key in ("width", "height"))
    if width != int(width) or height != int(height):
        raise FileError(f"{path}: width and height must be whole numbers")
    distortion = values.get("distortion", [])
    if not isinstance(distortion, list) or len(distortion) not in DISTORTION_COUNTS:
        counts = ", ".join(map(str, DISTORTION_COUNTS))
        raise FileError(f"{path}: distortion must be a list of {counts} numbers")
    return Intrinsics(
        width=int(width),
        height=int(height),
        fx=number_from(values, path, "fx", 1.0, 1e5),
        fy=number_from(values, path, "fy", 1.0, 1e5),
        cx=number_from(values, path, "cx", -width, 2 * width),
        cy=number_from(values, path, "cy", -height, 2 * height),
        distortion=tuple(
            number_from({"distortion": value}, path, "distortion", -1e3, 1e3)
            for value in distortion
        ),
    )


def depth_scale_from(values: dict[str, Any], path: Path) -> float:
    """Return a JSON object's depth scale in metres per unit; FileError, with `path`, if wrong."""
    scale = values.get("depth_scale")
    if isinstance(scale, int | float) and 1.0 / DEPTH_SCALES_M[1] <= scale <= 1e6:
        raise FileError(
            f"{path}: depth_scale is {scale:g}, but must be in metres per unit",
            f"enter {1.0 / scale:g} if a metre is {scale:g} units",
        )
    return number_from(values, path, "depth_scale", *DEPTH_SCALES_M)


def number_from(values: dict[str, Any], path: Path, key: str, low: float, high: float) -> float:
    """Return a JSON value as a number from `low` to `high`; FileError otherwise."""
    value = values.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise FileError(f"{path} must give {key} as a number")
    if not low <= value <= high:
        raise FileError(f"{path}: {key} is {value:g}, but must lie between {low:g} and {high:g}")
    return float(value)


def read_depth(path: Path, camera: Intrinsics) -> UInt16:
    """Read a depth image: 16-bit grey, of the camera's size; FileError otherwise."""
    image = read_image(path, cv2.IMREAD_UNCHANGED)
    if image.dtype != np.uint16 or image.ndim != 2:
        raise FileError(f"{path} must be a 16-bit image of one channel")
    return _of_size(image, path, camera)


def read_color(path: Path, camera: Intrinsics) -> UInt8:
    """Read a colour image as RGB, of the camera's size; FileError otherwise."""
    image = read_image(path, cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION)
    return _of_size(image, path, camera)


def _of_size(image: NDArray[Any], path: Path, camera: Intrinsics) -> NDArray[Any]:
    height, width = image.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise FileError(
            f"{path} is {width}x{height} pixels, but its camera's intrinsics say "
            f"{camera.width}x{camera.height}"
        )
    return image
