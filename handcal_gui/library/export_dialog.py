"""The export dialog: choose formats, follow the progress, see the files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtGui import QKeyEvent, QKeySequence
from PySide6.QtWidgets import QDialog, QStackedWidget, QWidget

from handcal.core.progress import Progress
from handcal.export.export import Exported, ExportSettings
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.engine.jobs import Job
from handcal_gui.library.export_choices import ExportChoices
from handcal_gui.library.export_progress import ExportProgress
from handcal_gui.widgets.fields import button, main_button
from handcal_gui.widgets.layouts import hbox, vbox

Export = Callable[[Path, ExportSettings, Progress], Exported]


class ExportDialog(QDialog):
    """Exports one or several sessions in a job; Esc cancels it, and so does closing the dialog.

    Parameters
    ----------
    name : str
        Of the session, or the number of sessions; the name of the export's folder begins with it.
    settings : ExportSettings
        Initial choice.
    folder : Path
        Parent of the export's folder.
    export : callable
        Given the export's folder, the settings and the progress.
    title : str
        Subject of the export; by default the name.

    Attributes
    ----------
    remembered : Signal(ExportSettings, Path)
        The settings and folder chosen, to be proposed next time.
    succeeded : Signal(object)
        The files.
    failed : Signal(str)
    """

    remembered = Signal(object, object)
    succeeded = Signal(object)
    failed = Signal(str)

    def __init__(
        self,
        name: str,
        settings: ExportSettings,
        folder: Path,
        export: Export,
        title: str = "",
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("exportDialog")
        self.setWindowTitle(tr("Export {}").format(title or name))
        self._export_to = export
        self._job: Job | None = None
        self._is_closing = False
        self._choices = ExportChoices(settings, folder, f"{name}-export")
        self._progress = ExportProgress()
        self._pages = QStackedWidget()
        self._pages.addWidget(self._choices)
        self._pages.addWidget(self._progress)
        self._back = button("back", tr("&Back"))
        self._close = button("close", tr("&Close"))
        self._export = main_button("export", tr("&Export"))
        self._lay_out()
        self._choices.changed.connect(self._refresh)
        self._export.clicked.connect(self.start)
        self._back.clicked.connect(self._choose_again)
        self._close.clicked.connect(self._cancel)
        self._refresh()

    def start(self) -> None:
        """Start the export."""
        settings, target = self._choices.settings, self._choices.target
        self.remembered.emit(settings, self._choices.folder)
        self._progress.begin()
        self._pages.setCurrentWidget(self._progress)
        # Without a parent: the job's thread keeps it alive if the dialog is destroyed.
        self._job = Job(lambda progress: self._export_to(target, settings, progress))
        self._job.progressed.connect(self._progress.show_progress)
        self._job.succeeded.connect(self._succeed)
        self._job.failed.connect(self._fail)
        self._job.cancelled.connect(self._stop)
        self._job.start()
        self._refresh()

    def stop(self) -> None:
        """Cancel a running export and close; called before the program ends."""
        if self._job is not None:
            self._job.abandon()
            self._job = None
        self.reject()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Cancel a running export, as its button does, so that the dialog can say so."""
        if self._job is not None and event.matches(QKeySequence.StandardKey.Cancel):
            self._cancel()
        else:
            super().keyPressEvent(event)

    def reject(self) -> None:
        """Close; a running export is cancelled first."""
        if self._job is None:
            super().reject()
        else:
            self._is_closing = True
            self._cancel()

    def _cancel(self) -> None:
        """Cancel a running export, or close."""
        if self._job is None:
            self.reject()
        else:
            self._job.cancel()
            self._progress.show_cancelling()
            self._close.setEnabled(False)

    def _succeed(self, made: Exported) -> None:
        self._progress.show_files(self._choices.target, made)
        self._end()
        self.succeeded.emit(made.files)

    def _fail(self, why: str) -> None:
        self._progress.show_failure(why)
        self._end()
        self.failed.emit(why)

    def _stop(self) -> None:
        self._progress.show_cancelled()
        self._end()

    def _end(self) -> None:
        assert self._job is not None
        self._job.wait()
        self._job = None
        self._refresh()
        if self._is_closing:
            self.reject()

    def _choose_again(self) -> None:
        self._pages.setCurrentWidget(self._choices)
        self._refresh()

    def _refresh(self) -> None:
        is_choosing = self._pages.currentWidget() is self._choices
        self._export.setVisible(is_choosing)
        self._export.setEnabled(self._choices.is_complete)
        self._back.setVisible(not is_choosing)
        self._back.setEnabled(self._job is None)
        (self._export if is_choosing else self._close).setDefault(True)
        self._close.setText(tr("&Close") if self._job is None else tr("&Cancel"))
        self._close.setEnabled(True)

    def _lay_out(self) -> None:
        buttons = hbox(1, self._back, self._close, self._export, spacing=SPACING_PX)
        vbox((self._pages, 1), buttons, on=self, margins=2 * SPACING_PX, spacing=2 * SPACING_PX)
