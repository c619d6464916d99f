from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from handcal.geometry import rigid
from handcal.hand.detect import Detections, overlaps
from handcal.hand.roi import RoiFinder, RoiSettings, Wanted
from handcal.hand.settings import SegmentSettings
from handcal.hand.view import Box
from handcal.types import Frame, Intrinsics, UInt8

CAMERA = Intrinsics(width=640, height=360, fx=500.0, fy=500.0, cx=319.5, cy=179.5)
FRAME_NS = 33_000_000


@dataclass
class Eyes:
    """A detector that sees what it is told to, and counts its looks."""

    boxes: list[Box] = field(default_factory=list)
    looks: int = 0

    def detect(self, color: UInt8) -> Detections:
        self.looks += 1
        return Detections(np.array(self.boxes, float).reshape(-1, 4), np.ones(len(self.boxes)))


def frame(index: int, *things: tuple[Box, float]) -> Frame:
    """Return a frame of boxes at depths before a far wall; depth is aligned to colour."""
    depth = np.full((360, 640), 2000, np.uint16)
    for (x0, y0, x1, y1), depth_m in things:
        depth[y0:y1, x0:x1] = round(1000 * depth_m)
    color = np.zeros((360, 640, 3), np.uint8)
    return Frame(index, index * FRAME_NS, 0, depth, 0.001, CAMERA, color, CAMERA)


def finder(eyes: Eyes, wanted: Wanted = "nearest") -> RoiFinder:
    return RoiFinder(eyes, SegmentSettings(), RoiSettings(wanted=wanted))


def overlap(box: Box | None, other: Box) -> float:
    assert box is not None
    return float(overlaps(np.array([box], float), np.array([other], float))[0, 0])


NEAR, FAR = (100, 100, 240, 260), (400, 120, 500, 250)


def test_the_box_is_the_detectors() -> None:
    assert finder(Eyes([NEAR])).find(frame(0, (NEAR, 0.5))) == NEAR


@pytest.mark.parametrize(("wanted", "box"), [("nearest", NEAR), ("left", NEAR), ("right", FAR)])
def test_of_two_hands_the_wanted_one(wanted: Wanted, box: Box) -> None:
    found = finder(Eyes([FAR, NEAR]), wanted).find(frame(0, (NEAR, 0.4), (FAR, 0.6)))
    assert found == box


@pytest.mark.parametrize("depth_m", [0.2, 0.9])
def test_what_is_out_of_reach_is_no_hand(depth_m: float) -> None:
    assert finder(Eyes([NEAR])).find(frame(0, (NEAR, depth_m))) is None


@pytest.mark.parametrize("box", [(100, 100, 120, 120), (0, 0, 600, 350)])
def test_what_has_not_a_hands_size_is_none(box: Box) -> None:
    assert finder(Eyes([box])).find(frame(0, (box, 0.5))) is None


def test_what_does_not_fill_its_box_is_none() -> None:
    corner = NEAR[0], NEAR[1], NEAR[0] + 60, NEAR[1] + 60
    assert finder(Eyes([NEAR])).find(frame(0, (corner, 0.5))) is None


def test_of_two_boxes_on_one_hand_the_surer() -> None:
    nearer_part = 110, 110, 190, 200
    eyes = Eyes([NEAR, nearer_part])
    assert finder(eyes).find(frame(0, (NEAR, 0.5), (nearer_part, 0.48))) == NEAR


def test_without_colour_there_is_no_box() -> None:
    eyes = Eyes([NEAR])
    blind = replace(frame(0, (NEAR, 0.5)), color=None, color_intrinsics=None)
    assert finder(eyes).find(blind) is None
    assert eyes.looks == 0


def test_the_box_moves_with_the_hand_between_looks() -> None:
    eyes = Eyes([NEAR])
    roi = finder(eyes)
    for index in range(5):
        moved = tuple(np.array(NEAR) + 12 * index)
        found = roi.find(frame(index, (moved, 0.5)))
        assert overlap(found, moved) > 0.75
    assert eyes.looks == 1


def test_the_box_does_not_creep_along_the_arm() -> None:
    hand, arm = (100, 100, 240, 260), (140, 260, 200, 360)
    eyes = Eyes([hand])
    roi = finder(eyes)
    for index in range(5):
        found = roi.find(frame(index, (hand, 0.5), (arm, 0.5)))
    assert overlap(found, hand) > 0.9
    assert eyes.looks == 1


def test_the_detector_looks_seldom_at_a_hand_that_is_followed() -> None:
    eyes = Eyes([NEAR])
    roi = finder(eyes)
    for index in range(61):
        assert roi.find(frame(index, (NEAR, 0.5))) is not None
    assert eyes.looks <= 14


def test_a_lost_hand_is_found_within_100_ms() -> None:
    eyes = Eyes([NEAR])
    roi = finder(eyes)
    for index in range(4):
        roi.find(frame(index, (NEAR, 0.5)))
    eyes.boxes = [FAR]
    found = [roi.find(frame(4 + index, (FAR, 0.5))) for index in range(4)]
    assert found[3] == FAR


def test_what_is_no_hand_any_more_is_dropped_within_300_ms() -> None:
    eyes = Eyes([NEAR])
    roi = finder(eyes)
    assert roi.find(frame(0, (NEAR, 0.5))) is not None
    eyes.boxes = []
    found = [roi.find(frame(index, (NEAR, 0.5))) for index in range(1, 10)]
    assert found[0] is not None
    assert found[-1] is None


def test_one_look_that_misses_does_not_drop_the_hand() -> None:
    eyes = Eyes([NEAR])
    roi = finder(eyes)
    roi.find(frame(0, (NEAR, 0.5)))
    eyes.boxes = []
    index = 1
    while eyes.looks < 2:
        roi.find(frame(index, (NEAR, 0.5)))
        index += 1
    eyes.boxes = [NEAR]
    assert all(roi.find(frame(index + more, (NEAR, 0.5))) for more in range(10))


def test_a_colour_camera_beside_the_depth_camera() -> None:
    aligned = frame(0, (NEAR, 0.5))
    # 20 mm to the left at 0.5 m are 20 px: what is at x in the depth image is at x + 20 in colour.
    beside = replace(aligned, T_C_D=rigid(translation_m=[0.02, 0.0, 0.0]))
    seen = NEAR[0] + 20, NEAR[1], NEAR[2] + 20, NEAR[3]
    assert overlap(finder(Eyes([seen])).find(beside), NEAR) > 0.97
