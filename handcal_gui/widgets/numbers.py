"""Counts in words."""

from __future__ import annotations


def pluralize(number: int, one: str, many: str = "") -> str:
    """Return a count with its noun: ``1 trial``, ``2 trials``; `many` is `one` with s if empty."""
    return f"{number} {one if number == 1 else many or one + 's'}"
