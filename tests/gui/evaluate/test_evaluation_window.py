"""The window of evaluations, with studies whose pace the test sets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QLabel,
    QProgressBar,
    QPushButton,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.lab.settings import MethodComparisonSettings, NoiseStudySettings
from handcal.lab.study.run import run_study
from handcal_gui.evaluate.entries import EvaluationEntries, make_specs
from handcal_gui.evaluate.evaluation_page import EvaluationPage
from handcal_gui.evaluate.window import EvaluationWindow
from handcal_gui.widgets.fields import MainButton
from handcal_gui.widgets.table import Table
from tests.gui.helpers import answer_questions, letters, note_opened

Kind = TypeVar("Kind", bound=QWidget)
PATIENCE_MS = 20_000


class Student:
    """Uses the window."""

    def __init__(self, qtbot: QtBot, window: EvaluationWindow) -> None:
        self._qtbot = qtbot
        self.window = window
        self.remembered: list[EvaluationEntries] = []
        window.remembered.connect(self.remembered.append)

    @property
    def page(self) -> EvaluationPage:
        return self.window.page

    def child(self, kind: type[Kind], name: str) -> Kind:
        found = self.page.findChild(kind, name)
        assert isinstance(found, kind)
        return found

    @property
    def found(self) -> str:
        return self.child(QLabel, "readinessFound").text()

    @property
    def button(self) -> QPushButton:
        return self.child(QPushButton, "run")

    def wait(self, condition: Callable[[], bool]) -> None:
        self._qtbot.waitUntil(condition, timeout=PATIENCE_MS)

    def wait_for_button(self, text: str) -> None:
        self.wait(lambda: self.button.isEnabled() and self.button.text() == text)

    def wait_for_text(self, part: str) -> None:
        self.wait(lambda: part in self.found)

    def press(self, text: str) -> None:
        self.wait_for_button(text)
        self.button.click()

    def enter(self, **values: object) -> None:
        self.page.form.enter(**values)


@pytest.fixture
def student(qtbot: QtBot, numbers: Any, entries: NoiseStudySettings) -> Iterator[Student]:
    """Show two evaluations of the same study."""
    others = MethodComparisonSettings(processes=1, output=f"{entries.output}-others")
    specs = {"noise": numbers.spec, "methods": replace(numbers.spec, title="Others")}
    window = EvaluationWindow(specs, EvaluationEntries(noise=entries, methods=others))
    qtbot.addWidget(window)
    window.show()
    yield Student(qtbot, window)
    numbers.may_go_on.set()
    window.stop()


def test_a_study_runs_to_its_end(
    student: Student, entries: NoiseStudySettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    question = student.child(QLabel, "question")
    assert question.text().endswith(" Check the entries, then start at the lower right.")
    student.press("Run")
    assert question.text().endswith(" If it is cancelled, its finished parts are kept.")
    student.wait_for_text("Done")
    assert student.child(QLabel, "lead").text() == "Squares grow."
    choice = student.child(QComboBox, "figures")
    titles = [choice.itemText(place) for place in range(choice.count())]
    assert titles == ["Numbers", "Terms and methods", "Some squares"]
    assert student.child(Table, "numbers").model().index(9, 1).data() == "81"
    opened = note_opened(monkeypatch)
    for name in ("openPdf", "openHtml", "openFolder"):
        student.child(QPushButton, name).click()
    folder = Path(entries.output)
    assert opened == [folder / "report.pdf", folder / "report.html", folder]
    assert all(path.exists() for path in opened)
    student.wait(lambda: student.button.text() == "Show results")
    assert not student.button.isEnabled(), "they are shown"
    assert question.text().endswith(" Change the entries for another study.")


def test_a_complete_study_is_good_news(
    numbers: Any, student: Student, entries: NoiseStudySettings
) -> None:
    run_study(numbers.work.study(entries), Path(entries.output), workers=1)
    student.window.show_page("methods")
    student.window.show_page("noise")
    student.wait_for_text("contains the complete study")
    assert student.child(QLabel, "readinessHealth").accessibleName() == "Good"
    student.press("Show results")
    student.wait_for_text("Done")
    assert student.child(QLabel, "lead").isVisible()


def test_a_study_is_cancelled_and_goes_on(numbers: Any, student: Student) -> None:
    numbers.pauses_at = 4
    student.press("Run")
    progress = student.child(QProgressBar, "progress")
    student.wait(lambda: progress.value() == round(0.95 * 0.4 * progress.maximum()))
    assert student.child(QLabel, "doing").text().startswith("4 of 10 cases, ")
    assert student.remembered[-1] == student.window.entries
    student.child(QPushButton, "cancel").click()
    numbers.may_go_on.set()
    student.wait_for_text("of this study. Completed trials are kept.")
    assert student.found.startswith("Cancelled; ")
    assert not student.child(QPushButton, "openPdf").isVisible()
    student.press("Resume")
    student.wait_for_text("Done")
    assert numbers.squared.count(0) == 1
    assert set(numbers.squared) == set(range(10))


def test_a_folder_of_another_study_is_reported(
    numbers: Any, student: Student, entries: NoiseStudySettings
) -> None:
    run_study(numbers.work.study(entries), Path(entries.output), workers=1)
    student.enter(seed=5)
    student.wait_for_text("holds another study (seed 1 there, 5 here)")
    assert not student.button.isEnabled()
    student.enter(output="")
    student.wait_for_text("Choose a folder for the results")
    student.enter(seed=1, output=student.window.entries.methods.output)
    student.wait_for_button("Run")


def test_a_failing_study_is_reported(numbers: Any, student: Student) -> None:
    numbers.fails = True
    student.press("Run")
    student.wait_for_text("Numbers are out of stock")
    student.wait_for_button("Run")
    student.enter(seed=2)
    student.wait_for_text("holds another study")  # begun, though nothing is done


def test_one_runs_at_a_time(numbers: Any, student: Student) -> None:
    numbers.pauses_at = 0
    student.press("Run")
    student.window.show_page("methods")
    student.wait_for_text("Numbers is running. Only one can run at a time.")
    assert not student.button.isEnabled()
    student.window.show_page("noise")
    student.page.cancel()
    numbers.may_go_on.set()
    student.wait_for_text("Cancelled; ")
    student.window.show_page("methods")
    student.wait_for_button("Run")
    student.wait_for_text("Ready")


def test_closing_asks_cancels_and_remembers(
    numbers: Any, student: Student, entries: NoiseStudySettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers.pauses_at = 3
    chunks = Path(entries.output, "chunks")
    student.press("Run")
    student.wait(lambda: len(list(chunks.glob("*.json"))) == 3)
    said = answer_questions(monkeypatch, "Keep running")
    QTest.keyClick(student.window, Qt.Key.Key_Escape)
    assert said == ["Numbers is running. If it is cancelled, its finished parts are kept."]
    assert not student.child(QLabel, "doing").text().startswith("Cancelling")
    answer_questions(monkeypatch, "Cancel and close")
    student.window.close()
    assert student.child(QLabel, "doing").text().startswith("Cancelling")
    assert student.window.isVisible()  # until the case being done has ended
    student.enter(seed=7)
    numbers.may_go_on.set()
    student.wait(lambda: not student.window.isVisible())
    assert not student.page.is_busy
    assert student.remembered[-1].noise.seed == 7
    assert 3 <= len(list(chunks.glob("*.json"))) < 10


def test_each_page_has_one_main_button_and_keys(qtbot: QtBot) -> None:
    window = EvaluationWindow(make_specs(), EvaluationEntries())
    qtbot.addWidget(window)
    window.resize(960, 510)
    window.show()
    for name in make_specs():
        window.show_page(name)
        QApplication.processEvents()
        (main,) = (one for one in window.findChildren(MainButton) if one.isVisible())
        buttons = [one for one in window.findChildren(QPushButton) if one.isVisible()]
        assert [one for one in buttons if one.isDefault()] == [main]
        found = [*letters(window.page), "o"]  # of hidden buttons, too, and of Close
        assert len(set(found)) == len(found)
        assert all("&" in label.text() for label in window.page.form.findChildren(QLabel))
        assert [one for one in window.findChildren(QLabel, "mainKey") if one.isVisible()]
    window.stop()
