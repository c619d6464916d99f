"""Descriptive statistics of errors: spread, mean with interval, variance components."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from handcal.core.types import Float64

# Fewer clusters than this do not determine the skewness.
_FEWEST_FOR_SKEWNESS = 10
_NO_SKEWNESS = 1e-6

INTERVAL_METHOD = f"Student's t, corrected for skewness from {_FEWEST_FOR_SKEWNESS} on (Hall 1992)"
"""Description of `mean_interval` for reports."""


@dataclass(frozen=True, slots=True)
class Summary:
    """The spread of a set of numbers."""

    count: int
    mean: float
    sd: float
    """Sample standard deviation; 0 for a single number."""
    median: float
    q1: float
    q3: float
    min: float
    max: float
    """`q1` to `q3` is the interquartile range."""


@dataclass(frozen=True, slots=True)
class MeanInterval:
    """A mean with its confidence interval at `level`."""

    mean: float
    low: float
    high: float
    level: float
    """0.95 for 95 %."""
    clusters: int
    """Number of independent values or clusters."""


@dataclass(frozen=True, slots=True)
class VarianceComponents:
    """Standard deviations between clusters and within them."""

    between: float
    within: float


def summarise(values: ArrayLike) -> Summary:
    """Return the spread of numbers; ValueError if there are none or one is not finite."""
    numbers = _numbers(values)
    q1, median, q3 = np.quantile(numbers, [0.25, 0.5, 0.75]).tolist()
    return Summary(
        count=len(numbers),
        mean=float(numbers.mean()),
        sd=float(numbers.std(ddof=1)) if len(numbers) > 1 else 0.0,
        median=median,
        q1=q1,
        q3=q3,
        min=float(numbers.min()),
        max=float(numbers.max()),
    )


def mean_interval(
    values: ArrayLike,
    clusters: Sequence[object] | None = None,
    *,
    level: float = 0.95,
) -> MeanInterval:
    """Return the mean over clusters, such as wearers, with a confidence interval.

    The errors of one wearer are correlated, so only wearers are independent: the interval is that
    of the mean of the clusters' means, each cluster counting once. With equally many values in
    each, the mean is that of all values, and Student's interval that of a mixed-effects model with
    a random intercept for each cluster.

    A bootstrap of few clusters is too narrow. From ten clusters on, Student's interval is
    corrected for skewness by Hall's monotone cubic transformation of the t statistic (Hall 1992,
    "On the removal of skewness by transformation", J. R. Statist. Soc. B 54:221-228), which does
    what a bootstrap-t does, without random numbers; for fewer, it is Student's own.

    Parameters
    ----------
    values : (N,) array_like
    clusters : sequence of N hashable, optional
        The cluster of each value; by default all values are independent.
    level : float

    Raises
    ------
    ValueError
        If there are fewer than two clusters, or a value is not finite.
    """
    if not 0.0 < level < 1.0:
        raise ValueError(f"a level is between 0 and 1, not {level:g}")
    numbers = _numbers(values)
    means = (
        numbers if clusters is None else np.array([g.mean() for g in _groups(numbers, clusters)])
    )
    count = len(means)
    if count < 2:
        raise ValueError("an interval needs at least two independent values or clusters")
    center, sd = float(means.mean()), float(means.std(ddof=1))
    bound = stdtrit(count - 1, 0.5 + level / 2.0) / np.sqrt(count)  # Student's t
    low, high = center - sd * _deskewed(np.array([bound, -bound]), means)
    return MeanInterval(center, float(low), float(high), level, count)


def variance_components(values: ArrayLike, clusters: Sequence[object]) -> VarianceComponents:
    """Return the standard deviations between and within clusters.

    Analysis of variance with a random intercept for each cluster, balanced or not (Searle,
    Casella, McCulloch 1992, Variance Components, section 3.6); `between` is 0 where the clusters
    differ less than expected by chance.

    Raises
    ------
    ValueError
        If there are fewer than two clusters or only one value in each, or one is not finite.
    """
    numbers = _numbers(values)
    groups = _groups(numbers, clusters)
    count, total = len(groups), len(numbers)
    if not 1 < count < total:
        raise ValueError("at least two clusters are needed, one of them with two values")
    sizes = np.array([len(group) for group in groups])
    means = np.array([group.mean() for group in groups])
    within = sum(((group - group.mean()) ** 2).sum() for group in groups) / (total - count)
    between = (sizes * (means - numbers.mean()) ** 2).sum() / (count - 1)
    size = (total - (sizes**2).sum() / total) / (count - 1)
    return VarianceComponents(
        between=float(np.sqrt(max(0.0, (between - within) / size))), within=float(np.sqrt(within))
    )


def _deskewed(bounds: Float64, values: Float64) -> Float64:
    """Return (mean - true mean) / sd at which Hall's transformation equals `bounds`."""
    if len(values) < _FEWEST_FOR_SKEWNESS or np.ptp(values) == 0.0:
        return bounds
    # Imported here: scipy.stats takes 0.3 to 2 s, and few programs compute an interval.
    from scipy.stats import skew

    offsets = values - values.mean()
    skewness = float(skew(offsets / np.abs(offsets).max(), bias=False))
    if abs(skewness) < _NO_SKEWNESS:
        return bounds
    shifted = skewness * (bounds - skewness / (6.0 * len(values)))
    return np.asarray((np.cbrt(1.0 + shifted) - 1.0) * 3.0 / skewness)


def _groups(values: Float64, clusters: Sequence[object]) -> list[Float64]:
    if len(clusters) != len(values):
        raise ValueError(f"{len(values)} values need as many clusters, got {len(clusters)}")
    places: dict[object, list[int]] = {}
    for place, cluster in enumerate(clusters):
        places.setdefault(cluster, []).append(place)
    return [values[found] for found in places.values()]


def _numbers(values: ArrayLike) -> Float64:
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.ndim != 1 or not len(numbers) or not np.isfinite(numbers).all():
        raise ValueError("a row of finite numbers is needed")
    return numbers
