import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.display import eye_projection
from handcal.core.geometry import project
from handcal.lab.methods.fingertip import solve_eye_from_points
from handcal.rig.example import example_rig

DISPLAY = example_rig().eyes["left"]


@settings(max_examples=25, derandomize=True)
@given(seed=st.integers(0, 10_000), count=st.sampled_from([2, 3, 8, 25]))
def test_exact_alignments_give_the_eye(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    shift_m = rng.uniform(-0.01, 0.01, 3)
    points_m = np.array([0.0, 0.0, 0.5]) + rng.uniform(-0.06, 0.06, (count, 3))
    found = solve_eye_from_points(
        points_m, project(eye_projection(DISPLAY, shift_m), points_m), DISPLAY
    )
    assert np.abs(found - shift_m).max() < 1e-6


def test_bad_input_is_refused() -> None:
    ray_m = np.outer([0.4, 0.5, 0.6], [0.1, 0.0, 1.0])
    pixels = project(eye_projection(DISPLAY), ray_m)
    with pytest.raises(ValueError, match="between 2 and"):
        solve_eye_from_points(ray_m[:1], pixels[:1], DISPLAY)
    with pytest.raises(ValueError, match="behind"):
        solve_eye_from_points(-ray_m, pixels, DISPLAY)
    on_display_m = np.array([[0.1, 0.0, 2.0], [0.0, 0.1, 2.0], [0.2, 0.1, 2.0]])
    with pytest.raises(ValueError, match="spread them out"):
        solve_eye_from_points(on_display_m, project(eye_projection(DISPLAY), on_display_m), DISPLAY)
    with pytest.raises(ValueError, match="spread them out"):
        solve_eye_from_points(
            np.repeat(ray_m[:1], 3, axis=0), np.repeat(pixels[:1], 3, axis=0), DISPLAY
        )
