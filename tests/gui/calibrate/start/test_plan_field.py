from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtWidgets import QComboBox, QPushButton
from pytestqt.qtbot import QtBot

from handcal.calibration.plan import PlanSettings
from handcal.core.types import EYES
from handcal.station.settings import StationSettings
from handcal_gui.app.preferences import Preferences, PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.calibrate.start.plan_field import PlanField
from tests.gui.helpers import child, show


@pytest.mark.parametrize(
    "plan",
    [
        PlanSettings("recommended", is_automatic=True),
        PlanSettings("recommended", ("right",), is_automatic=True),
        PlanSettings("paper"),
    ],
)
def test_a_plan_is_shown_and_taken(qtbot: QtBot, plan: PlanSettings) -> None:
    field = show(qtbot, PlanField(), 500, 60)
    field.show_settings(StationSettings(plan=plan))
    assert field.take(StationSettings()).plan == plan
    assert child(field, QComboBox, "usableEyes").isVisible() == (plan.name == "recommended")


def test_the_guide_chooses_the_eyes_of_the_paper_s_plan(qtbot: QtBot) -> None:
    field = show(qtbot, PlanField(), 500, 60)
    field.show_settings(StationSettings(plan=PlanSettings("recommended", ("left",), True)))
    with qtbot.waitSignal(field.changed):
        child(field, QComboBox, "plan").setCurrentText("As in the paper")
    assert field.take(StationSettings()).plan == PlanSettings("paper", EYES)


def test_the_recommended_plan_is_proposed_and_remembered(tmp_path: Path) -> None:
    file = PreferencesFile(tmp_path / "preferences.json")
    file.save(Preferences())
    plan = file.load()[0].station.plan
    assert (plan.name, plan.is_automatic) == ("recommended", True)


def test_the_start_button_is_in_sight_in_a_small_window(qtbot: QtBot, tmp_path: Path) -> None:
    """1920x1080 at 200 %."""
    program = Program(PreferencesFile(tmp_path / "preferences.json"))
    window = show(qtbot, program.window, 960, 540)
    start = child(window, QPushButton, "start")
    qtbot.waitUntil(lambda: start.visibleRegion().boundingRect() == start.rect())
    window.close()
