"""The menu Edit triggers the actions of the panels, and none of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtGui import QAction
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.register.results import Results
from handcal.session.session import Session, SessionRecord
from handcal.station.snapshot import Snapshot
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.calibrate.guide.wizard import WizardPanel
from handcal_gui.calibrate.window import MainWindow
from handcal_gui.library.window import LibraryWindow
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child
from tests.gui.views import NUDGED, begun


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path) -> Iterator[MainWindow]:
    program = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(program.window)
    program.window.show()
    program.window.activateWindow()
    yield program.window
    program.window.close()


def offered(window: MainWindow) -> dict[str, str]:
    """Return the texts of the enabled entries by their names, as after opening the menu."""
    menu = window.menus["Edit"]
    menu.aboutToShow.emit()
    entries = (one for one in menu.actions() if one.isEnabled() and one.objectName())
    return {one.objectName(): one.text().replace("&", "") for one in entries}


def press(window: MainWindow, name: str) -> None:
    child(window, QAction, name).trigger()


def test_nothing_can_be_edited_without_a_session(window: MainWindow) -> None:
    assert offered(window) == {}
    window.show_page("live")
    assert offered(window) == {}


def test_a_deletion_is_chosen_in_the_table_and_undone_from_anywhere(
    qtbot: QtBot, window: MainWindow, record: SessionRecord, results: Results
) -> None:
    window.show_page("live")
    session = window.panels.session
    session.show_record(record, results)
    window.go_to("session")
    table = child(session, Table, "alignments")
    table.selectRow(1)
    assert "edit-delete" not in offered(window), "the selection is not what the focus is on"
    table.setFocus()
    assert offered(window) == {"edit-delete": "Delete: Session\tDel"}
    with qtbot.waitSignal(session.delete_requested) as asked:
        press(window, "edit-delete")
    assert asked.args == ["alignment", 2]
    with Session(record.path) as stored:
        stored.delete("alignment", 2)
    session.show_record(Session.open(record.path), None)
    assert offered(window)["edit-undo"] == "Undo: Session\tCtrl+Z"
    window.go_to("camera")
    assert offered(window) == {"edit-undo": "Undo: Session"}
    with qtbot.waitSignal(session.restore_requested) as asked:
        press(window, "edit-undo")
    assert asked.args == ["alignment", 2]
    window.use_arrangement("station")
    assert offered(window) == {"edit-undo": "Undo: Session"}, "the guide discards alignments, too"
    window.show_page("start")
    assert offered(window) == {}


def test_an_open_menu_offers_to_undo_the_nudges_made_since(
    qtbot: QtBot, window: MainWindow, snapshot: Callable[..., Snapshot]
) -> None:
    guide = child(window, WizardPanel, "wizard")
    guide.start(begun())
    window.show_page("live")

    def verify(can_undo: bool) -> None:
        verifying = replace(NUDGED, can_undo=can_undo)
        guide.show_snapshot(snapshot(State.VERIFY, procedure={"verifying": verifying}))

    def undo() -> str:
        entry = child(window, QAction, "edit-undo")
        return entry.text() if entry.isEnabled() else ""

    verify(can_undo=False)
    assert "edit-undo" not in offered(window)
    verify(can_undo=True)
    qtbot.waitUntil(lambda: undo() == "&Undo: Movement of the outline")
    verify(can_undo=False)
    qtbot.waitUntil(lambda: not undo())
    window.menus["Edit"].aboutToHide.emit()


def test_results_are_copied_once_there_are_some(
    window: MainWindow, record: SessionRecord, results: Results
) -> None:
    window.show_page("review")
    window.panels.results.show_results(results, record.alignments)
    assert offered(window) == {"edit-copy": "Copy: Results"}
    window.panels.results.show_results(None, {})
    assert offered(window) == {}


def test_find_opens_the_library_at_its_search(window: MainWindow) -> None:
    find = next(a for a in window.menus["Edit"].actions() if a.shortcut().toString() == "Ctrl+F")
    find.trigger()
    library = child(window, LibraryWindow, "library")
    focus = library.focusWidget()
    assert focus is not None
    assert focus.objectName() == "search"
    library.accept()
