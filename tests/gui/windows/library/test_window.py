"""The library window: found, compared, checked, repaired, deleted and restored."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QInputDialog, QLabel, QLineEdit, QPushButton, QTableView
from pytestqt.qtbot import QtBot

from handcal.rig.example import example_rig
from handcal.session.library import LibraryEntry, delete_session, read_library
from handcal.session.repair import repair_session
from handcal.session.session import Session
from handcal.types import Alignment
from handcal_gui.windows.library.sessions_model import FILTERS, SessionsModel, make_row
from handcal_gui.windows.library.sessions_table import SessionsTable
from handcal_gui.windows.library.trend_plot import TrendPlot, calibrations_of
from handcal_gui.windows.library.window import LibraryWindow
from tests.gui.helpers import child, text
from tests.gui.views import VERIFIED

PATIENCE_MS = 10_000


def results(verdict: str, expected: float, measured: float | None = None) -> dict[str, Any]:
    one: dict[str, Any] = {"verdict": verdict, "benefit": {"after_arcmin": expected}}
    if measured is not None:
        one["measured_arcmin"] = [2.0 * measured, measured]
    return {"version": 2, "eyes": {"left": one, "right": one}}


@pytest.fixture
def folder(tmp_path: Path, alignment: Alignment) -> Path:
    """Return a folder with two sessions of Ada, one of Bea and one of Cid that is damaged."""

    def make(name: str, wearer: str, solved: dict[str, Any] | None) -> Path:
        with Session.create(tmp_path, example_rig(), {}, name=name, wearer=wearer) as session:
            session.save_alignment(alignment)
            if solved is not None:
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


def table(window: LibraryWindow) -> QTableView:
    return child(window, QTableView, "sessionTable")


def rows(window: LibraryWindow) -> list[list[str]]:
    model = table(window).model()
    return [
        [model.index(row, column).data() for column in range(model.columnCount())]
        for row in range(model.rowCount())
    ]


def wearers(window: LibraryWindow) -> list[str]:
    return [row[0] for row in rows(window)]


def choose(window: LibraryWindow, *wearer: str) -> None:
    table(window).clearSelection()
    table(window).setSelectionMode(QTableView.SelectionMode.MultiSelection)
    for number, row in enumerate(rows(window)):
        if row[0] in wearer:
            table(window).selectRow(number)


def press(window: LibraryWindow, name: str) -> None:
    found = child(window, QPushButton, name)
    assert found.isEnabled()
    found.click()


def test_the_newest_is_first_and_measured_is_not_expected(window: LibraryWindow) -> None:
    assert wearers(window) == ["Cid", "Bea", "Ada", "Ada"]
    newer, older = rows(window)[2:]
    assert older[4:9] == ["✓ Accept", "4.0 / 4.0", "9.0 / 9.0", "–", "Finished"]
    assert newer[5:7] == ["– / –", "8.0 / 8.0"]
    assert rows(window)[0][4] == "Not solved"
    assert rows(window)[0][8] == "Damaged: 1 part"


def test_search_filter_and_sorting(window: LibraryWindow) -> None:
    QTest.keyClicks(child(window, QLineEdit, "search"), "ada EXAMPLE")
    assert wearers(window) == ["Ada", "Ada"]
    assert "2 of 4 sessions" in text(window, "count")
    child(window, QLineEdit, "search").clear()
    kinds = child(window, QComboBox, "kind")
    expected = {"all": 4, "accepted": 2, "repeat": 1, "unfinished": 1, "damaged": 1}
    for kind in FILTERS:
        kinds.setCurrentIndex(kinds.findData(kind))
        assert len(rows(window)) == expected[kind]
    kinds.setCurrentIndex(0)
    table(window).sortByColumn(5, Qt.SortOrder.AscendingOrder)  # the unmeasured follow
    assert rows(window)[0][5] == "4.0 / 4.0"


def test_the_trend_of_one_wearer(window: LibraryWindow) -> None:
    plot = child(window, TrendPlot)
    choose(window, "Bea")
    assert plot.isHidden()
    choose(window, "Ada")
    assert not plot.isHidden()
    assert text(window, "trendTitle").startswith("Ada: 2 calibrations, and the error")
    measured, expected = plot._measured["left"].getData(), plot._expected["left"].getData()
    assert list(measured[1][:1]) == [4.0]
    assert list(expected[1]) == [9.0, 8.0]


def test_buttons_fit_the_choice(window: LibraryWindow) -> None:
    enabled = {
        (): set(),
        ("Bea",): {"openSession", "resumeSession", "exportSessions", "checkSessions"},
        ("Cid",): {"openSession", "resumeSession", "exportSessions", "checkSessions"},
        ("Ada", "Bea"): {"exportSessions", "checkSessions"},
    }
    names = ("openSession", "resumeSession", "exportSessions", "checkSessions")
    for wearer, expected in enabled.items():
        choose(window, *wearer)
        assert {name for name in names if child(window, QPushButton, name).isEnabled()} == expected


def test_open_and_export_ask_for_what_is_chosen(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    choose(window, "Ada")
    with qtbot.waitSignal(window.export_requested) as asked:
        press(window, "exportSessions")
    assert asked.args[0] == [folder / "ada-2", folder / "ada-1"]
    choose(window, "Bea")
    with qtbot.waitSignal(window.open_requested) as opened:
        press(window, "openSession")
    assert opened.args == [folder / "bea"]


def test_a_session_that_was_only_verified_is_exported(qtbot: QtBot, tmp_path: Path) -> None:
    with Session.create(tmp_path, example_rig(), {}, name="a", wearer="Ada") as session:
        session.save_facts(verified={"left": VERIFIED})
        session.save_results(results("accept", 4.0, 4.0))
    window = LibraryWindow(tmp_path)
    qtbot.addWidget(window)
    window.show()
    qtbot.waitUntil(lambda: table(window).model().rowCount() == 1, timeout=PATIENCE_MS)
    choose(window, "Ada")
    assert child(window, QPushButton, "exportSessions").isEnabled()
    window.stop()


def test_an_unreadable_one_among_others_is_left_to_the_export_and_keeps_its_name(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    (folder / "cid" / "journal.jsonl").write_text("nonsense\n")
    window.reload()
    qtbot.waitUntil(lambda: "–" in wearers(window), timeout=PATIENCE_MS)
    choose(window, "Bea", "–")
    with qtbot.waitSignal(window.export_requested) as asked:
        press(window, "exportSessions")
    assert set(asked.args[0]) == {folder / "bea", folder / "cid"}  # which names it with the reason
    answer_name(qtbot, window, "Eve")
    wait_for(qtbot, window, "Name corrected in 1 session.")


def wait_for(qtbot: QtBot, window: LibraryWindow, said: str) -> None:
    qtbot.waitUntil(lambda: said in text(window, "message"), timeout=PATIENCE_MS)


def test_check_names_the_damage_and_repair_copies_the_rest(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    choose(window, "Ada", "Bea", "Cid")
    press(window, "checkSessions")
    wait_for(qtbot, window, "3 sessions sound, every file read.")
    assert "cid: alignments/1.npz" in text(window, "message")
    choose(window, "Cid")
    press(window, "repairSession")
    wait_for(qtbot, window, "cid-repaired: a copy with 0 alignments")
    qtbot.waitUntil(lambda: len(rows(window)) == 5, timeout=PATIENCE_MS)
    assert (folder / "cid-repaired").is_dir()
    assert not Session.open(folder / "cid-repaired").damaged
    states = [row[8] for row in rows(window)]
    assert states.count("Unfinished, repaired copy") == 1
    state = table(window).model().index(states.index("Damaged, has a copy"), 8)
    assert "Repaired in cid-repaired" in state.data(Qt.ItemDataRole.ToolTipRole)
    assert [entry.path.name for entry in window.chosen] == ["cid-repaired"]


def test_a_sound_session_is_not_copied(qtbot: QtBot, window: LibraryWindow, folder: Path) -> None:
    choose(window, "Bea")
    press(window, "repairSession")
    wait_for(qtbot, window, "bea is sound: there is nothing to repair.")
    assert not (folder / "bea-repaired").exists()


def test_a_repaired_copy_counts_once(folder: Path) -> None:
    repair_session(folder / "ada-1", folder / "ada-1-repaired")
    found = calibrations_of("Ada", read_library(folder))
    assert [entry.path.name for entry in found] == ["ada-1-repaired", "ada-2"]


def test_enter_in_the_search_opens_the_first_that_is_found(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    assert [entry.wearer for entry in window.chosen] == ["Cid"]  # the newest
    activate(qtbot, window)
    search = child(window, QLineEdit, "search")
    QTest.keyClicks(search, "bea")
    assert [entry.wearer for entry in window.chosen] == ["Bea"]
    with qtbot.waitSignal(window.open_requested) as opened:
        QTest.keyClick(search, Qt.Key.Key_Return)
    assert opened.args == [folder / "bea"]


def test_a_sorted_or_filtered_table_keeps_what_is_selected(window: LibraryWindow) -> None:
    choose(window, "Ada", "Cid")
    table(window).sortByColumn(0, Qt.SortOrder.AscendingOrder)
    assert wearers(window) == ["Ada", "Ada", "Bea", "Cid"]
    assert [entry.wearer for entry in window.chosen] == ["Ada", "Ada", "Cid"]
    child(window, QLineEdit, "search").setText("a")  # not in Cid, but in the rig's name
    assert [entry.wearer for entry in window.chosen] == ["Ada", "Ada", "Cid"]


def test_every_button_has_a_letter_of_its_own(window: LibraryWindow) -> None:
    texts = [one.text() for one in window.findChildren(QPushButton) if one.objectName() != "cancel"]
    letters = [text[text.index("&") + 1].casefold() for text in texts]
    assert len(set(letters)) == len(letters)


def test_a_narrow_window_leaves_out_columns_and_cuts_none(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    repair_session(folder / "cid", folder / "cid-repaired")
    window.reload()
    qtbot.waitUntil(lambda: len(rows(window)) == 5, timeout=PATIENCE_MS)
    assert "Damaged, has a copy" in [row[8] for row in rows(window)]
    across = table(window).horizontalHeader()
    for width_px in (800, 960, 1600):
        window.resize(width_px, 510)
        assert across.length() <= table(window).viewport().width()
        for column in range(across.count()):
            if not across.isSectionHidden(column):
                assert across.sectionSize(column) >= table(window).sizeHintForColumn(column)
    assert not across.hiddenSectionCount()
    tip = table(window).model().index(0, 0).data(Qt.ItemDataRole.ToolTipRole)
    assert "Rig: Example" in tip


def test_what_was_deleted_together_is_restored_together_by_name(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    choose(window, "Ada", "Bea")
    press(window, "deleteSessions")
    wait_for(qtbot, window, "3 sessions deleted.")
    qtbot.waitUntil(lambda: wearers(window) == ["Cid"], timeout=PATIENCE_MS)
    tip = child(window, QPushButton, "restoreSession").toolTip
    assert tip() == "Last deleted: 3 sessions (Ctrl+Z)"
    press(window, "restoreSession")
    wait_for(qtbot, window, "3 sessions restored.")
    qtbot.waitUntil(lambda: len(rows(window)) == 4, timeout=PATIENCE_MS)
    choose(window, "Bea")
    press(window, "deleteSessions")
    qtbot.waitUntil(lambda: tip().startswith("Last deleted: Bea, "), timeout=PATIENCE_MS)


def test_few_calls_of_python_draw_and_choose_many_sessions(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: Counter[str] = Counter()
    for name in ("data", "index", "rowCount", "columnCount", "flags"):
        usual = getattr(SessionsModel, name)

        def count(*args: Any, name: str = name, usual: Any = usual) -> Any:
            calls[name] += 1
            return usual(*args)

        monkeypatch.setattr(SessionsModel, name, count)
    model = SessionsModel()
    shown = SessionsTable(model)
    qtbot.addWidget(shown)
    entries = [LibraryEntry(tmp_path / f"{i}", (0, 0), wearer=f"P{i}") for i in range(500)]
    model.show_rows([make_row(entry) for entry in entries])
    calls.clear()
    shown.selectAll()
    assert len(shown.chosen) == 500
    model.sort(0)
    model.search("P1", "all")
    assert calls.total() < 500


def test_long_names_are_cut_and_nothing_else(window: LibraryWindow) -> None:
    across = table(window).horizontalHeader()
    for width_px in (900, 1600):
        window.resize(width_px, 600)
        assert across.length() <= table(window).viewport().width()
        for column in (1, 4, 5, 6, 7):
            assert across.sectionSize(column) >= table(window).sizeHintForColumn(column)
    assert across.sectionSize(2) >= table(window).sizeHintForColumn(2)  # the rig: room for all


def test_delete_and_restore(qtbot: QtBot, window: LibraryWindow, folder: Path) -> None:
    assert child(window, QPushButton, "restoreSession").isHidden()
    choose(window, "Bea")
    table(window).setFocus()
    QTest.keyClick(table(window), Qt.Key.Key_Delete)
    qtbot.waitUntil(lambda: "Bea" not in wearers(window), timeout=PATIENCE_MS)
    assert not (folder / "bea").exists()
    press(window, "restoreSession")
    qtbot.waitUntil(lambda: "Bea" in wearers(window), timeout=PATIENCE_MS)
    qtbot.waitUntil(child(window, QPushButton, "restoreSession").isHidden, timeout=PATIENCE_MS)


def test_an_open_session_stays(qtbot: QtBot, window: LibraryWindow, folder: Path) -> None:
    choose(window, "Bea")
    with Session(folder / "bea"):
        press(window, "deleteSessions")
        wait_for(qtbot, window, "is in use by process")
    assert (folder / "bea").is_dir()


def test_one_that_is_gone_does_not_keep_the_others_from_being_deleted(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    choose(window, "Bea", "Cid")
    delete_session(folder / "bea")  # by another program
    press(window, "deleteSessions")
    wait_for(qtbot, window, "1 session deleted.\nbea: ")
    assert "is no longer there" in text(window, "message")
    qtbot.waitUntil(lambda: wearers(window) == ["Ada", "Ada"], timeout=PATIENCE_MS)


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


def test_a_name_is_corrected_and_brought_back(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    choose(window, "Ada")
    assert answer_name(qtbot, window, "ada") == ["Ada", "Bea", "Cid"]
    qtbot.waitUntil(lambda: wearers(window) == ["Cid", "Bea", "ada", "ada"], timeout=PATIENCE_MS)
    wait_for(qtbot, window, "Name corrected in 2 sessions.")
    assert [entry.wearer for entry in window.chosen] == ["ada", "ada"]
    activate(qtbot, window)
    QTest.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: wearers(window) == ["Cid", "Bea", "Ada", "Ada"], timeout=PATIENCE_MS)
    assert Session.open(folder / "ada-1").wearer == "Ada"
    qtbot.waitUntil(child(window, QPushButton, "correctName").isEnabled, timeout=PATIENCE_MS)
    assert child(window, QPushButton, "restoreSession").isHidden()
    assert answer_name(qtbot, window, "Eve")[:2] == ["Ada", "ada"]  # former names are offered


def test_a_name_is_no_markup(qtbot: QtBot, window: LibraryWindow) -> None:
    choose(window, "Bea")
    answer_name(qtbot, window, "<b>Bea")
    qtbot.waitUntil(lambda: window.chosen[0].wearer == "<b>Bea", timeout=PATIENCE_MS)
    index = table(window).selectionModel().selectedRows()[0]
    assert "&lt;b&gt;Bea" in index.data(Qt.ItemDataRole.ToolTipRole)
    window._former_names = {window.chosen[0].path: "<b>Bea"}
    window._refresh()
    assert "Name before: &lt;b&gt;Bea" in child(window, QPushButton, "restoreSession").toolTip()
    [told] = [one for one in window.findChildren(QLabel) if one.text() == "Name before: <b>Bea"]
    assert told.textFormat() == Qt.TextFormat.PlainText
    assert "&lt;b&gt;Bea" in told.toolTip()


def test_an_open_session_keeps_its_name(qtbot: QtBot, window: LibraryWindow, folder: Path) -> None:
    choose(window, "Bea")
    with Session(folder / "bea"):
        answer_name(qtbot, window, "Eve")
        wait_for(qtbot, window, "Name corrected in 0 sessions.\nbea: ")
        qtbot.waitUntil(child(window, QPushButton, "restoreSession").isHidden, timeout=PATIENCE_MS)
        choose(window, "Bea", "Cid")
        answer_name(qtbot, window, "Eve")
        wait_for(qtbot, window, "Name corrected in 1 session.\nbea: ")
        assert "is in use by process" in text(window, "message")
    qtbot.waitUntil(lambda: wearers(window)[:2] == ["Eve", "Bea"], timeout=PATIENCE_MS)
    press(window, "restoreSession")  # only Cid's name was corrected
    wait_for(qtbot, window, "Name corrected in 1 session.")
    qtbot.waitUntil(lambda: wearers(window)[0] == "Cid", timeout=PATIENCE_MS)


def test_the_context_menu_has_every_action(window: LibraryWindow, folder: Path) -> None:
    assert table(window).contextMenuPolicy() == Qt.ContextMenuPolicy.ActionsContextMenu
    actions = {
        one.text().replace("&", ""): one for one in table(window).actions() if not one.isSeparator()
    }
    assert set(actions) == {
        "Open", "Resume", "Export…", "Name…", "Show folder", "Copy path", "Check", "Repair",
        "Delete",
    }  # fmt: skip
    choose(window, "Ada")
    assert not actions["Show folder"].isEnabled()
    actions["Copy path"].trigger()
    assert QGuiApplication.clipboard().text() == f"{folder / 'ada-2'}\n{folder / 'ada-1'}"
    table(window).clearSelection()
    assert not any(action.isEnabled() for action in actions.values())


def test_an_empty_folder(qtbot: QtBot, tmp_path_factory: pytest.TempPathFactory) -> None:
    window = LibraryWindow(tmp_path_factory.mktemp("empty"))
    qtbot.addWidget(window)
    window.show()
    qtbot.waitUntil(lambda: text(window, "count").startswith("0 sessions"), timeout=PATIENCE_MS)
    assert text(window, "noSessions").startswith("No session is in this folder yet. Calibrate")
    window.stop()


def test_a_search_that_finds_nothing_says_so(window: LibraryWindow) -> None:
    reason = child(window, QLabel, "noSessions")
    assert not reason.isVisible()
    child(window, QLineEdit, "search").setText("nobody")
    assert reason.isVisible()
    assert reason.text().startswith("No session matches.")
    assert reason.visibleRegion().boundingRect() == reason.rect()
