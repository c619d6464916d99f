"""The steps of the rig wizard: solving them, and what the window shows of them."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QLabel,
    QListWidget,
    QPushButton,
    QTableView,
    QTabWidget,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal_gui.rig.step_page import StepPage
from handcal_gui.rig.wizard import RigWizard
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.table import Table

BOARDS, STEREO, VIEWPOINT, LEFT, RIGHT, RESULT = range(6)


def child(wizard: RigWizard, kind: Any, name: str) -> Any:
    """Return the child of a name that can be seen."""
    (found,) = (one for one in wizard.findChildren(kind, name) if one.isVisible())
    return found


def page_of(wizard: RigWizard, step: int | None = None) -> StepPage:
    """Return the page shown, after a step is if it is given."""
    if step is not None:
        wizard.show_step(step)
    page = wizard.page
    assert isinstance(page, StepPage)
    return page


def solve(qtbot: QtBot, wizard: RigWizard, step: int) -> str:
    """Solve a step once its images have been looked through; return the verdict's text."""
    wizard.show_step(step)
    wait(qtbot, wizard)
    child(wizard, QPushButton, "solve").click()
    wait(qtbot, wizard)
    return str(child(wizard, QLabel, "verdictFound").text())


def wait(qtbot: QtBot, wizard: RigWizard) -> None:
    bars = wizard.findChildren(JobBar)
    qtbot.waitUntil(lambda: not any(bar.is_busy for bar in bars), timeout=30_000)


def show_tab(wizard: RigWizard, title: str) -> None:
    tabs = child(wizard, QTabWidget, "")
    (place,) = (i for i in range(tabs.count()) if tabs.tabText(i).replace("&", "") == title)
    tabs.setCurrentIndex(place)


def cell(parent: QWidget, row: int, column: int) -> str:
    """Return the text of a cell of the list of images."""
    model = parent.findChildren(Table, "shots")[0].model()
    return str(model.index(row, column).data())


def tick(table: QTableView, row: int, is_ticked: bool) -> None:
    """Tick the box of an image, or untick it."""
    state = Qt.CheckState.Checked if is_ticked else Qt.CheckState.Unchecked
    table.model().setData(table.model().index(row, 0), state, Qt.ItemDataRole.CheckStateRole)


def findings(page: QWidget) -> dict[str, tuple[str, str]]:
    """Return what was found of each item of a rig, and its sign in words."""
    [table] = page.findChildren(Table, "rigFindings")
    model, role = table.model(), Qt.ItemDataRole.AccessibleDescriptionRole
    rows = [(model.index(row, 0), model.index(row, 1)) for row in range(model.rowCount())]
    return {item.data(): (found.data(), item.data(role)) for item, found in rows}


def marks(wizard: RigWizard) -> list[str]:
    [rail] = wizard.findChildren(QListWidget, "rigRail")
    return [rail.item(row).toolTip() for row in range(rail.count())]
