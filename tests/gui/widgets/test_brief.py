"""A short message: in the window, over everything, for a moment, and read out."""

from __future__ import annotations

import pytest
from PySide6.QtGui import QAccessible, QAccessibleEvent, QGuiApplication
from PySide6.QtWidgets import QLabel, QLineEdit, QWidget
from pytestqt.qtbot import QtBot

from handcal_gui.widgets import brief
from handcal_gui.widgets.brief import copy_text, show_briefly
from handcal_gui.widgets.layouts import vbox


def test_what_was_copied_is_said_for_a_moment(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []

    def tell(event: QAccessibleEvent) -> None:
        told.append(event.message())  # type: ignore[attr-defined]  # of an announcement

    monkeypatch.setattr(QAccessible, "updateAccessibility", tell)
    monkeypatch.setattr(brief, "_SHOWN_MS", 50)
    window, field = QWidget(), QLineEdit()
    vbox(field, on=window)
    qtbot.addWidget(window)
    window.resize(300, 100)
    window.show()
    show_briefly(field, "before")
    copy_text(field, "text", "Copied: <b>")
    assert QGuiApplication.clipboard().text() == "text"
    assert told == ["before", "Copied: <b>"]
    [shown] = [one for one in window.findChildren(QLabel, "brief") if one.isVisible()]
    assert shown.text() == "Copied: <b>"
    assert window.rect().contains(shown.geometry())
    field.setFocus()
    assert shown.isVisible()
    qtbot.waitUntil(lambda: not window.findChildren(QLabel, "brief"))
