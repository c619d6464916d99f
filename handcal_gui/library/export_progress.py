"""Progress and result of an export."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QLabel,
    QListWidget,
    QListWidgetItem,
    QProgressBar,
    QVBoxLayout,
    QWidget,
)

from handcal.export.export import Exported
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX, icon
from handcal_gui.app.translation import tr
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import button, plain_tooltip, with_name
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.job_bar import show_share
from handcal_gui.widgets.layouts import hbox
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.opening import open_path

_NOTHING = tr("nothing was exported; the sessions and earlier exports are unchanged")
_NOTHING_ADVICE = tr("see the reasons below, then go back to choose another folder or try again")
_UNCHANGED = tr("the session and earlier exports are unchanged")


class ExportProgress(QWidget):
    """A progress bar during the export, then the files or the reason for its failure."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._doing: QLabel = with_name(ElidedLabel(), "doing")
        self._bar = with_name(QProgressBar(format="%p %"), "progress", tr("Progress"))
        self._end = FindingLine("exportEnd")
        self._report = Path()
        self._open_report = button("openReport", tr("Open &report"))
        self._open_report.clicked.connect(lambda: open_path(self, self._report))
        self._files = with_name(QListWidget(), "files", tr("Files"))
        self._files.setWordWrap(True)
        self._files.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._files.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(SPACING_PX)
        layout.addWidget(self._doing)
        layout.addWidget(self._bar)
        end = hbox((self._end, 1), self._open_report, spacing=SPACING_PX)
        end.setAlignment(self._open_report, Qt.AlignmentFlag.AlignTop)
        layout.addLayout(end)
        layout.addWidget(self._files, 1)
        layout.addStretch(0)

    def begin(self) -> None:
        """Show an export that has just started."""
        self._end.hide()
        self._open_report.hide()
        self._files.clear()
        self._files.hide()
        self._bar.show()
        self.show_progress(tr("Starting"), 0.0)

    def show_progress(self, doing: str, share: float) -> None:
        """Show the present activity and the share done, 0..1."""
        self._doing.setText(f"{doing}…")
        show_share(self._bar, share)

    def show_files(self, folder: Path, made: Exported) -> None:
        """Show the files written, below the sessions that were not exported."""
        for missing in made.missing:
            item = QListWidgetItem(icon("warning"), missing)
            item.setToolTip(plain_tooltip(missing))
            self._files.addItem(item)
        self._files.addItems([str(path.relative_to(folder)) for path in made.files])
        self._files.show()
        lost = pluralize(len(made.missing), tr("session"), tr("sessions"))
        not_exported = tr("{} not exported, see below.").format(lost)
        self._doing.setText(not_exported if made.missing else tr("Done."))
        if not made.files:
            self._show_end(Finding("", Health.BROKEN, _NOTHING, _NOTHING_ADVICE))
            return
        count = tr("{} in {}").format(pluralize(len(made.files), tr("file"), tr("files")), folder)
        reports = sorted(path for path in made.files if path.stem == "report")
        if len({path.parent for path in reports}) == 1:  # else the list tells them apart
            self._report = reports[-1]  # the PDF
            self._open_report.show()
        self._show_end(
            Finding("", Health.LIMITED if made.missing else Health.GOOD, count),
            tr("&Open folder"),
            lambda: open_path(self, folder),
        )

    def show_failure(self, why: str) -> None:
        """Show the reason why nothing was exported."""
        self._doing.setText(tr("Nothing was exported."))
        advice = tr("{}; go back to choose another folder, or to try again").format(_UNCHANGED)
        self._show_end(Finding("", Health.BROKEN, why, advice))

    def show_cancelling(self) -> None:
        """Show that the export is being cancelled."""
        self._doing.setText(tr("Cancelling…"))

    def show_cancelled(self) -> None:
        """Show that the export was cancelled."""
        self._doing.setText(tr("Nothing was exported."))
        self._show_end(Finding("", Health.LIMITED, tr("cancelled"), _UNCHANGED))

    def _show_end(
        self, finding: Finding, fix: str = "", mend: Callable[[], object] | None = None
    ) -> None:
        """Show an end in place of the bar, which would stay where it stopped."""
        self._bar.hide()
        self._end.show_finding(finding, fix, mend)
        self._end.show()
