"""A rig in place of the true one, for wearers who calibrate with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handcal.core.geometry import rigid
from handcal.core.progress import Progress
from handcal.lab.bench.accuracy import ratio_of_means, reprojection_of_wearers
from handcal.rig.example import example_rig


def test_a_rig_that_is_wrong_leaves_wearers_worse_off() -> None:
    true = example_rig()
    wrong = replace(true, T_H_D=true.T_H_D @ rigid([0.0, 0.0, 0.0], [0.02, 0.0, 0.0]))
    told: list[float] = []
    progress = Progress(lambda _, share: told.append(share))
    same, worse = (reprojection_of_wearers(rig, true, 3, progress) for rig in (true, wrong))
    assert told == [1 / 3, 2 / 3, 1.0] * 2
    assert ratio_of_means(worse, same).mean > 1.3


def test_the_interval_of_a_ratio_covers_it() -> None:
    rng = np.random.default_rng(0)
    covered = 0
    for _ in range(400):
        baseline = rng.gamma(4.0, 2.0, 60)
        errors = 1.2 * baseline + rng.normal(0.0, 2.0, 60)
        found = ratio_of_means(errors, baseline)
        covered += found.low < 1.2 < found.high
    assert covered / 400 == pytest.approx(0.95, abs=0.03)


def test_equal_errors_have_a_ratio_of_one() -> None:
    errors = np.array([3.0, 5.0, 9.0])
    found = ratio_of_means(errors, errors)
    assert (found.mean, found.low, found.high) == (1.0, 1.0, 1.0)
