"""A library of four sessions, and what a person does in its window."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QInputDialog, QPushButton
from pytestqt.qtbot import QtBot

from handcal.core.types import EYES, Alignment, Verification
from handcal.register.results import RESULTS_VERSION
from handcal.rig.example import example_rig
from handcal.session.session import Session
from handcal_gui.library.sessions import COLUMNS
from handcal_gui.library.window import LibraryWindow
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child, text

PATIENCE_MS = 10_000


def results(verdict: str, expected: float, measured: float | None = None) -> dict[str, Any]:
    benefit = {"without_arcmin": 20.0, "after_arcmin": expected}
    one: dict[str, Any] = {"verdict": verdict, "benefit": benefit}
    if measured is not None:
        one["measured_arcmin"] = [2.0 * measured, measured]
    return {"version": RESULTS_VERSION, "eyes": {"left": one, "right": one}}


@pytest.fixture
def folder(tmp_path: Path, alignment: Alignment) -> Path:
    """Return a folder with two sessions of Ada, one of Bea and one of Cid that is damaged."""

    def make(name: str, wearer: str, solved: dict[str, Any] | None) -> Path:
        with Session.create(tmp_path, example_rig(), {}, name=name, wearer=wearer) as session:
            session.save_alignment(alignment)
            if solved is not None:
                if "measured_arcmin" in solved["eyes"]["left"]:
                    found = Verification((0.0, 0.0, 0.0), (1.0, 0.0), (0.001, 0.0, 0.0))
                    session.save_facts(verified=dict.fromkeys(EYES, found))
                session.save_results(solved)
                session.finish()
        return session.path

    make("ada-1", "Ada", results("accept", 9.0, 4.0))
    make("ada-2", "Ada", results("accept", 8.0))
    make("bea", "Bea", results("repeat", 17.0))
    path = make("cid", "Cid", None)
    (path / "alignments" / "1.npz").write_bytes(b"nonsense")
    return tmp_path


@pytest.fixture
def window(qtbot: QtBot, folder: Path) -> Iterator[LibraryWindow]:
    window = LibraryWindow(folder)
    qtbot.addWidget(window)
    window.show()
    qtbot.waitUntil(lambda: table(window).model().rowCount() == 4, timeout=PATIENCE_MS)
    yield window
    window.stop()


def table(window: LibraryWindow) -> Table:
    return child(window, Table, "sessionTable")


def rows(window: LibraryWindow) -> list[dict[str, str]]:
    """Return the cells of each row by the first line of the column's title."""
    model = table(window).model()
    titles = [column.title.split("\n")[0] for column in COLUMNS]
    return [
        {title: model.index(row, place).data() for place, title in enumerate(titles)}
        for row in range(model.rowCount())
    ]


def wearers(window: LibraryWindow) -> list[str]:
    return [row["Wearer"] for row in rows(window)]


def choose(window: LibraryWindow, *wearer: str) -> None:
    keys = zip(table(window).keys, wearers(window), strict=True)
    table(window).choose([key for key, name in keys if name in wearer])


def press(window: LibraryWindow, name: str) -> None:
    found = child(window, QPushButton, name)
    assert found.isEnabled()
    found.click()


def wait_for(qtbot: QtBot, window: LibraryWindow, said: str) -> None:
    qtbot.waitUntil(lambda: said in text(window, "message"), timeout=PATIENCE_MS)


def activate(qtbot: QtBot, window: LibraryWindow) -> None:
    """Do what a window manager does when a dialog ends."""
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow, timeout=PATIENCE_MS)


def answer_name(qtbot: QtBot, window: LibraryWindow, name: str) -> list[str]:
    """Press F2 and type a name; return the names that were offered."""
    activate(qtbot, window)
    table(window).setFocus()
    QTest.keyClick(table(window), Qt.Key.Key_F2)
    dialog = child(window, QInputDialog)
    qtbot.waitUntil(dialog.isActiveWindow, timeout=PATIENCE_MS)  # else Return opens the session
    typed = child(dialog, QComboBox).lineEdit()
    assert typed is not None
    assert typed.text() == window.chosen[0].wearer
    typed.selectAll()
    QTest.keyClicks(typed, name)
    offered = dialog.comboBoxItems()
    QTest.keyClick(typed, Qt.Key.Key_Return)
    return offered
