from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from handcal.camera.playback import of_one_camera
from handcal.core.types import Frame

MakeFrames = Callable[..., Iterator[Frame]]


def test_frames_of_one_camera_pass_in_order_even_without_colour(make_frames: MakeFrames) -> None:
    pairs = list(make_frames(3))
    pairs[1] = replace(pairs[1], color=None, color_intrinsics=None, T_C_D=np.eye(4))
    first, frames = of_one_camera(iter(pairs))
    assert first is pairs[0]
    assert list(frames) == pairs


@pytest.mark.parametrize("change", ["scale", "depth", "color", "pose"])
def test_another_camera_is_noticed(make_frames: MakeFrames, change: str) -> None:
    one, other = make_frames(2)
    assert one.color_intrinsics is not None
    changed = {
        "scale": replace(other, depth_scale_m=0.001),
        "depth": replace(other, depth_intrinsics=replace(one.depth_intrinsics, fx=1.0)),
        "color": replace(other, color_intrinsics=replace(one.color_intrinsics, fx=1.0)),
        "pose": replace(other, T_C_D=np.eye(4)),
    }[change]
    _, frames = of_one_camera([one, changed])
    assert next(frames) is one
    with pytest.raises(ValueError, match="frame 2 is not from the camera of the first frame"):
        next(frames)


def test_nothing_cannot_be_recorded() -> None:
    with pytest.raises(ValueError, match="no frame to record"):
        of_one_camera([])
