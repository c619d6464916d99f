"""Help without a network: the guide, and the support bundle."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QUrl
from PySide6.QtGui import QDesktopServices
from PySide6.QtWidgets import QLineEdit, QPushButton, QTextBrowser
from pytestqt.qtbot import QtBot

from handcal.io.resources import documentation_path
from handcal.station import support
from handcal.station.support import SupportSettings
from handcal_gui.dialogs.guide import GuideDialog
from handcal_gui.dialogs.support import SupportDialog
from tests.gui.helpers import child, text


def test_the_guide_shows_pages_pictures_and_finds_text(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    guide = GuideDialog()
    qtbot.addWidget(guide)
    guide.show()
    page = child(guide, QTextBrowser, "guidePage")
    assert "handcal" in page.toPlainText()
    picture = page.loadResource(2, QUrl("pictures/start.png"))
    assert 0 < picture.width() / picture.devicePixelRatio() <= 620
    child(guide, QLineEdit, "searchGuide").setText("Fine-tune")
    child(guide, QLineEdit, "searchGuide").returnPressed.emit()
    assert page.textCursor().selectedText().casefold() == "fine-tune"
    page.anchorClicked.emit(QUrl("export.md#files"))
    assert page.source() == QUrl.fromLocalFile(str(documentation_path("export.md")))
    assert child(guide, QPushButton, "back").isEnabled()
    opened: list[QUrl] = []
    monkeypatch.setattr(QDesktopServices, "openUrl", opened.append)
    page.anchorClicked.emit(QUrl("https://example.org"))
    page.anchorClicked.emit(QUrl("../pyproject.toml"))
    assert opened == [QUrl("https://example.org")]
    assert page.source().fileName() == "export.md"


def test_the_dialog_writes_a_bundle(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(support, "examine", list)
    dialog = SupportDialog(SupportSettings(tmp_path), tmp_path)
    qtbot.addWidget(dialog)
    dialog.show()
    child(dialog, QPushButton, "writeBundle").click()
    qtbot.waitUntil(lambda: "is written" in text(dialog, "supportSaid"), timeout=10_000)
    assert len(list(tmp_path.glob("handcal-support-*.zip"))) == 1
    dialog.stop()
