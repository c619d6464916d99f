import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handcal.core.display import arcmin_from_px, eye_projection, update_matrix
from handcal.core.geometry import project, transform
from handcal.register.model import (
    balanced_turn,
    cursor_displacement,
    fit_shift,
    nudged_shift_m,
    predict,
)
from handcal.rig.example import example_rig

SHIFTS = st.tuples(*[st.floats(-0.02, 0.02)] * 3).map(np.array)
DISTANCES = st.floats(1.0, 5.0)
HAND_M = np.random.default_rng(0).uniform([-0.1, -0.1, 0.4], [0.1, 0.1, 0.6], (30, 3))
both_factors = pytest.mark.parametrize("exact", [False, True])


@both_factors
@given(shift_m=SHIFTS, distance_m=DISTANCES)
def test_known_pairs_give_the_shift(exact: bool, shift_m: np.ndarray, distance_m: float) -> None:
    cursor_m = predict(HAND_M, shift_m, distance_m, exact=exact)
    found_m = fit_shift(cursor_m, HAND_M, distance_m, exact=exact)
    np.testing.assert_allclose(found_m, shift_m, atol=1e-9)


@given(shift_m=SHIFTS, distance_m=DISTANCES)
def test_cursor_and_hand_fall_on_one_pixel(shift_m: np.ndarray, distance_m: float) -> None:
    # The offline model draws the cursor; the eye at φ sees the hand. Either factor, one pixel.
    offline, moved = np.eye(3, 4), update_matrix(shift_m, distance_m)[:3]
    seen = project(moved, HAND_M)
    for exact in (False, True):
        cursor_m = predict(HAND_M, shift_m, distance_m, exact=exact)
        np.testing.assert_allclose(project(offline, cursor_m), seen, atol=1e-12)


@given(drawn_m=SHIFTS)
def test_a_cursor_drawn_with_another_shift_looks_like_one_drawn_offline(
    drawn_m: np.ndarray,
) -> None:
    cursor_m = HAND_M
    pixels = project(update_matrix(drawn_m, 2.0)[:3], cursor_m)
    as_offline_m = transform(cursor_displacement(drawn_m, 2.0), cursor_m)
    np.testing.assert_allclose(project(np.eye(3, 4), as_offline_m), pixels, atol=1e-12)
    # A hand where the cursor is needs the very shift that the cursor is drawn with.
    found_m = fit_shift(as_offline_m, cursor_m, 2.0, exact=True)
    np.testing.assert_allclose(found_m, drawn_m, atol=1e-12)


@given(turned_rad=st.tuples(*[st.floats(-0.16, 0.16)] * 3).map(np.array))
def test_a_turned_outline_is_balanced_wherever_it_is_turned_about(turned_rad: np.ndarray) -> None:
    R = Rotation.from_rotvec(turned_rad).as_matrix()

    def balanced_m(about_m: np.ndarray) -> np.ndarray:
        turned_m = about_m + (HAND_M - about_m) @ R
        return np.asarray(turned_m + balanced_turn(HAND_M, R, about_m))

    placed_m = balanced_m(HAND_M.mean(axis=0))
    np.testing.assert_allclose(balanced_m(HAND_M[0]), placed_m, atol=5e-5)

    # No small movement from there makes both outlines agree better in the image.
    def apart(moved_m: np.ndarray) -> float:
        seen = (placed_m + moved_m)[:, :2] / (placed_m + moved_m)[:, 2:]
        return float(np.sum((seen - HAND_M[:, :2] / HAND_M[:, 2:]) ** 2))

    for step_m in 2e-3 * np.vstack([np.eye(3), -np.eye(3)]):
        assert apart(step_m) > apart(np.zeros(3))


DISPLAY = example_rig().eyes["left"]
NUDGED_M = np.array([0.02, 0.04, 0.47])
_SIDES_M = 0.01 * np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
MILLIMETRES = st.floats(-0.01, 0.01)


def _drawn(shift_m: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the pixel of the hand's centre, and the size of a cross around it in px."""
    pixels = project(
        eye_projection(DISPLAY, shift_m), NUDGED_M + np.vstack([np.zeros(3), _SIDES_M])
    )
    return pixels[0], float(np.linalg.norm(pixels[1] - pixels[2]))


@given(
    shift=st.tuples(MILLIMETRES, MILLIMETRES, MILLIMETRES),
    right=st.floats(-60.0, 60.0),
    down=st.floats(-60.0, 60.0),
    size=st.floats(-0.05, 0.05),
)
def test_the_drawing_moves_and_grows_by_the_nudge(
    shift: tuple[float, float, float], right: float, down: float, size: float
) -> None:
    shift_m = np.array(shift)
    before_px, before_size_px = _drawn(shift_m)
    after_px, after_size_px = _drawn(nudged_shift_m(DISPLAY, shift_m, NUDGED_M, right, down, size))
    moved_arcmin = np.sign(after_px - before_px) * arcmin_from_px(
        DISPLAY, np.abs(after_px - before_px)
    )
    assert moved_arcmin == pytest.approx([right, down], abs=1e-6)
    assert after_size_px / before_size_px == pytest.approx(1.0 + size, rel=1e-9)


@pytest.mark.parametrize(
    ("hand_m", "size"),
    [((0.0, 0.0, 2.5), 0.0), ((0.0, 0.0, -0.1), 0.0), ((0.0, 0.0, np.nan), 0.0), (NUDGED_M, -0.9)],
)
def test_impossible_nudges_are_refused(hand_m: tuple[float, float, float], size: float) -> None:
    with pytest.raises(ValueError, match=r"hand|drawing|finite"):
        nudged_shift_m(DISPLAY, np.zeros(3), hand_m, 1.0, 1.0, size)
