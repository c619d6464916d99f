"""The 3D window, requested from the session: closed with the program, its failures shown."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pytestqt.qtbot import QtBot

from handcal.core.errors import CancelledError
from handcal.core.progress import Progress
from handcal.export import window_3d
from handcal.export.outcome import SessionOutcome
from handcal.session.session import SessionRecord
from handcal_gui.app import separate_windows
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program

PATIENCE_MS = 20_000


@pytest.fixture
def program(qtbot: QtBot, tmp_path: Path) -> Iterator[Program]:
    program = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(program.window)
    yield program
    program.window.close()
    assert [t.name for t in threading.enumerate() if t.name.startswith("handcal")] == []


def open_session(program: Program, qtbot: QtBot, record: SessionRecord) -> None:
    program.open_session(record.path)
    qtbot.waitUntil(lambda: program.window.page == "review", timeout=PATIENCE_MS)


def test_one_window_at_a_time_is_open_until_the_program_closes(
    program: Program, qtbot: QtBot, record: SessionRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[tuple[int, ...]] = []
    closed = threading.Semaphore(0)

    def show(outcome: SessionOutcome, *, progress: Progress) -> None:
        shown.append(tuple(outcome.record.alignments))
        while not progress.is_cancelled():
            threading.Event().wait(0.01)
        closed.release()
        raise CancelledError("closed")

    monkeypatch.setattr(separate_windows, "inspect_session", show)
    open_session(program, qtbot, record)
    program.window.panels.session.inspect_button.click()
    qtbot.waitUntil(lambda: len(shown) == 1, timeout=PATIENCE_MS)
    program.window.panels.session.inspect_button.click()
    qtbot.waitUntil(lambda: len(shown) == 2, timeout=PATIENCE_MS)
    assert closed.acquire(timeout=0)
    assert not closed.acquire(timeout=0)
    program.close()
    assert closed.acquire(timeout=0)
    assert shown == [(1, 2)] * 2


@pytest.mark.parametrize("missing", ["Open3D is not installed", "no display found"])
def test_a_window_that_cannot_open_says_why(
    missing: str,
    program: Program,
    qtbot: QtBot,
    record: SessionRecord,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found: Any = None if missing.startswith("Open3D") else True
    monkeypatch.setattr(window_3d, "find_spec", lambda _name: found)
    monkeypatch.setattr(window_3d, "_has_display", lambda: False)
    open_session(program, qtbot, record)
    program.windows.inspect()
    qtbot.waitUntil(lambda: missing in program.window.banner.text, timeout=PATIENCE_MS)


def test_without_an_alignment_nothing_opens(program: Program) -> None:
    program.windows.inspect()
    assert "nothing to inspect: open a session first" in program.window.banner.text
