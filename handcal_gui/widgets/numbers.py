"""Formatting of numbers."""

from __future__ import annotations

MINUS = "−"


def pluralize(number: int, one: str, many: str = "") -> str:
    """Return a count with its noun: ``1 trial``, ``2 trials``; `many` is `one` with s if empty."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def signed(value: float, decimals: int) -> str:
    """Return a number with its sign; zero, also after rounding, has a plus."""
    rounded = round(value, decimals) + 0.0  # turns −0 into 0
    return with_minus(f"{rounded:+.{decimals}f}")


def with_minus(number: str) -> str:
    """Return a number that Python or Qt has written, with a minus in place of a hyphen."""
    return number.replace("-", MINUS)
