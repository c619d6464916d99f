"""Many alignments, and figures with their targets."""

from __future__ import annotations

import numpy as np
import pytest

from handcal.core.progress import Progress
from handcal.lab.bench.trials import (
    BenchFigure,
    Errors,
    collect_errors,
    run_trials,
    trial_alignment,
)
from handcal.lab.study.trials import floor_error_m
from handcal.sim.alignments import AlignmentSettings

SMALL = AlignmentSettings(count=300)


def test_outcomes_keep_the_order_of_their_tasks() -> None:
    told: list[float] = []
    assert run_trials(
        lambda task: task * task, range(5), Progress(lambda _, share: told.append(share))
    ) == [0, 1, 4, 9, 16]
    np.testing.assert_allclose(told, [0.2, 0.4, 0.6, 0.8, 1.0])


def test_errors_are_stacked_by_case_and_method() -> None:
    def trial(case: str, number: int) -> Errors:
        errors = {"quick": np.full(3, len(case) + number)}
        return errors if number else errors | {"slow": np.zeros(3)}

    by_case = collect_errors(trial, ["a", "bb"], 3, Progress())
    assert list(by_case) == ["a", "bb"]
    np.testing.assert_array_equal(by_case["bb"]["quick"][:, 0], [2, 3, 4])
    assert by_case["bb"]["slow"].shape == (1, 3)


def test_a_trial_differs_between_angles_only_by_the_angle() -> None:
    straight, turned = (trial_alignment(3, angle_deg, SMALL) for angle_deg in (0.0, 9.0))
    np.testing.assert_array_equal(straight.hand_m, turned.hand_m)
    np.testing.assert_array_equal(straight.shift_m, turned.shift_m)
    assert np.linalg.norm(straight.rotation_rad) == 0.0
    assert np.linalg.norm(turned.rotation_rad) == pytest.approx(np.radians(9.0))


@pytest.mark.parametrize("exact", [True, False])
def test_known_pairs_of_a_straight_hand_give_phi_exactly(exact: bool) -> None:
    made = trial_alignment(4, 0.0, AlignmentSettings(count=300, exact=exact))
    assert np.abs(floor_error_m(made, exact=exact)).max() < 1e-9
    assert np.linalg.norm(floor_error_m(made, exact=not exact)) > 1e-4


@pytest.mark.parametrize(
    ("at_least", "at_most", "target", "met"),
    [
        (None, None, "", None),
        (30.0, None, "≥ 30", True),
        (30.5, None, "≥ 30.5", False),
        (None, 30.0, "≤ 30", True),
        (None, 29.0, "≤ 29", False),
        (2.4, 36.0, "≥ 2.4, ≤ 36", True),
        (2.4, 3.6, "≥ 2.4, ≤ 3.6", False),
    ],
)
def test_a_figure_is_judged_by_its_target(
    at_least: float | None, at_most: float | None, target: str, met: bool | None
) -> None:
    figure = BenchFigure("speed", 30.0, "mm", at_least, at_most)
    assert figure.to_json() == {
        "what": "speed",
        "value": 30.0,
        "unit": "mm",
        "target": target,
        "met": met,
    }
