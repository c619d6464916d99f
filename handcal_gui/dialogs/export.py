"""The export dialog: choose formats, follow the progress, see the files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QDialog, QStackedWidget, QWidget

from handcal.export.export import ExportSettings, export_session
from handcal.progress import Progress
from handcal.session.session import SessionRecord
from handcal_gui.dialogs.export_choices import ExportChoices
from handcal_gui.dialogs.export_progress import ExportProgress
from handcal_gui.engine.jobs import Job
from handcal_gui.theme import SPACING_PX
from handcal_gui.translation import tr
from handcal_gui.widgets.fields import button
from handcal_gui.widgets.layouts import hbox, vbox

Export = Callable[..., tuple[Path, ...]]


class ExportDialog(QDialog):
    """Exports a session in a job; closing the dialog cancels it.

    Parameters
    ----------
    record : SessionRecord
    settings : ExportSettings
        Initial choice.
    folder : Path
        Parent of the export's folder.
    export : callable
        As `export_session`.
    name : str
        Subject of the export, and name of its folder; by default those of the session.

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
        record: SessionRecord,
        settings: ExportSettings,
        folder: Path,
        parent: QWidget | None = None,
        export: Export = export_session,
        name: str = "",
    ) -> None:
        super().__init__(parent)
        self.setObjectName("exportDialog")
        self.setWindowTitle(tr("Export {}").format(name or record.wearer or record.path.name))
        self._record = record
        self._export_session = export
        self._job: Job | None = None
        self._is_closing = False
        self._choices = ExportChoices(settings, folder, f"{name or record.path.name}-export")
        self._progress = ExportProgress()
        self._pages = QStackedWidget()
        self._pages.addWidget(self._choices)
        self._pages.addWidget(self._progress)
        self._back = button("back", tr("Back"))
        self._close = button("close", tr("Close"))
        self._export = button("export", tr("Export"))
        self._export.setDefault(True)
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
        export, record = self._export_session, self._record

        def work(progress: Progress) -> object:
            return export(record, target, settings, progress)

        self._progress.begin()
        self._pages.setCurrentWidget(self._progress)
        # Without a parent: the job's thread keeps it alive if the dialog is destroyed.
        self._job = Job(work)
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

    def _succeed(self, files: tuple[Path, ...]) -> None:
        self._progress.show_files(self._choices.target, files)
        self._end()
        self.succeeded.emit(files)

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
        self._close.setText(tr("Close") if self._job is None else tr("Cancel"))
        self._close.setEnabled(True)

    def _lay_out(self) -> None:
        buttons = hbox(1, self._back, self._close, self._export, spacing=SPACING_PX)
        vbox((self._pages, 1), buttons, on=self, margins=2 * SPACING_PX, spacing=2 * SPACING_PX)
