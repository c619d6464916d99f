"""Segmentation of every frame of a camera, with the motion of the hand between frames."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.camera.camera import Camera
from handcal.core.errors import CameraEndError, HandError
from handcal.core.frozen import freeze
from handcal.core.geometry import transform
from handcal.core.types import Float64, Frame, HandCloud
from handcal.hand.settings import SegmentSettings
from handcal.hand.shipped import make_finder
from handcal.register.rigid import RigidSettings, register_rigid
from handcal.register.surface import Surface, describe_surface


@dataclass(frozen=True, slots=True, eq=False)
class HandMotion:
    """The motion of the hand since the last frame in which it was found."""

    rotation_rad: Float64
    """(3,); rotation vector, frame D."""
    shift_m: Float64
    """(3,); displacement of the hand's centroid, frame D."""

    def __post_init__(self) -> None:
        freeze(self, "rotation_rad", np.float64, 3)
        freeze(self, "shift_m", np.float64, 3)


@dataclass(frozen=True, slots=True, eq=False)
class ReplayStep:
    """The result of one frame."""

    frame: Frame
    hand: HandCloud | None
    problem: str
    """The reason why no hand was found; empty if one was."""
    segment_s: float
    """Duration of the segmentation."""
    motion: HandMotion | None
    """None for the first hand."""


def replay(camera: Camera, settings: SegmentSettings) -> Iterator[ReplayStep]:
    """Segment each frame until the camera has no more.

    Parameters
    ----------
    camera : Camera
        Stays open.
    settings : SegmentSettings

    Yields
    ------
    ReplayStep

    Raises
    ------
    CameraError
        As `Camera.read`, except for the end of a recording.
    """
    finder = make_finder(settings)
    previous: Surface | None = None
    while True:
        try:
            frame = camera.read()
        except CameraEndError:
            return
        start_s = time.perf_counter()
        try:
            hand = finder.find(frame)
            segment_s = time.perf_counter() - start_s
            surface = describe_surface(
                hand.points_m.astype(np.float64), hand.is_cut, RigidSettings().max_points
            )
        except HandError as error:
            yield ReplayStep(frame, None, str(error), time.perf_counter() - start_s, None)
            continue
        motion = None if previous is None else _motion(previous, surface)
        yield ReplayStep(frame, hand, "", segment_s, motion)
        previous = surface


def _motion(previous: Surface, surface: Surface) -> HandMotion:
    T_now_then = register_rigid(previous, surface).T_target_source
    centroid_m = previous.points_m.mean(axis=0)
    return HandMotion(
        Rotation.from_matrix(T_now_then[:3, :3]).as_rotvec(),
        (transform(T_now_then, centroid_m[None]) - centroid_m)[0],
    )
