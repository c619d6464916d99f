import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.display import eye_projection
from handcal.core.geometry import rigid
from handcal.core.types import Float64
from handcal.lab.methods.indica import solve_indica_full, solve_indica_recycled, split_projection
from handcal.rig.example import example_rig

DISPLAY = example_rig().eyes["right"]


def ratio(P: Float64, Q: Float64) -> float:
    """Return how far two projections differ but for their scale, with their sign."""
    return float(np.abs(P / np.linalg.norm(P) - Q / np.linalg.norm(Q)).max())


@settings(max_examples=25, derandomize=True)
@given(seed=st.integers(0, 10_000))
def test_recycled_moves_the_viewpoint(seed: int) -> None:
    rng = np.random.default_rng(seed)
    T_E_H = rigid(rng.normal(0.0, 0.3, 3), rng.normal(0.0, 0.1, 3))
    shift_m = rng.uniform(-0.01, 0.01, 3)
    eye_m = (shift_m - T_E_H[:3, 3]) @ T_E_H[:3, :3]
    found = solve_indica_recycled(eye_projection(DISPLAY) @ T_E_H, DISPLAY.z_C0_S_m, eye_m)
    assert ratio(found, eye_projection(DISPLAY, shift_m) @ T_E_H) < 1e-6


def test_full_sees_the_display_where_it_is() -> None:
    """Any point of the display is on the pixel that lies there, from wherever the eye looks."""
    rng = np.random.default_rng(1)
    T_S_H = rigid(rng.normal(0.0, 0.2, 3), [0.01, 0.02, -1.5])
    focal_px_m, centre_px = 1800.0, np.array([640.0, 360.0])
    spot_m = np.array([0.2, -0.1])
    spot_H_m = T_S_H[:3, :3].T @ (np.array([*spot_m, 0.0]) - T_S_H[:3, 3])
    for _ in range(5):
        eye_m = rng.normal(0.0, 0.02, 3)
        P = solve_indica_full(focal_px_m, centre_px, T_S_H, eye_m)
        beyond_m = eye_m + 0.4 * (spot_H_m - eye_m)
        x = P @ [*beyond_m, 1.0]
        assert np.abs(x[:2] / x[2] - centre_px - focal_px_m * spot_m).max() < 1e-6
        assert x[2] > 0.0


def test_both_setups_agree_on_the_same_display() -> None:
    T_S_H = rigid([0.1, -0.05, 0.02], [0.0, 0.01, -1.8])
    before = solve_indica_full(1500.0, (500.0, 300.0), T_S_H, np.zeros(3))
    eye_m = np.array([0.004, -0.003, 0.006])
    after = solve_indica_full(1500.0, (500.0, 300.0), T_S_H, eye_m)
    assert ratio(solve_indica_recycled(before, 1.8, eye_m), after) < 1e-6


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_split_projection_gives_it_back(mirror: float) -> None:
    P = np.diag([1.0, mirror, 1.0]) @ eye_projection(DISPLAY, (0.003, 0.002, 0.001))
    K, R, c_m = split_projection(P)
    assert np.linalg.det(R) == pytest.approx(mirror)
    assert (np.diag(K) > 0.0).all()
    assert ratio(K @ R @ np.column_stack([np.eye(3), -c_m]), P) < 1e-12


def test_bad_input_is_refused() -> None:
    P = eye_projection(DISPLAY)
    with pytest.raises(ValueError, match="NaN"):
        solve_indica_recycled(P, 2.0, [np.nan, 0.0, 0.0])
    with pytest.raises(ValueError, match="no viewpoint"):
        solve_indica_recycled(np.zeros((3, 4)), 2.0, np.zeros(3))
    with pytest.raises(ValueError, match="positive"):
        solve_indica_recycled(P, 0.0, np.zeros(3))
    with pytest.raises(ValueError, match="focal plane"):
        solve_indica_full(1500.0, (0.0, 0.0), np.eye(4), np.array([0.0, 0.0, 0.1]))
    with pytest.raises(ValueError, match="shape"):
        solve_indica_full(1500.0, (0.0, 0.0), np.eye(3), np.zeros(3))
