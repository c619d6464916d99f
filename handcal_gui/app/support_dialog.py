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
from handcal_gui.widgets.fields import button, label_for, main_button, paragraph
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.job_bar import JobBar
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
        self._folder = PathField(tr("Folder"), "folder")
        self._folder.set_path(str(folder))
        self._folder.setMinimumWidth(45 * SPACING_PX)
        self._frames = PathField(tr("Recording to add"), "either", empty=tr("None"))
        self._name = f"handcal-support-{date.today():%Y%m%d}.zip"
        will = tr("The file {} will be written to the folder.").format(self._name)
        self._jobs = JobBar()
        self._jobs.failed.connect(lambda why: self._say(Finding("", Health.BROKEN, why, _ADVICE)))
        self._jobs.busy_changed.connect(self._on_busy)
        self._said = FindingLine("support")
        self._said.hide()
        self._write = main_button("writeBundle", tr("&Write"))
        close = button("close", tr("&Close"))
        self._folder.changed.connect(lambda: self._write.setEnabled(bool(self._folder.path)))
        self._write.clicked.connect(self.write)
        close.clicked.connect(self.reject)
        self.finished.connect(self._jobs.stop)
        form = QFormLayout()
        form.addRow(label_for(self._folder, tr("&Folder")), self._folder)
        form.addRow(label_for(self._frames, tr("&Recording to add")), self._frames)
        vbox(
            paragraph("supportAbout", _ABOUT),
            form,
            paragraph("supportWill", will),
            self._jobs,
            self._said,
            1,
            hbox(1, close, self._write, spacing=SPACING_PX),
            on=self,
            margins=2 * SPACING_PX,
            spacing=2 * SPACING_PX,
        )

    def write(self) -> None:
        """Write the bundle."""
        output = user_path(self._folder.path) / self._name
        frames = Path(self._frames.path) if self._frames.path else None
        settings = replace(self._settings, frames=frames)

        def work(progress: Progress) -> str:
            written = run_support(output, settings, progress)
            return tr("{} was written; it contains {}.").format(output, ", ".join(written[:5]))

        self._said.hide()
        self._jobs.run(tr("Writing"), work, lambda said: self._say(Finding("", Health.GOOD, said)))

    def stop(self) -> None:
        """Cancel the writing; safe to call twice."""
        self._jobs.stop()

    def _on_busy(self, is_busy: bool) -> None:
        for part in (self._folder, self._frames, self._write):
            part.setEnabled(not is_busy)

    def _say(self, found: Finding) -> None:
        self._said.show_finding(found)
        self._said.show()
