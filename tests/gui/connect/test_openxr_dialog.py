"""The dialog that gives a calibration to OpenXR programs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PySide6.QtWidgets import QCheckBox, QPushButton
from pytestqt.qtbot import QtBot

from handcal.export import openxr
from handcal.io.resources import resource_path
from handcal.session.in_force import in_force_path
from handcal.session.session import open_session
from handcal_gui.connect.openxr_dialog import OpenxrDialog
from tests.gui.helpers import child, text


def test_a_calibration_is_put_in_force_and_what_became_of_it_is_shown(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("XDG_CONFIG_HOME", "XDG_DATA_HOME"):
        monkeypatch.setenv(name, str(tmp_path / name))
    shipped = tmp_path / "shipped.so"
    monkeypatch.setattr(openxr, "_shipped_library", lambda: shipped)
    dialog = OpenxrDialog(open_session(resource_path("example_session")))
    qtbot.addWidget(dialog)
    dialog.show()

    def says(words: str) -> None:
        qtbot.waitUntil(lambda: words in text(dialog, "openxrStatus"), timeout=10_000)

    use, remove = (child(dialog, QPushButton, name) for name in ("useOpenxr", "removeOpenxr"))
    says("The layer is not installed")
    use.click()
    assert not use.isEnabled()
    says("shipped.so")  # is not there
    shipped.write_bytes(b"a layer")
    use.click()
    says("for 12.0 h more")
    child(dialog, QCheckBox, "keepOpenxr").click()
    use.click()
    says("kept until")
    told = {"state": "refused", "reason": "the knob was turned"}
    (in_force_path().parent / "openxr-status.json").write_text(json.dumps(told))
    says("refused, the knob was turned")
    remove.click()
    says("The layer is not installed")
    assert not in_force_path().exists()
    dialog.stop()
