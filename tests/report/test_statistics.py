"""Spread and intervals; the intervals' coverage is measured in 1,000 studies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.random import Generator

from handcal.core.types import Float64
from handcal.report.statistics import mean_interval, summarise, variance_components

STUDIES = 1000
# Three standard deviations of a share of 1,000 about 0.95 are 0.021.
NOMINAL = 0.95, 0.021
TRUE_MEAN = 10.0

Wearers = Callable[[Generator, int], Float64]


def even(random: Generator, count: int) -> Float64:
    return random.normal(TRUE_MEAN, 2.0, count)


def skewed(random: Generator, count: int) -> Float64:
    return random.gamma(4.0, TRUE_MEAN / 4.0, count)


def coverage(wearers: Wearers, count: int, trials: int, seed: int) -> float:
    """Return the share of studies whose interval covers the true mean error.

    In a study, wearers' errors differ, each trial's differ from the wearer's, and each trial's four
    corners are much alike.
    """
    random = np.random.default_rng(seed)
    clusters = np.repeat(np.arange(count), 4 * trials)
    covered = 0
    for _ in range(STUDIES):
        of_trials = np.repeat(wearers(random, count), trials) * random.gamma(
            9, 1 / 9, count * trials
        )
        of_corners = np.repeat(of_trials, 4) * random.uniform(0.9, 1.1, 4 * count * trials)
        found = mean_interval(of_corners, clusters.tolist())
        covered += found.low <= TRUE_MEAN <= found.high
    return covered / STUDIES


@pytest.mark.parametrize(("count", "trials"), [(3, 10), (10, 3), (30, 1)])
def test_of_1000_studies_of_wearers_as_many_intervals_cover_the_truth_as_they_say(
    count: int, trials: int
) -> None:
    nominal, tolerance = NOMINAL
    assert abs(coverage(even, count, trials, seed=count) - nominal) <= tolerance


def test_so_they_do_if_wearers_errors_are_skewed() -> None:
    nominal, tolerance = NOMINAL
    assert abs(coverage(skewed, 10, 3, seed=1) - nominal) <= tolerance


def test_without_skewness_it_is_students_interval() -> None:
    found = mean_interval([1.0, 2.0, 3.0, 4.0, 5.0])
    assert (found.mean, found.level, found.clusters) == (3.0, 0.95, 5)
    half = 2.7764451 * np.sqrt(2.5 / 5.0)  # t of 4 degrees of freedom
    assert [found.low, found.high] == pytest.approx([3.0 - half, 3.0 + half])


def test_each_wearer_counts_once() -> None:
    found = mean_interval([1.0, 1.0, 1.0, 4.0], ["a", "a", "a", "b"])
    assert found.mean == 2.5


def test_the_spread_is_as_by_hand() -> None:
    found = summarise([4.0, 1.0, 3.0, 2.0, 5.0])
    assert (found.count, found.mean, found.median) == (5, 3.0, 3.0)
    assert (found.q1, found.q3, found.min, found.max) == (2.0, 4.0, 1.0, 5.0)
    assert found.sd == pytest.approx(np.sqrt(2.5))
    assert summarise([7.0]).sd == 0.0


def test_variance_components_are_recovered() -> None:
    random = np.random.default_rng(4)
    wearers = random.integers(0, 400, 6000)  # of unequal numbers
    errors = random.normal(10.0, 2.0, 400)[wearers] + random.normal(0.0, 3.0, 6000)
    found = variance_components(errors, wearers.tolist())
    assert found.between == pytest.approx(2.0, rel=0.1)
    assert found.within == pytest.approx(3.0, rel=0.05)


def test_wearers_who_do_not_differ_have_no_variance_between_them() -> None:
    assert variance_components([1.0, 2.0, 1.0, 2.0], "aabb").between == 0.0


@pytest.mark.parametrize("values", [[], [1.0, np.nan], [[1.0], [2.0]]])
def test_what_is_no_row_of_numbers_is_refused(values: list[float]) -> None:
    for of in (summarise, mean_interval):
        with pytest.raises(ValueError, match="finite numbers"):
            of(values)


def test_too_little_is_refused() -> None:
    with pytest.raises(ValueError, match="two independent values"):
        mean_interval([1.0, 2.0], ["a", "a"])
    with pytest.raises(ValueError, match="as many clusters"):
        mean_interval([1.0, 2.0], ["a"])
    with pytest.raises(ValueError, match="between 0 and 1, not 95"):
        mean_interval([1.0, 2.0], level=95)
    with pytest.raises(ValueError, match="two clusters"):
        variance_components([1.0, 2.0], ["a", "b"])


def test_the_skewness_is_corrected_for_bias() -> None:
    """The interval of ten numbers by Hall's formula, with the skewness as a textbook has it.

    That is n / ((n - 1)(n - 2)) times the sum of the cubes of (value - mean) / standard deviation.
    """
    values = np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 3.0, 8.0])
    count, mean, sd = len(values), values.mean(), values.std(ddof=1)
    skewness = count / ((count - 1) * (count - 2)) * (((values - mean) / sd) ** 3).sum()
    t = 2.2621572  # of 9 degrees of freedom

    def bound(of_t: float) -> float:
        """Return the bound at which Hall's transformation of the mean's error is `of_t`."""
        w = np.cbrt(1.0 + skewness * (of_t / np.sqrt(count) - skewness / (6.0 * count)))
        return float(mean - sd * (w - 1.0) * 3.0 / skewness)

    found = mean_interval(values)
    assert [found.low, found.high] == pytest.approx([bound(t), bound(-t)])
