"""The mark of the window's texts. Without Qt, so that the guide's steps can use it."""

from __future__ import annotations


def tr(text: str) -> str:
    """Return a visible text of the window; CONTRIBUTING.md says how a translation is added."""
    return text
