from dataclasses import dataclass, replace

import numpy as np
import pytest

from handcal.core.errors import HandError
from handcal.core.types import Frame, HandCloud, UInt8
from handcal.hand.detect import Detections
from handcal.hand.finder import HandFinder
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.hand.view import Box

from .conftest import CAMERA, shoot

SETTINGS = SegmentSettings()


@dataclass
class Eyes:
    """A detector that sees one box, be it shown the whole of a `coloured` frame or a part."""

    box: Box

    def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
        x, y = color[0, 0, ::2] * 8.0 + divmod(color[0, 0, 1], 8)
        return Detections(np.array([self.box], float) - [x, y, x, y], np.ones(1))


def coloured(frame: Frame) -> Frame:
    """Return a frame whose colours tell where in the image they are."""
    y, x = np.indices(frame.depth.shape)
    color = np.dstack([x // 8, 8 * (x % 8) + y % 8, y // 8]).astype(np.uint8)
    return replace(frame, color=color, color_intrinsics=CAMERA)


def agreement(found: HandCloud, expected: HandCloud) -> float:
    """Return the intersection over union of two masks."""
    both, either = found.mask & expected.mask, found.mask | expected.mask
    return np.count_nonzero(both) / np.count_nonzero(either)


@pytest.fixture(scope="module")
def frame() -> Frame:
    return coloured(shoot().frame)


def test_the_detectors_hand_is_the_one_that_depth_alone_finds(frame: Frame) -> None:
    expected = segment_hand(frame, SETTINGS)
    x0, y0, x1, y1 = expected.box_px
    third = (x1 - x0) // 6  # a box as poor as a detector's may be
    seen = Eyes((x0 + third, y0 + third, x1 - third, y1))
    found = HandFinder(SETTINGS, seen).find(frame)
    assert agreement(found, expected) > 0.98
    assert abs(found.points_m.mean(axis=0) - expected.points_m.mean(axis=0)).max() < 0.001


def test_of_two_hands_the_one_that_the_detector_sees(frame: Frame) -> None:
    width = CAMERA.width // 3
    depth = frame.depth.copy()
    depth[:, :width] = shoot(at_m=(-0.17, 0.02, 0.42)).frame.depth[:, :width]
    two = replace(frame, depth=depth)
    seen = segment_hand(frame, SETTINGS)
    assert segment_hand(two, SETTINGS).box_px[2] <= width  # by depth alone the other is taken
    found = HandFinder(SETTINGS, Eyes(seen.box_px)).find(two)
    assert agreement(found, seen) > 0.98


@pytest.mark.parametrize("part", [(0, 0.5, 1, 1), (0, 0, 1, 0.5), (0.5, 0, 1, 1), (0, 0.3, 1, 1.3)])
def test_a_box_that_cuts_the_hand_gives_the_whole_hand(
    frame: Frame, part: tuple[float, float, float, float]
) -> None:
    expected = segment_hand(frame, SETTINGS)
    x0, y0, x1, y1 = expected.box_px
    seen = np.array([x0, y0, x0, y0]) + np.array(part) * [x1 - x0, y1 - y0, x1 - x0, y1 - y0]
    found = HandFinder(SETTINGS, Eyes((*seen.astype(int).tolist(),))).find(frame)
    assert agreement(found, expected) > 0.88


def test_without_a_detector_or_colour_depth_decides(frame: Frame) -> None:
    expected = segment_hand(frame, SETTINGS).mask
    assert np.array_equal(HandFinder(SETTINGS).find(frame).mask, expected)
    blind = replace(frame, color=None, color_intrinsics=None)
    assert np.array_equal(HandFinder(SETTINGS, Eyes((0, 0, 9, 9))).find(blind).mask, expected)


def moved(frame: Frame, by_m: float) -> Frame:
    """Return a frame with everything measured that much further away."""
    depth = np.where(
        frame.depth > 0, frame.depth.astype(int) + round(by_m / frame.depth_scale_m), 0
    )
    return replace(frame, depth=depth.clip(0, 65535).astype(np.uint16))


def test_where_the_detector_sees_a_hand_the_reason_names_what_is_there(frame: Frame) -> None:
    seen = segment_hand(frame, SETTINGS)
    eyes = Eyes(seen.box_px)
    x0, y0, x1, y1 = seen.box_px
    hole = frame.depth.copy()
    hole[y0:y1, x0:x1] = 0
    for there, reason in (
        (moved(frame, -0.25), r"too near, at 2\d cm; move it back by 1[3-6] cm"),
        (moved(frame, 0.25), r"too far, at 7\d cm; bring it nearer by (9|10|11|12) cm"),
        (
            replace(frame, depth_scale_m=0.1 * frame.depth_scale_m),
            "only [12] cm large: depth is in",
        ),
        (
            replace(frame, depth=np.minimum(5 * frame.depth.astype(int), 65535).astype(np.uint16)),
            r"at the measured 2\.\d+ m would be 0\.[5-9] m large: depth is in a wrong unit",
        ),
        (replace(frame, depth=hole), "measures nothing where the hand is"),
        (replace(frame, depth=np.full_like(hole, 15000)), "only the background, at 1.50 m"),
    ):
        with pytest.raises(HandError, match=reason):
            HandFinder(SETTINGS, eyes).find(there)


def test_another_thing_is_never_taken_for_the_hand_that_the_detector_sees(frame: Frame) -> None:
    elsewhere = Eyes((20, 20, 160, 180))
    with pytest.raises(HandError, match="only the background"):
        HandFinder(SETTINGS, elsewhere).find(frame)
    x0, y0, _, _ = segment_hand(frame, SETTINGS).box_px
    with pytest.raises(HandError, match="the detector and the depth image disagree"):
        HandFinder(SETTINGS, Eyes((x0, y0, x0 + 40, y0 + 90))).find(frame)  # one finger
    blind = Eyes((0, 0, 0, 0))
    with pytest.raises(HandError, match=r"no hand is seen|only the background|measures nothing"):
        HandFinder(SETTINGS, blind).find(frame)


def test_a_detected_hand_may_be_a_little_nearer_than_the_gate(frame: Frame) -> None:
    seen = segment_hand(frame, SETTINGS)
    nearest_m = float(seen.points_m[:, 2].min())
    narrow = SegmentSettings(depth_min_m=nearest_m + 0.02)
    found = HandFinder(narrow, Eyes(seen.box_px)).find(frame)
    assert agreement(found, seen) > 0.98
