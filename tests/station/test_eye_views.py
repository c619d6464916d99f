"""The wearer's views: of both eyes at one moment, one rendered with each frame."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from handcal.calibration.hands import PlacedHand
from handcal.calibration.procedure import Calibration
from handcal.core.types import EYES, HandCloud
from handcal.rig.example import example_rig
from handcal.station import wearer_view
from handcal.station.settings import StationSettings
from handcal.station.wearer_view import EyeViews

FRAME_NS = 333_000_000


def hand_of(frame: int) -> PlacedHand:
    """Return the hand of a frame; its outline has as many points as there were frames."""
    contour_m = np.tile([0.0, 0.0, 0.5], (frame, 1))
    cloud = cast(HandCloud, SimpleNamespace(outline_m=contour_m))
    return PlacedHand(cloud, FRAME_NS * frame, np.eye(4), contour_m, contour_m[0])


@pytest.fixture
def views(monkeypatch: pytest.MonkeyPatch) -> EyeViews:
    monkeypatch.setattr(wearer_view, "_PERIOD_S", 0.0)
    monkeypatch.setattr(wearer_view, "time", SimpleNamespace(monotonic=lambda: 0.0))
    offline_m = {eye: np.zeros(3) for eye in EYES}
    calibration = SimpleNamespace(cursor=None, results=None, applied_shift_m=offline_m)
    rig, settings = example_rig(), StationSettings(source="realsense", headset="network")
    return EyeViews(cast(Calibration, calibration), rig, settings, None, rig)


def shown_after(views: EyeViews, frame: int) -> list[int]:
    """Return the frames of which the eyes' views are, once a frame has been taken."""
    views.render_next(hand_of(frame), {}, is_offline=False)
    return [len(views.shown[eye].hand_px) for eye in views.shown]


def test_both_eyes_are_shown_at_the_same_moment(views: EyeViews) -> None:
    shown = [shown_after(views, frame) for frame in range(1, 6)]
    assert shown == [[], [1, 1], [1, 1], [3, 3], [3, 3]]


def test_an_eye_is_not_rendered_of_a_hand_that_was_lost_long_ago(views: EyeViews) -> None:
    assert shown_after(views, 1) == []
    assert shown_after(views, 30) == []
    assert shown_after(views, 31) == [30, 30]
