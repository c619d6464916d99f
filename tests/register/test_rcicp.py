import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.core.errors import HandcalError
from handcal.core.geometry import rigid, transform
from handcal.core.types import Float64
from handcal.lab.bench.trials import trial_alignment
from handcal.register.rcicp import (
    MAX_ITERATIONS,
    PAPER_RATIO,
    Iterated,
    best_rigid,
    solve_icp,
    solve_icp_open3d,
    solve_linear,
    solve_paper,
)
from handcal.sim.alignments import AlignmentSettings, SimulatedAlignment

DISTANCE_M = 2.0
VECTORS = st.tuples(*[st.floats(-2, 2)] * 3)
POINTS_M = np.random.default_rng(0).normal(size=(20, 3))


def _clouds(made: SimulatedAlignment) -> tuple[Float64, Float64]:
    return transform(made.T_E_W, made.cursor_m), transform(made.T_E_W, made.hand_m)


@pytest.fixture(scope="module")
def straight() -> SimulatedAlignment:
    """The paper's data with nothing turned."""
    return trial_alignment(0, 0.0, AlignmentSettings(count=1000, exact=False))


@pytest.fixture(scope="module")
def turned() -> SimulatedAlignment:
    return trial_alignment(0, 4.0, AlignmentSettings(count=1000, exact=False))


@pytest.fixture(scope="module")
def paper(turned: SimulatedAlignment) -> Iterated:
    return solve_paper(*_clouds(turned), DISTANCE_M)


def test_paper_and_linear_are_exact_on_their_own_data(straight: SimulatedAlignment) -> None:
    for solver in (solve_paper, solve_linear):
        ended = solver(*_clouds(straight), DISTANCE_M)
        np.testing.assert_allclose(ended.shift_m, straight.shift_m, atol=1e-6)
        np.testing.assert_allclose(ended.moved_m, ended.partner_m, atol=1e-6)
        assert ended.converged


def test_paper_stops_by_its_rule(paper: Iterated) -> None:
    ratios = paper.history_m2[1:] / paper.history_m2[:-1]
    is_end = (ratios < 1.0) & (ratios > PAPER_RATIO)
    assert paper.converged == bool(is_end.any())
    assert not is_end[:-1].any()
    assert len(paper.history_m2) <= MAX_ITERATIONS


def test_linear_ends_where_no_pair_changes(turned: SimulatedAlignment, paper: Iterated) -> None:
    linear = solve_linear(*_clouds(turned), DISTANCE_M)
    assert linear.converged
    assert linear.stop_reason == "step below 0.1 µm"
    assert (np.diff(linear.history_m2) <= 0.0).all()
    # The same model, solved all the way.
    assert linear.history_m2[-1] <= paper.history_m2[-1] * 1.001
    assert len(linear.history_m2) < len(paper.history_m2)


def test_icp_reads_the_shift_off_a_rigid_motion(straight: SimulatedAlignment) -> None:
    _, hand_m = _clouds(straight)
    T = rigid([0.01, -0.02, 0.03], [0.004, -0.003, 0.002])
    ended = solve_icp(transform(T, hand_m), hand_m)
    np.testing.assert_allclose(ended.shift_m, -T[:3, 3], atol=1e-6)
    assert ended.converged


@given(VECTORS, VECTORS)
def test_best_rigid_recovers_a_motion(
    rotation: tuple[float, ...], offset: tuple[float, ...]
) -> None:
    T = rigid(rotation, offset)
    np.testing.assert_allclose(best_rigid(POINTS_M, transform(T, POINTS_M)), T, atol=1e-9)


@pytest.mark.parametrize("trial", range(4))
def test_open3d_ends_where_icp_does(trial: int) -> None:
    pytest.importorskip("open3d")
    making = AlignmentSettings(count=500, resample=True, depth_sigma_m=0.001)
    clouds = _clouds(trial_alignment(trial, 2.0, making))
    ours, theirs = solve_icp(*clouds), solve_icp_open3d(*clouds)
    np.testing.assert_allclose(theirs.shift_m, ours.shift_m, atol=1e-4)
    assert theirs.history_m2[-1] == pytest.approx(ours.history_m2[-1], rel=1e-3)
    assert (np.diff(theirs.history_m2) <= 1e-12).all()
    assert theirs.converged
    gap_m2 = np.sum((theirs.moved_m - theirs.partner_m) ** 2, axis=1)
    assert gap_m2.mean() == pytest.approx(theirs.history_m2[-1])


def test_without_open3d_the_method_says_so(
    straight: SimulatedAlignment, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(HandcalError, match=r"pip install 'handcal\[3d\]'"):
        solve_icp_open3d(*_clouds(straight))
