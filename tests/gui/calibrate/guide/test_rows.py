from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from PySide6.QtWidgets import QApplication, QLabel
from pytestqt.qtbot import QtBot

from handcal_gui.calibrate.guide.rows import StepRail
from handcal_gui.calibrate.guide.view import Action, ButtonSpec, Step, WizardView
from tests.gui.helpers import show


def test_the_steps_stand_apart_and_none_of_them_moves(qtbot: QtBot) -> None:
    rail = show(qtbot, StepRail(), 480, 20)
    places = set()
    for step in Step:
        rail.show_step(WizardView(step, "", (), ButtonSpec(Action.NEXT, "Next")))
        QApplication.processEvents()
        labels = rail.findChildren(QLabel)
        places.add(tuple(label.geometry().center().x() for label in labels))
        halves_px = [label.fontMetrics().horizontalAdvance(label.text()) / 2 for label in labels]
        ends = list(
            zip([label.geometry().center().x() for label in labels], halves_px, strict=True)
        )
        gaps_px = [after - half - (at + own) for (at, own), (after, half) in pairwise(ends)]
        assert min(gaps_px) >= 12
    assert len(places) == 1


def test_the_last_step_is_ticked_once_the_session_is_finished(qtbot: QtBot) -> None:
    rail = show(qtbot, StepRail(), 480, 20)
    last = []
    for action in (Action.FINISH, Action.NEXT_WEARER):
        rail.show_step(WizardView(Step.SAVE, "", (), ButtonSpec(action, "On")))
        last.append(rail.findChildren(QLabel)[-1].text())
    assert last == ["▸ Save", "✓ Save"]


def test_aligning_is_not_ticked_while_an_eye_is_left_out(qtbot: QtBot) -> None:
    rail = show(qtbot, StepRail(), 480, 20)
    view = WizardView(Step.SOLVE, "", (), ButtonSpec(Action.NEXT, "Next"))
    texts = []
    for is_aligned in (False, True):
        rail.show_step(replace(view, is_aligned=is_aligned))
        texts.append([label.text() for label in rail.findChildren(QLabel)][2:4])
    assert texts == [["✓ Make cursor", "Align"], ["✓ Make cursor", "✓ Align"]]
