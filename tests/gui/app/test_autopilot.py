"""A demonstration from the start page to the export, in this process and with short pauses."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from handcal.session.session import Session
from handcal.station.settings import StationSettings
from handcal_gui.app import autopilot
from handcal_gui.app.autopilot import Demonstration
from handcal_gui.app.preferences import PREFERENCES_VERSION, PreferencesFile
from handcal_gui.app.program import Program
from tests.helpers import Patience, slow_simulator, write_small_rig

PATIENCE_S = 60.0

pytestmark = pytest.mark.process


def test_a_demonstration_calibrates_exports_and_takes_pictures(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    codes: list[int] = []
    kept = {name: getattr(QApplication, name) for name in ("sendPostedEvents", "sendEvent")}
    application = SimpleNamespace(quit=lambda: codes.append(0), exit=codes.append, **kept)
    monkeypatch.setattr(autopilot, "QApplication", application)
    monkeypatch.setattr(autopilot, "_LOOK_S", 0.05)
    monkeypatch.setattr(autopilot, "_LOOK_MS", 60)
    slow_simulator(monkeypatch)
    # A busy computer gives few frames a second, and the wearer's answer lies between two.
    monkeypatch.setattr("handcal.calibration.hands.MATCH_NS", 600_000_000)
    preferences = tmp_path / "preferences.json"
    export = {"formats": ["report", "csv"]}
    preferences.write_text(json.dumps({"version": PREFERENCES_VERSION, "export": export}))
    program = Program(PreferencesFile(preferences), remembers=False)
    qtbot.addWidget(program.window)
    program.window.show()
    shown = Demonstration(program, tmp_path / "result", tmp_path / "pictures")
    rig = write_small_rig(tmp_path / "rig.yaml")
    shown.start(StationSettings(seed=1, rig=str(rig)))
    patience = Patience(PATIENCE_S)
    qtbot.waitUntil(lambda: bool(codes) or patience.is_over(), timeout=round(1e5 * PATIENCE_S))
    program.window.close()
    assert (codes, shown.complaint) == ([0], None)
    [path] = (tmp_path / "result").glob("session-*[!t]")
    assert Session.open(path).is_finished
    [report] = (tmp_path / "result").glob("*/report.pdf")
    assert report.read_bytes().startswith(b"%PDF")
    names = {path.stem for path in (tmp_path / "pictures").glob("*.png")}
    assert {f"step-{i}" for i in range(1, 8)} <= {name[:6] for name in names}
    assert {"panel-camera", "panel-results", "panel-fine-tune", "panel-session"} <= names
    assert {"start", "window-fine-tune", "export-done", "review", "preferences"} <= names
    assert {"station", "sessions", "rig", "evaluate", "support", "manual"} <= names
    assert {"keys", "rig-6", "evaluate-5", "camera-settings"} <= names
