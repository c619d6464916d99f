"""The dialog that writes a support bundle."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QFormLayout, QWidget

from handcal.io.files import user_path
from handcal.progress import Progress
from handcal.station.support import SupportSettings, run_support
from handcal_gui.engine.jobs import Job
from handcal_gui.theme import SPACING_PX
from handcal_gui.translation import tr
from handcal_gui.widgets.fields import button, paragraph
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.path_field import PathField

_ABOUT = tr(
    "One file to send with a bug report: the checks of the installation, package versions, and the "
    "log, in which wearers' names, your user name and the home folder are replaced. It contains "
    "nothing from sessions, and camera frames only if you add a recording here."
)


class SupportDialog(QDialog):
    """Writes a support bundle in a job; closing the dialog cancels it.

    Parameters
    ----------
    settings : SupportSettings
        Without frames.
    folder : Path
        Proposed folder.
    """

    def __init__(
        self, settings: SupportSettings, folder: Path, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setObjectName("supportDialog")
        self.setWindowTitle(tr("Support bundle"))
        self._settings = settings
        self._job: Job | None = None
        self._folder = PathField(tr("Folder"), "folder")
        self._folder.set_path(str(folder))
        self._folder.setMinimumWidth(45 * SPACING_PX)
        self._frames = PathField(tr("Recording to add"), "either", empty=tr("None"))
        self._said = paragraph("supportSaid")
        self._said.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._write = button("writeBundle", tr("Write"))
        self._write.setDefault(True)
        close = button("close", tr("Close"))
        self._write.clicked.connect(self.write)
        close.clicked.connect(self.reject)
        self.finished.connect(self.stop)
        form = QFormLayout()
        form.addRow(tr("Folder"), self._folder)
        form.addRow(tr("Recording to add"), self._frames)
        vbox(
            paragraph("supportAbout", _ABOUT),
            form,
            self._said,
            1,
            hbox(1, close, self._write, spacing=SPACING_PX),
            on=self,
            margins=2 * SPACING_PX,
            spacing=2 * SPACING_PX,
        )

    def write(self) -> None:
        """Write the bundle."""
        if self._job is not None:
            return
        folder = user_path(self._folder.path)
        output = folder / f"handcal-support-{date.today():%Y%m%d}.zip"
        frames = Path(self._frames.path) if self._frames.path else None
        settings = replace(self._settings, frames=frames)

        def work(progress: Progress) -> str:
            written = run_support(output, settings, progress)
            return tr("{} was written; it contains {}.").format(output, ", ".join(written[:5]))

        self._write.setEnabled(False)
        self._job = Job(work)
        self._job.progressed.connect(lambda doing, _: self._said.setText(f"{doing}…"))
        self._job.succeeded.connect(self._end)
        self._job.failed.connect(self._end)
        self._job.cancelled.connect(self._end)
        self._job.start()

    def stop(self) -> None:
        """Cancel the writing; safe to call twice."""
        if self._job is not None:
            self._job.abandon()
            self._job = None

    def _end(self, said: object = "") -> None:
        assert self._job is not None
        self._job.wait()
        self._job = None
        self._said.setText(str(said))
        self._write.setEnabled(True)
