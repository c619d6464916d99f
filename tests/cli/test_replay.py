"""Replaying frames and recordings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.cli.recordings import replayed
from handcal.core.errors import CameraEndError, CameraTimeoutError
from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, Float64, Frame, Intrinsics
from handcal.hand.settings import SegmentSettings
from handcal.io.closable import Closable
from handcal.sim.hand import HandModel, make_hand
from handcal.sim.raster import draw_hand

CAMERA = Intrinsics(640, 360, 502.5, 502.5, 319.5, 179.5)
T_0 = rigid([0.1, 0.1, 0.1], [0.0, 0.02, 0.52])
TURN_RAD = np.array([0.03, -0.05, 0.04])
SHIFT_M = np.array([0.01, -0.008, 0.015])


class FrameList(Closable):
    """A camera that gives the frames of a list."""

    name = "List"
    identity = CameraIdentity()
    depth_intrinsics = CAMERA

    def __init__(self, frames: Iterable[Frame]) -> None:
        self._frames: Iterator[Frame] = iter(frames)

    def read(self, timeout_s: float = 1.0) -> Frame:
        try:
            return next(self._frames)
        except StopIteration:
            raise CameraEndError("the list has ended") from None

    def close(self) -> None:
        pass


class DeadCamera(FrameList):
    """A camera that never delivers."""

    def read(self, timeout_s: float = 1.0) -> Frame:
        raise CameraTimeoutError("no frame")


@pytest.fixture(scope="module")
def hand() -> HandModel:
    return make_hand(3)


def look_at(hand: HandModel, T_D_hand: Float64, index: int) -> Frame:
    image = draw_hand(hand, T_D_hand, CAMERA)
    depth = np.zeros((CAMERA.height, CAMERA.width), np.uint16)
    height, width = image.depth_m.shape
    seen_m = np.where(np.isfinite(image.depth_m), image.depth_m, 0.0)
    part = np.s_[image.y0 : image.y0 + height, image.x0 : image.x0 + width]
    depth[part] = np.round(seen_m * 1e4)
    return Frame(index, index * 33_000_000, 0, depth, 1e-4, CAMERA)


def test_motion_of_the_hand_is_reported_across_frames_without_one(hand: HandModel) -> None:
    first = look_at(hand, T_0, 1)
    empty = replace(first, index=2, depth=np.zeros_like(first.depth))
    turned = T_0.copy()
    turned[:3, :3] = Rotation.from_rotvec(TURN_RAD).as_matrix() @ T_0[:3, :3]
    turned[:3, 3] += SHIFT_M
    steps = list(replayed(FrameList([first, empty, look_at(hand, turned, 3)]), SegmentSettings()))
    assert [step.frame.index for step in steps] == [1, 2, 3]
    assert [step.hand is None for step in steps] == [False, True, False]
    assert [step.problem.startswith("no hand-sized") for step in steps] == [False, True, False]
    assert all(0.0 < step.segment_s < 1.0 for step in steps)
    assert steps[0].motion is None
    assert steps[1].motion is None
    motion = steps[2].motion
    assert motion is not None
    np.testing.assert_allclose(motion.rotation_rad, TURN_RAD, atol=0.01)
    np.testing.assert_allclose(motion.shift_m, SHIFT_M, atol=0.004)


def test_a_hand_wholly_beside_cut_edges_does_not_end_the_replay(hand: HandModel) -> None:
    frames = [look_at(hand, T_0, index) for index in (1, 2)]
    steps = list(replayed(FrameList(frames), SegmentSettings(cut_band_m=0.3)))
    assert [step.hand for step in steps] == [None, None]
    assert all("beside cut edges" in step.problem for step in steps)


def test_failing_camera_is_not_taken_for_the_end() -> None:
    with pytest.raises(CameraTimeoutError):
        list(replayed(DeadCamera([]), SegmentSettings()))
