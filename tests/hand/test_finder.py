from dataclasses import dataclass, replace

import numpy as np
import pytest

from handcal.errors import HandError
from handcal.hand.detect import Detections
from handcal.hand.finder import HandFinder
from handcal.hand.segment import SegmentSettings, segment_hand
from handcal.hand.view import Box
from handcal.types import Frame, UInt8

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


@pytest.fixture(scope="module")
def frame() -> Frame:
    return coloured(shoot().frame)


def test_the_detectors_hand_is_the_one_that_depth_alone_finds(frame: Frame) -> None:
    expected = segment_hand(frame, SETTINGS)
    x0, y0, x1, y1 = expected.box_px
    third = (x1 - x0) // 6  # a box as poor as a detector's may be
    seen = Eyes((x0 + third, y0 + third, x1 - third, y1))
    found = HandFinder(SETTINGS, seen).find(frame)
    assert np.array_equal(found.mask, expected.mask)
    assert np.array_equal(found.points_m, expected.points_m)


def test_of_two_hands_the_one_that_the_detector_sees(frame: Frame) -> None:
    width = CAMERA.width // 3
    depth = frame.depth.copy()
    depth[:, :width] = shoot(at_m=(-0.17, 0.02, 0.42)).frame.depth[:, :width]
    two = replace(frame, depth=depth)
    seen = segment_hand(frame, SETTINGS)
    assert segment_hand(two, SETTINGS).box_px[2] <= width  # by depth alone the other is taken
    found = HandFinder(SETTINGS, Eyes(seen.box_px)).find(two)
    assert np.array_equal(found.mask, seen.mask)


def test_a_box_that_cuts_the_hand_is_not_trusted(frame: Frame) -> None:
    expected = segment_hand(frame, SETTINGS)
    x0, y0, x1, y1 = expected.box_px
    lower_half = Eyes((x0, (y0 + y1) // 2, x1, y1))
    found = HandFinder(SETTINGS, lower_half).find(frame)
    assert np.array_equal(found.mask, expected.mask)


def test_without_a_detector_or_colour_depth_decides(frame: Frame) -> None:
    expected = segment_hand(frame, SETTINGS).mask
    assert np.array_equal(HandFinder(SETTINGS).find(frame).mask, expected)
    blind = replace(frame, color=None, color_intrinsics=None)
    assert np.array_equal(HandFinder(SETTINGS, Eyes((0, 0, 9, 9))).find(blind).mask, expected)


def test_says_that_there_is_no_hand(frame: Frame) -> None:
    empty = replace(frame, depth=np.full_like(frame.depth, 1500))
    with pytest.raises(HandError, match="no hand-sized object"):
        HandFinder(SETTINGS, Eyes((100, 100, 300, 300))).find(empty)
