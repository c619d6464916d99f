from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from handcal.core.geometry import rigid
from handcal.core.types import Frame, Intrinsics, UInt8
from handcal.hand.detect import Detections, overlaps
from handcal.hand.finder import RoiFinder
from handcal.hand.settings import Roi, SegmentSettings
from handcal.hand.view import Box

CAMERA = Intrinsics(width=640, height=360, fx=500.0, fy=500.0, cx=319.5, cy=179.5)
FRAME_NS = 33_000_000


@dataclass
class Eyes:
    """A detector that sees things by their colour, the surest first, and counts its looks.

    Those of `only_from_far` it does not see near by.
    """

    seen: dict[int, float] = field(default_factory=lambda: {1: 0.9, 2: 0.8})
    only_from_far: tuple[int, ...] = ()
    looks: int = 0
    wide_looks: int = 0

    def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
        self.looks += 1
        self.wide_looks += pixels is None
        boxes, scores = [], []
        for number, score in self.seen.items():
            rows, columns = np.nonzero(color[..., 0] == number)
            if rows.size and (pixels is None or number not in self.only_from_far):
                boxes.append([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
                scores.append(score)
        return Detections(np.array(boxes, float).reshape(-1, 4), np.array(scores))


def frame(index: int, *things: tuple[Box, float], camera_x_px: int = 0) -> Frame:
    """Return a frame of things, coloured 1, 2 and so on, at depths before a far wall."""
    depth = np.full((360, 640), 2000, np.uint16)
    color = np.zeros((360, 640, 3), np.uint8)
    for number, ((x0, y0, x1, y1), depth_m) in enumerate(things, 1):
        depth[y0:y1, x0:x1] = round(1000 * depth_m)
        color[y0:y1, x0 + camera_x_px : x1 + camera_x_px] = number
    return Frame(index, index * FRAME_NS, 0, depth, 0.001, CAMERA, color, CAMERA)


def finder(eyes: Eyes, wanted: Roi = "detector") -> RoiFinder:
    return RoiFinder(eyes, SegmentSettings(roi=wanted))


def overlap(box: Box | None, other: Box) -> float:
    assert box is not None
    return float(overlaps(np.array([box], float), np.array([other], float))[0, 0])


def moved_by(box: Box, x_px: int) -> Box:
    x0, y0, x1, y1 = box
    return x0 + x_px, y0, x1 + x_px, y1


NEAR, FAR = (100, 100, 240, 260), (400, 120, 500, 250)


def test_the_box_is_the_detectors() -> None:
    assert finder(Eyes()).find(frame(0, (NEAR, 0.5))) == NEAR


WANTED = pytest.mark.parametrize(
    ("wanted", "box"), [("detector", NEAR), ("left", NEAR), ("right", FAR)]
)


@WANTED
def test_of_two_hands_the_wanted_one(wanted: Roi, box: Box) -> None:
    found = finder(Eyes(), wanted).find(frame(0, (FAR, 0.6), (NEAR, 0.4)))
    assert found == box


@WANTED
def test_the_wanted_hand_is_followed_once_it_comes(wanted: Roi, box: Box) -> None:
    both = (FAR, 0.6), (NEAR, 0.4)
    other = both[box == FAR]
    roi = finder(Eyes(), wanted)
    for index in range(10):
        assert roi.find(frame(index, other)) == other[0]
    found = [roi.find(frame(10 + index, *both)) for index in range(40)]
    assert found[-1] == box


def test_the_other_hand_is_not_followed_for_being_a_little_nearer() -> None:
    roi = finder(Eyes())
    assert roi.find(frame(0, (FAR, 0.50))) == FAR
    found = [roi.find(frame(1 + index, (FAR, 0.50), (NEAR, 0.45))) for index in range(60)]
    assert set(found) == {FAR}


def test_a_followed_hand_stays_where_what_is_nearer_is_none() -> None:
    eyes = Eyes({1: 0.9})
    roi = finder(eyes)
    found = {roi.find(frame(index, (FAR, 0.6), (NEAR, 0.4))) for index in range(60)}
    assert found == {FAR}
    assert eyes.wide_looks <= 3


def test_what_looks_like_a_hand_only_from_far_is_none() -> None:
    roi = finder(Eyes(only_from_far=(1,)))
    found = {roi.find(frame(index, (NEAR, 0.4), (FAR, 0.6))) for index in range(10)}
    assert found == {FAR}


def test_a_doubtful_hand_is_not_taken_for_being_nearer() -> None:
    eyes = Eyes({1: 0.9, 2: 0.5})
    assert finder(eyes).find(frame(0, (FAR, 0.6), (NEAR, 0.4))) == FAR


@pytest.mark.parametrize("depth_m", [0.2, 0.9])
def test_what_is_out_of_reach_is_no_hand(depth_m: float) -> None:
    assert finder(Eyes()).find(frame(0, (NEAR, depth_m))) is None


@pytest.mark.parametrize("box", [(100, 100, 120, 120), (0, 0, 600, 350)])
def test_what_has_not_a_hands_size_is_none(box: Box) -> None:
    assert finder(Eyes()).find(frame(0, (box, 0.5))) is None


def test_what_does_not_fill_its_box_is_none() -> None:
    corners = [(100, 100, 140, 140), (200, 220, 240, 260)]
    one_thing = frame(0, *((corner, 0.5) for corner in corners))
    assert one_thing.color is not None
    color = np.minimum(one_thing.color, 1)
    assert finder(Eyes()).find(replace(one_thing, color=color)) is None


def test_of_two_boxes_on_one_hand_the_surer() -> None:
    eyes = Eyes({1: 0.9, 2: 0.85})
    inner = 110, 110, 190, 200
    assert finder(eyes).find(frame(0, (NEAR, 0.5), (inner, 0.48))) == NEAR


def test_without_colour_there_is_no_box() -> None:
    eyes = Eyes()
    blind = replace(frame(0, (NEAR, 0.5)), color=None, color_intrinsics=None)
    assert finder(eyes).find(blind) is None
    assert eyes.looks == 0


def test_the_box_moves_with_the_hand_between_looks() -> None:
    eyes = Eyes()
    roi = finder(eyes)
    for index in range(5):
        moved = moved_by(NEAR, 12 * index)
        assert overlap(roi.find(frame(index, (moved, 0.5))), moved) > 0.75
    assert eyes.looks == 2  # from far and, to be sure, near by


def test_the_box_does_not_creep_along_the_arm() -> None:
    hand, arm = (100, 100, 240, 260), (140, 260, 200, 360)
    eyes = Eyes({1: 0.9})
    roi = finder(eyes)
    for index in range(5):
        found = roi.find(frame(index, (hand, 0.5), (arm, 0.5)))
    assert overlap(found, hand) > 0.9
    assert eyes.looks == 2


def test_the_detector_looks_seldom_and_nearby_at_a_hand_that_is_followed() -> None:
    eyes = Eyes()
    roi = finder(eyes)
    for index in range(61):
        assert roi.find(frame(index, (moved_by(NEAR, 4 * index), 0.5))) is not None
    assert eyes.looks <= 14
    assert eyes.wide_looks == 1


RATES_HZ = pytest.mark.parametrize("rate_hz", [6, 7, 9, 12, 15, 18, 30, 45, 60, 90])


def at(index: int, rate_hz: int, *things: tuple[Box, float]) -> Frame:
    return replace(frame(index, *things), t_camera_ns=round(1e9 * index / rate_hz))


@RATES_HZ
@pytest.mark.parametrize("before", range(1, 8))
def test_a_lost_hand_is_found_within_100_ms(rate_hz: int, before: int) -> None:
    roi = finder(Eyes())
    for index in range(before):
        roi.find(at(index, rate_hz, (NEAR, 0.5)))
    found = [roi.find(at(before + index, rate_hz, (FAR, 0.5))) for index in range(rate_hz)]
    assert found.index(FAR) / rate_hz <= 0.1
    assert set(found[found.index(FAR) :]) == {FAR}


@RATES_HZ
@pytest.mark.parametrize("before", range(1, 8))
def test_what_is_no_hand_any_more_is_dropped_within_300_ms(rate_hz: int, before: int) -> None:
    eyes = Eyes()
    roi = finder(eyes)
    for index in range(before):
        assert roi.find(at(index, rate_hz, (NEAR, 0.5))) is not None
    eyes.seen = {}
    found = [roi.find(at(before + index, rate_hz, (NEAR, 0.5))) for index in range(rate_hz)]
    assert found.index(None) / rate_hz <= 0.3
    assert set(found[found.index(None) :]) == {None}


def test_one_look_that_misses_does_not_drop_the_hand() -> None:
    eyes = Eyes()
    roi = finder(eyes)
    roi.find(frame(0, (NEAR, 0.5)))
    seen, eyes.seen = eyes.seen, {}
    index = 1
    while eyes.looks < 3:
        roi.find(frame(index, (NEAR, 0.5)))
        index += 1
    eyes.seen = seen
    assert all(roi.find(frame(index + more, (NEAR, 0.5))) for more in range(10))


def test_a_repeated_recording_is_searched_again() -> None:
    roi = finder(Eyes())
    for index in range(100, 104):
        roi.find(frame(index, (NEAR, 0.5)))
    assert roi.find(frame(0, (FAR, 0.5))) == FAR


def test_a_colour_camera_beside_the_depth_camera() -> None:
    eyes = Eyes()
    roi = finder(eyes)
    for index in range(8):
        # 20 mm to the left at 0.5 m are 20 px: what is at x in the depth image is at x + 20 there.
        seen = frame(index, (NEAR, 0.5), camera_x_px=20)
        beside = replace(seen, T_C_D=rigid(translation_m=[0.02, 0.0, 0.0]))
        assert overlap(roi.find(beside), NEAR) > 0.97
    assert (eyes.looks, eyes.wide_looks) == (3, 1)
