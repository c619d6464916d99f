"""The session panel: alignments, trials and notes of a session, with undo of deletions."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QFormLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QWidget,
)

from handcal.core.types import EyeDistance
from handcal.register.results import Results
from handcal.session.session import SessionRecord
from handcal.session.state import SessionEvent
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.record_tabs import RecordTabs
from handcal_gui.calibrate.parts.undo_strip import UndoStrip
from handcal_gui.calibrate.session.notes_editor import NotesEditor
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import paragraph, with_name
from handcal_gui.widgets.layouts import hbox, keep_space, vbox
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.opening import open_path
from handcal_gui.widgets.session_rows import (
    ALIGNMENT_COLUMNS,
    TRIAL_COLUMNS,
    alignment_rows,
    deletions,
    trial_rows,
    trials_id,
)
from handcal_gui.widgets.table import Table
from handcal_gui.widgets.times import local_time

_EYE_DISTANCE_HELP = tr(
    "Distance between the wearer's pupils in millimetres, by a ruler or pupillometer (± 1 mm);\n"
    "empty: not measured. Alignments with both eyes open hardly show it.\n"
    "A change discards the results: solve again."
)


class SessionPanel(QWidget):
    """Shows a session, and requests changes to it.

    Attributes
    ----------
    delete_requested, restore_requested : Signal(str, int)
        Kind and number of the alignment or trial.
    notes_changed : Signal(str)
        The complete notes, 0.8 s after the last key.
    eye_distance_changed : Signal(EyeDistance or None)
        The wearer's, as typed; None if it is not measured.
    export_requested, inspect_requested : Signal()
    """

    delete_requested = Signal(str, int)
    restore_requested = Signal(str, int)
    notes_changed = Signal(str)
    eye_distance_changed = Signal(object)
    export_requested = Signal()
    inspect_requested = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("session")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._record: SessionRecord | None = None
        self._results: Results | None = None
        self._is_read_only = False
        self._wearer, self._folder, self._started = ElidedLabel(), ElidedLabel(), QLabel()
        self._eye_distance = with_name(
            QLineEdit(), "eyeDistance", tr("Eye distance in millimetres"), _EYE_DISTANCE_HELP
        )
        self._eye_distance.editingFinished.connect(self._take_eye_distance)
        self._eye_distance_problem = paragraph("eyeDistanceProblem")
        self._alignments = Table(
            "alignments",
            tr("Alignments"),
            tr("Confirmed alignments appear here once they are written"),
            "one",
        )
        self._alignments.offer_delete(partial(self.delete_requested.emit, "alignment"))
        self._trials = Table(
            "trials-of-the-session",
            tr("Trials of the session"),
            tr("Recorded trials appear here"),
            "one",
        )
        self._trials.offer_delete(partial(self.delete_requested.emit, "trial"))
        self._notes = NotesEditor()
        self._notes.changed.connect(self.notes_changed)
        self._unwritten = paragraph("unwritten")
        self._unwritten.hide()
        self._meaning = ElidedLabel()
        self._strip = UndoStrip(self)
        self._strip.restore_requested.connect(
            lambda deletion: self.restore_requested.emit(deletion.kind, deletion.number)
        )
        self._tabs = RecordTabs()
        self._open_folder = QPushButton(tr("&Open folder"))
        self._inspect = QPushButton(tr("I&nspect in 3D"))
        self._export = QPushButton(tr("Ex&port…"))
        self._lay_out()
        self._refresh()

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the session of a snapshot."""
        results = snapshot.procedure.results
        if snapshot.record is not self._record or results is not self._results:
            self.show_record(snapshot.record, results)
        saved = [event.name for event in snapshot.record.unwritten]
        count = saved.count(SessionEvent.ALIGNMENT_SAVED)
        held = pluralize(count, tr("alignment"), tr("alignments"))
        self._unwritten.setText(tr("{} not written yet.").format(held))
        self._unwritten.setVisible(bool(count))

    def show_record(self, record: SessionRecord, results: Results | None) -> None:
        """Show a session.

        Parameters
        ----------
        record : SessionRecord
        results : Results or None
            Results of all its alignments, if known.
        """
        before, self._record, self._results = self._record, record, results
        if before is None or before.path != record.path:
            self._eye_distance.setModified(False)
        self._alignments.show_rows(ALIGNMENT_COLUMNS, alignment_rows(record, results))
        if before is None or trials_id(before) != trials_id(record):
            self._trials.show_rows(TRIAL_COLUMNS, trial_rows(record))
        self._notes.show_saved(record.path, record.notes)
        self._unwritten.hide()
        self._refresh()

    def set_read_only(self, is_read_only: bool) -> None:
        """Set the panel read-only: the session can still be exported."""
        self._is_read_only = is_read_only
        for part in (self._alignments, self._trials, self._notes):
            part.set_read_only(is_read_only)
        self._refresh()

    @property
    def notes_are_saved(self) -> bool:
        """True if the notes written are those stored."""
        return self._notes.are_saved

    def save_notes(self) -> None:
        """Request to save the notes now."""
        self._notes.save_now()

    def flush(self) -> None:
        """Save pending changes of the notes now."""
        self._notes.flush()

    def _refresh(self) -> None:
        record = self._record
        self._show_note()
        self._open_folder.setEnabled(record is not None)
        self._inspect.setEnabled(record is not None and bool(record.alignments))
        self._export.setEnabled(record is not None)
        self._eye_distance.setEnabled(record is not None and not self._is_read_only)
        if record is None:
            self._wearer.setText("–")
            self._folder.setText(tr("Start or open a session to see it here"))
            self._started.setText("–")
            return
        self._wearer.setText(record.wearer or "–")
        self._folder.setText(str(record.path))
        began = local_time(record.events[0].time)
        self._started.setText(tr("{}, finished").format(began) if record.is_finished else began)
        if not self._eye_distance.isModified():
            self._show_eye_distance(record.facts.eye_distance)
        self._strip.show_deletions([] if self._is_read_only else deletions(record))
        self._tabs.setTabText(0, tr("Alignments ({})").format(len(record.alignments)))
        self._tabs.setTabText(1, tr("Trials ({})").format(len(record.trials)))

    def _show_note(self) -> None:
        """Explain the numbers of alignments or trials while they are in sight."""
        record, shown, meaning = self._record, self._tabs.currentWidget(), ""
        if record is not None and record.alignments and shown is self._alignments:
            meaning = tr("φ of each alignment alone; the result is in Results")
        elif record is not None and record.trials and shown is self._trials:
            meaning = tr("Error: between the calibrated φ and the fine-tuned one")
        self._meaning.setText(meaning)
        self._meaning.setVisible(bool(meaning))

    def _show_eye_distance(self, stored: EyeDistance | None) -> None:
        is_told = stored is not None and stored.source == "headset"
        self._eye_distance.setPlaceholderText(
            tr("{} (headset)").format(stored) if is_told else tr("Not measured")
        )
        self._eye_distance.setText(
            "" if stored is None or is_told else f"{1e3 * stored.value_m:.1f}"
        )
        self._eye_distance_problem.hide()

    def _take_eye_distance(self) -> None:
        """Request the typed eye distance, or say why it is refused."""
        if self._record is None or not self._eye_distance.isModified():
            return
        text, stored = self._eye_distance.text().strip(), self._record.facts.eye_distance
        try:
            typed = _read_eye_distance(text) if text else None
        except ValueError as error:
            self._eye_distance_problem.setText(tr("Not used: {}.").format(error))
            self._eye_distance_problem.show()
            return
        self._show_eye_distance(stored)  # until the session holds the new one
        self.eye_distance_changed.emit(typed)

    def _show_folder(self) -> None:
        if self._record is not None:
            open_path(self, self._record.path)

    def _lay_out(self) -> None:
        self._open_folder.setToolTip(tr("Show the session's folder in the file manager"))
        self._open_folder.clicked.connect(self._show_folder)
        self._inspect.setToolTip(
            tr("Show clouds, residuals, eyes and displays in a separate 3D window (needs Open3D)")
        )
        self._inspect.clicked.connect(self.inspect_requested)
        self._export.setToolTip(tr("Write a report, tables and calibration files"))
        self._export.clicked.connect(self.export_requested)
        form = QFormLayout()
        form.setVerticalSpacing(SPACING_PX // 2)
        form.addRow(tr("Wearer"), self._wearer)
        form.addRow(tr("Folder"), self._folder)
        form.addRow(tr("Started"), self._started)
        form.addRow(tr("Eye dis&tance (mm)"), self._eye_distance)
        form.addRow(self._eye_distance_problem)
        self._eye_distance_problem.hide()
        self._tabs.addTab(self._alignments, tr("Alignments"))
        self._tabs.addTab(self._trials, tr("Trials"))
        self._tabs.addTab(self._notes, tr("Notes"))
        keep_space(self._strip.button)
        buttons = self._strip.button, (QWidget(), 1), self._open_folder, self._inspect, self._export
        row = hbox(*buttons, spacing=SPACING_PX)
        self._tabs.currentChanged.connect(self._show_note)
        parts = form, (self._tabs, 1), self._unwritten, self._meaning, self._strip, row
        vbox(*parts, on=self, margins=SPACING_PX, spacing=SPACING_PX)


def _read_eye_distance(text: str) -> EyeDistance:
    """Return an eye distance typed in millimetres; ValueError if no person has it."""
    try:
        value_mm = float(text.replace(",", "."))
    except ValueError:
        raise ValueError(tr("the eye distance must be a number; enter 45 to 85 mm")) from None
    return EyeDistance(1e-3 * value_mm)
