from dataclasses import replace

import numpy as np
import pytest
from scipy.special import chdtri

from handcal import solve_eye_shift
from handcal.core.types import Bool, Float64, Method
from handcal.lab.bench.trials import mean_length_mm, trial_alignment, trial_hand
from handcal.lab.study.trials import floor_error_m, solve_trial
from handcal.register.consistent import common_cut
from handcal.register.solve import solve_alignment
from handcal.rig.example import example_rig
from handcal.sim.alignments import AlignmentSettings, SimulatedAlignment
from handcal.sim.overlay import overlay_by_eye

# Few hands are made: trial n has hand n % 10.
HANDS = 3


def _trial(number: int) -> int:
    return 10 * number + number % HANDS


def _measured(number: int, angle_deg: float, sigma_m: float = 0.0015) -> SimulatedAlignment:
    """Make an alignment as a sensor gives it: noisy, resampled, cut at different places."""
    rng = np.random.default_rng([number, 1])
    cursor_forearm_m, hand_forearm_m = rng.uniform(0.02, 0.06, 2)
    making = AlignmentSettings(
        count=2000,
        resample=True,
        depth_sigma_m=sigma_m,
        cursor_forearm_m=cursor_forearm_m,
        hand_forearm_m=hand_forearm_m,
    )
    return trial_alignment(_trial(number), angle_deg, making)


def _uncut(made: SimulatedAlignment) -> SimulatedAlignment:
    """Forget which points lie beside a cut edge."""
    return replace(
        made,
        cursor_cut=np.zeros(len(made.cursor_cut), dtype=np.bool_),
        hand_cut=np.zeros(len(made.hand_cut), dtype=np.bool_),
    )


def _errors_m(alignments: list[SimulatedAlignment], method: Method = "consistent") -> Float64:
    return np.array([solve_trial(made, method).shift_m - made.shift_m for made in alignments])


def _floors_mm(alignments: list[SimulatedAlignment]) -> float:
    return mean_length_mm(np.array([floor_error_m(made, exact=True) for made in alignments]))


@pytest.mark.parametrize("exact", [True, False], ids=["honest data", "the paper's data"])
def test_clean_pairs_give_the_shift_exactly(exact: bool) -> None:
    for number in range(4):
        made = trial_alignment(_trial(number), 0.0, AlignmentSettings(count=2000, exact=exact))
        np.testing.assert_allclose(solve_trial(made, "consistent").shift_m, made.shift_m, atol=2e-5)


@pytest.mark.parametrize("along_m", [-0.010, 0.010])
def test_a_wearer_who_errs_nowhere_is_solved_without_bias(along_m: float) -> None:
    """Data made by rays through a display, in which no solver's equation takes part."""
    rig = example_rig()
    errors_m, shares = [], []
    for number in range(8):
        rng = np.random.default_rng(number)
        true_m = np.array([*rng.uniform(-0.005, 0.005, 2), along_m])
        eye = ("left", "right")[number % 2]
        hand = trial_hand(number % HANDS)
        alignment = overlay_by_eye(rng, hand, rig, {eye: true_m}, 2000)  # type: ignore[dict-item]
        (solved,) = solve_alignment(alignment, rig).values()
        errors_m.append(solved.shift_m - true_m)
        if number < 4:
            (solved,) = solve_alignment(alignment, rig, "linear").values()
            shares.append(1.0 - solved.shift_m[2] / along_m)
    assert (np.abs(np.mean(errors_m, axis=0)) < 0.3e-3).all()
    assert 0.15 < np.mean(shares) < 0.35


def test_cuts_noise_and_samples_cost_little_when_the_hand_is_not_turned() -> None:
    alignments = [_measured(number, 0.0) for number in range(12)]
    known_mm = mean_length_mm(_errors_m(alignments))
    unknown_mm = mean_length_mm(_errors_m([_uncut(made) for made in alignments]))
    assert known_mm < 1.0
    assert known_mm < unknown_mm < 2.0


@pytest.mark.parametrize("angle_deg", [3.0, 6.0, 9.0])
def test_cuts_noise_and_samples_cost_little_beside_the_turn(angle_deg: float) -> None:
    alignments = [_measured(number, angle_deg) for number in range(10)]
    floor_mm = _floors_mm(alignments)
    assert mean_length_mm(_errors_m(alignments)) < floor_mm + 0.5
    assert mean_length_mm(_errors_m([_uncut(made) for made in alignments])) < floor_mm + 1.0


@pytest.mark.parametrize("angle_deg", [0.0, 5.0, 20.0])
def test_clean_clouds_keep_to_the_floor(angle_deg: float) -> None:
    making = AlignmentSettings(count=1500)
    alignments = [trial_alignment(_trial(number), angle_deg, making) for number in range(10)]
    assert mean_length_mm(_errors_m(alignments)) < 1.1 * _floors_mm(alignments) + 0.05


@pytest.mark.parametrize("exact", [True, False], ids=["honest data", "the paper's data"])
@pytest.mark.parametrize("angle_deg", [0.0, 3.0, 9.0])
def test_no_worse_than_the_paper(angle_deg: float, exact: bool) -> None:
    making = AlignmentSettings(count=800, exact=exact)
    alignments = [trial_alignment(_trial(number), angle_deg, making) for number in range(3)]
    paper_mm = mean_length_mm(_errors_m(alignments, "paper"))
    assert mean_length_mm(_errors_m(alignments)) < paper_mm + 0.05


