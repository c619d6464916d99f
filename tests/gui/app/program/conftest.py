"""The whole program, with a real station whose camera and headset are in the test's hand."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from pytestqt.qtbot import QtBot

from handcal_gui.app.preferences import PREFERENCES_VERSION, PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.app.theme import use_theme
from tests.gui.app.program.technician import KEY, Technician


@pytest.fixture
def file(tmp_path: Path) -> PreferencesFile:
    path = tmp_path / "config" / "preferences.json"
    path.parent.mkdir()
    station = {"sessions": str(tmp_path / "sessions")}
    chosen = {"version": PREFERENCES_VERSION, "station": station, "runs_itself": False}
    path.write_text(json.dumps(chosen))
    path.with_name("pairing.key").write_text(json.dumps({"devices": [{"key": KEY}]}))
    return PreferencesFile(path)


@pytest.fixture
def open_program(
    qtbot: QtBot, file: PreferencesFile, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[[], Technician]]:
    opened: list[Program] = []

    # The tests' camera is slow on a busy computer.
    monkeypatch.setattr("handcal_gui.calibrate.control.conditions._SLOW_HZ", 0.0)

    monkeypatch.setattr("handcal_gui.app.program.ask_whether_worn", lambda *_: True)

    def open_program() -> Technician:
        program = Program(file)
        opened.append(program)
        qtbot.addWidget(program.window)
        program.window.show()
        return Technician(program, qtbot)

    yield open_program
    for program in opened:
        program.window.close()
    use_theme("system")
    assert [t.name for t in threading.enumerate() if t.name.startswith("handcal")] == []


@pytest.fixture
def technician(open_program: Callable[[], Technician]) -> Technician:
    return open_program()


@pytest.fixture
def live(technician: Technician, studio: Any) -> Technician:
    """Return a technician before a station that runs, with the headset connected."""
    technician.program.start_calibration(studio.settings, "Ada")
    technician.wait_for_page("live")
    technician.wait(lambda: technician.snapshot.link.connected)
    return technician
