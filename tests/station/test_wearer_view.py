"""The view of each eye, and both eyes' views of one moment."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from handcal.calibration.hands import PlacedHand
from handcal.calibration.procedure import Calibration
from handcal.core.display import eye_projection, target_corners_m
from handcal.core.geometry import project
from handcal.core.types import EYES, Float64, HandCloud
from handcal.rig.example import FOCAL_PX, example_rig
from handcal.station import wearer_view
from handcal.station.settings import StationSettings
from handcal.station.wearer_view import EyeView, EyeViews, render_eye_view
from tests.helpers import reprojection_error_px

DISPLAY = example_rig().eyes["left"]
OUTLINE_M = np.array([[x, y, 0.5] for x in (-0.04, 0.04) for y in (-0.03, 0.03)])
SHIFT_M = np.array([0.003, -0.002, 0.004])
NONE_M = np.empty((0, 3))


def _see(drawn_shift_m: Float64, outline_m: Float64 = OUTLINE_M) -> EyeView:
    return render_eye_view(
        "left", DISPLAY, SHIFT_M, drawn_shift_m, outline_m, OUTLINE_M, is_true=True
    )


def test_right_projection_draws_the_outline_onto_the_hand() -> None:
    view = _see(SHIFT_M)
    np.testing.assert_allclose(view.drawn.outline_px, view.hand_px)
    assert view.drawn.error_px == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(view.cursor_px, view.drawn.outline_px)


def test_error_is_the_distance_between_the_hand_and_its_drawing() -> None:
    view = _see(np.zeros(3))
    expected_px = reprojection_error_px(DISPLAY, np.zeros(3), SHIFT_M, OUTLINE_M).mean()
    assert view.drawn.error_px == pytest.approx(expected_px)
    # An eye 3.6 mm aside sees 1/0.5 m - 1/2 m of that parallax between the hand and the display.
    assert view.drawn.error_px == pytest.approx(0.0036 * FOCAL_PX * 1.5, rel=0.1)
    assert view.drawn.error_arcmin == pytest.approx(
        60.0 * np.degrees(expected_px / FOCAL_PX), rel=0.01
    )


def test_offline_projection_stays_for_comparison() -> None:
    view = _see(SHIFT_M)
    np.testing.assert_allclose(view.offline.outline_px, project(eye_projection(DISPLAY), OUTLINE_M))
    assert view.offline.error_px == _see(np.zeros(3)).drawn.error_px


def test_target_is_seen_at_its_place_and_drawn_with_what_the_headset_has() -> None:
    corners_m = target_corners_m(0.5)
    wrong_m = np.zeros(3)
    view = render_eye_view(
        "left", DISPLAY, SHIFT_M, wrong_m, NONE_M, NONE_M, corners_m, is_true=True
    )
    np.testing.assert_allclose(view.target_px, project(eye_projection(DISPLAY, SHIFT_M), corners_m))
    np.testing.assert_allclose(
        np.linalg.norm(view.drawn_target_px - view.target_px, axis=1),
        reprojection_error_px(DISPLAY, wrong_m, SHIFT_M, corners_m),
    )
    right = render_eye_view(
        "left", DISPLAY, SHIFT_M, SHIFT_M, NONE_M, NONE_M, corners_m, is_true=True
    )
    np.testing.assert_allclose(right.drawn_target_px, right.target_px)


def test_what_lies_at_or_behind_the_eye_is_left_out() -> None:
    behind_m = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.0]])
    view = _see(np.zeros(3), np.vstack([behind_m, OUTLINE_M]))
    np.testing.assert_array_equal(view.hand_px, _see(np.zeros(3)).hand_px)
    assert len(view.drawn.outline_px) == len(view.hand_px) == len(OUTLINE_M)


def test_no_outline_has_no_error() -> None:
    view = _see(np.zeros(3), NONE_M)
    assert view.hand_px.shape == (0, 2)
    assert view.drawn.error_px is None
    assert view.offline.error_arcmin is None
    assert view.target_px.shape == view.drawn_target_px.shape == (0, 2)


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
