"""The findings about a rig, and the lens models compared, in a small window."""

from __future__ import annotations

from PySide6.QtWidgets import QApplication, QLabel
from pytestqt.qtbot import QtBot

from handcal.rig.report import RigFinding
from handcal.rig.verdict import CalibrationVerdict
from handcal_gui.windows.rig.finding_list import FindingList
from handcal_gui.windows.rig.solve import SolvedPart
from handcal_gui.windows.rig.solve_box import SolveBox
from tests.gui.helpers import child, height_px, show

LONG = " ".join(60 * ["told"])


def test_a_long_finding_is_whole(qtbot: QtBot) -> None:
    findings = show(qtbot, FindingList("Check of the rig"), 700, 300)
    findings.show_findings([RigFinding("Calibration", LONG)])
    QApplication.processEvents()
    row = findings.topLevelItem(0)
    assert row is not None
    needed_px = height_px(findings, LONG, findings.columnWidth(1))
    assert findings.visualItemRect(row).height() >= needed_px > 20


def test_no_column_is_empty(qtbot: QtBot) -> None:
    findings = show(qtbot, FindingList("Check of the rig"), 700, 300)
    findings.show_findings([RigFinding("Distance", "2 m", True, "0.3 to 10 m")])
    assert findings.isColumnHidden(2)
    findings.show_findings([RigFinding("Distance", "30 m", False, "0.3 to 10 m")])
    assert not findings.isColumnHidden(2)


def test_the_lenses_compared_are_whole_beside_the_numbers(qtbot: QtBot) -> None:
    box = SolveBox()
    qtbot.addWidget(box)
    numbers = show(qtbot, box.numbers, 700, 300)
    solved = SolvedPart(CalibrationVerdict("good", "as told"), (), {}, lenses=LONG)
    box.show_solved(solved, "it is used")
    QApplication.processEvents()
    lenses = child(numbers, QLabel, "lenses")
    assert lenses.height() >= height_px(lenses, lenses.text(), lenses.width()) > 20
