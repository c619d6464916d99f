import numpy as np
import pytest

from handcal.core.display import eye_projection, reprojection_error_px, target_corners_m
from handcal.core.geometry import project
from handcal.core.types import Float64
from handcal.rig.example import FOCAL_PX, example_rig
from handcal.station.wearer_view import EyeView, render_eye_view

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
