"""The dialog that writes a support bundle."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

from PySide6.QtWidgets import QDialog, QFormLayout, QWidget

from handcal.core.progress import Progress
from handcal.io.files import user_path
from handcal.station.checks.doctor import Finding, Health
from handcal.station.checks.support import SupportSettings, run_support
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.engine.jobs import Job
from handcal_gui.widgets.fields import button, label_for, main_button, paragraph
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.path_field import PathField

_ABOUT = tr(
    "Choose a folder, write one file there, and send it with a bug report to the handcal "
    "developers. It contains the checks of the installation, package versions, and the log, in "
    "which wearers' names, your user name and the home folder are replaced; nothing from sessions, "
    "and camera frames only if you add a recording here."
)
_ADVICE = tr("nothing was written; choose another folder or recording, and try again")


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
        self._name = f"handcal-support-{date.today():%Y%m%d}.zip"
        self._will = tr("The file {} will be written to the folder.").format(self._name)
        self._doing = paragraph("supportDoing", self._will)
        self._said = FindingLine("support")
        self._said.hide()
        self._write = main_button("writeBundle", tr("&Write"))
        close = button("close", tr("&Close"))
        self._folder.changed.connect(lambda: self._write.setEnabled(bool(self._folder.path)))
        self._write.clicked.connect(self.write)
        close.clicked.connect(self.reject)
        self.finished.connect(self.stop)
        form = QFormLayout()
        form.addRow(label_for(self._folder, tr("&Folder")), self._folder)
        form.addRow(label_for(self._frames, tr("&Recording to add")), self._frames)
        vbox(
            paragraph("supportAbout", _ABOUT),
            form,
            self._doing,
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
        output = user_path(self._folder.path) / self._name
        frames = Path(self._frames.path) if self._frames.path else None
        settings = replace(self._settings, frames=frames)

        def work(progress: Progress) -> str:
            written = run_support(output, settings, progress)
            return tr("{} was written; it contains {}.").format(output, ", ".join(written[:5]))

        self._set_writing(True)
        self._job = Job(work)
        self._said.hide()
        self._job.progressed.connect(lambda doing, _: self._doing.setText(f"{doing}…"))
        self._job.succeeded.connect(lambda said: self._end(Finding("", Health.GOOD, said)))
        self._job.failed.connect(lambda why: self._end(Finding("", Health.BROKEN, why, _ADVICE)))
        self._job.cancelled.connect(self._end)
        self._job.start()

    def stop(self) -> None:
        """Cancel the writing; safe to call twice."""
        if self._job is not None:
            self._job.abandon()
            self._job = None

    def _end(self, found: Finding | None = None) -> None:
        assert self._job is not None
        self._job.wait()
        self._job = None
        self._doing.clear()
        self._set_writing(False)
        self._show(found)

    def _set_writing(self, is_writing: bool) -> None:
        for part in (self._folder, self._frames, self._write):
            part.setEnabled(not is_writing)

    def _show(self, found: Finding | None) -> None:
        self._said.setVisible(found is not None)
        if found is not None:
            self._said.show_finding(found)
