"""The rig wizard: the offline calibration, step by step, in a separate window."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QGuiApplication, QIcon, QKeyEvent
from PySide6.QtWidgets import (
    QDialog,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QSizePolicy,
    QStackedWidget,
    QWidget,
)

from handcal.camera.settings import RealSenseSettings
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme, icon, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.rig.board_page import BoardPage
from handcal_gui.rig.camera_pages import StereoPage, ViewpointPage
from handcal_gui.rig.display_page import DisplayPage
from handcal_gui.rig.project import UNREADABLE, RigProject
from handcal_gui.rig.project_folder import ProjectFolder
from handcal_gui.rig.result_page import ResultPage
from handcal_gui.rig.solve_box import SolveBox
from handcal_gui.rig.step_inputs import STEP_TITLES, Step
from handcal_gui.rig.step_page import StepPage
from handcal_gui.widgets.banner import Banner
from handcal_gui.widgets.fields import button, paragraph, with_name
from handcal_gui.widgets.job_bar import may_cancel
from handcal_gui.widgets.layouts import hbox, vbox

_FIRST_SIZE = QSize(1240, 760)
_RAIL_PX = 20 * SPACING_PX
_SAVED = tr("saved")
_SIGNS = {
    "good": ("check", "good"),
    _SAVED: ("check", "good"),
    "bad": ("cross", "red"),
    UNREADABLE: ("cross", "red"),
}
_DOUBTFUL, _UNDONE = ("warning", "warning"), ("wait", "muted")
_BOARD = tr("Board")
_STEPS: dict[str, tuple[str, Step | None]] = {
    _BOARD: (tr("Print the board at 100 %, measure a square and enter its size."), None),
    STEP_TITLES["T_H_D"]: (
        tr(
            "Take images of the board with both cameras, and solve where the depth camera is on "
            "the headset."
        ),
        "T_H_D",
    ),
    STEP_TITLES["viewpoint"]: (
        tr(
            "Take images of the board with the camera that later takes the eye's place, and solve "
            "its lens."
        ),
        "viewpoint",
    ),
    STEP_TITLES["left"]: (
        tr(
            "Put the viewpoint camera behind the left display, take images of its grid and of the "
            "board, enter the screen's distance in Inputs, and solve."
        ),
        "left",
    ),
    STEP_TITLES["right"]: (
        tr(
            "Do the same behind the right display: take images of its grid and of the board, enter "
            "the screen's distance in Inputs, and solve."
        ),
        "right",
    ),
    tr("Result"): (tr("Name the rig, look at what is doubtful, save it, and use it."), None),
}
"""By title: the step's purpose, and what it solves."""


class RigPage(Protocol):
    """Interface of a page of the wizard; the strip with its main button stands below it."""

    strip: QWidget

    def enter(self) -> None:
        """Prepare to be shown."""

    def stop(self) -> None:
        """End background work."""


