"""The export dialog: choose formats and a folder, follow the progress, open what was written."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent, QKeySequence, QShowEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QDialog,
    QFormLayout,
    QGridLayout,
    QLabel,
    QStackedWidget,
    QWidget,
)

from handcal.core.progress import Progress
from handcal.export.export import Exported, ExportSettings
from handcal.export.formats import FORMATS, TOOL_FORMATS, Format
from handcal.io.files import require_writable, user_path
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.widgets.brief import copy_text
from handcal_gui.widgets.fields import (
    button,
    fill_row,
    label_for,
    main_button,
    number,
    paragraph,
    with_name,
)
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import hbox, keep_space, vbox
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.opening import open_path
from handcal_gui.widgets.path_field import PathField

Export = Callable[[Path, ExportSettings, Progress], Exported]

_PURPOSES: dict[Format, tuple[str, str]] = {
    "report": ("R", tr("Verdict, eye shifts, figures and settings, to read and archive")),
    "html": ("H", tr("The report for a browser, and each figure with its data")),
    "csv": ("V", tr("Each φ with its errors, each corner of each trial: for statistics")),
    "yaml": ("Y", tr("Projection, K, H0 and φ of each eye, read by cv2.FileStorage")),
    "json": ("J", tr("The projections in the convention of each system")),
    "ply": ("P", tr("Cursor and hand of each alignment, with residuals")),
    "zip": ("Z", tr("All recorded data, to archive or to open elsewhere")),
    "unity": ("U", tr("The final calibration for Unity's JsonUtility")),
    "openxr": ("X", tr("The final calibration as views of OpenXR: poses and angles")),
    "northstar": ("N", tr("The final calibration for Monado's North Star driver")),
    "slicer": ("S", tr("The eyes as transforms and the clouds as models")),
}
"""Of each format: the letter in its title that ticks it, and what it is for."""
_NOTHING = tr("nothing was exported; the reasons are below, and earlier exports are unchanged")
_UNCHANGED = tr("the session and earlier exports are unchanged")
_SLOW_MS = 300
"""From a change of the folder until it is said that it is checked."""
_WITH_PLANES: tuple[Format, ...] = ("json", "unity")
"""Formats with clipping distances."""


class ExportDialog(QDialog):
    """Exports one or several sessions in a job; Esc cancels it, and so does closing the dialog.

    Parameters
    ----------
    name : str
        Name of the export's folder.
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
        self._settings, self._name, self._export_to = settings, name, export
        self._is_checked = self._is_refused = self._is_closing = False
        self._made = Exported(())
        self._boxes = {
            kind: with_name(QCheckBox(_lettered(info.title, _PURPOSES[kind][0])), kind)
            for kind, info in {**FORMATS, **TOOL_FORMATS}.items()
        }
        self._near = number("near", 0.01, 1.0, 0.05, " m", tr("Anything nearer is not drawn."))
        self._far = number("far", 1.5, 10000.0, 10.0, " m", tr("Anything farther is not drawn."))
        self._near.setValue(settings.near_m)
        self._far.setValue(settings.far_m)
        self._task = paragraph("exportTask")
        self._folder = PathField(tr("Export folder"), "folder")
        self._folder.set_path(str(folder))
        self._found = FindingLine("folder")
        keep_space(self._found)
        self._end = FindingLine("exportEnd")
        self._sentence, self._missing = paragraph("sentence"), paragraph("missing")
        for said in (self._sentence, self._missing):
            said.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._open_report = main_button("openReport", tr("Open &report"))
        self._open_folder = button("openFolder", tr("Open &folder"))
        self._copy_path = button("copyPath", tr("Copy &path"))
        self._copy_sentence = button("copySentence", tr("Copy &sentence"))
        self._jobs = JobBar()
        self._back = button("back", tr("&Back"))
        self._close = button("close", tr("&Close"))
        self._export = main_button("export", tr("&Export"))
        self._lay_out()
        for kind, box in self._boxes.items():
            box.setChecked(kind in settings.formats)
            box.toggled.connect(self._refresh)
        self._check = LatestJob(_has_files, self)  # the folder may be on a slow network
        self._check.answered.connect(lambda _, found: self._show_found("", has_files=found))
        self._check.failed.connect(self._show_found)
        self._slow = QTimer(self, interval=_SLOW_MS, singleShot=True)
        self._slow.timeout.connect(lambda: self._task.setText(tr("Checking the folder…")))
        self._folder.changed.connect(self._check_folder)
        self._export.clicked.connect(self.start)
        self._back.clicked.connect(partial(self._show_page, 0))
        self._close.clicked.connect(self.reject)
        self._open_report.clicked.connect(lambda: open_path(self, self._report))
        self._open_folder.clicked.connect(lambda: open_path(self, self.target))
        self._copy_path.clicked.connect(partial(self._copy, lambda: str(self.target)))
        self._copy_sentence.clicked.connect(partial(self._copy, lambda: self._made.sentence))
        self._jobs.failed.connect(self._fail)
        self._jobs.cancelled.connect(self._stop)
        self._jobs.busy_changed.connect(self._refresh)
        self._refresh()

    @property
    def target(self) -> Path:
        """The export's folder."""
        return user_path(self._folder.path).absolute() / self._name

    def start(self) -> None:
        """Start the export."""
        settings = replace(
            self._settings,
            formats=self._formats(),
            near_m=self._near.value(),
            far_m=self._far.value(),
        )
        target = self.target
        self.remembered.emit(settings, target.parent)
        self._end.clear()
        self._jobs.run(
            tr("Starting"),
            lambda progress: self._export_to(target, settings, progress),
            self._succeed,
        )

    def stop(self) -> None:
        """Cancel a running export and close; called before the program ends."""
        self._jobs.stop()
        self.reject()

    def showEvent(self, event: QShowEvent) -> None:
        """Check the folder."""
        super().showEvent(event)
        self._check_folder()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Cancel a running export, as its button does, so that the dialog can say so."""
        if self._jobs.is_busy and event.matches(QKeySequence.StandardKey.Cancel):
            self._jobs.cancel()
        else:
            super().keyPressEvent(event)

    def reject(self) -> None:
        """Close; a running export is cancelled first."""
        if self._jobs.is_busy:
            self._is_closing = True
            self._jobs.cancel()
            return
        self._check.stop()
        self._slow.stop()
        super().reject()

    def _succeed(self, made: Exported) -> None:
        self._made = made
        count = pluralize(len(made.files), tr("file"), tr("files"))
        lost = pluralize(len(made.missing), tr("session"), tr("sessions"))
        text = tr("{} in {}").format(count, self.target) if made.files else _NOTHING
        if made.missing and made.files:
            text = tr("{}. {} not exported, see below").format(text, lost)
        health = Health.LIMITED if made.missing else Health.GOOD
        self._end.show_finding(Finding("", health if made.files else Health.BROKEN, text))
        self._sentence.setText(made.sentence)
        self._missing.setText("\n".join(made.missing))
        self._show_page(1)
        self._end_closing()
        self.succeeded.emit(made.files)

    def _fail(self, why: str) -> None:
        advice = tr("choose another folder, or try again; {}").format(_UNCHANGED)
        self._end.show_finding(Finding("", Health.BROKEN, why, advice))
        self._end_closing()
        self.failed.emit(why)

    def _stop(self) -> None:
        self._end.show_finding(Finding("", Health.LIMITED, tr("cancelled"), _UNCHANGED))
        self._end_closing()

    def _end_closing(self) -> None:
        if self._is_closing:
            self.reject()

    @property
    def _report(self) -> Path:
        """The report that was written: of all sessions if there is one, as a PDF if there is."""
        reports = [path for path in self._made.files if path.stem == "report"]
        return min(reports, key=lambda path: (len(path.parts), path.suffix != ".pdf"))

    def _copy(self, text: Callable[[], str]) -> None:
        copy_text(self, text(), tr("Copied"))

    def _show_page(self, number: int) -> None:
        self._pages.setCurrentIndex(number)
        if number == 0:
            self._end.clear()
        self._refresh()

    def _check_folder(self) -> None:
        self._is_checked = self._is_refused = False
        if self._folder.path:
            self._check.ask(self.target)
            self._slow.start()
        self._refresh()

    def _show_found(self, problem: str, *, has_files: bool = False) -> None:
        """Show why the folder is refused, or else what is created or replaced in it."""
        self._is_checked, self._is_refused = True, bool(problem)
        self._slow.stop()
        found = Finding("", Health.BROKEN, problem)
        if not problem:
            text = tr("The export will create the folder {} there.")
            if has_files:
                text = tr("Files of the same names in the folder {} there will be replaced.")
            health = Health.LIMITED if has_files else Health.GOOD
            found = Finding("", health, text.format(self._name))
        self._found.show_finding(found)
        self._refresh()

    def _lacking(self) -> str:
        """Return what is still to be chosen; empty if nothing is."""
        if not self._formats():
            return tr("Choose what to write: nothing is ticked.")
        if not self._folder.path:
            return tr("Choose the folder to export to.")
        return tr("Choose another folder to export to.") if self._is_refused else ""

    def _formats(self) -> tuple[Format, ...]:
        return tuple(kind for kind, box in self._boxes.items() if box.isChecked())

    def _refresh(self) -> None:
        is_choosing, is_busy = self._pages.currentIndex() == 0, self._jobs.is_busy
        for field in (self._near, self._far):
            field.setEnabled(any(self._boxes[kind].isChecked() for kind in _WITH_PLANES))
        self._found.setVisible(self._is_checked and bool(self._folder.path))
        self._task.setText(self._lacking() or tr("Choose what to write and where, then export."))
        self._choices.setEnabled(not is_busy)
        self._export.setVisible(is_choosing)
        self._export.setEnabled(self._is_checked and not self._lacking() and not is_busy)
        self._back.setVisible(not is_choosing)
        made = self._made
        self._open_report.setVisible(any(path.stem == "report" for path in made.files))
        for one in (self._open_folder, self._copy_path):
            one.setVisible(bool(made.files))
        self._copy_sentence.setVisible(bool(made.sentence))
        (self._export if is_choosing else self._close).setDefault(True)

    def _lay_out(self) -> None:
        formats = QGridLayout()
        formats.setHorizontalSpacing(2 * SPACING_PX)
        formats.setVerticalSpacing(SPACING_PX // 2)  # all fits a screen 540 px high
        formats.setColumnStretch(1, 1)
        for kind, box in self._boxes.items():
            if kind == next(iter(TOOL_FORMATS)):
                heading = QLabel(tr("For one program each:"))
                heading.setContentsMargins(0, SPACING_PX, 0, 0)  # apart from the group above
                formats.addWidget(heading, formats.rowCount(), 0)
            row = formats.rowCount()
            formats.addWidget(box, row, 0)
            formats.addWidget(QLabel(_PURPOSES[kind][1]), row, 1)
        form = QFormLayout()
        form.setHorizontalSpacing(2 * SPACING_PX)
        form.setVerticalSpacing(SPACING_PX)
        planes, far = QWidget(), label_for(self._far, tr("F&ar plane"))
        fill_row(planes, self._near, far, self._far, grows=self._far)
        for title, field in (
            (tr("Near p&lane (OpenGL, Unity)"), planes),
            (tr("Export &to"), self._folder),
        ):
            form.addRow(label_for(field, title), field)
        form.addRow(self._found)
        self._choices, result = QWidget(), QWidget()
        vbox(self._task, formats, form, 1, on=self._choices, margins=0, spacing=SPACING_PX)
        opening = hbox(
            self._open_report,
            self._open_folder,
            self._copy_path,
            self._copy_sentence,
            1,
            spacing=SPACING_PX,
        )
        parts = opening, self._sentence, self._missing
        vbox(*parts, 1, on=result, margins=0, spacing=2 * SPACING_PX)
        self._pages = QStackedWidget()
        self._pages.addWidget(self._choices)
        self._pages.addWidget(result)
        vbox(
            (self._pages, 1),
            self._end,
            hbox((self._jobs, 1), self._back, self._close, self._export, spacing=SPACING_PX),
            on=self,
            margins=2 * SPACING_PX,
            spacing=SPACING_PX,
        )


def _has_files(folder: Path) -> bool:
    """Return whether a folder contains anything; raise FileError if it cannot be written to."""
    require_writable(folder)
    with suppress(OSError):  # it is not there, or only to be written to
        return any(folder.iterdir())
    return False


def _lettered(title: str, letter: str) -> str:
    """Return a title in which & precedes a letter."""
    return title.replace(letter, f"&{letter}", 1)
