"""The support bundle."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtWidgets import QPushButton
from pytestqt.qtbot import QtBot

from handcal.station.checks import support
from handcal.station.checks.support import SupportSettings
from handcal_gui.app.support_dialog import SupportDialog
from handcal_gui.widgets.path_field import PathField
from tests.gui.helpers import child, text


def test_the_dialog_writes_a_bundle(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(support, "examine", list)
    dialog = SupportDialog(SupportSettings(tmp_path), tmp_path)
    qtbot.addWidget(dialog)
    dialog.show()
    assert "to the handcal developers" in text(dialog, "supportAbout")
    announced = text(dialog, "supportWill")
    folder, write = dialog.findChildren(PathField)[0], child(dialog, QPushButton, "writeBundle")
    folder.set_path("")
    assert not write.isEnabled(), "or it would be written wherever the program was started"
    (tmp_path / "file").touch()
    folder.set_path(str(tmp_path / "file"))
    write.click()
    qtbot.waitUntil(lambda: "choose another folder" in text(dialog, "supportFound"))
    folder.set_path(str(tmp_path))
    write.click()
    assert not folder.isEnabled(), "or another would not be checked"
    qtbot.waitUntil(lambda: "was written" in text(dialog, "supportFound"), timeout=10_000)
    qtbot.waitUntil(folder.isEnabled)
    [written] = tmp_path.glob("handcal-support-*.zip")
    assert f"The file {written.name} will be written" in announced
    dialog.stop()


def test_a_failure_says_what_to_do(qtbot: QtBot, tmp_path: Path) -> None:
    dialog = SupportDialog(SupportSettings(tmp_path), tmp_path)
    qtbot.addWidget(dialog)
    dialog.show()
    recording = next(one for one in dialog.findChildren(PathField) if "Recording" in one.name)
    recording.set_path(str(tmp_path / "nowhere"))
    write = child(dialog, QPushButton, "writeBundle")
    qtbot.waitUntil(write.isEnabled)
    write.click()
    qtbot.waitUntil(lambda: "choose another folder" in text(dialog, "supportFound"))
    dialog.stop()
