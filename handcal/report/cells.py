"""Numbers and statistics formatted as text, without line breaks."""

from __future__ import annotations

from handcal.report.statistics import MeanInterval, Summary

NOTHING = "–"
MINUS = "−"


def with_minus(number: str) -> str:
    """Return a number that Python or Qt has written, with a minus in place of a hyphen."""
    return number.replace("-", MINUS)


def signed(value: float, decimals: int) -> str:
    """Return a number with its sign; zero, also after rounding, has a plus."""
    rounded = round(value, decimals) + 0.0  # turns −0 into 0
    return with_minus(f"{rounded:+.{decimals}f}")


def length_mm(length_m: float) -> str:
    """Return a length in millimetres with two decimals and a true minus sign."""
    return with_minus(f"{1e3 * length_m:.2f}")


def mean_sd(summary: Summary) -> str:
    """Return the mean ± one standard deviation."""
    return f"{summary.mean:.2f}\u00a0±\u00a0{summary.sd:.2f}"


def median_quartiles(summary: Summary) -> str:
    """Return the median with the quartiles in parentheses."""
    return f"{summary.median:.2f}\u00a0({summary.q1:.2f}–{summary.q3:.2f})"


def extremes(summary: Summary) -> str:
    """Return the minimum and the maximum."""
    return f"{summary.min:.2f}–{summary.max:.2f}"


def interval_ends(interval: MeanInterval | None) -> str:
    """Return the limits of an interval, or a dash if there is none."""
    if interval is None:
        return NOTHING
    return with_minus(f"{interval.low:.2f}\u00a0to\u00a0{interval.high:.2f}")
