from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import Bool, Float64
from handcal.lab.bench.trials import trial_alignment
from handcal.register.consistent import match_hands
from handcal.register.rcicp import best_rigid
from handcal.register.rigid import RigidSettings, register_rigid
from handcal.register.surface import Surface, describe_surface
from handcal.sim.alignments import AlignmentSettings, SimulatedAlignment

COUNT = 1500
# Between clouds of the same points; a hand turned and moved as hands are.
T_TARGET_SOURCE = rigid([0.1, -0.15, 0.2], [0.02, -0.03, 0.04])


@pytest.fixture(scope="module")
def made() -> SimulatedAlignment:
    making = AlignmentSettings(
        count=COUNT,
        resample=True,
        depth_sigma_m=0.001,
        cursor_forearm_m=0.02,
        hand_forearm_m=0.06,
    )
    return trial_alignment(1, 7.0, making)


@pytest.fixture(scope="module")
def hand(made: SimulatedAlignment) -> Surface:
    return describe_surface(made.hand_m, made.hand_cut, COUNT)


@pytest.fixture(scope="module")
def cursor(made: SimulatedAlignment) -> Surface:
    return describe_surface(made.cursor_m, made.cursor_cut, COUNT)


def _miss(T: Float64, T_true: Float64, centre_m: Float64) -> tuple[float, float]:
    """Return by how far a point and the rotation are missed, in mm and degrees."""
    away_m = transform(T, centre_m[None]) - transform(T_true, centre_m[None])
    turned = Rotation.from_matrix(T[:3, :3] @ T_true[:3, :3].T)
    return 1e3 * float(np.linalg.norm(away_m)), float(np.degrees(turned.magnitude()))


def test_the_same_points_are_found_again(made: SimulatedAlignment, hand: Surface) -> None:
    order = np.random.default_rng(0).permutation(COUNT)
    target_m = transform(T_TARGET_SOURCE, made.hand_m[order])
    target = describe_surface(target_m, made.hand_cut[order], COUNT)
    result = register_rigid(hand, target)
    miss_mm, miss_deg = _miss(result.T_target_source, T_TARGET_SOURCE, made.hand_m.mean(axis=0))
    assert miss_mm < 0.1
    assert miss_deg < 0.05
    assert result.converged
    assert result.stop_reason == "step below 100 µm"
    assert result.history_m2[-1] < 1e-4 * result.history_m2[0]


def test_other_samples_cuts_and_noise(
    made: SimulatedAlignment, hand: Surface, cursor: Surface
) -> None:
    T_W_E = invert(made.T_E_W)
    T_true = best_rigid(transform(T_W_E, made.known_hand_m), transform(T_W_E, made.known_cursor_m))
    result = register_rigid(hand, cursor)
    miss_mm, miss_deg = _miss(result.T_target_source, T_true, made.hand_m.mean(axis=0))
    assert miss_mm < 1.0
    assert miss_deg < 1.0
    # The noise, and what sampling adds.
    assert 0.001 < np.sqrt(result.history_m2[-1]) < 0.002


def test_too_few_iterations_are_told(hand: Surface, cursor: Surface) -> None:
    result = register_rigid(hand, cursor, replace(RigidSettings(), max_iterations=2))
    assert not result.converged
    assert result.stop_reason == "limit of 2 iterations"
    assert len(result.history_m2) == 2


def test_an_outline_wholly_cut_leaves_the_inside(made: SimulatedAlignment, hand: Surface) -> None:
    cut = np.zeros(COUNT, dtype=np.bool_)
    cut[np.isin(made.hand_m, hand.points_m[hand.outline]).all(axis=1)] = True
    inside = describe_surface(made.hand_m, cut | made.hand_cut, COUNT)
    assert len(inside.outline) < 0.1 * len(hand.outline)
    without = replace(inside, outline=inside.outline[:0], outline_weight=inside.outline_weight[:0])
    for pair in ((without, hand), (hand, without)):
        result = register_rigid(*pair)
        miss_mm, _ = _miss(result.T_target_source, np.eye(4), made.hand_m.mean(axis=0))
        assert miss_mm < 1.0


def _spoiled(made: SimulatedAlignment, how: str) -> tuple[Float64, Bool]:
    """Return the hand with what a sensor may add or lose, which no flag tells."""
    rng = np.random.default_rng(0)
    points_m, is_cut = made.hand_m, made.hand_cut
    low_m, high_m = points_m.min(axis=0), points_m.max(axis=0)
    if how == "outliers":
        more_m = rng.uniform(low_m, high_m, (len(points_m) // 20, 3))
    elif how == "flying pixels":
        surface = describe_surface(points_m, is_cut, COUNT)
        rim_m = surface.points_m[surface.outline]
        more_m = transform(made.T_E_W, rim_m[rng.integers(len(rim_m), size=len(points_m) // 10)])
        more_m *= 1.0 + rng.uniform(0.0, 0.1, (len(more_m), 1)) / more_m[:, 2:]
        more_m = transform(invert(made.T_E_W), more_m)
    else:
        middle_m = points_m.mean(axis=0)
        along_m = (points_m - middle_m) @ (points_m[is_cut].mean(axis=0) - middle_m)
        is_kept = along_m > np.quantile(along_m, 0.3)
        return points_m[is_kept], is_cut[is_kept]
    return np.vstack([points_m, more_m]), np.append(is_cut, np.zeros(len(more_m), np.bool_))


@pytest.mark.parametrize("how", ["outliers", "flying pixels", "missing fingers"])
def test_outliers_and_missing_parts_move_the_hand_little(how: str) -> None:
    making = AlignmentSettings(
        count=3000,
        resample=True,
        depth_sigma_m=0.001,
        cursor_forearm_m=0.03,
        hand_forearm_m=0.05,
    )
    misses_mm = []
    for trial in range(5):
        made = trial_alignment(trial, 3.0, making)
        T_W_E = invert(made.T_E_W)
        T_true = best_rigid(
            transform(T_W_E, made.known_hand_m), transform(T_W_E, made.known_cursor_m)
        )
        hand_m, hand_cut = _spoiled(made, how)
        found = match_hands(made.cursor_m, hand_m, made.cursor_cut, hand_cut).rigid
        miss_mm, miss_deg = _miss(found.T_target_source, T_true, made.hand_m.mean(axis=0))
        misses_mm.append(miss_mm)
        assert miss_deg < 1.0
    assert np.median(misses_mm) < 0.5
    assert max(misses_mm) < 1.0
