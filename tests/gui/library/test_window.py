"""The library window: found, sorted, compared, opened and exported."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetrics, QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QLabel, QLineEdit, QPushButton
from pytestqt.qtbot import QtBot

from handcal.core.types import EYES
from handcal.rig.example import example_rig
from handcal.session.judged_trials import EyeTrials
from handcal.session.library import EyeOutcome, LibraryEntry, delete_session, read_library
from handcal.session.repair import repair_session
from handcal.session.session import Session
from handcal_gui.app.theme import SPACING_PX, number_font
from handcal_gui.library.sessions_model import (
    COLUMNS,
    FILTERS,
    NAMES,
    SessionsModel,
    make_row,
)
from handcal_gui.library.sessions_table import SessionsTable
from handcal_gui.library.trend_plot import TrendPlot, calibrations_of
from handcal_gui.library.window import LibraryWindow
from handcal_gui.widgets.error_bars import LIBRARY_LEGEND, error_text
from tests.gui.helpers import child, text
from tests.gui.library.conftest import (
    PATIENCE_MS,
    activate,
    answer_name,
    choose,
    press,
    results,
    rows,
    table,
    wait_for,
    wearers,
)
from tests.gui.views import VERIFIED


def test_the_newest_is_first_and_measured_is_not_expected(window: LibraryWindow) -> None:
    assert wearers(window) == ["Cid", "Bea", "Ada", "Ada"]
    newer, older = rows(window)[2:]
    assert older[4:] == ["✓ Accept", "20.0 / 20.0", "8.0 / 8.0", "4.0 / 4.0", "–", "Finished"]
    assert newer[5:8] == ["20.0 / 20.0", "– / –", "8.0 / 8.0"]
    assert rows(window)[0][4] == "Not solved"
    assert rows(window)[0][9] == "Damaged: 1 part"


def test_the_bars_have_a_key_while_there_are_any(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    key = child(window, QLabel, "legend")
    assert (key.text(), key.isVisible()) == (
        "Bars: expected error before, after; left eye above",
        True,
    )
    for name in ("ada-1", "ada-2", "bea"):
        delete_session(folder / name)
    window.reload()
    qtbot.waitUntil(key.isHidden, timeout=PATIENCE_MS)


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
    header = table(window).model().headerData(6, Qt.Orientation.Horizontal)
    assert header == "Found ′\nleft / right"
    table(window).sortByColumn(6, Qt.SortOrder.AscendingOrder)  # those not verified follow
    assert rows(window)[0][6] == "8.0 / 8.0"  # not what is expected to be left of it


def test_the_trend_of_one_wearer(window: LibraryWindow) -> None:
    plot = child(window, TrendPlot)
    choose(window, "Bea")
    assert plot.isHidden()
    choose(window, "Ada")
    assert not plot.isHidden()
    assert text(window, "trendTitle").startswith("Ada: 2 calibrations, and the error")
    verified, unverified = plot._verified["left"].getData(), plot._unverified["left"].getData()
    np.testing.assert_equal(verified[1], [4.0, np.nan])
    np.testing.assert_equal(unverified[1], [np.nan, 8.0])  # each calibration has one symbol


def test_the_trend_has_a_line_at_the_newest_target(qtbot: QtBot, tmp_path: Path) -> None:
    plot = TrendPlot()
    qtbot.addWidget(plot)
    entries = [LibraryEntry(tmp_path, (0, 0), target_arcmin=one) for one in (5.0, 8.0, None)]
    plot.show_calibrations(entries)
    assert plot._target.getData()[1].tolist() == [8.0, 8.0]
    assert plot.item.viewRange()[1][1] > 8.0
    plot.show_calibrations(entries[2:])
    assert plot._target.getData()[1] is None or not len(plot._target.getData()[1])


def tried(mean_arcmin: float, target_arcmin: float | None) -> EyeTrials:
    return EyeTrials(1, mean_arcmin, math.inf if target_arcmin is None else target_arcmin)


def test_trials_over_the_target_are_marked_and_no_tick_stands_beside_them(tmp_path: Path) -> None:
    def said(arcmin: float, target_arcmin: float | None, *verdicts: str) -> tuple[str, str]:
        left, right = (EyeOutcome(one, 20, 5, None) for one in verdicts)
        entry = LibraryEntry(
            tmp_path,
            (0, 0),
            trials=2,
            target_arcmin=target_arcmin,
            eyes={
                "left": replace(left, trials=tried(arcmin, target_arcmin)),
                "right": replace(right, trials=tried(2.0, target_arcmin)),
            },
        )
        row = make_row(entry)
        return row.texts[4], row.texts[8]

    both = "accept", "accept"
    over = "⚠ Trials over 8′"
    assert said(10.4, 8.0, *both) == (f"Left {over}, Right ✓ Accept", "⚠ 10.4 / 2.0 n=1/1")
    assert said(7.9, 8.0, *both) == ("✓ Accept", "7.9 / 2.0 n=1/1")
    assert said(10.4, None, *both) == ("✓ Accept", "10.4 / 2.0 n=1/1")  # no target is set
    assert said(10.4, 8.0, "accept", "repeat")[0] == f"Left {over}, Right ↻ Repeat"
    assert said(10.4, 8.0, "repeat", "accept")[0] == "Left ↻ Repeat, Right ✓ Accept"


def test_sessions_whose_trials_contradict_the_verdict_are_found_and_stand_together() -> None:
    model = SessionsModel()
    entries = []
    for arcmin in (7.0, 9.0, 6.0, 10.0):
        eyes = dict.fromkeys(EYES, EyeOutcome("accept", 20, 5, None, trials=tried(arcmin, 8.0)))
        entries.append(LibraryEntry(Path(f"{arcmin}"), (0, 0), eyes=eyes, target_arcmin=8.0))
    model.show_rows([make_row(one) for one in entries])
    model.search("", "accepted")
    model.sort(4)
    assert [row.texts[4][0] for row in model.shown] == [*"⚠⚠✓✓"]
    model.sort(8)
    assert [row.entry.path.name for row in model.shown] == ["6.0", "7.0", "9.0", "10.0"]


def test_the_bars_and_the_columns_use_the_same_words_and_numbers() -> None:
    titles = [column.title.partition(" ′")[0] for column in COLUMNS]
    assert "error before, after" in LIBRARY_LEGEND
    assert titles[5:8] == ["Before", "Found", "After"]
    verified = EyeOutcome("accept", 20.0, 10.0, 5.0, 8.0)
    one = make_row(LibraryEntry(Path("a"), (0, 0), eyes={"left": verified}))
    assert one.texts[5:8] == ("20.0 / –", "8.0 / –", "5.0 / –")  # of the left eye
    assert error_text(one.entry.eyes) == "Left eye: 20.0′ before, 5.0′ after"
    assert all(column.tooltip for column in COLUMNS)


def test_titles_have_room_for_the_arrow(window: LibraryWindow) -> None:
    window.resize(1900, 600)
    window._sessions.show_rows([make_row(LibraryEntry(Path("a"), (0, 0)))])
    child(window, SessionsTable).fit_columns()
    across = table(window).horizontalHeader()
    for number, column in enumerate(COLUMNS):
        text_px = max(map(across.fontMetrics().horizontalAdvance, column.title.split("\n")))
        assert across.sectionSize(number) >= text_px + 2 * SPACING_PX


def test_search_and_kind_show_their_keys(window: LibraryWindow) -> None:
    assert "(Ctrl+F)" in child(window, QLineEdit, "search").placeholderText()
    kind = child(window, QComboBox, "kind")
    assert [one.text() for one in window.findChildren(QLabel) if one.buddy() is kind] == ["S&how"]


def test_numbers_stand_apart_from_the_text_of_the_next_column(window: LibraryWindow) -> None:
    model = table(window).model()
    centre = Qt.AlignmentFlag.AlignHCenter
    assert all(
        model.headerData(column, Qt.Orientation.Horizontal, Qt.ItemDataRole.TextAlignmentRole)
        & centre
        for column in (5, 6, 7, 8)
    )


def test_trials_stand_apart_from_the_state(window: LibraryWindow) -> None:
    window.resize(1600, 600)
    tried = EyeOutcome("accept", 20, 5, None, trials=EyeTrials(111, 111.1, 8.0))
    one = LibraryEntry(Path("a"), (0, 0), trials=222, eyes=dict.fromkeys(EYES, tried))
    window._sessions.show_rows([make_row(one)])
    child(window, SessionsTable).fit_columns()
    text_px = QFontMetrics(number_font()).horizontalAdvance("⚠ 111.1 / 111.1 n=111/111")
    assert table(window).columnWidth(8) - text_px >= 24


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
    qtbot.waitUntil(lambda: "cid" in wearers(window), timeout=PATIENCE_MS)
    choose(window, "Bea", "cid")
    with qtbot.waitSignal(window.export_requested) as asked:
        press(window, "exportSessions")
    assert set(asked.args[0]) == {folder / "bea", folder / "cid"}  # which names it with the reason
    answer_name(qtbot, window, "Eve")
    wait_for(qtbot, window, "Name corrected in 1 session.")


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


def test_keys_sort_by_the_columns_in_sight(window: LibraryWindow) -> None:
    window.resize(800, 510)
    QApplication.processEvents()
    across = table(window).horizontalHeader()
    hidden = {column for column in range(across.count()) if across.isSectionHidden(column)}
    assert hidden
    seen = []
    for _ in range(across.count() - len(hidden)):
        QTest.keyClick(table(window), Qt.Key.Key_F6)
        seen.append(across.sortIndicatorSection())
    assert sorted(seen) == [one for one in range(across.count()) if one not in hidden]
    table(window).sortByColumn(0, Qt.SortOrder.AscendingOrder)
    assert wearers(window) == ["Ada", "Ada", "Bea", "Cid"]
    QTest.keyClick(table(window), Qt.Key.Key_F6, Qt.KeyboardModifier.ShiftModifier)
    assert wearers(window) == ["Cid", "Bea", "Ada", "Ada"]


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


def test_a_button_closes_it_and_leaves_the_others_their_room(
    qtbot: QtBot, window: LibraryWindow
) -> None:
    window.resize(960, 510)
    QApplication.processEvents()
    assert window.width() == 960
    for one in window.findChildren(QPushButton):
        assert one.width() >= one.sizeHint().width() or not one.isVisible(), one.text()
    with qtbot.waitSignal(window.rejected):  # as Esc does
        child(window, QPushButton, "closeLibrary").click()


def test_a_narrow_window_names_the_columns_left_out_and_cuts_only_names(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    repair_session(folder / "cid", folder / "cid-repaired")
    window.reload()
    qtbot.waitUntil(lambda: len(rows(window)) == 5, timeout=PATIENCE_MS)
    assert "Damaged, has a copy" in [row[9] for row in rows(window)]
    across = table(window).horizontalHeader()
    for width_px in (800, 960, 1600):
        window.resize(width_px, 510)
        assert across.length() <= table(window).viewport().width()
        for column in range(across.count()):
            if not (across.isSectionHidden(column) or column in NAMES):
                assert across.sectionSize(column) >= table(window).sizeHintForColumn(column)
        hidden = [COLUMNS[i].title for i in range(across.count()) if across.isSectionHidden(i)]
        table(window).selectAll()
        named = text(window, "leftOut").removeprefix("A wider window also shows: ").split(", ")
        assert [one for one in named if one] == [one.partition("\n")[0] for one in hidden]
        choose(window, "Bea")
        assert ("Headset: –" in text(window, "leftOut")) == ("Headset" in hidden)
        child(window, QLineEdit, "search").setText("zzz")
        assert "Headset: " not in text(window, "leftOut"), "no session is in sight"
        child(window, QLineEdit, "search").clear()
        assert not across.isSectionHidden(2), "the name of the rig is cut instead"
    assert not across.hiddenSectionCount()
    tip = table(window).model().index(0, 0).data(Qt.ItemDataRole.ToolTipRole)
    assert "Rig: Example" in tip


def test_the_count_has_the_line_to_itself(window: LibraryWindow) -> None:
    window.resize(960, 510)
    QGuiApplication.processEvents()
    assert child(window, QLabel, "count").width() > 900 // 2


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


def test_what_is_selected_is_painted_before_work_begins(
    window: LibraryWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    usual = SessionsModel.data

    def data(*args: Any) -> object:
        done.append("cell")
        return usual(*args)

    monkeypatch.setattr(SessionsModel, "data", data)
    monkeypatch.setattr(window._jobs, "run", lambda *_: done.append("work"))
    QGuiApplication.processEvents()
    done.clear()
    table(window).selectAll()
    window._check.trigger()
    QGuiApplication.processEvents()
    assert "cell" in done
    assert done[-1] == "work"


def test_long_names_are_cut_and_nothing_else(window: LibraryWindow) -> None:
    across = table(window).horizontalHeader()
    for width_px in (900, 1600):
        window.resize(width_px, 600)
        assert across.length() <= table(window).viewport().width()
        for column in (1, 4, 6, 7, 9):
            assert across.sectionSize(column) >= table(window).sizeHintForColumn(column)
        assert across.isSectionHidden(8) == (width_px == 900), "no session has trials"
    assert across.sectionSize(5) >= table(window).sizeHintForColumn(5)
    assert across.sectionSize(2) >= table(window).sizeHintForColumn(2)  # the rig: room for all


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


def test_a_folder_that_does_not_exist_is_not_called_empty(qtbot: QtBot, tmp_path: Path) -> None:
    window = LibraryWindow(tmp_path / "none")
    qtbot.addWidget(window)
    window.show()
    qtbot.waitUntil(lambda: text(window, "count").startswith("0 sessions"), timeout=PATIENCE_MS)
    assert text(window, "noSessions").startswith("This folder does not exist. Calibrate a wearer")
    window.stop()


def test_a_search_that_finds_nothing_says_so(window: LibraryWindow) -> None:
    reason = child(window, QLabel, "noSessions")
    assert not reason.isVisible()
    child(window, QLineEdit, "search").setText("nobody")
    assert reason.isVisible()
    assert reason.text().startswith("No session matches.")
    assert reason.visibleRegion().boundingRect() == reason.rect()
