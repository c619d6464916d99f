"""The menu Edit triggers the actions of the panels; Help lists the keys."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from pathlib import Path

import pytest
from PySide6.QtGui import QAction
from pytestqt.qtbot import QtBot

from handcal.register.results import Results
from handcal.session.session import Session, SessionRecord
from handcal_gui.app.keys import keys_by_group
from handcal_gui.app.menus import keys_html, show_keys
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.calibrate.window import MainWindow
from handcal_gui.library.window import LibraryWindow
from handcal_gui.widgets.table import Table
from tests.gui.calibrate.conftest import Engine
from tests.gui.helpers import child


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path) -> Iterator[MainWindow]:
    program = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(program.window)
    program.window.show()
    program.window.activateWindow()
    yield program.window
    program.window.close()


def offered(window: MainWindow) -> dict[str, QAction]:
    """Return the enabled entries by their texts, as after opening the menu; not the search."""
    menu = window.menus["Edit"]
    menu.aboutToShow.emit()
    entries = (one for one in menu.actions() if one.isEnabled() and not one.isSeparator())
    return {one.text().replace("&", ""): one for one in entries if "Find" not in one.text()}


def test_what_can_be_deleted_and_restored_in_a_panel_is_offered(
    window: MainWindow, record: SessionRecord, results: Results
) -> None:
    assert not offered(window)
    window.show_page("live")
    session = window.panels.session
    session.show_record(record, results)
    window.go_to("session")
    child(session, Table, "alignments").selectRow(1)
    session.submit = engine = Engine()
    offered(window)["Delete: Session\tDel"].trigger()
    engine.station.delete.assert_called_once_with("alignment", 2)
    with Session(record.path) as stored:
        stored.delete("alignment", 2)
    session.show_record(Session.open(record.path), None)
    offered(window)["Undo: Session\tCtrl+Z"].trigger()
    engine.station.restore.assert_called_once_with("alignment", 2)
    window.show_page("start")
    assert not offered(window)


def test_results_are_copied_once_there_are_some(
    window: MainWindow, record: SessionRecord, results: Results
) -> None:
    window.show_page("review")
    window.panels.results.show_results(results, record, 8.0)
    assert [text.partition("\t")[0] for text in offered(window)] == ["Copy: Results"]
    window.panels.results.show_results(None, None)
    assert not offered(window)


def test_find_opens_the_library_at_its_search(window: MainWindow) -> None:
    find = next(a for a in window.menus["Edit"].actions() if a.shortcut().toString() == "Ctrl+F")
    find.trigger()
    library = child(window, LibraryWindow, "library")
    focus = library.focusWidget()
    assert focus is not None
    assert focus.objectName() == "search"
    library.accept()


def test_the_list_of_keys_names_each_with_the_place_where_it_works(window: MainWindow) -> None:
    html = keys_html(window)
    for group in keys_by_group(window).values():
        assert all(f"<b>{escape(keys)}</b>" in html for keys, _ in group.rows)
    assert "Camera: a panel; works while it has the keyboard focus" in html
    dialog = show_keys(window)
    assert show_keys(window) is dialog
    assert dialog.isVisible()
    assert not dialog.isModal()
