"""One cut for both clouds: where each was cut does not enter φ."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import chdtri

from handcal.core.types import Bool, Float64
from handcal.lab.bench.trials import trial_alignment
from handcal.lab.study.trials import solve_trial
from handcal.register.consistent import CUT_BAND_M, common_cut
from handcal.register.surface import clip_surface, describe_surface, nearest
from handcal.sim.alignments import AlignmentSettings, SimulatedAlignment

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

    surface = describe_surface(made.hand_m, made.hand_cut, 1000)
    clipped = clip_surface(surface, surface.points_m @ along - limit_m, CUT_BAND_M)
    place = clipped.points_m @ along
    assert place.max() <= limit_m
    assert clipped.near_cut[place > limit_m - CUT_BAND_M].all()
    assert not clipped.near_cut[clipped.outline].any()
    assert 0.6 * len(surface.points_m) < len(clipped.points_m) < len(surface.points_m)
    distance_m, index = nearest(clipped.tree, clipped.points_m)
    assert not distance_m.any()
    np.testing.assert_array_equal(index, np.arange(len(clipped.points_m)))


def test_a_cut_that_is_not_across_the_forearm_is_left_alone() -> None:
    made = trial_alignment(0, 0.0, MAKING)
    none = np.zeros(len(made.cursor_m), np.bool_)
    assert common_cut(made.cursor_m, made.cursor_m, none, None, np.eye(4)) is None
    middle_m = made.cursor_m.mean(axis=0)
    across = np.linalg.norm(made.cursor_m - middle_m, axis=1) < 0.02
    assert common_cut(made.cursor_m, made.cursor_m, across, across, np.eye(4)) is None


def test_no_point_lies_on_the_cut() -> None:
    """Rounding, which differs between processors, decides about none."""
    made = trial_alignment(0, 0.0, MAKING)
    found = common_cut(made.cursor_m, made.hand_m, made.cursor_cut, made.hand_cut, np.eye(4))
    assert found is not None
    along, limit_m = found
    beyond_m = np.concatenate([made.cursor_m, made.hand_m]) @ along - limit_m
    assert np.abs(beyond_m).min() > 1e-10
