"""Check that frames to record come from one camera, as a recording describes only one."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np

from handcal.core.types import Frame


def of_one_camera(frames: Iterable[Frame]) -> tuple[Frame, Iterator[Frame]]:
    """Return the first frame, and an iterator over all frames that checks each.

    Later frames may lack colour or the pose.

    Raises
    ------
    ValueError
        If there is no frame; from the iterator, if a frame is from another camera.
    """
    remaining = iter(frames)
    first = next(remaining, None)
    if first is None:
        raise ValueError("there is no frame to record")
    return first, chain([first], (_checked(frame, first) for frame in remaining))


def _checked(frame: Frame, first: Frame) -> Frame:
    has_same_depth = (
        frame.depth_intrinsics == first.depth_intrinsics
        and frame.depth_scale_m == first.depth_scale_m
    )
    has_same_color = frame.color is None or (
        frame.color_intrinsics == first.color_intrinsics
        and np.array_equal(frame.T_C_D, first.T_C_D)
    )
    gains_pose = frame.T_W_D is not None and first.T_W_D is None
    if not has_same_depth or not has_same_color or gains_pose:
        raise ValueError(f"frame {frame.index} is not from the camera of the first frame")
    return frame
