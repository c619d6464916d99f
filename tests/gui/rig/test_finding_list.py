"""The findings about a rig, and the lens models compared, in a small window."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtWidgets import QApplication, QLabel
from pytestqt.qtbot import QtBot

from handcal.rig.boards.views import WorstView
from handcal.rig.report import RigFinding
from handcal.rig.verdict import CalibrationVerdict
from handcal_gui.rig.finding_list import FindingList
from handcal_gui.rig.solve import SolvedPart
from handcal_gui.rig.solve_box import SolveBox
from handcal_gui.widgets.table import Row, Table
from handcal_gui.widgets.times import local_time
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


def test_what_is_found_has_the_width_that_what_is_expected_does_not_need(qtbot: QtBot) -> None:
    findings = show(qtbot, FindingList("Check of the rig"), 740, 300)  # as in one of 960x540
    findings.show_findings([RigFinding("Calibration of the left display", LONG, False, "good")])
    QApplication.processEvents()
    found_px, expected_px = findings.columnWidth(1), findings.columnWidth(2)
    assert expected_px < 100 < 440 < found_px
    findings.show_findings([RigFinding("Calibration of the left display, " + LONG, "good")])
    QApplication.processEvents()
    row = findings.topLevelItem(0)
    assert row is not None
    needed_px = height_px(findings, row.text(0), findings.columnWidth(0))
    assert findings.visualItemRect(row).height() >= needed_px, "the item is whole, too"
    assert sum(findings.columnWidth(column) for column in range(3)) <= findings.viewport().width()


def test_times_are_shown_as_everywhere(qtbot: QtBot) -> None:
    findings = show(qtbot, FindingList("Check of the rig"), 700, 300)
    findings.show_findings([RigFinding("Depth check", "+0.1 mm (9 views, 2026-11-26T08:29:24Z)")])
    row = findings.topLevelItem(0)
    assert row is not None
    assert row.text(1) == f"+0.1 mm (9 views, {local_time('2026-11-26T08:29:24Z')})"
    assert "T08" not in row.text(1)


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


def test_the_lenses_compared_are_whole_beside_the_numbers(qtbot: QtBot) -> None:
    box = SolveBox()
    qtbot.addWidget(box)
    numbers = show(qtbot, box.numbers, 700, 300)
    found = (Row("Focal length fx", ("900.45 px", "0.86 px")),)
    fits = tuple(
        Row(f"Headset: {name}", ("0.075", "± 0.28"))
        for name in ("No distortion", "k1, k2 ✓", "k1, k2, p1, p2, k3", "Fisheye")
    )
    solved = SolvedPart(CalibrationVerdict("good", "as told"), found, {}, lenses=fits)
    box.show_solved(solved, "it is used")
    QApplication.processEvents()
    for table in (box.table, child(numbers, Table, "lenses")):
        assert table.isVisible()
        assert table.horizontalScrollBar().maximum() == table.verticalScrollBar().maximum() == 0
    box.show_solved(replace(solved, lenses=()), "it is used")
    assert not child(numbers, Table, "lenses").isVisible()
