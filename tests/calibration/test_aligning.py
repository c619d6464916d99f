"""The advice to a wearer whose hand is turned, which does not come and go at its limit."""

from __future__ import annotations

import numpy as np
import pytest

from handcal.calibration.aligning import ADVISE_EVERY_NS, Aligning, align_prompt
from handcal.calibration.hands import PlacedHand
from handcal.calibration.sight import Observation
from handcal.calibration.states import State
from handcal.core.types import EYES, HandCloud
from handcal.register.guard import GuardSettings
from handcal.rig.example import example_rig

TURN_BACK = "Tilt your hand anticlockwise, then confirm."


def hand(t_host_ns: int) -> PlacedHand:
    points_W_m = np.random.default_rng(0).normal([0.0, 0.0, 0.5], 0.05, (300, 3))
    points_m = points_W_m.astype(np.float32)
    cut = np.zeros(300, bool)
    cloud = HandCloud(
        t_camera_ns=t_host_ns,
        t_host_ns=t_host_ns,
        points_m=points_m,
        is_cut=cut,
        colors=None,
        contour_m=points_m,
        contour_is_cut=cut,
        mask=np.zeros((4, 4), np.uint8),
        box_px=(0, 0, 1, 1),
        median_depth_m=0.5,
    )
    return PlacedHand(cloud, t_host_ns, np.eye(4), points_W_m, np.median(points_W_m, axis=0))


class Wearer:
    """Turns the hand about the camera's axis, and reads the advice."""

    def __init__(self) -> None:
        self._aligning = Aligning(hand(0), EYES, example_rig(), GuardSettings())
        self._t_ns = 0

    def turn(self, angle_deg: float, after_ns: int = ADVISE_EVERY_NS) -> str | None:
        """Return the prompt that is new at an angle, `after_ns` after the last."""
        self._t_ns += after_ns
        rotation_rad = np.radians([0.0, 0.0, angle_deg])
        seen = Observation(State.ALIGN, hand(self._t_ns), "", True, rotation_rad=rotation_rad)
        return self._aligning.advise(seen)


@pytest.fixture
def wearer() -> Wearer:
    return Wearer()


def test_advice_begins_above_three_degrees_and_ends_clearly_below(wearer: Wearer) -> None:
    assert wearer.turn(2.9) is None
    assert wearer.turn(3.1) == TURN_BACK
    assert [wearer.turn(angle_deg) for angle_deg in (2.9, 3.1, 2.2)] == [None] * 3
    assert wearer.turn(2.0) == align_prompt(EYES)
    assert wearer.turn(2.9) is None


def test_advice_stays_long_enough_to_be_read(wearer: Wearer) -> None:
    assert wearer.turn(5.0) == TURN_BACK
    assert wearer.turn(-5.0, ADVISE_EVERY_NS // 2) is None
    assert wearer.turn(-5.0, ADVISE_EVERY_NS // 2) == "Tilt your hand clockwise, then confirm."
