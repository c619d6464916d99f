"""Stored sessions: opened, compared, given up, and refused where they are damaged."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtWidgets import (
    QComboBox,
    QLabel,
    QProgressDialog,
    QPushButton,
    QTabWidget,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.calibration.solve_again import stored_solve_settings
from handcal.core.errors import CancelledError
from handcal.core.progress import Progress
from handcal.register.results import Results
from handcal.rig.example import example_rig
from handcal.session.library import correct_wearer, delete_session
from handcal.session.record import Replayed, replay
from handcal.session.session import Session, SessionRecord
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.calibrate.control import review
from handcal_gui.calibrate.control.review import _Stored
from handcal_gui.calibrate.parts.legend import LegendEntry
from handcal_gui.calibrate.review_page import ReviewPage
from handcal_gui.calibrate.start.example import copy_example
from handcal_gui.connect.openxr_dialog import OpenxrDialog
from handcal_gui.library.window import LibraryWindow
from handcal_gui.widgets.path_field import PathField
from handcal_gui.widgets.table import Table
from tests.gui.views import VERIFIED

PATIENCE_MS = 20_000


@pytest.fixture
def program(qtbot: QtBot, tmp_path: Path) -> Iterator[Program]:
    program = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(program.window)
    program.window.show()
    yield program
    program.window.close()
    assert [t.name for t in threading.enumerate() if t.name.startswith("handcal")] == []


class Solver:
    """Stands in for what solves a session: goes on until it is cancelled."""

    def __init__(self) -> None:
        self.began = threading.Event()
        self.was_cancelled = threading.Event()

    def __call__(
        self, _alignments: Any, _rig: Any, _settings: Any, progress: Progress, **_measured: Any
    ) -> Results:
        progress.at(0.0, "Solving alignment 1 of 2")
        self.began.set()
        while not progress.is_cancelled():
            threading.Event().wait(0.01)
        self.was_cancelled.set()
        raise CancelledError("solving was cancelled")


def child(program: Program, kind: type[Any], name: str) -> Any:
    found = program.window.findChild(kind, name)
    assert isinstance(found, QWidget), name
    return found


def is_open(program: Program) -> bool:
    return program.window.page == "review"


def test_a_corrected_name_is_shown_and_exported(
    program: Program, qtbot: QtBot, tmp_path: Path
) -> None:
    path = copy_example(tmp_path / "sessions")
    program.open_session(path)
    qtbot.waitUntil(lambda: is_open(program), timeout=PATIENCE_MS)
    library = program.windows.show_library(path.parent)
    qtbot.waitUntil(lambda: bool(library.chosen), timeout=PATIENCE_MS)
    library._correct_names(library.chosen, "Ada")

    def exported() -> str:
        assert program.windows.record is not None
        return program.windows.record.wearer

    qtbot.waitUntil(lambda: exported() == "Ada", timeout=PATIENCE_MS)
    titles = [one.text() for one in program.window.findChildren(QLabel)]
    assert titles.count("Ada") == 2  # of the page, and in the session panel
    assert program.window.windowTitle() == "Ada – handcal"
    delete_session(path)
    library.changed.emit()
    qtbot.waitUntil(lambda: program.review._wearer._job is None, timeout=PATIENCE_MS)
    assert exported() == "Ada"
    library.reject()


def test_a_name_corrected_as_the_library_closes_is_read_outside_the_windows_thread(
    program: Program, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    threads = []

    def replay_slowly(path: Path) -> Replayed:
        threads.append(threading.current_thread())
        return replay(path)

    monkeypatch.setattr(review, "replay", replay_slowly)
    path = copy_example(tmp_path / "sessions")
    program.open_session(path)
    qtbot.waitUntil(lambda: is_open(program), timeout=PATIENCE_MS)
    library = program.windows.show_library(path.parent)
    correct_wearer(path, "Ada")
    library.reject()

    def is_shown() -> bool:
        assert program.review.record is not None
        return program.review.record.wearer == "Ada"

    qtbot.waitUntil(is_shown, timeout=PATIENCE_MS)
    assert threading.main_thread() not in threads


def test_the_example_is_opened_from_the_start_page(
    program: Program, qtbot: QtBot, tmp_path: Path
) -> None:
    assert not (tmp_path / "preferences.json").exists()  # nothing has changed yet
    entered = str(tmp_path / "sessions")
    (folder,) = (
        one for one in program.start.findChildren(PathField) if one.name == "Session folder"
    )
    folder.set_path(entered)
    program.start.open_example(tmp_path / "sessions")
    qtbot.waitUntil(lambda: is_open(program), timeout=PATIENCE_MS)
    assert child(program, QLabel, "reviewContents").text().startswith("2 alignments, 6 trials")
    numbers = child(program, Table, "numbers-of-both-eyes").as_text()
    assert "Trials\t2.4′ n=3\t7.5′ n=3" in numbers
    assert program.window.findChild(QLabel, "reviewNote") is None
    program.show_start()
    assert program.start.new.settings.sessions == entered  # kept for the next wearer
    program.start.open_example(tmp_path / "preferences.json" / "none")
    assert "preferences.json" in program.window.banner.text


def test_other_results_than_those_of_solving_again_are_named(
    program: Program, qtbot: QtBot, tmp_path: Path
) -> None:
    path = copy_example(tmp_path / "sessions")
    stored = Session.open(path).results
    assert stored is not None
    stored["eyes"]["left"]["verdict"] = "repeat"
    with Session(path) as session:
        session.save_results(stored)
    program.open_session(path)
    qtbot.waitUntil(lambda: is_open(program), timeout=PATIENCE_MS)
    numbers = child(program, Table, "numbers-of-both-eyes").as_text()
    assert "Trials\t2.4′ n=3\t7.5′ n=3" in numbers
    assert child(program, QLabel, "reviewNote").text() == (
        "Solved again by this version; when it was recorded, the verdict was left eye ↻ Not yet."
    )


def test_a_session_without_alignments_shows_no_hand_of_another(
    program: Program, record: SessionRecord, results: Results
) -> None:
    settings = stored_solve_settings(record)
    points, tasks = [], []
    for alignments, solved in ((record.alignments, results), ({}, None)):
        one = replace(record, alignments=alignments)
        program.review._show(_Stored(one, settings, solved))
        points.append([e.text for e in program.window.panels.cloud.findChildren(LegendEntry)])
        tasks.append(child(program, QLabel, "reviewTask").text())
    assert "export" in tasks[0]
    assert tasks[1].startswith("Resume")
    assert not any(text.endswith("none") for text in points[0])
    assert all(text.endswith("none") for text in points[1])


def test_a_session_is_shown_and_closed_again(
    program: Program, qtbot: QtBot, record: SessionRecord
) -> None:
    program.open_session(record.path)
    qtbot.waitUntil(lambda: is_open(program), timeout=PATIENCE_MS)
    assert child(program, QLabel, "reviewContents").text().startswith("2 alignments, 0 trials")
    card = child(program, ReviewPage, "reviewPage").findChild(QLabel, "card-verdict-left")
    assert isinstance(card, QLabel)
    assert card.text().startswith("Left eye: ")
    assert program.preferences.sessions == (str(record.path),)
    child(program, QPushButton, "reviewClose").click()
    assert program.window.page == "start"
    assert program.review.record is None


def test_the_alignment_whose_residuals_are_shown_is_in_the_hand_cloud(
    program: Program,
    qtbot: QtBot,
    record: SessionRecord,
    results: Results,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shown = []
    cloud = program.window.panels.cloud
    monkeypatch.setattr(cloud, "show_alignment", lambda one, *_: shown.append(one))
    program.window.resize(1280, 900)
    program.review._show(_Stored(record, stored_solve_settings(record), results))
    program.window.show_page("review")
    child(program, QTabWidget, "results-tabs").setCurrentIndex(2)
    residuals = program.window.panels.results.residuals
    qtbot.waitUntil(residuals.isVisible)
    choice = residuals.findChild(QComboBox, "residuals-choice")
    assert isinstance(choice, QComboBox)
    numbers = set()
    for index in range(choice.count()):
        choice.setCurrentIndex(index)
        number, _ = choice.currentData()
        assert shown[-1] is record.alignments[number]
        numbers.add(number)
    assert numbers == set(record.alignments)
    program.review._show(_Stored(record, stored_solve_settings(record), results))  # another one
    number, _ = choice.currentData()
    assert shown[-1] is record.alignments[number]


def tear(path: Path) -> None:
    journal = path / "journal.jsonl"
    journal.write_bytes(journal.read_bytes()[:-20])


def overwrite(name: str, content: bytes) -> Callable[[Path], object]:
    return lambda path: (path / name).write_bytes(content)


def remove(name: str) -> Callable[[Path], object]:
    return lambda path: (path / name).unlink()


@pytest.mark.parametrize(
    "damage",
    [
        remove("journal.jsonl"),
        overwrite("journal.jsonl", b"\xff\xfe garbage\n"),
    ],
)
def test_a_damaged_session_is_refused_in_words_and_the_program_goes_on(
    program: Program,
    qtbot: QtBot,
    record: SessionRecord,
    tmp_path: Path,
    damage: Callable[[Path], object],
) -> None:
    damage(record.path)
    program.open_session(record.path)
    qtbot.waitUntil(lambda: program.window.banner.text != "", timeout=PATIENCE_MS)
    assert str(record.path) in program.window.banner.text
    assert "unexpected error" not in program.window.banner.text
    assert program.window.page == "start"
    program.open_session(tmp_path / "nowhere")
    qtbot.waitUntil(lambda: "nowhere" in program.window.banner.text, timeout=PATIENCE_MS)


@pytest.mark.parametrize(
    "damage",
    [
        overwrite("alignments/1.npz", b"PK\x03\x04 garbage"),
        remove("rig.yaml"),
        overwrite("settings.json", b'{"calibration": {"solve": {"method": "magic"}}}'),
        overwrite("results.json", b"\x00"),
    ],
)
def test_what_is_left_of_a_damaged_session_is_opened(
    program: Program, qtbot: QtBot, record: SessionRecord, damage: Callable[[Path], object]
) -> None:
    damage(record.path)
    program.open_session(record.path)
    qtbot.waitUntil(lambda: is_open(program), timeout=PATIENCE_MS)
    said = child(program, QLabel, "reviewDamaged").text()
    assert "The session is damaged: " in said
    assert said.endswith("Repair, in All sessions (Ctrl+L), copies what is sound.")


def test_a_session_whose_last_line_was_cut_off_is_opened_without_it(
    program: Program, qtbot: QtBot, record: SessionRecord
) -> None:
    tear(record.path)
    program.open_session(record.path)
    qtbot.waitUntil(lambda: is_open(program), timeout=PATIENCE_MS)
    assert "incomplete, as after a crash" in child(program, QLabel, "reviewJournal").text()


def test_opening_can_be_cancelled(
    program: Program, qtbot: QtBot, record: SessionRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver = Solver()
    monkeypatch.setattr("handcal.calibration.solve_again.solve_session", solver)
    program.open_session(record.path)
    qtbot.waitUntil(
        lambda: child(program, QProgressDialog, "opening").isVisible(), timeout=PATIENCE_MS
    )
    dialog = child(program, QProgressDialog, "opening")
    qtbot.waitUntil(lambda: dialog.labelText() == "Solving alignment 1 of 2…", timeout=PATIENCE_MS)
    dialog.findChild(QPushButton).click()
    qtbot.waitUntil(lambda: "cancelled" in program.window.banner.text, timeout=PATIENCE_MS)
    assert solver.was_cancelled.is_set()
    assert program.window.page == "start"
    monkeypatch.undo()
    program.open_session(record.path)
    qtbot.waitUntil(lambda: is_open(program), timeout=PATIENCE_MS)
    assert program.window.banner.text == ""


def test_a_session_given_up_for_another_does_not_open_later(
    program: Program, qtbot: QtBot, record: SessionRecord
) -> None:
    for _ in range(3):
        program.open_session(record.path)
    program.show_start()
    qtbot.wait(200)
    assert program.window.page == "start"
    assert program.review.record is None


def test_a_session_that_was_only_verified_is_shown_compared_and_exported(
    program: Program, qtbot: QtBot, tmp_path: Path
) -> None:
    assert program.windows.export() is None
    [library] = program.window.findChildren(LibraryWindow)  # to choose sessions in
    assert library.isVisible()
    library.reject()
    with Session.create(tmp_path, example_rig(), {}) as session:
        session.save_facts(verified={"left": replace(VERIFIED, hand_E_m=(0.0, 0.0, 0.5))})
    program.open_session(session.path)
    qtbot.waitUntil(lambda: is_open(program), timeout=PATIENCE_MS)
    contents = child(program, QLabel, "reviewContents").text()
    assert contents.startswith("1 verified eye, 0 trials")
    said = child(program, QLabel, "reviewNote").text()
    assert said == "This session was only verified; it has no alignments."
    tabs = child(program, QTabWidget, "results-tabs")
    shown = [tabs.tabText(i) for i in range(tabs.count()) if tabs.isTabVisible(i)]
    assert shown == ["Eyes", "Plots", "Other method"]
    assert child(program, QPushButton, "reviewExport").isEnabled()
    assert program.windows.export() is not None
    child(program, QPushButton, "reviewOpenxr").click()
    assert len(program.window.findChildren(OpenxrDialog)) == 1
    child(program, QComboBox, "comparison-method").setCurrentText("linear")
    child(program, QPushButton, "comparison-start").click()
    status = child(program, QLabel, "comparison-status")
    qtbot.waitUntil(lambda: status.text().startswith("Δ"), timeout=PATIENCE_MS)


def test_it_can_be_compared_and_closed_at_once(
    program: Program, qtbot: QtBot, record: SessionRecord, monkeypatch: pytest.MonkeyPatch
) -> None:
    program.open_session(record.path)
    qtbot.waitUntil(lambda: is_open(program), timeout=PATIENCE_MS)
    solver = Solver()
    monkeypatch.setattr("handcal.calibration.solve_again.solve_session", solver)
    child(program, QPushButton, "comparison-start").click()
    program.window.close()
    assert solver.was_cancelled.is_set()
