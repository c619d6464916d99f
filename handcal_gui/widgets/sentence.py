"""Texts of the engine, which begin small, as people read them."""

from __future__ import annotations


def sentence(text: str) -> str:
    """Return a text with its first letter capital."""
    return text[:1].upper() + text[1:]