def test_the_covariance_is_honest() -> None:
    """Normalised squared errors follow chi-square with 3 degrees of freedom, mean 3."""
    count = 50
    rng = np.random.default_rng(0)
    squares = []
    for number in range(count):
        made = _measured(number, rng.uniform(0.0, 9.0), rng.uniform(0.0005, 0.002))
        solved = solve_trial(made, "consistent")
        np.testing.assert_allclose(solved.covariance_m2, solved.covariance_m2.T)
        assert np.linalg.eigvalsh(solved.covariance_m2)[0] > 0.0
        error_m = solved.shift_m - made.shift_m
        squares.append(error_m @ np.linalg.solve(solved.covariance_m2, error_m))
    sigma = np.sqrt(6.0 / count)
    assert abs(np.mean(squares) - 3.0) < 3.0 * sigma
    # 95 % of them lie below 7.8.
    assert np.mean(np.array(squares) < 7.8) > 0.85


def test_what_is_cut_is_no_inlier() -> None:
    """A hand that shows more arm than its cursor has no partners there."""
    making = AlignmentSettings(
        count=2000, resample=True, cursor_forearm_m=0.02, hand_forearm_m=0.06
    )
    made = trial_alignment(0, 0.0, making)
    solved = solve_trial(made, "consistent")
    in_common = len(made.known_hand_m) / len(made.hand_m)
    assert in_common < 0.9
    assert solved.inlier_ratio == pytest.approx(in_common, abs=0.05)
    # Pairs of clouds that are sampled apart lie within a point spacing of one another.
    assert solved.rms_m < 0.003


def test_one_grid_of_pixels_does_not_draw_clouds_together() -> None:
    """Disjoint halves of one grid coincide after a step of a pixel: that is no movement."""
    across, along = np.mgrid[0:80, 0:120].reshape(2, -1) * 0.001
    depth_m = 0.5 + 0.1 * np.hypot(across - 0.04, along - 0.06) ** 2 / 0.06
    wide = np.hypot((across - 0.04) / 0.04, (along - 0.06) / 0.06) < 1.0
    points_m = np.column_stack([across - 0.04, along - 0.06, depth_m])[wide]
    order = np.random.default_rng(0).permutation(len(points_m))
    half = len(order) // 2
    solved = solve_eye_shift(points_m[order[:half]], points_m[order[half:]], display_distance_m=2.0)
    assert np.linalg.norm(solved.shift_m[:2]) < 0.0003
    # Along the line of sight, φ also depends on the size of the two.
    assert abs(solved.shift_m[2]) < 0.0006


MAKING = AlignmentSettings(
    count=4000, resample=True, depth_sigma_m=0.001, cursor_forearm_m=0.05, hand_forearm_m=0.05
)


def along_the_arm(points_m: Float64, is_cut: Bool) -> Float64:
    """Return the distance of points inside the cut edge, along the forearm."""
    toward = points_m[is_cut].mean(axis=0) - points_m.mean(axis=0)
    place: Float64 = points_m @ (toward / np.linalg.norm(toward))
    return np.asarray(place.max() - place)


def cut_further_up(made: SimulatedAlignment, by_m: float, cloud: str) -> SimulatedAlignment:
    """Cut one cloud as the segmentation would, this much nearer to the fingers."""
    points_m, is_cut = getattr(made, f"{cloud}_m"), getattr(made, f"{cloud}_cut")
    inside_m = along_the_arm(points_m, is_cut)
    kept = inside_m > by_m
    edge = is_cut | (inside_m < by_m + 0.003)
    return replace(made, **{f"{cloud}_m": points_m[kept], f"{cloud}_cut": edge[kept]})


@pytest.mark.parametrize("cloud", ["cursor", "hand"])
@pytest.mark.parametrize("angle_deg", [0.0, 6.0])
def test_a_cut_further_up_moves_the_shift_less_than_sigma(cloud: str, angle_deg: float) -> None:
    made = trial_alignment(1, angle_deg, MAKING)
    whole = solve_trial(made, "consistent")
    for by_m in (0.01, 0.02, 0.03):
        cut = solve_trial(cut_further_up(made, by_m, cloud), "consistent")
        moved_m = cut.shift_m - whole.shift_m
        assert moved_m @ np.linalg.solve(whole.covariance_m2, moved_m) < chdtri(3, 0.05)


def test_both_clouds_end_at_the_same_place() -> None:
    made = trial_alignment(0, 0.0, replace(MAKING, cursor_forearm_m=0.02, shift_max_m=1e-6))
    found = common_cut(made.cursor_m, made.hand_m, made.cursor_cut, made.hand_cut, np.eye(4))
    assert found is not None
    along, limit_m = found
    cursor_kept, hand_kept = made.cursor_m @ along <= limit_m, made.hand_m @ along <= limit_m
    assert cursor_kept.mean() > 0.95
    assert 0.6 < hand_kept.mean() < 0.95
    toward = made.hand_m[made.hand_cut].mean(axis=0) - made.hand_m.mean(axis=0)
    ends = [
        float((cloud @ toward / np.linalg.norm(toward)).max())
        for cloud in (made.cursor_m[cursor_kept], made.hand_m[hand_kept])
    ]
    assert ends[0] == pytest.approx(ends[1], abs=0.004)


def test_a_cut_that_is_not_across_the_forearm_is_left_alone() -> None:
    made = trial_alignment(0, 0.0, MAKING)
    none = np.zeros(len(made.cursor_m), np.bool_)
    assert common_cut(made.cursor_m, made.cursor_m, none, None, np.eye(4)) is None
    middle_m = made.cursor_m.mean(axis=0)
    across = np.linalg.norm(made.cursor_m - middle_m, axis=1) < 0.02
    assert common_cut(made.cursor_m, made.cursor_m, across, across, np.eye(4)) is None