class RigWizard(QDialog):
    """Guides through the offline calibration; all entries are stored in a folder.

    Parameters
    ----------
    folder : ProjectFolder
        Project folder; a later wizard resumes from it.
    realsense : RealSenseSettings, optional
        Settings of a RealSense used to take images.
    read, use : callable
        Show a page of the manual, and take a rig file for the next calibration.

    Attributes
    ----------
    project : RigProject
    """

    def __init__(
        self,
        folder: ProjectFolder,
        parent: QWidget | None = None,
        realsense: RealSenseSettings | None = None,
        read: Callable[[str], object] = lambda _page: None,
        use: Callable[[Path], object] = lambda _rig: None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("rigWizard")
        self.setWindowTitle(tr("Calibrate a rig"))
        self.project = RigProject(folder, realsense or RealSenseSettings(), self)
        self._banner = Banner()
        self._rail = with_name(QListWidget(), "rigRail", tr("Steps"))
        self._title, self._purpose = QLabel(), paragraph("rigPurpose")
        self._stack, self._strips = QStackedWidget(), QStackedWidget()
        result = ResultPage(self.project, read, use)
        self._pages: list[RigPage] = []
        for page in (
            BoardPage(self.project),
            StereoPage(self.project),
            ViewpointPage(self.project),
            DisplayPage(self.project, "left", read),
            DisplayPage(self.project, "right", read),
            result,
        ):
            self._stack.addWidget(page)
            self._strips.addWidget(page.strip)
            self._pages.append(page)
        self._back = button("rigBack", tr("&Back"))
        self._next = button("rigNext", tr("&Next"))
        self._close = button("rigClose", tr("Cl&ose"), help_text=tr("All entries are kept"))
        for title in _STEPS:
            self._rail.addItem(QListWidgetItem(title))
        self._lay_out()
        self._rail.currentRowChanged.connect(self._go_to)
        self._back.clicked.connect(lambda: self.show_step(self.step - 1))
        self._next.clicked.connect(lambda: self.show_step(self.step + 1))
        self._close.clicked.connect(self.reject)
        for box in self.findChildren(SolveBox):
            box.shown.connect(self._refresh)
        self.project.rig_changed.connect(self._refresh)
        self.project.inputs_changed.connect(self._refresh)
        self.project.failed.connect(self._banner.show_message)
        self._banner.show_message(self.project.complaint)
        screen = QGuiApplication.primaryScreen().availableSize()
        self.resize(screen.boundedTo(_FIRST_SIZE))
        follow_theme(self, self._refresh)
        self.show_step(0)

    @property
    def step(self) -> int:
        """The step shown, from 0."""
        return self._rail.currentRow()

    @property
    def page(self) -> RigPage:
        """The page shown."""
        return self._pages[self.step]

    def show_step(self, step: int) -> None:
        """Show a step."""
        self._rail.setCurrentRow(step)

    def reject(self) -> None:
        """Close; a running solve is cancelled first, if the user agrees."""
        is_solving = any(box.bar.is_busy for box in self.findChildren(SolveBox))
        running = tr("A step is being solved. If it is cancelled, its former result is kept.")
        if not is_solving or may_cancel(self, running):
            super().reject()

    def done(self, result: int) -> None:
        """Store all entries, end background work, and close."""
        for page in self._pages:
            page.stop()
        self.project.save()
        super().done(result)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Let Enter press only the button that has the focus."""
        if event.key() not in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            super().keyPressEvent(event)

    def _go_to(self, step: int) -> None:
        title = list(_STEPS)[step]
        self._title.setText(title)
        self._purpose.setText(_STEPS[title][0])
        self._stack.setCurrentIndex(step)
        self._strips.setCurrentIndex(step)
        self._back.setEnabled(step > 0)
        self._next.setEnabled(step < len(_STEPS) - 1)
        self._pages[step].enter()
        self._refresh()  # images may have been taken

    def _refresh(self) -> None:
        """Mark each step with its state."""
        for row, title in enumerate(_STEPS):
            page, verdict = self._pages[row], self._verdict(title)
            name, role = _SIGNS.get(verdict, _DOUBTFUL if verdict else _UNDONE)
            if verdict != UNREADABLE and isinstance(page, StepPage) and page.box.failure:
                verdict, (name, role) = page.box.failure, _SIGNS["bad"]
            sign = icon(name, getattr(colors(), role))
            chosen = icon(name, self.palette().highlightedText().color().name())
            sign.addPixmap(chosen.pixmap(2 * SPACING_PX), QIcon.Mode.Selected)
            self._rail.item(row).setIcon(sign)
            self._rail.item(row).setToolTip(verdict or tr("not done yet"))

    def _verdict(self, title: str) -> str:
        """Return a step's verdict; empty if it is not done."""
        step = _STEPS[title][1]
        if step is not None and (outdated := self.project.outdated(step)):
            return outdated
        if step == "viewpoint":
            return self.project.camera_verdict
        if step is not None:
            origin = self.project.rig.origins.get(step)
            return origin.verdict if origin else ""
        if title == _BOARD:
            return "good" if self.project.inputs.board_found else ""
        return _SAVED if self.project.saved_file else ""

    def _lay_out(self) -> None:
        scale_font(self._title, 1.6, is_bold=True)
        self._rail.setFixedWidth(_RAIL_PX)
        self._rail.setWordWrap(True)
        self._rail.setSpacing(SPACING_PX // 2)
        self._rail.setIconSize(QSize(2 * SPACING_PX, 2 * SPACING_PX))
        self._rail.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._strips.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        moves = self._close, self._back, self._next
        foot = hbox(*moves, (self._strips, 1), spacing=SPACING_PX)
        right = vbox(self._title, self._purpose, (self._stack, 1), spacing=SPACING_PX)
        row = hbox(self._rail, (right, 1), spacing=2 * SPACING_PX)
        vbox(self._banner, (row, 1), foot, on=self, margins=2 * SPACING_PX, spacing=SPACING_PX)
