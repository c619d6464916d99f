"""Numbers as people read them."""

from __future__ import annotations


def counted(number: int, what: str) -> str:
    """Return how many there are of something: ``1 trial``, ``2 trials``."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def signed(value: float, decimals: int) -> str:
    """Return a number with its sign; zero, also by rounding, has a plus."""
    rounded = round(value, decimals) + 0.0  # makes −0 a 0
    return f"{rounded:+.{decimals}f}".replace("-", "−")
