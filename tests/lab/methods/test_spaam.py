import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.display import eye_projection
from handcal.core.geometry import project, rigid
from handcal.core.types import EYES, Float64
from handcal.lab.methods.spaam import solve_spaam
from handcal.lab.methods.stereo_spaam import solve_stereo_spaam
from handcal.rig.example import example_rig

DISPLAY = example_rig().eyes["left"]


def spread_points(rng: np.random.Generator, count: int) -> Float64:
    depth_m = rng.uniform(0.35, 0.7, count)
    aside = rng.uniform(-1.0, 1.0, (count, 2)) * [0.22, 0.12]
    return np.column_stack([aside * depth_m[:, None], depth_m])


def unit(P: Float64) -> Float64:
    result: Float64 = P / np.linalg.norm(P)
    return result


@settings(max_examples=25, derandomize=True)
@given(seed=st.integers(0, 10_000), count=st.sampled_from([6, 8, 25]))
def test_exact_alignments_give_the_projection(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    T_E_H = rigid(rng.normal(0.0, 0.3, 3), rng.normal(0.0, 0.1, 3))
    P = eye_projection(DISPLAY, rng.uniform(-0.01, 0.01, 3)) @ T_E_H
    points_E_m = spread_points(rng, count)
    points_H_m = (points_E_m - T_E_H[:3, 3]) @ T_E_H[:3, :3]
    # With six points the system is square but for one row, and rounding weighs more.
    found = solve_spaam(points_H_m, project(P, points_H_m))
    assert np.abs(found - unit(P)).max() < 1e-6


def test_stereo_gives_each_eye_its_own() -> None:
    rng = np.random.default_rng(3)
    points_m = spread_points(rng, 12)
    rig = example_rig()
    true = {eye: eye_projection(rig.eyes[eye], rng.uniform(-0.01, 0.01, 3)) for eye in EYES}
    found = solve_stereo_spaam(points_m, {eye: project(P, points_m) for eye, P in true.items()})
    for eye in EYES:
        assert np.abs(found[eye] - unit(true[eye])).max() < 1e-6


def test_more_alignments_err_less() -> None:
    rng = np.random.default_rng(4)
    P = eye_projection(DISPLAY)
    check_m = spread_points(rng, 50)
    errors_px = {count: [] for count in (8, 40)}  # type: dict[int, list[float]]
    for count, errors in errors_px.items():
        for _ in range(40):
            points_m = spread_points(rng, count)
            found = solve_spaam(points_m, project(P, points_m) + rng.normal(size=(count, 2)))
            errors.append(float(np.linalg.norm(project(found, check_m) - project(P, check_m))))
    assert np.median(errors_px[40]) < 0.5 * np.median(errors_px[8])


@pytest.mark.parametrize(
    ("points", "pixels", "message"),
    [
        (np.ones((5, 3)), np.ones((5, 2)), "between 6 and"),
        (np.ones((7, 2)), np.ones((7, 2)), "shape"),
        (np.ones((7, 3)), np.ones((8, 2)), "partner"),
        (np.full((7, 3), np.nan), np.ones((7, 2)), "NaN"),
        (np.ones((7, 3)), np.ones((7, 2)), "spread them"),
    ],
)
def test_bad_input_is_refused(points: Float64, pixels: Float64, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        solve_spaam(points, pixels)


def test_points_on_a_plane_are_refused() -> None:
    points_m = spread_points(np.random.default_rng(5), 20)
    points_m[:, 2] = 0.5
    pixels = project(eye_projection(DISPLAY), points_m)
    with pytest.raises(ValueError, match="in depth"):
        solve_spaam(points_m, pixels)


def test_contradicting_alignments_are_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(ValueError, match="behind the eye"):
        solve_spaam(spread_points(rng, 9), rng.uniform(0.0, 1000.0, (9, 2)))


def test_stereo_names_the_eye() -> None:
    with pytest.raises(ValueError, match="right eye: points_m has 2"):
        solve_stereo_spaam(np.ones((2, 3)), {"right": np.ones((2, 2))})
