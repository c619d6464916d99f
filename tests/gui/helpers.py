"""Helpers that several tests of windows share."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

import pytest
from PySide6.QtCore import QObject, QRect, Qt, QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import (
    QAbstractButton,
    QLabel,
    QMenuBar,
    QMessageBox,
    QPushButton,
    QTabBar,
    QWidget,
)
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


def height_px(widget: QWidget, text: str, width_px: int) -> int:
    """Return the height of a text in a widget's font, with lines of a width."""
    room, wraps = QRect(0, 0, width_px, 9999), Qt.TextFlag.TextWordWrap.value
    return widget.fontMetrics().boundingRect(room, wraps, text).height()


def letters(window: QWidget, *, is_shown: bool = False) -> list[str]:
    """Return the letters with which Alt reaches the menus, buttons, fields and tabs of a window.

    By default those of hidden widgets, too.
    """
    texts: list[str] = []
    for bar in window.findChildren(QMenuBar):
        texts += [action.text() for action in bar.actions()]
    for button in window.findChildren(QAbstractButton):
        texts += [button.text()] * (button.isVisible() or not is_shown)
    for tabs in window.findChildren(QTabBar):
        if tabs.isVisible() or not is_shown:
            texts += [tabs.tabText(place) for place in range(tabs.count())]
    for label in window.findChildren(QLabel):
        buddy = label.buddy()
        if buddy and "&" in label.text() and (label.isVisible() or not is_shown):
            texts.append(label.text())
            # Qt leads to no buddy without a focus of its own.
            assert buddy.focusPolicy() != Qt.FocusPolicy.NoFocus, label.text()
    return [text.partition("&")[2][0].lower() for text in texts if "&" in text]


def button(parent: QObject, kind: type[Button], text: str) -> Button:
    """Return the first button of a kind and a text, regardless of its letter."""
    found = parent.findChildren(kind)
    return next(one for one in found if one.text().replace("&", "") == text.replace("&", ""))


def answer_questions(monkeypatch: pytest.MonkeyPatch, answer: str) -> list[str]:
    """Have message boxes answered by the button of a text; return the list of what they say."""
    said: list[str] = []

    def press(box: QMessageBox) -> int:
        said.append(box.text())
        button(box, QPushButton, answer).click()
        return 0

    monkeypatch.setattr(QMessageBox, "exec", press)
    return said


def note_opened(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Have no file or folder opened by a program; return the list of those that would be."""
    opened: list[Path] = []

    def note(url: QUrl) -> bool:
        opened.append(Path(url.toLocalFile()))
        return True

    monkeypatch.setattr(QDesktopServices, "openUrl", note)
    return opened
