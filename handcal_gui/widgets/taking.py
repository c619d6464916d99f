"""Base of the dialogs that take images with live cameras, by a button or when all is at rest."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QSize
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QCheckBox, QDialog, QWidget

from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.widgets.action_strip import one_of_strips
from handcal_gui.widgets.fields import button, main_button, with_name
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import hbox
from handcal_gui.widgets.live_cameras import LiveCameras

_FIRST_SIZE, _FRAME = QSize(1240, 760), QSize(SPACING_PX, 6 * SPACING_PX)
BY_ITSELF = tr("Take a&utomatically")


class TakingDialog(QDialog):
    """Shows live images; takes them by a button, or by itself those that a job finds good.

    Parameters
    ----------
    name, title : str
        Object name, and title of the window.
    cameras : LiveCameras
    help_text : str
        When an image is taken by itself.
    judge : callable
        Given what `asked` returned, in a thread of its own: takes the images if they are good.
    judged : callable
        Given the same and what `judge` returned.
    """

    def __init__(
        self,
        name: str,
        title: str,
        cameras: LiveCameras,
        help_text: str,
        judge: Callable[[Any], Any],
        judged: Callable[[Any, Any], object],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName(name)
        self.setWindowTitle(title)
        self._cameras, self._judged, self._is_judging = cameras, judged, False
        self._found = FindingLine("taken")
        self._bar = JobBar()
        self._start = main_button("startCameras", tr("&Show"))
        self._take = main_button("takeImage", tr("Take"))
        self._mains = one_of_strips(self._start, self._take, keys="Space")
        self._by_itself = with_name(QCheckBox(BY_ITSELF), "byItself", help_text=help_text)
        self._close = button("close", tr("Cl&ose"))
        self._judge = LatestJob(judge, self)
        self._judge.answered.connect(self._end_judging)
        self._judge.failed.connect(self._fail_judging)
        cameras.images_changed.connect(self._follow)
        cameras.failed.connect(self._show_camera_failure)
        self._start.clicked.connect(self.start)
        self._take.clicked.connect(self.take)
        self._by_itself.toggled.connect(self.refresh)
        self._close.clicked.connect(self.accept)
        self._bar.failed.connect(self.show_failure)
        self._bar.busy_changed.connect(self.refresh)
        room = QGuiApplication.primaryScreen().availableSize() - _FRAME
        self.resize(room.boundedTo(_FIRST_SIZE))

    def asked(self) -> Any:
        """Return what the present images are judged by; None if they are not to be judged."""
        raise NotImplementedError

    def start(self) -> None:
        """Show the images of the chosen cameras."""
        self.stop_judging()
        self._found.clear()
        self._cameras.start()

    def take(self) -> None:
        """Take the present images."""
        raise NotImplementedError

    def refresh(self) -> None:
        """Show which of the buttons can be pressed, and which is the main one."""
        is_shown = self._cameras.images is not None
        self._take.setEnabled(is_shown and not self._bar.is_busy)
        self._mains.setCurrentIndex(int(is_shown))

    def show_failure(self, why: str) -> None:
        """Show why an image was not taken."""
        self._found.show_finding(Finding("", Health.BROKEN, why))

    def stop_judging(self) -> None:
        """End judging, and take nothing by itself until the next image."""
        self._judge.stop()
        self._is_judging = False

    def done(self, result: int) -> None:
        """Close the cameras and the dialog."""
        self.stop_judging()
        self._cameras.stop()
        self._bar.stop()
        super().done(result)

    def _follow(self) -> None:
        """Judge the present images, if images are taken by themselves and none are judged."""
        if self._by_itself.isChecked() and not self._is_judging:
            asked = None if self._cameras.images is None else self.asked()
            if asked is not None:
                self._is_judging = True
                self._judge.ask(asked)
        self.refresh()

    def _end_judging(self, asked: Any, answer: Any) -> None:
        self._is_judging = False
        self._judged(asked, answer)

    def _fail_judging(self, why: str) -> None:
        self._is_judging = False
        self._by_itself.setChecked(False)
        self.show_failure(why)

    def _show_camera_failure(self, why: str) -> None:
        self.stop_judging()
        advice = tr("press Show to open the camera again")
        self._found.show_finding(Finding("", Health.BROKEN, why, advice))

    def _foot(self, *others: QWidget) -> QWidget:
        """Return the row at the bottom: closing, what else there is, progress, the main button."""
        foot = QWidget()
        parts = self._close, self._by_itself, *others
        hbox(*parts, (self._bar, 1), self._mains, on=foot, margins=0, spacing=SPACING_PX)
        return foot
