"""A progress bar for one job at a time, with a button to cancel it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QLabel, QMessageBox, QProgressBar, QWidget

from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.engine.jobs import Job, Work
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import button, fill_row, with_name

_WHOLE = 1000


def show_share(bar: QProgressBar, share: float) -> None:
    """Show the share that is done, 0..1."""
    bar.setRange(0, _WHOLE)
    bar.setValue(round(_WHOLE * share))


def may_cancel(window: QWidget, running: str) -> bool:
    """Ask before a window is closed whose job is running; Esc keeps it running."""
    box = QMessageBox(QMessageBox.Icon.Question, window.windowTitle(), running, parent=window)
    end = box.addButton(tr("&Cancel and close"), QMessageBox.ButtonRole.DestructiveRole)
    keep = box.addButton(tr("&Keep running"), QMessageBox.ButtonRole.RejectRole)
    box.setDefaultButton(keep)
    box.setEscapeButton(keep)
    box.exec()
    return box.clickedButton() is end


class JobBar(QWidget):
    """Runs jobs one at a time; its space stays reserved in between.

    Parameters
    ----------
    end : str, optional
        Text of the button that ends a job; default: Cancel.
    parent : QWidget or None

    Attributes
    ----------
    failed : Signal(str)
        Reason why a job failed, for the user.
    cancelled : Signal()
    busy_changed : Signal(bool)
    """

    failed = Signal(str)
    cancelled = Signal()
    busy_changed = Signal(bool)

    def __init__(self, end: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._job: Job | None = None
        self._then: Callable[[Any], object] = lambda _: None
        self._doing: QLabel = with_name(ElidedLabel(), "doing")
        self._bar = with_name(QProgressBar(format="%p %"), "progress", tr("Progress"))
        self._bar.setFixedWidth(20 * SPACING_PX)
        self._cancel = button("cancel", end or tr("Cance&l"))
        self._cancel.clicked.connect(self.cancel)
        fill_row(self, self._bar, self._doing, self._cancel, grows=self._doing)
        self._refresh()
        self.setMinimumHeight(self._cancel.sizeHint().height())

    @property
    def is_busy(self) -> bool:
        """True while a job is running."""
        return self._job is not None

    def run(self, doing: str, work: Work, then: Callable[[Any], object]) -> None:
        """Cancel the running job and start another; `then` receives its result."""
        self.stop()
        self._then = then
        # Without a parent: should the bar be destroyed, the job's thread keeps the job alive.
        self._job = Job(work)
        self._job.progressed.connect(self._show_progress)
        self._job.succeeded.connect(self._succeed)
        self._job.failed.connect(self._fail)
        self._job.cancelled.connect(self._end_cancelled)
        self._doing.setText(f"{doing}…")
        self._bar.setRange(0, 0)  # busy indicator until a share is reported
        self._job.start()
        self._refresh()

    def say(self, doing: str) -> None:
        """Show that the running job does something else by now."""
        self._doing.setText(f"{doing}…")

    def wait_for_user(self) -> None:
        """Show that the running job waits for the user: nothing moves."""
        self.say(tr("Waiting for you"))
        if self._bar.maximum() == 0:
            show_share(self._bar, 0.0)

    def cancel(self) -> None:
        """Cancel the running job at its next check."""
        if self._job is not None:
            self._job.cancel()
            self._doing.setText(tr("Cancelling…"))
            self._cancel.setEnabled(False)

    def stop(self) -> None:
        """Cancel the running job and wait for its end."""
        if self._job is not None:
            self._job.abandon()
            self._job = None
            self._refresh()

    def _show_progress(self, doing: str, share: float) -> None:
        if self._cancel.isEnabled():
            self._doing.setText(f"{doing}…")
        show_share(self._bar, share)

    def _succeed(self, done: object) -> None:
        self._end()
        self._then(done)

    def _fail(self, why: str) -> None:
        self._end()
        self.failed.emit(why)

    def _end_cancelled(self) -> None:
        self._end()
        self.cancelled.emit()

    def _end(self) -> None:
        assert self._job is not None
        self._job.wait()
        self._job = None
        self._refresh()

    def _refresh(self) -> None:
        for widget in (self._bar, self._doing, self._cancel):
            widget.setVisible(self.is_busy)
        self._cancel.setEnabled(True)
        self.busy_changed.emit(self.is_busy)
