"""Numbers and statistics formatted as text, without line breaks, and as CSV (RFC 4180, UTF-8)."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

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


_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def rows_csv(rows: Iterable[Mapping[str, Any]], columns: Sequence[str] | None = None) -> bytes:
    """Return rows as CSV; text that a spreadsheet would run as a formula gets an apostrophe.

    Parameters
    ----------
    rows : iterable of mapping
        Cells by column; missing ones and None stay empty.
    columns : sequence of str, optional
        Default: all, in order of first appearance.

    Raises
    ------
    ValueError
        If a row has a cell outside the columns.
    """
    rows = list(rows)
    names = columns or list(dict.fromkeys(name for row in rows for name in row))
    stream = io.StringIO(newline="")
    writer = csv.DictWriter(stream, names)
    writer.writeheader()
    for row in rows:
        writer.writerow({name: _cell(value) for name, value in row.items()})
    return stream.getvalue().encode(errors="replace")


def _cell(value: Any) -> Any:
    if isinstance(value, str) and value.startswith(_FORMULA_STARTS):
        return f"'{value}"
    return value
