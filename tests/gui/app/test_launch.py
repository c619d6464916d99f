"""From the first window to the main one."""

from __future__ import annotations

import subprocess
import sys
from argparse import Namespace
from pathlib import Path
from types import SimpleNamespace

import pytest
from PySide6.QtCore import QSize
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

from handcal_gui.app import launch
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.calibrate.window import MainWindow


@pytest.fixture
def arguments(qapp: QApplication, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Namespace:
    """Arguments of the command line, for a launch that leaves the tests' process as it was."""
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)  # put back at the end
    for name in ("setApplicationDisplayName", "setWindowIcon"):
        monkeypatch.setattr(qapp, name, lambda _: None)
    monkeypatch.setattr(launch, "gc", SimpleNamespace(freeze=lambda: None))
    for name in ("close_on_signals", "collect_in_this_thread", "_log_to"):
        monkeypatch.setattr(launch, name, lambda *_: None)
    return Namespace(
        preferences=tmp_path / "preferences.json",
        size=None,
        session=None,
        source=None,
        rig=None,
        seed=None,
        autopilot=False,
        screenshots=None,
    )


@pytest.fixture
def first(qtbot: QtBot) -> QWidget:
    """The window shown until the main window replaces it."""
    first = QWidget()
    qtbot.addWidget(first)
    first.show()
    return first


def test_a_size_is_that_of_the_window_although_it_was_maximized_when_closed(
    qapp: QApplication, first: QWidget, arguments: Namespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments.preferences.parent.mkdir(exist_ok=True)
    program = Program(PreferencesFile(arguments.preferences))
    program.window.showMaximized()
    program.window.close()
    arguments.size = QSize(1100, 650)
    before = set(qapp.topLevelWidgets())
    seen: list[tuple[bool, QSize]] = []

    def look() -> None:
        opened = set(qapp.topLevelWidgets()) - before
        windows = [one for one in opened if isinstance(one, MainWindow)]
        seen.extend((one.isMaximized(), one.size()) for one in windows)

    monkeypatch.setattr(qapp, "exec", look)
    launch.launch(qapp, arguments, first)
    assert seen == [(False, arguments.size)]


@pytest.mark.process
def test_a_crash_in_a_library_leaves_the_places_of_all_threads_in_the_log(tmp_path: Path) -> None:
    crash = (
        "import faulthandler, sys; from pathlib import Path;"
        "from handcal_gui.app.launch import _log_to;"
        "_log_to(Path(sys.argv[1])); faulthandler._sigabrt()"
    )
    path = tmp_path / "handcal.log"
    ended = subprocess.run([sys.executable, "-c", crash, str(path)], check=False)
    assert ended.returncode != 0
    assert "Fatal Python error: Aborted" in path.read_text()
