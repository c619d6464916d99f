"""The verdict on a step, and the lens models compared."""

from __future__ import annotations

from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from handcal.rig.boards.views import WorstView
from handcal.rig.verdict import CalibrationVerdict
from handcal_gui.rig.solve import SolvedPart
from handcal_gui.rig.solve_box import SolveBox
from tests.gui.helpers import child, show


def test_a_step_not_solved_has_a_clock_and_its_worst_image_no_sign(qtbot: QtBot) -> None:
    box = show(qtbot, SolveBox(), 700, 100)
    sign, worst = child(box, QLabel, "verdictHealth"), child(box, QLabel, "worst")
    box.allow("to solve, take images", is_busy=False)
    assert child(box, QLabel, "verdictFound").text() == "Not solved yet. To solve, take images."
    assert sign.accessibleName() == "Not yet"
    view = WorstView("a.png", 0.12, "nothing else about it stands out")
    box.show_solved(SolvedPart(CalibrationVerdict("good", "as told"), (), {}, worst=view), "")
    assert sign.accessibleName() == "Good"
    assert worst.isVisible()
    assert worst.text() == "Worst: a.png, 0.12 px: nothing else about it stands out."
    assert not [one for one in box.findChildren(QLabel) if one.isVisible() and one.pixmap()][1:]
    box.show_origin(None, "solved with other inputs")
    assert sign.accessibleName() == "Note"
