"""The library window: found, sorted, compared, opened and exported."""

from __future__ import annotations

import csv
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLabel, QLineEdit, QPushButton
from pytestqt.qtbot import QtBot

from handcal.core.types import EYES
from handcal.export.export import ExportSettings
from handcal.export.many import export_sessions
from handcal.io.resources import resource_path
from handcal.rig.example import example_rig
from handcal.session.judged_trials import EyeTrials
from handcal.session.library import EyeOutcome, LibraryEntry, correct_wearer, read_library
from handcal.session.repair import repair_session
from handcal.session.session import Session
from handcal_gui.library.sessions import (
    COLUMNS,
    FILTERS,
    calibrations_of,
    is_of,
    selection_text,
    session_row,
)
from handcal_gui.library.window import LibraryWindow, TrendPlot
from tests.gui.helpers import child, text
from tests.gui.library.conftest import (
    PATIENCE_MS,
    activate,
    answer_name,
    choose,
    press,
    rows,
    table,
    wait_for,
    wearers,
)

NAMES = ("openSession", "resumeSession", "exportSessions", "checkSessions")


def test_the_newest_is_first_and_found_is_not_what_is_left(window: LibraryWindow) -> None:
    assert wearers(window) == ["Cid", "Bea", "Ada", "Ada"]
    newer, older = rows(window)[2:]
    errors = "Before ′", "Found ′", "After ′"
    assert [older[name] for name in errors] == ["20.0 / 20.0", "8.0 / 8.0", "4.0 / 4.0"]
    assert [newer[name] for name in errors] == ["20.0 / 20.0", "– / –", "8.0 / 8.0"]
    assert (older["Verdict"], older["State"]) == ("Good", "Finished")
    assert [row["Verdict"] for row in rows(window)[:2]] == ["Not solved", "Not yet"]
    assert rows(window)[0]["State"] == "Damaged: 1 part"


def test_search_filter_and_sorting(window: LibraryWindow) -> None:
    QTest.keyClicks(child(window, QLineEdit, "search"), "ada EXAMPLE")
    assert wearers(window) == ["Ada", "Ada"]
    assert "2 of 4 sessions" in text(window, "count")
    child(window, QLineEdit, "search").clear()
    kinds = child(window, QComboBox, "kind")
    expected = {"all": 4, "accepted": 2, "repeat": 1, "unfinished": 1, "damaged": 1, "empty": 0}
    for kind in FILTERS:
        kinds.setCurrentIndex(kinds.findData(kind))
        assert len(rows(window)) == expected[kind]
    kinds.setCurrentIndex(0)
    found = [column.title for column in COLUMNS].index("Found ′\nleft / right")
    table(window).sortByColumn(found, Qt.SortOrder.AscendingOrder)  # those not verified follow
    assert rows(window)[0]["Found ′"] == "8.0 / 8.0"


