"""Calibration methods of others: exact data give the truth, and hopeless ones are refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.display import eye_projection
from handcal.core.geometry import project, rigid, transform
from handcal.core.types import EYES, Float64
from handcal.lab.methods import (
    FEWEST_PAIRS,
    MapModel,
    solve_eye_from_points,
    solve_indica_full,
    solve_indica_recycled,
    solve_mpaam,
    solve_spaam,
    solve_stereo_spaam,
    split_projection,
)
from handcal.rig.example import example_rig

DISPLAY = example_rig().eyes["left"]
CORNERS_M = 0.04 * np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [1, 1, 1]], dtype=float
)
RIGID = rigid([0.02, -0.03, 0.01], [0.004, -0.002, 0.01])
AFFINE = RIGID @ np.diag([1.01, 0.98, 1.03, 1.0])
PERSPECTIVE = np.vstack([AFFINE[:3], [0.02, -0.01, 0.05, 1.0]])
seeds = given(seed=st.integers(0, 10_000))
few = settings(max_examples=25, derandomize=True)


def spread_points(rng: np.random.Generator, count: int) -> Float64:
    depth_m = rng.uniform(0.35, 0.7, count)
    aside = rng.uniform(-1.0, 1.0, (count, 2)) * [0.22, 0.12]
    return np.column_stack([aside * depth_m[:, None], depth_m])


def difference(P: Float64, Q: Float64) -> float:
    """Return how far two projections differ but for their scale, with their sign."""
    return float(np.abs(P / np.linalg.norm(P) - Q / np.linalg.norm(Q)).max())


def mapped(T: Float64, points_m: Float64) -> Float64:
    h = np.column_stack([points_m, np.ones(len(points_m))]) @ T.T
    return np.asarray(h[:, :3] / h[:, 3:])


@few
@given(seed=st.integers(0, 10_000), count=st.sampled_from([6, 8, 25]))
def test_spaam_gives_the_projection(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    T_E_H = rigid(rng.normal(0.0, 0.3, 3), rng.normal(0.0, 0.1, 3))
    P = eye_projection(DISPLAY, rng.uniform(-0.01, 0.01, 3)) @ T_E_H
    points_H_m = (spread_points(rng, count) - T_E_H[:3, 3]) @ T_E_H[:3, :3]
    # With six points the system is square but for one row, and rounding weighs more.
    assert difference(solve_spaam(points_H_m, project(P, points_H_m)), P) < 1e-6


def test_stereo_spaam_gives_each_eye_its_own() -> None:
    rng = np.random.default_rng(3)
    points_m = spread_points(rng, 12)
    true = {
        eye: eye_projection(example_rig().eyes[eye], rng.uniform(-0.01, 0.01, 3)) for eye in EYES
    }
    found = solve_stereo_spaam(points_m, {eye: project(P, points_m) for eye, P in true.items()})
    assert max(difference(found[eye], true[eye]) for eye in EYES) < 1e-6
    with pytest.raises(ValueError, match="right eye: points_m has 2"):
        solve_stereo_spaam(np.ones((2, 3)), {"right": np.ones((2, 2))})


@pytest.mark.parametrize(
    ("points", "pixels", "message"),
    [
        (np.ones((5, 3)), np.ones((5, 2)), "between 6 and"),
        (np.ones((7, 2)), np.ones((7, 2)), "shape"),
        (np.ones((7, 3)), np.ones((8, 2)), "partner"),
        (np.full((7, 3), np.nan), np.ones((7, 2)), "NaN"),
        (np.ones((7, 3)), np.ones((7, 2)), "spread them"),
        (spread_points(np.random.default_rng(0), 9) * [1, 1, 0] + [0, 0, 0.5], None, "in depth"),
        (
            spread_points(np.random.default_rng(0), 9),
            np.random.default_rng(1).uniform(0.0, 1000.0, (9, 2)),
            "behind the eye",
        ),
    ],
)
def test_spaam_refuses(points: Float64, pixels: Float64 | None, message: str) -> None:
    if pixels is None:
        pixels = project(eye_projection(DISPLAY), points)
    with pytest.raises(ValueError, match=message):
        solve_spaam(points, pixels)


@few
@given(seed=st.integers(0, 10_000), count=st.sampled_from([2, 3, 8, 25]))
def test_fingertips_give_the_eye(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    shift_m = rng.uniform(-0.01, 0.01, 3)
    points_m = np.array([0.0, 0.0, 0.5]) + rng.uniform(-0.06, 0.06, (count, 3))
    pixels = project(eye_projection(DISPLAY, shift_m), points_m)
    assert np.abs(solve_eye_from_points(points_m, pixels, DISPLAY) - shift_m).max() < 1e-6


@pytest.mark.parametrize(
    ("points_m", "message"),
    [
        ([[0.0, 0.0, 0.5]], "between 2 and"),
        ([[0.0, 0.0, -0.5], [0.1, 0.0, -0.5]], "behind"),
        ([[0.1, 0.0, 2.0], [0.0, 0.1, 2.0], [0.2, 0.1, 2.0]], "spread them out"),  # the display
        ([[0.1, 0.0, 0.5]] * 3, "spread them out"),
    ],
)
def test_fingertips_that_determine_no_eye_are_refused(
    points_m: list[list[float]], message: str
) -> None:
    pixels = project(eye_projection(DISPLAY), np.abs(points_m))
    with pytest.raises(ValueError, match=message):
        solve_eye_from_points(points_m, pixels, DISPLAY)


@few
@seeds
def test_recycled_indica_moves_the_viewpoint(seed: int) -> None:
    rng = np.random.default_rng(seed)
    T_E_H = rigid(rng.normal(0.0, 0.3, 3), rng.normal(0.0, 0.1, 3))
    shift_m = rng.uniform(-0.01, 0.01, 3)
    eye_m = (shift_m - T_E_H[:3, 3]) @ T_E_H[:3, :3]
    found = solve_indica_recycled(eye_projection(DISPLAY) @ T_E_H, DISPLAY.z_C0_S_m, eye_m)
    assert difference(found, eye_projection(DISPLAY, shift_m) @ T_E_H) < 1e-6


def test_full_indica_sees_the_display_where_it_is() -> None:
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


def test_both_setups_of_indica_agree_on_the_same_display() -> None:
    T_S_H = rigid([0.1, -0.05, 0.02], [0.0, 0.01, -1.8])
    before = solve_indica_full(1500.0, (500.0, 300.0), T_S_H, np.zeros(3))
    eye_m = np.array([0.004, -0.003, 0.006])
    after = solve_indica_full(1500.0, (500.0, 300.0), T_S_H, eye_m)
    assert difference(solve_indica_recycled(before, 1.8, eye_m), after) < 1e-6


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_a_split_projection_gives_it_back(mirror: float) -> None:
    P = np.diag([1.0, mirror, 1.0]) @ eye_projection(DISPLAY, (0.003, 0.002, 0.001))
    K, R, c_m = split_projection(P)
    assert np.linalg.det(R) == pytest.approx(mirror)
    assert (np.diag(K) > 0.0).all()
    assert difference(K @ R @ np.column_stack([np.eye(3), -c_m]), P) < 1e-12


def test_indica_refuses() -> None:
    P = eye_projection(DISPLAY)
    with pytest.raises(ValueError, match="NaN"):
        solve_indica_recycled(P, 2.0, [np.nan, 0.0, 0.0])
    with pytest.raises(ValueError, match="no viewpoint"):
        solve_indica_recycled(np.zeros((3, 4)), 2.0, np.zeros(3))
    with pytest.raises(ValueError, match="focal plane"):
        solve_indica_full(1500.0, (0.0, 0.0), np.eye(4), np.array([0.0, 0.0, 0.1]))


@pytest.mark.parametrize(
    ("model", "true"),
    [
        ("isometric", RIGID),
        ("affine", AFFINE),
        ("perspective", AFFINE),
        ("perspective", PERSPECTIVE),
    ],
)
def test_mpaam_gives_the_map(model: MapModel, true: Float64) -> None:
    rng = np.random.default_rng(1)
    places = [rigid(rng.normal(0.0, 0.4, 3), rng.normal([0, 0, 0.5], 0.08)) for _ in range(4)]
    points_m = np.concatenate([transform(T, CORNERS_M) for T in places])
    found = solve_mpaam(points_m, mapped(true, points_m), model)
    assert np.abs(found / found[3, 3] - true).max() < 1e-6


@pytest.mark.parametrize("model", FEWEST_PAIRS)
def test_mpaam_needs_so_many_pairs_apart(model: MapModel) -> None:
    fewest = FEWEST_PAIRS[model]
    points_m = np.random.default_rng(2).normal([0.0, 0.0, 0.5], 0.05, (fewest, 3))
    found = solve_mpaam(points_m, mapped(RIGID, points_m), model)
    assert np.abs(found / found[3, 3] - RIGID).max() < 1e-6
    with pytest.raises(ValueError, match="are needed"):
        solve_mpaam(points_m[1:], points_m[1:], model)
    line_m = np.outer(np.linspace(0.0, 1.0, 9), [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="different places"):
        solve_mpaam(line_m, line_m, model)
    if model != "isometric":
        with pytest.raises(ValueError, match="one plane"):  # of a face, or of one cube
            solve_mpaam(CORNERS_M[:fewest], CORNERS_M[:fewest], model)


def test_the_isometric_map_is_the_nearest_motion() -> None:
    """Never a mirror, though one would fit these pairs better."""
    points_m = CORNERS_M[:3] + np.array([0.0, 0.0, 0.5])
    found = solve_mpaam(points_m, points_m * [1.0, 1.0, -1.0], "isometric")
    assert np.linalg.det(found[:3, :3]) == pytest.approx(1.0)
