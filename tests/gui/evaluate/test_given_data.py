"""A page that evaluates given files: what it asks for before and after, and what prevents a run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from PySide6.QtWidgets import QLabel, QPushButton
from pytestqt.qtbot import QtBot

from handcal.core.progress import Progress
from handcal.lab.evaluate.user_test import UserTestRun
from handcal.report.document import Report
from handcal.report.html import write_report
from handcal_gui.evaluate.entries import EvaluationEntries, UserEntries, make_specs
from handcal_gui.evaluate.window import EvaluationWindow
from handcal_gui.evaluate.work import FileEvaluation
from tests.gui.helpers import child


def _missing(entries: UserEntries) -> str:
    return "" if Path(entries.sessions).is_dir() else "there is no such folder"


def _says(label: QLabel, words: str) -> bool:
    return words in label.text()


def _order(entries: UserEntries, _progress: Progress) -> UserTestRun:
    report = Report("Data", "given", "Read.", [])
    return UserTestRun(None, report, write_report(Path(entries.output), report))  # type: ignore[arg-type]


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path) -> Iterator[EvaluationWindow]:
    spec = replace(make_specs()["users"], evaluation=FileEvaluation(_missing, _order))
    entries = UserEntries(str(tmp_path), str(tmp_path / "results"))
    window = EvaluationWindow({"users": spec}, EvaluationEntries(users=entries))
    qtbot.addWidget(window)
    window.show()
    yield window
    window.stop()


def test_once_done_it_no_longer_says_how_to_start(
    qtbot: QtBot, window: EvaluationWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, question = child(window, QPushButton, "run"), child(window, QLabel, "question")
    qtbot.waitUntil(run.isEnabled)
    assert run.text() == "Run"
    assert question.text().endswith(" Check the entries, then start at the lower right.")
    said: list[str] = []

    def say(text: str) -> None:
        said.append(text)
        QLabel.setText(question, text)

    monkeypatch.setattr(question, "setText", say)
    for _ in range(2):
        run.click()
        qtbot.waitUntil(lambda: run.isEnabled() and run.text() == "Run again")
        assert child(window, QLabel, "readinessFound").text() == "Done."
        assert question.text().endswith(
            " Change the entries, or run again if the files have changed."
        )
    window.page.hide()
    window.page.show()
    assert not [text for text in said if text.endswith("start at the lower right.")]
    output = window.entries.users.output
    window.page.form.enter(output=f"{output}-2")
    qtbot.waitUntil(lambda: run.isEnabled() and run.text() == "Run")
    assert question.text().endswith(" Check the entries, then start at the lower right.")


def test_what_prevents_a_run_has_one_sign(qtbot: QtBot, window: EvaluationWindow) -> None:
    run, found = child(window, QPushButton, "run"), child(window, QLabel, "readinessFound")
    sign = child(window, QLabel, "readinessHealth")
    qtbot.waitUntil(run.isEnabled)
    before = window.entries.users
    for entries, told in (
        ({"sessions": "/nowhere"}, "There is no such folder."),
        ({"output": ""}, "Choose a folder for the results"),
    ):
        window.page.form.enter(**{"sessions": before.sessions, "output": before.output, **entries})
        qtbot.waitUntil(partial(_says, found, told))
        assert not run.isEnabled()
        assert sign.accessibleName() == "Problem"
    window.page.form.enter(output=before.output)
    qtbot.waitUntil(run.isEnabled)
    window.page.wait_for("Noise study")
    assert not run.isEnabled()
    assert sign.accessibleName() == "Not yet", "it ends by itself"