def test_sessions_in_which_nothing_was_done_are_shown_only_on_request(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    for name in ("false-start", "another"):
        with Session.create(folder, example_rig(), {}, name=name) as session:
            session.record("refused", reason="no hand")
    window.reload()
    qtbot.waitUntil(lambda: "not shown: 2 empty" in text(window, "count"), timeout=PATIENCE_MS)
    assert len(rows(window)) == 4
    assert "4 sessions in" in text(window, "count")
    kinds = child(window, QComboBox, "kind")
    kinds.setCurrentIndex(kinds.findData("empty"))
    assert {row["Session"] for row in rows(window)} == {"false-start", "another"}
    table(window).selectAll()
    press(window, "deleteSessions")
    wait_for(qtbot, window, "2 sessions deleted.")
    qtbot.waitUntil(lambda: rows(window) == [], timeout=PATIENCE_MS)


def test_the_means_of_the_selection_are_those_of_the_export(tmp_path: Path) -> None:
    example = resource_path("example_session")
    paths = [Path(shutil.copytree(example, tmp_path / "in" / name)) for name in ("a", "b", "c")]
    for path, wearer in zip(paths, ("Ada", "Bea", "Ada"), strict=True):
        correct_wearer(path, wearer)
    entries = read_library(tmp_path / "in")
    shown = selection_text(entries)
    export_sessions(paths, tmp_path / "out", ExportSettings(("csv",)))
    with (tmp_path / "out" / "summary.csv").open(encoding="utf-8", newline="") as file:
        summary = {row["quantity"]: row for row in csv.DictReader(file)}
    for name, quantity in (("before", "before_arcmin"), ("after", "expected_error_arcmin")):
        row = summary[quantity]
        assert f"{name} {float(row['mean']):.1f} ± {float(row['sd_between']):.1f}′" in shown
    counts = (summary[name]["values"] for name in ("wearers", "eyes", "accepted", "verified"))
    wearer_count, eyes, good, verified = counts
    assert shown.startswith(
        f"{wearer_count} wearers, {eyes} eyes: {good} good, {verified} verified"
    )
    assert selection_text(entries[:1]) == ""


def test_the_means_of_what_is_selected_stand_below_the_table(window: LibraryWindow) -> None:
    choose(window, "Ada")
    assert "1 wearer, 4 eyes: 4 good, 2 verified; mean error before 20.0′" in text(window, "means")
    choose(window, "Bea")
    assert text(window, "means") == ""


def test_the_trend_of_one_wearer(window: LibraryWindow) -> None:
    plot = child(window, TrendPlot)
    choose(window, "Bea")
    assert plot.isHidden()
    choose(window, "Ada")
    assert not plot.isHidden()
    verified, unverified = plot._verified["left"].getData(), plot._unverified["left"].getData()
    np.testing.assert_equal(verified[1], [4.0, np.nan])
    np.testing.assert_equal(unverified[1], [np.nan, 8.0])  # each calibration has one symbol


def test_the_trend_has_a_line_at_the_newest_target(qtbot: QtBot, tmp_path: Path) -> None:
    plot = TrendPlot()
    qtbot.addWidget(plot)
    entries = [LibraryEntry(tmp_path, (0, 0), target_arcmin=one) for one in (5.0, 8.0, None)]
    plot.show_calibrations(entries)
    assert plot._target.getData()[1].tolist() == [8.0, 8.0]
    plot.show_calibrations(entries[2:])
    assert plot._target.getData()[1] is None or not len(plot._target.getData()[1])


def test_a_repaired_copy_counts_once(folder: Path) -> None:
    repair_session(folder / "ada-1", folder / "ada-1-repaired")
    found = calibrations_of("Ada", read_library(folder))
    assert [entry.path.name for entry in found] == ["ada-1-repaired", "ada-2"]


@pytest.mark.parametrize(
    ("mean_arcmin", "target_arcmin", "verdicts", "expected"),
    [
        (10.4, 8.0, ("accept", "accept"), "Left ⚠ Trials over 8′, Right Good"),
        (7.9, 8.0, ("accept", "accept"), "Good"),
        (10.4, np.inf, ("accept", "accept"), "Good"),
        (10.4, 8.0, ("accept", "keep"), "Left ⚠ Trials over 8′, Right No better than before"),
        (10.4, 8.0, ("repeat", "accept"), "Left Not yet, Right Good"),
    ],
)
def test_trials_over_the_target_are_marked_and_not_called_good(
    mean_arcmin: float, target_arcmin: float, verdicts: tuple[str, str], expected: str
) -> None:
    left, right = (EyeOutcome(verdict, 20, 5, None) for verdict in verdicts)
    eyes = {
        "left": replace(left, trials=EyeTrials(1, mean_arcmin, target_arcmin)),
        "right": replace(right, trials=EyeTrials(1, 2.0, target_arcmin)),
    }
    entry = LibraryEntry(Path("a"), (0, 0), trials=2, eyes=eyes)  # type: ignore[arg-type]
    cells = session_row(entry).cells
    assert cells[2] == expected
    assert cells[6].startswith("⚠") == (mean_arcmin > target_arcmin)


def test_what_is_known_of_a_session_stands_in_its_columns() -> None:
    outcome = EyeOutcome("accept", 20.0, 10.0, None, final="set by hand")
    entry = LibraryEntry(
        Path("folder/one"),
        (0, 0),
        eyes={"left": outcome},
        plan="recommended",
        eye_distance_m=0.0634,
        notes="Glasses off",
        is_finished=True,
        is_simulated=True,
    )
    titles = [column.title for column in COLUMNS]
    cells = dict(zip(titles, session_row(entry).cells, strict=True))
    assert cells["Final φ"] == "Left set by hand"
    assert (cells["Plan"], cells["Eyes mm"]) == ("recommended", "63.4")
    assert (cells["Notes"], cells["Session"]) == ("Glasses off", "one")
    assert cells["State"] == "Finished, simulated"
    assert all(column.tooltip for column in COLUMNS)
    assert is_of(entry, "accepted")


def test_buttons_fit_the_choice(window: LibraryWindow) -> None:
    for wearer, expected in (("Bea", NAMES), ("Cid", NAMES), ("Ada", NAMES[2:])):
        choose(window, wearer)
        assert [one for one in NAMES if child(window, QPushButton, one).isEnabled()] == [*expected]
    table(window).clearSelection()
    assert not any(action.isEnabled() for action in table(window).actions() if action.text())


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


def test_a_narrow_window_names_what_it_leaves_out(window: LibraryWindow) -> None:
    window.resize(800, 510)
    hidden = [title.split("\n")[0] for title in table(window).hidden]
    assert {"Session", "Headset"} <= {*hidden}
    assert not {"Wearer", "Date", "Verdict", "After ′"} & {*hidden}
    choose(window, "Bea")
    assert "Session: bea" in text(window, "leftOut")
    table(window).selectAll()
    assert text(window, "leftOut") == f"A wider window also shows: {', '.join(hidden)}"
    child(window, QLineEdit, "search").setText("zzz")
    assert "Session: " not in text(window, "leftOut"), "no session is in sight"


def test_paths_are_copied(window: LibraryWindow, folder: Path) -> None:
    actions = {one.text().replace("&", ""): one for one in table(window).actions()}
    choose(window, "Ada")
    assert not actions["Show folder"].isEnabled()
    actions["Copy path"].trigger()
    assert QGuiApplication.clipboard().text() == f"{folder / 'ada-2'}\n{folder / 'ada-1'}"


def test_a_button_closes_it_and_each_has_a_letter_of_its_own(
    qtbot: QtBot, window: LibraryWindow
) -> None:
    texts = [one.text() for one in window.findChildren(QPushButton) if one.objectName() != "cancel"]
    letters = [text[text.index("&") + 1].casefold() for text in texts]
    assert len(set(letters)) == len(letters)
    with qtbot.waitSignal(window.rejected):  # as Esc does
        child(window, QPushButton, "closeLibrary").click()


@pytest.mark.parametrize(
    ("name", "reason"), [("empty", "No session is in this folder yet."), ("none", "does not exist")]
)
def test_a_folder_without_sessions_says_why_and_what_to_do(
    qtbot: QtBot, tmp_path: Path, name: str, reason: str
) -> None:
    (tmp_path / "empty").mkdir()
    window = LibraryWindow(tmp_path / name)
    qtbot.addWidget(window)
    window.show()
    qtbot.waitUntil(lambda: text(window, "count").startswith("0 sessions"), timeout=PATIENCE_MS)
    assert reason in text(window, "sessionTable-empty")
    assert "Calibrate a wearer" in text(window, "sessionTable-empty")
    window.stop()


def test_a_search_that_finds_nothing_says_so(window: LibraryWindow) -> None:
    hint = child(window, QLabel, "sessionTable-empty")
    assert not hint.isVisible()
    child(window, QLineEdit, "search").setText("nobody")
    assert hint.isVisible()
    assert hint.text().startswith("No session matches.")


def test_five_hundred_sessions_are_searched_and_sorted_at_once(
    qtbot: QtBot, tmp_path: Path, window: LibraryWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    eyes = dict.fromkeys(EYES, EyeOutcome("accept", 20, 5, None))
    entries = tuple(
        LibraryEntry(tmp_path / f"{i}", (0, 0), wearer=f"P{i}", eyes=eyes) for i in range(500)
    )
    window._contents = replace(window._contents, entries=entries)
    child(window, QLineEdit, "search").setText("P4")
    assert len(wearers(window)) == 111
    table(window).selectAll()
    assert len(window.chosen) == 111
