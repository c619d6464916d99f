from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handcal import solve_eye_shift
from handcal.core.errors import HandError
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import METHODS, Alignment, EyeShift, Float64, Method
from handcal.lab.bench.trials import trial_alignment
from handcal.register.model import cursor_displacement
from handcal.register.solve import MAX_POINTS, solve_alignment
from handcal.rig.example import example_rig
from handcal.sim.alignments import AlignmentSettings, SimulatedAlignment

RIG = example_rig()
QUICK: tuple[Method, ...] = ("consistent", "linear", "icp")


@pytest.fixture(scope="module")
def made() -> SimulatedAlignment:
    making = AlignmentSettings(
        count=1500,
        resample=True,
        depth_sigma_m=0.001,
        cursor_forearm_m=0.03,
        hand_forearm_m=0.05,
    )
    return trial_alignment(2, 3.0, making)


def _solve(made: SimulatedAlignment, **changes: Any) -> EyeShift:
    arguments: dict[str, Any] = {
        "cursor_m": made.cursor_m,
        "hand_m": made.hand_m,
        "display_distance_m": made.display_distance_m,
        "T_E_W": made.T_E_W,
        "cursor_cut": made.cursor_cut,
        "hand_cut": made.hand_cut,
    }
    return solve_eye_shift(**(arguments | changes))


def _alignment(made: SimulatedAlignment, **changes: Any) -> Alignment:
    alignment = Alignment(
        cursor_m=made.cursor_m,
        hand_m=made.hand_m,
        cursor_is_cut=made.cursor_cut,
        hand_is_cut=made.hand_cut,
        T_E_W={"left": made.T_E_W, "right": rigid(translation_m=[-0.063, 0, 0]) @ made.T_E_W},
        eyes=("left", "right"),
        rotation_rad=np.zeros(3),
        t_a_ns=0,
        t_b_ns=1,
    )
    return replace(alignment, **changes)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_gives_the_same_kind_of_result(
    made: SimulatedAlignment, method: Method
) -> None:
    result = _solve(made, method=method)
    assert result.method == method
    assert result.shift_m.shape == (3,)
    assert np.isfinite(result.shift_m).all()
    np.testing.assert_allclose(result.covariance_m2, result.covariance_m2.T)
    assert np.linalg.eigvalsh(result.covariance_m2)[0] > 0
    assert 0.0 < result.rms_m < 0.01
    assert 0.5 < result.inlier_ratio <= 1.0
    assert result.iterations == len(result.history_m2)
    if method in ("consistent", "icp"):  # one measure from first to last, minimised
        assert (np.diff(result.history_m2) <= 1e-3 * result.history_m2[0]).all()
    assert result.converged == ("limit" not in result.stop_reason)
    inliers_m = result.residuals_m[np.isfinite(result.residuals_m)]
    assert len(result.residuals_m) == len(made.hand_m)
    assert len(inliers_m) == pytest.approx(result.inlier_ratio * len(made.hand_m))
    assert np.sqrt(np.mean(inliers_m**2)) == pytest.approx(result.rms_m)


def test_the_frame_of_the_world_does_not_matter(made: SimulatedAlignment) -> None:
    T = rigid([2.0, -1.0, 0.5], [10.0, -3.0, 4.0])
    once = _solve(made)
    again = _solve(
        made,
        cursor_m=transform(T, made.cursor_m),
        hand_m=transform(T, made.hand_m),
        T_E_W=made.T_E_W @ invert(T),
    )
    np.testing.assert_allclose(again.shift_m, once.shift_m, atol=1e-6)
    np.testing.assert_allclose(again.covariance_m2, once.covariance_m2, rtol=1e-3)


def test_both_eyes_are_solved_as_each_alone(made: SimulatedAlignment) -> None:
    alignment = _alignment(made)
    for method in QUICK:
        together = solve_alignment(alignment, RIG, method)
        assert list(together) == ["left", "right"]
        for eye, shift in together.items():
            alone = _solve(made, method=method, T_E_W=alignment.T_E_W[eye])
            # `solve_eye_shift` adds the eye box, whose pull is as strong as φ is unsure.
            pull_m = np.linalg.norm(alone.covariance_m2 @ alone.shift_m) / 0.010**2
            assert np.linalg.norm(alone.shift_m - shift.shift_m) <= 1.2 * pull_m + 1e-9


@pytest.mark.parametrize("method", QUICK)
def test_a_cursor_drawn_with_an_earlier_solution(made: SimulatedAlignment, method: Method) -> None:
    """The same hand, over a cursor that an earlier φ makes appear at the same place."""
    earlier_m = np.array([0.003, -0.002, 0.004])
    offline = _alignment(made, eyes=("left",))
    T_drawn = made.T_E_W.copy()
    T_drawn = np.linalg.inv(cursor_displacement(earlier_m, 2.0) @ T_drawn) @ T_drawn
    cursor_m = transform(T_drawn, made.cursor_m)
    redrawn = replace(
        offline,
        cursor_m=cursor_m,
        drawn_shift_m={"left": earlier_m, "right": np.zeros(3)},
    )
    found_m = solve_alignment(redrawn, RIG, method)["left"].shift_m
    expected_m = solve_alignment(offline, RIG, method)["left"].shift_m
    # `consistent` registers rigidly first, in which the two differ by the φ3φ4 of depth, 0.2 %.
    np.testing.assert_allclose(found_m, expected_m, atol=3e-4 if method == "consistent" else 1e-7)


def _with(points_m: Float64, value: float) -> Float64:
    spoilt = np.array(points_m)
    spoilt[3, 2] = value
    return spoilt


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"method": "magic"}, "unknown method 'magic': choose from paper, linear, consistent, icp"),
        ({"display_distance_m": 0.0}, "display_distance_m must be positive, got 0.0"),
        ({"T_E_W": np.zeros((4, 4))}, "T_E_W must be a rigid transform"),
        ({"cursor_cut": np.zeros(7, dtype=bool)}, "cursor_cut must hold one bool for each of the"),
        ({"hand_cut": np.zeros(1500)}, "hand_cut must hold one bool for each of the"),
    ],
)
def test_bad_arguments_are_refused(
    made: SimulatedAlignment, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        _solve(made, **changes)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", ["cursor_m", "hand_m"])
def test_bad_clouds_are_refused(made: SimulatedAlignment, name: str, method: Method) -> None:
    good = getattr(made, name)
    for bad, message in [
        (_with(good, np.nan), "contains NaN or infinity"),
        (_with(good, np.inf), "contains NaN or infinity"),
        (good[:99], f"has 99 points; between 100 and {MAX_POINTS:,} are needed"),
        (good[:0], "has 0 points"),
        (good[:, :2], r"must have shape \(N, 3\), got \(\d+, 2\)"),
        (good.ravel(), r"must have shape \(N, 3\), got \(\d+,\)"),
        (np.outer(np.linspace(0, 1, 200), [1, 2, 3]), "has all its points on one line"),
    ]:
        with pytest.raises(ValueError, match=f"{name} {message}"):
            _solve(made, method=method, cursor_cut=None, hand_cut=None, **{name: bad})


def test_a_hand_wholly_beside_cuts_is_refused(made: SimulatedAlignment) -> None:
    everywhere = np.ones(len(made.hand_m), dtype=np.bool_)
    with pytest.raises(HandError, match="beside cut edges"):
        _solve(made, hand_cut=everywhere)
