"""The window's texts in the user's language. Without Qt, so that the wizard's steps can use it.

Every visible text of the window is written as ``tr("…")``, and collected from there into
``resources/translations/handcal_en.ts`` by ``pyside6-lupdate`` (docs/translating.md). Texts at the
top of a module are translated when it is imported, so the language must be chosen before. Messages
of the engine are English.
"""

from __future__ import annotations

from collections.abc import Callable

_translate: list[Callable[[str], str]] = []


def tr(text: str) -> str:
    """Return a text in the user's language; the text itself where it has no translation."""
    return _translate[-1](text) if _translate else text


def use_translator(translate: Callable[[str], str]) -> None:
    """Translate texts with a function; call it before other modules of the window are imported."""
    _translate[:] = [translate]
