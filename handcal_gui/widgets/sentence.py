"""Capitalization of engine messages, which begin in lower case."""

from __future__ import annotations


def sentence(text: str) -> str:
    """Return a text with its first letter capitalized."""
    return text[:1].upper() + text[1:]
