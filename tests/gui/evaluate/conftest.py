"""A study of a few numbers at a pace set by the test."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from matplotlib.axes import Axes

from handcal.core.errors import HandcalError
from handcal.core.progress import Progress
from handcal.lab.settings import NoiseStudySettings
from handcal.lab.study.run import Case, Study
from handcal.lab.study.store import StudyRow
from handcal.lab.study.studies import StudyResult, run_and_report
from handcal.report.document import Column, Figure, Report, Section, Table
from handcal_gui.evaluate.evaluation_page import EvaluationSpec
from handcal_gui.evaluate.work import StudyEvaluation
from handcal_gui.widgets.entries_form import EntriesForm

CASES = 10


@dataclass(frozen=True)
class Settings:
    seed: int


@dataclass
class Numbers:
    """A study that squares numbers and pauses at a case until `may_go_on` is set."""

    pauses_at: int = CASES
    fails: bool = False
    squared: list[int] = field(default_factory=list)
    may_go_on: threading.Event = field(default_factory=threading.Event)

    @property
    def work(self) -> StudyEvaluation:
        return StudyEvaluation(self.study, self._order)

    @property
    def spec(self) -> EvaluationSpec:
        return EvaluationSpec("Numbers", "What are their squares?", self.work, make_form)

    def study(self, entries: NoiseStudySettings) -> Study:
        cases: list[Case] = [{"number": number} for number in range(CASES)]
        return Study("numbers", Settings(entries.seed), cases, self._square)

    def _order(self, entries: NoiseStudySettings, progress: Progress) -> StudyResult:
        return run_and_report(self.study(entries), self._describe, entries, progress)

    def _square(self, _settings: Any, case: Case) -> list[StudyRow]:
        number = int(case["number"])
        if self.fails:
            raise HandcalError("numbers are out of stock")
        if number == self.pauses_at:
            assert self.may_go_on.wait(20)
        self.squared.append(number)
        return [{**case, "square": number**2}]

    def _describe(self, settings: Settings, rows: Sequence[StudyRow]) -> Report:
        cells = [(str(row["number"]), str(row["square"])) for row in rows]
        table = Table([Column("number"), Column("square")], cells, "All of them.")
        squares = [int(str(row["square"])) for row in rows]

        def draw(axes: Sequence[Axes]) -> None:
            axes[0].plot(squares)

        figure = Figure("some-squares", "Grows.", draw, rows)
        sections = [Section("", ["Text.", table, figure])]
        return Report("Numbers", f"seed {settings.seed}", "Squares grow.", sections)


def make_form() -> EntriesForm:
    return EntriesForm(NoiseStudySettings, ("seed", "output"))


@pytest.fixture
def numbers() -> Iterator[Numbers]:
    numbers = Numbers()
    yield numbers
    numbers.may_go_on.set()


@pytest.fixture
def entries(tmp_path: Path) -> NoiseStudySettings:
    return NoiseStudySettings(processes=1, output=str(tmp_path / "numbers"))
