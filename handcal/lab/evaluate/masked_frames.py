"""Frames of a hand with the true mask of each: a folder of images with a ``meta.json``."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.camera.images import (
    DEPTH_SCALES_M,
    intrinsics_from,
    number_from,
    read_color,
    read_depth,
)
from handcal.core.errors import FileError
from handcal.core.frozen import freeze
from handcal.core.types import Bool, Float64, Frame, Intrinsics, UInt8
from handcal.io.files import read_json
from handcal.io.images import IMAGE_SUFFIXES, read_image

_MOST_FRAMES = 10_000
_WRIST, _MIDDLE_FINGER = 0, 9  # of 21 joints: the wrist, then four for each finger from the thumb


@dataclass(frozen=True, slots=True, eq=False)
class MaskedFrame:
    """A frame of a hand and the truth about it."""

    name: str
    frame: Frame
    is_hand: Bool
    """(H, W); true mask of the hand in the depth image."""
    wrist_m: Float64 | None = None
    arm_axis: Float64 | None = None
    """(3,); the wrist joint and the direction from the middle finger's knuckle to it, in the depth
    camera's frame; None where the joints are not given."""

    def __post_init__(self) -> None:
        intrinsics = self.frame.depth_intrinsics
        freeze(self, "is_hand", np.bool_, intrinsics.height, intrinsics.width)
        freeze(self, "wrist_m", np.float64, 3)
        freeze(self, "arm_axis", np.float64, 3)


def read_masked_names(folder: Path) -> dict[str, dict[str, Any]]:
    """Return what ``meta.json`` says about each frame of a folder, in the order of the names.

    Names that are numbers are sorted as numbers.

    Raises
    ------
    FileError
        If the file or an image is missing, or it is malformed, or describes no frames or too many.
    """
    path = folder / "meta.json"
    if not path.exists():
        raise FileError(f"{folder} holds no meta.json, which describes the frames there")
    described = read_json(path)
    if not 0 < len(described) <= _MOST_FRAMES:
        raise FileError(f"{path} must describe 1 to {_MOST_FRAMES:,} frames")
    for name, about in described.items():
        if not re.fullmatch(r"[\w.-]+", name) or not isinstance(about, dict):
            raise FileError(f"{path}: {name!r} does not describe a frame")
        _camera(about, name, path)
        for file in (folder / f"{name}_depth.png", folder / f"{name}_handmask.png"):
            if not file.exists():
                raise FileError(f"there is no {file}, although meta.json describes the frame")
    return dict(sorted(described.items(), key=lambda item: (item[0].zfill(64), item[0])))


def read_masked_frames(folder: Path, described: dict[str, dict[str, Any]]) -> Iterator[MaskedFrame]:
    """Read the frames of a folder, one after the other.

    For each name of `described`: ``NAME_depth.png`` (16 bits), ``NAME_handmask.png`` (not 0 on the
    hand) and, if there is one, ``NAME_color.png`` or ``.jpg``, to which the depth is aligned.
    ``meta.json`` gives by name ``intrinsics`` (a list: fx, fy, cx, cy, in pixels), ``width``,
    ``height``, ``depth_unit_m`` and optionally ``joints3d_mm``, 21 joints in the camera's frame, in
    millimetres: the wrist, then four of each finger, the thumb's first.

    Raises
    ------
    FileError
        If a file is missing, malformed or too large, or if the files do not match.
    """
    path = folder / "meta.json"
    for name, about in described.items():
        camera = _camera(about, name, path)
        if about.get("depth_aligned_to_color", True) is not True:
            raise FileError(f"{path}: the depth of {name} must be aligned to its colour")
        depth = read_depth(folder / f"{name}_depth.png", camera)
        mask_path = folder / f"{name}_handmask.png"
        mask = read_image(mask_path, cv2.IMREAD_GRAYSCALE)
        if mask.shape != depth.shape or not mask.any():
            raise FileError(f"{mask_path} is empty or not of the depth image's size")
        colors = (folder / f"{name}_color{suffix}" for suffix in IMAGE_SUFFIXES)
        color = next((read_color(one, camera) for one in colors if one.exists()), None)
        frame = Frame(
            index=0,
            t_camera_ns=0,
            t_host_ns=0,
            depth=depth,
            depth_scale_m=number_from(about, path, "depth_unit_m", *DEPTH_SCALES_M),
            depth_intrinsics=camera,
            color=color,
            color_intrinsics=None if color is None else camera,
        )
        yield MaskedFrame(name, frame, mask > 0, *_wrist(about, name, path))


