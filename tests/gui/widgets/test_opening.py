from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtGui import QDesktopServices, QGuiApplication
from PySide6.QtWidgets import QMessageBox, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from handcal_gui.widgets.opening import open_path
from tests.gui.helpers import button


@pytest.mark.parametrize(("name", "kind"), [("report.pdf", "file"), ("", "folder")])
def test_where_it_is_is_said_if_no_program_opens_it(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, kind: str
) -> None:
    window, path = QWidget(), tmp_path / name
    qtbot.addWidget(window)
    window.show()
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda _: True)
    open_path(window, path)
    assert not window.findChildren(QMessageBox)
    monkeypatch.setattr(QDesktopServices, "openUrl", lambda _: False)
    open_path(window, path)
    [box] = window.findChildren(QMessageBox)
    assert box.isVisible()
    assert box.text() == f"No program opened it; the {kind} is at\n{path}"
    button(box, QPushButton, "Copy path").click()
    assert QGuiApplication.clipboard().text() == str(path)
    qtbot.waitUntil(lambda: not window.findChildren(QMessageBox))
