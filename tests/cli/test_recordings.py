"""Replaying recordings, and the files of a segmented hand."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.cli.recordings import draw_overlay, replayed, write_segmentation
from handcal.core.errors import CameraEndError
from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, Float64, Frame, HandCloud, Intrinsics
from handcal.hand.segment import SegmentSettings
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


SMALL_CAMERA = Intrinsics(40, 30, 50.0, 50.0, 20.0, 15.0)


def make_frame(T_C_D: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Frame:
    depth = np.full((30, 40), 500, np.uint16)
    color = np.full((30, 40, 3), (100, 0, 0), np.uint8)
    return Frame(0, 0, 0, depth, 0.001, SMALL_CAMERA, color, SMALL_CAMERA, T_C_D)


@pytest.fixture
def cloud() -> HandCloud:
    mask = np.zeros((30, 40), np.uint8)
    mask[10:20, 12:24] = 255
    corners = np.array([[12, 10], [23, 10], [23, 19], [12, 19]])
    contour_m = np.column_stack([(corners - (20.0, 15.0)) / 50.0 * 0.5, np.full(4, 0.5)])
    return HandCloud(
        t_camera_ns=0,
        t_host_ns=0,
        points_m=np.array([[0.1, 0.2, 0.5], [0.0, 0.0, 0.25]], np.float32),
        is_cut=np.array([False, True]),
        colors=np.array([[1, 2, 3], [4, 5, 6]], np.uint8),
        contour_m=contour_m.astype(np.float32),
        contour_is_cut=np.array([False, False, True, True]),
        mask=mask,
        box_px=(12, 10, 24, 20),
        median_depth_m=0.375,
    )


def test_files_hold_the_hand(cloud: HandCloud, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "out"
    write_segmentation(cloud, make_frame(np.eye(4)), folder)
    assert {file.name for file in folder.iterdir()} == {
        "hand.ply",
        "contour.ply",
        "mask.png",
        "overlay.png",
        "hand.json",
    }
    assert json.loads((folder / "hand.json").read_text()) == {
        "box": [12, 10, 24, 20],
        "points": 2,
        "contour_points": 4,
        "median_depth_m": 0.375,
    }
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(mask, cloud.mask)
    header, _, body = (folder / "hand.ply").read_bytes().partition(b"end_header\n")
    assert b"element vertex 2" in header
    np.testing.assert_array_equal(np.frombuffer(body[:12], "<f4"), cloud.points_m[0])
    assert body[12:15] == bytes([1, 2, 3])
    overlay = cv2.imread(str(folder / "overlay.png"), cv2.IMREAD_COLOR_RGB)
    np.testing.assert_array_equal(overlay, draw_overlay(cloud, make_frame(np.eye(4))))


def test_unaligned_color_is_not_drawn_under_the_depth_mask(cloud: HandCloud) -> None:
    picture = draw_overlay(cloud, make_frame(rigid(translation_m=[0.02, 0.0, 0.0])))
    np.testing.assert_array_equal(picture[0, 0], (127, 127, 127))
