"""A hand that opens uniformly between the cursor and the alignment, held over the same pixels."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.geometry import invert, transform
from handcal.core.types import Bool, EyeShift, Float64
from handcal.lab.bench.trials import measured_alignment
from handcal.lab.study.trials import solve_trial
from handcal.register.consistent import match_hands
from handcal.register.shape import Opening
from handcal.sim.alignments import SimulatedAlignment

POINTS = 3000


def _opened(trial: int, by: float) -> SimulatedAlignment:
    """Return an alignment whose hand is larger by a share, and as much farther from the eye."""
    rng = np.random.default_rng([trial, 6])
    made = measured_alignment(rng, trial % 3, rng.uniform(0.0, 2.0), 0.001, POINTS)
    seen_m = transform(made.T_E_W, made.hand_m) - made.shift_m
    hand_m = transform(invert(made.T_E_W), made.shift_m + (1.0 + by) * seen_m)
    return replace(made, hand_m=hand_m)


def _squared(solved: EyeShift, made: SimulatedAlignment) -> float:
    error_m = solved.shift_m - made.shift_m
    return float(error_m @ np.linalg.solve(solved.covariance_m2, error_m))


@pytest.mark.parametrize("by", [-0.02, 0.01, 0.02, 0.03])
def test_a_hand_that_opens_moves_phi_no_more_than_sigma_says(by: float) -> None:
    alignments = [_opened(trial, by) for trial in range(12)]
    solved = [solve_trial(made, "consistent") for made in alignments]
    assert np.mean(list(map(_squared, solved, alignments))) < 6.0
    # Half a metre and a display at 2 m: without the size, φ3 would be wrong by 6.7 mm for 1 %.
    errors_m = [
        abs(one.shift_m[2] - made.shift_m[2]) for one, made in zip(solved, alignments, strict=True)
    ]
    assert np.median(errors_m) < 0.0035


def test_a_hand_that_does_not_open_keeps_its_phi(monkeypatch: pytest.MonkeyPatch) -> None:
    alignments = [_opened(trial, 0.0) for trial in range(12)]
    solved = [solve_trial(made, "consistent") for made in alignments]
    monkeypatch.setattr(Opening, "known", lambda *_: (0.0, 0.0))
    rigid = [solve_trial(made, "consistent") for made in alignments]
    moved_m = [np.linalg.norm(a.shift_m - b.shift_m) for a, b in zip(solved, rigid, strict=True)]
    assert np.median(moved_m) < 0.0003
    assert np.mean(list(map(_squared, solved, alignments))) < 4.5


def _of(made: SimulatedAlignment) -> tuple[Float64, Float64, Bool, Bool]:
    return made.cursor_m, made.hand_m, made.cursor_cut, made.hand_cut


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 20), st.floats(-0.04, 0.04))
def test_the_size_is_measured(trial: int, by: float) -> None:
    opening = match_hands(*_of(_opened(trial, by))).opening
    assert -opening.log_size == pytest.approx(np.log1p(by), abs=5.0 * opening.sigma)
    assert 0.0005 < opening.sigma < 0.004
    # The similarity has that size.
    size = np.cbrt(np.linalg.det(opening.T_target_source[:3, :3]))
    assert size == pytest.approx(np.exp(opening.log_size))


@given(st.floats(-0.1, 0.1), st.floats(0.0005, 0.01), st.floats(0.0, 0.01))
def test_what_noise_or_a_bent_hand_explains_is_not_believed(
    log_size: float, sigma: float, shape_rms_m: float
) -> None:
    share, left = Opening(log_size, sigma, np.eye(4)).known(shape_rms_m)
    assert 0.0 <= share <= 1.0
    assert left >= 0.0
    bent_share, _ = Opening(log_size, sigma, np.eye(4)).known(shape_rms_m + 0.01)
    assert bent_share <= max(share, 0.3)
    if abs(log_size) < sigma:
        assert share < 0.35


def test_noise_is_no_change_of_size() -> None:
    """The noise of the hand must not multiply itself: it would be half a percent."""
    sizes = []
    for trial in range(10):
        rng = np.random.default_rng([trial, 7])
        made = measured_alignment(rng, trial % 3, 0.0, 0.002, POINTS)
        sizes.append(match_hands(*_of(made)).opening.log_size)
    assert abs(np.mean(sizes)) < 0.0015
