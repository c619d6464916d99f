"""Choice of the formats and the folder of an export."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QTimer, Signal
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QCheckBox, QFormLayout, QGridLayout, QLabel, QWidget

from handcal.export.export import ExportSettings
from handcal.export.formats import FORMATS, TOOL_FORMATS, Format
from handcal.io.files import require_writable, user_path
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.widgets.fields import fill_row, label_for, number, paragraph, with_name
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.layouts import keep_space, vbox
from handcal_gui.widgets.path_field import PathField

_PURPOSES: dict[Format, str] = {
    "report": tr("Verdict, eye shifts, figures and settings, to read and archive"),
    "html": tr("The report for a browser, and each figure with its data"),
    "csv": tr("One row for each eye, alignment and trial, for statistics"),
    "yaml": tr("Projection, K, H0 and φ of each eye, read by cv2.FileStorage"),
    "json": tr("The projections in the convention of each system"),
    "ply": tr("Cursor and hand of each alignment, with residuals"),
    "zip": tr("All recorded data, to archive or to open elsewhere"),
    "unity": tr("The final calibration for Unity's JsonUtility"),
    "openxr": tr("The final calibration as views of OpenXR: poses and angles"),
    "northstar": tr("The final calibration for Monado's North Star driver"),
    "slicer": tr("The eyes as transforms and the clouds as models"),
}
_LETTERS: dict[Format, str] = {
    "report": "R",
    "html": "H",
    "csv": "V",
    "yaml": "Y",
    "json": "J",
    "ply": "P",
    "zip": "Z",
    "unity": "U",
    "openxr": "X",
    "northstar": "N",
    "slicer": "S",
}
"""Letter in the title of each format that ticks it."""
_SLOW_MS = 300
"""From a change of the folder until it is said that it is checked."""
_WITH_PLANES: tuple[Format, ...] = ("json", "unity")
"""Formats with clipping distances."""


class ExportChoices(QWidget):
    """Formats, clipping distances and folder.

    Parameters
    ----------
    settings : ExportSettings
    folder : Path
        Proposed parent of the export's folder.
    name : str
        Name of the export's folder.

    Attributes
    ----------
    changed : Signal()
    """

    changed = Signal()

    def __init__(
        self, settings: ExportSettings, folder: Path, name: str, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._settings, self._name = settings, name
        self._boxes = {
            kind: with_name(QCheckBox(_lettered(info.title, _LETTERS[kind])), kind)
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
        self._is_checked = self._is_refused = False
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
        self._refresh()

    @property
    def is_complete(self) -> bool:
        """True if at least one format and a folder are chosen, and the folder is checked."""
        return self._is_checked and not self._missing()

    @property
    def settings(self) -> ExportSettings:
        """The settings chosen; valid only if `is_complete`."""
        return replace(
            self._settings,
            formats=self._formats(),
            near_m=self._near.value(),
            far_m=self._far.value(),
        )

    @property
    def folder(self) -> Path:
        """The parent folder chosen."""
        return user_path(self._folder.path).absolute()

    @property
    def target(self) -> Path:
        """The export's folder."""
        return self.folder / self._name

    def showEvent(self, event: QShowEvent) -> None:
        """Check the folder."""
        super().showEvent(event)
        self._check_folder()

    def hideEvent(self, event: QHideEvent) -> None:
        """Wait for the end of the check."""
        super().hideEvent(event)
        self._check.stop()
        self._slow.stop()

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

    def _missing(self) -> str:
        """Return what is still to be chosen; empty if nothing is."""
        if not self._formats():
            return tr("Choose what to write: nothing is ticked.")
        if not self._folder.path:
            return tr("Choose the folder to export to.")
        return tr("Choose another folder to export to.") if self._is_refused else ""

    def _formats(self) -> tuple[Format, ...]:
        return tuple(kind for kind, box in self._boxes.items() if box.isChecked())

    def _refresh(self) -> None:
        for field in (self._near, self._far):
            field.setEnabled(any(self._boxes[kind].isChecked() for kind in _WITH_PLANES))
        self._found.setVisible(self._is_checked and bool(self._folder.path))
        self._task.setText(self._missing() or tr("Choose what to write and where, then export."))
        self.changed.emit()

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
            formats.addWidget(QLabel(_PURPOSES[kind]), row, 1)
        form = QFormLayout()
        form.setHorizontalSpacing(2 * SPACING_PX)
        form.setVerticalSpacing(SPACING_PX)
        planes, far = QWidget(), label_for(self._far, tr("&Far plane"))
        fill_row(planes, self._near, far, self._far, grows=self._far)
        for title, field in (
            (tr("Ne&ar plane (OpenGL, Unity)"), planes),
            (tr("Export &to"), self._folder),
        ):
            form.addRow(label_for(field, title), field)
        form.addRow(self._found)
        vbox(self._task, formats, form, 1, on=self, margins=0, spacing=2 * SPACING_PX)


def _has_files(folder: Path) -> bool:
    """Return whether a folder contains anything; raise FileError if it cannot be written to."""
    require_writable(folder)
    with suppress(OSError):  # it is not there, or only to be written to
        return any(folder.iterdir())
    return False


def _lettered(title: str, letter: str) -> str:
    """Return a title in which & precedes a letter."""
    return title.replace(letter, f"&{letter}", 1)
