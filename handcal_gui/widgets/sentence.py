"""Messages of the engine as the window shows them: capitalised, and with advice."""

from __future__ import annotations


def sentence(text: str) -> str:
    """Return a text with its first letter capitalized, unless it begins with a file's name."""
    first = text.partition(" ")[0].rstrip(".:;,")
    return text if {".", "/", "\\"} & set(first) else text[:1].upper() + text[1:]


def lowered(text: str) -> str:
    """Return a text to follow a colon."""
    return text[:1].lower() + text[1:]
