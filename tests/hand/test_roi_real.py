"""Real frames from the detector's box to the segmented hand."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from handcal.camera.images import read_depth
from handcal.core.errors import HandError
from handcal.core.types import Bool, Float64, Frame, Intrinsics, UInt8
from handcal.hand.detect import Detections, HandDetector, overlaps
from handcal.hand.finder import HandFinder, RoiFinder
from handcal.hand.settings import NEARER_M, SegmentSettings
from handcal.hand.shipped import load_detector
from handcal.io.images import read_image

SETTINGS = SegmentSettings()


@dataclass(frozen=True)
class Shot:
    """A frame of a real hand, and what is known about it."""

    frame: Frame
    box: Float64
    is_hand: Bool
    wrist_m: Float64
    arm_axis: Float64


@pytest.fixture(scope="module")
def shots(shared_data: Path) -> list[Shot]:
    folder = shared_data / "rgbd" / "color_aligned_640"
    described = json.loads((folder / "meta.json").read_text())
    return [read_shot(folder, name, shot) for name, shot in described.items()]


def read_shot(folder: Path, name: str, shot: dict[str, Any]) -> Shot:
    camera = Intrinsics(640, 480, *shot["intrinsics"])
    depth = read_depth(folder / f"{name}_depth.png", camera)
    color = read_image(folder / f"{name}_color.jpg", cv2.IMREAD_COLOR_RGB)
    frame = Frame(0, 0, 0, depth, 0.001, camera, color, camera)
    mask = read_image(folder / f"{name}_handmask.png", cv2.IMREAD_GRAYSCALE)
    joints_m = np.array(shot["joints3d_mm"]) / 1000.0
    arm_axis = joints_m[0] - joints_m[9]
    arm_axis /= np.linalg.norm(arm_axis)
    return Shot(frame, np.array([shot["hand_box"]], float), mask > 0, joints_m[0], arm_axis)


@pytest.fixture(scope="module")
def detector() -> HandDetector:
    return load_detector()


def test_real_hands_are_segmented_where_the_detector_saw_them(
    shots: list[Shot], detector: HandDetector
) -> None:
    beyond_m = []
    for shot in shots:
        cloud = HandFinder(SETTINGS, detector).find(shot.frame)
        gated = shot.is_hand & (shot.frame.depth >= 350) & (shot.frame.depth <= 700)
        assert (cloud.mask[gated] > 0).mean() > 0.95
        cut_m = cloud.contour_m[cloud.contour_is_cut] - shot.wrist_m
        beyond_m.append((cut_m @ shot.arm_axis).mean())
    assert 0.0 < np.mean(beyond_m) < 0.03


@pytest.mark.parametrize("end", ["near", "far"])
@pytest.mark.parametrize("beyond", [0.1, 0.25, 0.5])
def test_real_hands_across_the_gate_are_whole_or_refused(
    shots: list[Shot], detector: HandDetector, end: str, beyond: float
) -> None:
    """Hands of which a share lies beyond the gate."""
    whole = 0
    for shot in shots:
        measured = shot.is_hand & (shot.frame.depth > 0)
        depth_m = shot.frame.depth[measured] * shot.frame.depth_scale_m
        near_m, far_m = np.quantile(depth_m, [beyond, 1.0 - beyond])
        gate_m = (near_m + NEARER_M, 0.95) if end == "near" else (0.1, far_m)
        try:
            cloud = HandFinder(SegmentSettings("detector", *gate_m), detector).find(shot.frame)
        except HandError as error:
            assert f"the hand is too {end}" in str(error)  # noqa: PT017 (or it is whole)
        else:
            assert (cloud.mask[measured] > 0).mean() > 0.97
            whole += 1
    assert whole > 0.5 * len(shots) or beyond > 0.1


def test_a_look_nearby_confirms_a_real_hand(shots: list[Shot], detector: HandDetector) -> None:
    wide_looks = []

    class Watched:
        def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
            wide_looks.append(pixels is None)
            return detector.detect(color, pixels)

    for shot in shots:
        roi = RoiFinder(Watched(), SETTINGS)
        for index in range(3):
            box = roi.find(replace(shot.frame, t_camera_ns=index * 200_000_000))
            assert box is not None
            assert overlaps(np.array([box], float), shot.box)[0, 0] >= 0.5
    assert wide_looks == [True, False, False, False] * len(shots)  # the first at once near by too
