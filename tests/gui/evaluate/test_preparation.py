"""A page whose evaluation can be prepared in a dialog."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtWidgets import QDialog, QLabel, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from handcal.lab.settings import NoiseStudySettings
from handcal_gui.evaluate.entries import EvaluationEntries
from handcal_gui.evaluate.evaluation_page import Preparation
from handcal_gui.evaluate.window import EvaluationWindow
from tests.gui.helpers import child


class ScenarioDialog(QDialog):
    def __init__(self, entries: NoiseStudySettings, parent: QWidget) -> None:
        super().__init__(parent)
        self.entries = entries


@pytest.fixture
def window(qtbot: QtBot, numbers: Any, entries: NoiseStudySettings) -> Iterator[EvaluationWindow]:
    """Show an evaluation that can be prepared with a seed other than 0."""
    preparation = Preparation(
        "Prepare…", "Do.", lambda one: one.seed != 0, ScenarioDialog, request="Enter a seed."
    )
    specs = {"noise": replace(numbers.spec, preparations=(preparation,))}
    window = EvaluationWindow(specs, EvaluationEntries(noise=entries))
    qtbot.addWidget(window)
    window.show()
    yield window
    window.stop()


def open_dialog(window: EvaluationWindow) -> ScenarioDialog:
    child(window, QPushButton, "prepare").click()
    dialog = child(window, ScenarioDialog)
    assert dialog.isVisible()
    return dialog


def test_it_is_offered_where_the_entries_suffice(window: EvaluationWindow) -> None:
    prepare = child(window, QPushButton, "prepare")
    assert (
        prepare.text(),
        prepare.toolTip(),
    ) == ("Prepare…", "Do.")
    window.page.form.enter(seed=0)
    assert not prepare.isEnabled()
    request = child(window, QLabel, "preparationRequest")
    assert (request.text(), request.isVisible()) == ("Enter a seed.", True)
    window.page.form.enter(seed=2)
    assert prepare.isEnabled()
    assert not request.isVisible()


def test_prepared_data_is_checked_again(
    qtbot: QtBot, window: EvaluationWindow, entries: NoiseStudySettings, tmp_path: Path
) -> None:
    run = child(window, QPushButton, "run")
    qtbot.waitUntil(run.isEnabled)
    dialog = open_dialog(window)
    assert dialog.entries == entries
    dialog.entries = replace(entries, output=str(tmp_path / "prepared"))
    dialog.accept()
    assert not run.isEnabled()
    qtbot.waitUntil(run.isEnabled)
    assert window.entries.noise == dialog.entries


def test_a_result_stays_until_it_is_made_again_with_what_was_prepared(
    qtbot: QtBot, window: EvaluationWindow, entries: NoiseStudySettings
) -> None:
    run, found = child(window, QPushButton, "run"), child(window, QLabel, "readinessFound")
    lead = child(window, QLabel, "lead")
    qtbot.waitUntil(run.isEnabled)
    run.click()
    qtbot.waitUntil(lambda: found.text() == "Done." and run.text() == "Show results")
    open_dialog(window).accept()
    qtbot.waitUntil(lambda: "contains the complete study" in found.text())
    assert (lead.text(), lead.isVisible()) == ("Squares grow.", True)
    window.page.form.enter(seed=2)
    assert not lead.isVisible(), "that of other entries"


def test_it_closes_with_the_window_which_remembers_it(
    window: EvaluationWindow, entries: NoiseStudySettings
) -> None:
    remembered: list[EvaluationEntries] = []
    window.remembered.connect(remembered.append)
    dialog = open_dialog(window)
    dialog.entries = replace(entries, processes=5)
    window.close()
    assert not dialog.isVisible()
    assert remembered[-1].noise.processes == 5