def _camera(about: dict[str, Any], name: str, path: Path) -> Intrinsics:
    values = about.get("intrinsics")
    if not isinstance(values, list) or len(values) != 4:
        raise FileError(
            f"{path}: the intrinsics of {name} must be a list of four numbers without names, "
            "[fx, fy, cx, cy] in pixels"
        )
    return intrinsics_from(about | dict(zip(("fx", "fy", "cx", "cy"), values, strict=True)), path)


def _wrist(about: dict[str, Any], name: str, path: Path) -> tuple[Float64 | None, Float64 | None]:
    """Return the wrist and the direction of the arm, if the joints are given."""
    if "joints3d_mm" not in about:
        return None, None
    try:
        joints_m = np.array(about["joints3d_mm"], np.float64) / 1000.0
    except (TypeError, ValueError):
        joints_m = np.zeros(0)
    if joints_m.shape != (21, 3) or not np.isfinite(joints_m).all():
        raise FileError(f"{path}: joints3d_mm of {name} must be 21 points")
    axis = joints_m[_WRIST] - joints_m[_MIDDLE_FINGER]
    return joints_m[_WRIST], axis / max(float(np.linalg.norm(axis)), 1e-9)


def cropped(frame: Frame, left: int, top: int, right: int, bottom: int) -> Frame:
    """Return a frame of depth aligned to colour with columns and rows cropped off."""
    camera = frame.depth_intrinsics
    part = np.s_[top : camera.height - bottom, left : camera.width - right]
    smaller = replace(
        camera,
        width=camera.width - left - right,
        height=camera.height - top - bottom,
        cx=camera.cx - left,
        cy=camera.cy - top,
    )
    return _of_camera(frame, smaller, frame.depth[part], lambda color: color[part])


def scaled(frame: Frame, scale: float) -> Frame:
    """Return a frame of depth aligned to colour at another resolution; depth is not mixed."""
    camera = frame.depth_intrinsics
    size = round(scale * camera.width), round(scale * camera.height)
    x, y = size[0] / camera.width, size[1] / camera.height
    resized = replace(
        camera,
        width=size[0],
        height=size[1],
        fx=x * camera.fx,
        fy=y * camera.fy,
        cx=x * (camera.cx + 0.5) - 0.5,
        cy=y * (camera.cy + 0.5) - 0.5,
    )
    depth = cv2.resize(frame.depth, size, interpolation=cv2.INTER_NEAREST_EXACT)
    return _of_camera(frame, resized, depth, lambda color: cv2.resize(color, size))


def subsampled(frame: Frame, step: int, column: int, row: int) -> Frame:
    """Return a frame with every `step`-th pixel of its depth; its colour stays as it is."""
    camera = frame.depth_intrinsics
    depth = np.ascontiguousarray(frame.depth[row::step, column::step])
    coarser = replace(
        camera,
        width=depth.shape[1],
        height=depth.shape[0],
        fx=camera.fx / step,
        fy=camera.fy / step,
        cx=(camera.cx - column) / step,
        cy=(camera.cy - row) / step,
    )
    return replace(frame, depth=depth, depth_intrinsics=coarser)


def _of_camera(
    frame: Frame, camera: Intrinsics, depth: NDArray[Any], of: Callable[[UInt8], NDArray[Any]]
) -> Frame:
    return replace(
        frame,
        depth=np.ascontiguousarray(depth),
        depth_intrinsics=camera,
        color=None if frame.color is None else np.ascontiguousarray(of(frame.color)),
        color_intrinsics=None if frame.color is None else camera,
    )
