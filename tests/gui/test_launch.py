"""From the first window to the main one: nothing typed meanwhile is lost or presses a button."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from types import SimpleNamespace

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QComboBox, QWidget
from pytestqt.qtbot import QtBot

from handcal_gui import launch
from handcal_gui.pages.start.start_page import StartPage
from handcal_gui.window import MainWindow
from tests.gui.helpers import child


def test_text_typed_while_it_starts_goes_to_the_wearers_name_and_no_other_key_does_anything(
    qtbot: QtBot, qapp: QApplication, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = QWidget()
    qtbot.addWidget(first)
    first.show()
    keys = Qt.Key
    for key, text in (
        *((keys.Key_Space, " "), (keys.Key_A, "a"), (keys.Key_X, "x"), (keys.Key_Backspace, "")),
        *((keys.Key_Tab, "\t"), (keys.Key_D, "d"), (keys.Key_Return, "\r"), (keys.Key_A, "a")),
    ):
        event = QKeyEvent(QEvent.Type.KeyPress, key, Qt.KeyboardModifier.NoModifier, text)
        QCoreApplication.postEvent(first.windowHandle(), event)  # handled once all is imported
    seen = []

    def look() -> None:
        window = next(one for one in qapp.topLevelWidgets() if isinstance(one, MainWindow))
        wearer = child(child(window, StartPage), QComboBox, "wearer")
        seen.append((wearer.currentText(), window.page, first.isVisible()))

    monkeypatch.setattr(qapp, "exec", look)
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)  # put back at the end
    for name in ("setApplicationDisplayName", "setWindowIcon"):
        monkeypatch.setattr(qapp, name, lambda _: None)
    monkeypatch.setattr(launch, "gc", SimpleNamespace(freeze=lambda: None, enable=lambda: None))
    for name in ("close_on_signals", "_log_to"):
        monkeypatch.setattr(launch, name, lambda *_: None)
    arguments = Namespace(
        preferences=tmp_path / "preferences.json",
        size=None,
        session=None,
        source=None,
        rig=None,
        seed=None,
        autopilot=False,
        screenshots=None,
    )
    launch.launch(qapp, arguments, first)
    assert seen == [("ada", "start", False)]
