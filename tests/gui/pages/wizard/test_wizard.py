from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from handcal.station.procedure import State
from handcal.station.snapshot import Snapshot
from handcal_gui.pages.wizard.steps import Action, Step, Wizard
from handcal_gui.pages.wizard.wizard import WizardPanel

Maker = Callable[..., Snapshot]


@pytest.fixture
def panel(qtbot: QtBot) -> WizardPanel:
    panel = WizardPanel()
    qtbot.addWidget(panel)
    panel.resize(460, 420)
    panel.show()
    return panel


def child(panel: QWidget, name: str) -> QPushButton:
    found = panel.findChild(QPushButton, name)
    assert isinstance(found, QPushButton)
    return found


def test_the_main_button_asks_for_what_it_says(
    qtbot: QtBot, panel: WizardPanel, snapshot: Maker
) -> None:
    panel.show_snapshot(snapshot(State.ALIGNED))
    button = child(panel, "wizardMain")
    assert button.text() == "Solve"
    with qtbot.waitSignal(panel.asked) as asked:
        QTest.mouseClick(button, Qt.MouseButton.LeftButton)
    assert asked.args == [Action.SOLVE]
    with qtbot.waitSignal(panel.asked) as asked:
        panel.press_main()
    assert asked.args == [Action.SOLVE]


def test_another_step_is_told_once(qtbot: QtBot, panel: WizardPanel, snapshot: Maker) -> None:
    with qtbot.waitSignal(panel.step_changed) as told:
        panel.show_snapshot(snapshot(State.ALIGN))
    assert told.args == [Step.ALIGN]
    with qtbot.assertNotEmitted(panel.step_changed):
        panel.show_snapshot(snapshot(State.ALIGN))
    with qtbot.waitSignal(panel.step_changed) as told:
        panel.show_snapshot(snapshot(State.ALIGNED))
    assert told.args == [Step.SOLVE]


def test_a_disabled_main_button_asks_for_nothing(
    qtbot: QtBot, panel: WizardPanel, snapshot: Maker
) -> None:
    panel.show_snapshot(snapshot(State.APPLYING))
    with qtbot.assertNotEmitted(panel.asked):
        panel.press_main()


def test_the_other_buttons_come_and_go(qtbot: QtBot, panel: WizardPanel, snapshot: Maker) -> None:
    panel.show_snapshot(snapshot(State.ALIGNED))
    other = child(panel, "wizardOther0")
    assert (other.isVisible(), other.text()) == (True, "Discard and repeat")
    with qtbot.waitSignal(panel.asked) as asked:
        QTest.mouseClick(other, Qt.MouseButton.LeftButton)
    assert asked.args == [Action.REDO]
    panel.show_snapshot(snapshot(State.APPLYING))
    assert not other.isVisible()


def test_nothing_jumps_when_the_texts_change(panel: WizardPanel, snapshot: Maker) -> None:
    places = set()
    layout = panel.layout()
    assert layout is not None
    refused = {"refusal": "Your hand is turned by 14.0°, more than 9°. Turn it as the cursor is."}
    for made in (snapshot(), snapshot(procedure=refused), snapshot(State.ALIGNED)):
        panel.show_snapshot(made)
        layout.activate()
        places.add(
            child(panel, "wizardMain")
            .mapTo(panel, child(panel, "wizardMain").rect().topLeft())
            .toTuple()
        )
    assert len(places) == 1


def test_the_plan_is_chosen_before_the_cursor_is_made(
    qtbot: QtBot, panel: WizardPanel, snapshot: Maker
) -> None:
    plan = panel.findChild(QComboBox, "wizardPlan")
    assert isinstance(plan, QComboBox)
    panel.start(Wizard("both"))
    assert plan.currentText() == "Both eyes at once"
    panel.show_snapshot(snapshot(State.SHOW_HAND))
    assert plan.isEnabled()
    with qtbot.waitSignal(panel.plan_changed) as changed:
        plan.setCurrentText("Right eye only")
    assert changed.args == ["right"]
    assert panel.wizard.plan == "right"
    panel.show_snapshot(snapshot(State.ALIGN))
    assert not plan.isEnabled()


def test_the_refusal_is_read(panel: WizardPanel, snapshot: Maker) -> None:
    panel.show_snapshot(snapshot(procedure={"refusal": "Your hand is turned by 14.0°."}))
    note = panel.findChild(QLabel, "wizardNote")
    assert isinstance(note, QLabel)
    assert note.text() == "Your hand is turned by 14.0°."
