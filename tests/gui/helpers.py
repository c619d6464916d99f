"""Helpers that several tests of windows share."""

from __future__ import annotations

from typing import TypeVar

from PySide6.QtCore import QObject, Qt
from PySide6.QtWidgets import QAbstractButton, QLabel, QWidget
from pytestqt.qtbot import QtBot

Child = TypeVar("Child", bound=QObject)
Button = TypeVar("Button", bound=QAbstractButton)
Shown = TypeVar("Shown", bound=QWidget)


def show(qtbot: QtBot, widget: Shown, width: int, height: int) -> Shown:
    """Show a widget in a size, and close it after the test."""
    qtbot.addWidget(widget)
    widget.resize(width, height)
    widget.show()
    return widget


def child(parent: QObject, kind: type[Child], name: str = "") -> Child:
    """Return the one descendant of a kind and a name, or the first of a kind."""
    if not name:
        return parent.findChildren(kind)[0]
    [found] = parent.findChildren(kind, name)
    return found


def text(parent: QObject, name: str) -> str:
    """Return the text of the label of a name."""
    return child(parent, QLabel, name).text()


def letters(dialog: QWidget) -> list[str]:
    """Return the letters with which Alt reaches the buttons and fields of a dialog."""
    texts = [one.text() for one in dialog.findChildren(QAbstractButton)]
    for label in dialog.findChildren(QLabel):
        texts.append(label.text())
        # Qt leads to no buddy without a focus of its own.
        if "&" in label.text():
            assert label.buddy().focusPolicy() != Qt.FocusPolicy.NoFocus, label.text()
    return [text.partition("&")[2][0].lower() for text in texts if "&" in text]


def button(parent: QObject, kind: type[Button], text: str) -> Button:
    """Return the first button of a kind and a text."""
    return next(found for found in parent.findChildren(kind) if found.text() == text)
