"""Rows and columns of widgets."""

from __future__ import annotations

from typing import TypeAlias, TypeVar

from PySide6.QtWidgets import (
    QBoxLayout,
    QFrame,
    QHBoxLayout,
    QLayout,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

Item: TypeAlias = QWidget | QLayout | tuple[QWidget | QLayout, int] | int
"""A widget or layout, with its stretch if not 0; a number is an empty stretch."""
Margins: TypeAlias = int | tuple[int, int, int, int] | None
"""In pixels: of all sides, or left, top, right and bottom; None for the style's."""

_Box = TypeVar("_Box", bound=QBoxLayout)


def hbox(
    *items: Item, on: QWidget | None = None, margins: Margins = None, spacing: int | None = None
) -> QHBoxLayout:
    """Lay out items from left to right, on a widget or as a part of another layout."""
    return _fill(QHBoxLayout(on) if on else QHBoxLayout(), items, margins, spacing)


def vbox(
    *items: Item, on: QWidget | None = None, margins: Margins = None, spacing: int | None = None
) -> QVBoxLayout:
    """Lay out items from top to bottom, on a widget or as a part of another layout."""
    return _fill(QVBoxLayout(on) if on else QVBoxLayout(), items, margins, spacing)


def scrollable(content: QWidget) -> QScrollArea:
    """Return a frameless area that scrolls its content where there is too little room."""
    area = QScrollArea()
    area.setWidget(content)
    area.setWidgetResizable(True)
    area.setFrameShape(QFrame.Shape.NoFrame)
    for part in (area.viewport(), content):
        part.setAutoFillBackground(False)  # the ground is that of what it stands on
    return area


def keep_space(widget: QWidget) -> None:
    """Keep a widget's space while it is hidden."""
    policy = widget.sizePolicy()
    policy.setRetainSizeWhenHidden(True)
    widget.setSizePolicy(policy)


def _fill(box: _Box, items: tuple[Item, ...], margins: Margins, spacing: int | None) -> _Box:
    if margins is not None:
        sides = 4 * (margins,) if isinstance(margins, int) else margins
        box.setContentsMargins(*sides)
    if spacing is not None:
        box.setSpacing(spacing)
    for item in items:
        if isinstance(item, int):
            box.addStretch(item)
            continue
        content, stretch = item if isinstance(item, tuple) else (item, 0)
        if isinstance(content, QWidget):
            box.addWidget(content, stretch)
        else:
            box.addLayout(content, stretch)
    return box
