import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.display import arcmin_from_px, eye_projection
from handcal.core.geometry import project
from handcal.register.model import nudged_shift_m
from handcal.rig.example import example_rig

DISPLAY = example_rig().eyes["left"]
HAND_M = np.array([0.02, 0.04, 0.47])
_SIDES_M = 0.01 * np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
MILLIMETRES = st.floats(-0.01, 0.01)


def _drawn(shift_m: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the pixel of the hand's centre, and the size of a cross around it in px."""
    pixels = project(eye_projection(DISPLAY, shift_m), HAND_M + np.vstack([np.zeros(3), _SIDES_M]))
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
    after_px, after_size_px = _drawn(nudged_shift_m(DISPLAY, shift_m, HAND_M, right, down, size))
    moved_arcmin = np.sign(after_px - before_px) * arcmin_from_px(
        DISPLAY, np.abs(after_px - before_px)
    )
    assert moved_arcmin == pytest.approx([right, down], abs=1e-6)
    assert after_size_px / before_size_px == pytest.approx(1.0 + size, rel=1e-9)


@given(shift=st.tuples(MILLIMETRES, MILLIMETRES, MILLIMETRES))
def test_no_nudge_changes_nothing(shift: tuple[float, float, float]) -> None:
    assert nudged_shift_m(DISPLAY, shift, HAND_M, 0.0, 0.0) == pytest.approx(shift, abs=1e-12)


@pytest.mark.parametrize(
    ("hand_m", "size"),
    [((0.0, 0.0, 2.5), 0.0), ((0.0, 0.0, -0.1), 0.0), ((0.0, 0.0, np.nan), 0.0), (HAND_M, -0.9)],
)
def test_impossible_nudges_are_refused(hand_m: tuple[float, float, float], size: float) -> None:
    with pytest.raises(ValueError, match=r"hand|drawing|finite"):
        nudged_shift_m(DISPLAY, np.zeros(3), hand_m, 1.0, 1.0, size)
