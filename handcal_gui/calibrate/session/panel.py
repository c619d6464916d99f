"""The session panel: alignments and notes of a session, with undo of deletions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QSignalBlocker, Qt, QTimer
from PySide6.QtGui import QTextDocument
from PySide6.QtWidgets import (
    QFormLayout,
    QLabel,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QWidget,
)

from handcal.core.types import EyeDistance
from handcal.register.results import Results
from handcal.session.session import MAX_NOTES_CHARACTERS, SessionRecord
from handcal.session.state import SessionEvent
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.record_tabs import RecordTabs
from handcal_gui.calibrate.parts.undo_strip import UndoStrip
from handcal_gui.engine.engine_thread import Submit, calibrating, no_engine
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import paragraph, with_name
from handcal_gui.widgets.layouts import hbox, keep_space, vbox
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.opening import open_path
from handcal_gui.widgets.session_rows import (
    ALIGNMENT_COLUMNS,
    alignment_rows,
    deletions,
)
from handcal_gui.widgets.table import Table
from handcal_gui.widgets.times import local_time

_EYE_DISTANCE_HELP = tr(
    "Distance between the wearer's pupils in millimetres, by a ruler or pupillometer (± 1 mm);\n"
    "empty: not measured. Alignments with both eyes open hardly show it.\n"
    "A change discards the results: solve again."
)

SAVE_MS = 800
_WRITE = tr("Notes on this session; saved automatically")
_RESUME = tr("This session is only shown. To write notes, resume it.")


class SessionPanel(QWidget):
    """Shows a session, and changes it.

    Attributes
    ----------
    submit : callable
        Gives the engine a command.
    notes : NotesEditor
    export_button, inspect_button : QPushButton
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("session")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.submit: Submit = no_engine
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
        self._alignments.offer_delete(
            lambda number: self.submit(
                tr("delete the alignment"), lambda s: s.delete("alignment", number)
            )
        )
        self.notes = NotesEditor()
        self._unwritten = paragraph("unwritten")
        self._unwritten.hide()
        self._strip = UndoStrip(
            self,
            lambda one: self.submit(
                tr("restore the {}").format(one.kind), lambda s: s.restore(one.kind, one.number)
            ),
        )
        self._tabs = RecordTabs()
        self._open_folder = QPushButton(tr("&Open folder"))
        self.inspect_button = QPushButton(tr("I&nspect in 3D"))
        self.export_button = QPushButton(tr("Ex&port…"))
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
        self.notes.show_saved(record.path, record.notes)
        self._unwritten.hide()
        self._refresh()

    def set_read_only(self, is_read_only: bool) -> None:
        """Set the panel read-only: the session can still be exported."""
        self._is_read_only = is_read_only
        for part in (self._alignments, self.notes):
            part.set_read_only(is_read_only)
        self._refresh()

    def _refresh(self) -> None:
        record = self._record
        self._open_folder.setEnabled(record is not None)
        self.inspect_button.setEnabled(record is not None and bool(record.alignments))
        self.export_button.setEnabled(record is not None)
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
        self.submit(tr("set the eye distance"), calibrating(lambda c: c.set_eye_distance(typed)))

    def _show_folder(self) -> None:
        if self._record is not None:
            open_path(self, self._record.path)

    def _lay_out(self) -> None:
        self._open_folder.setToolTip(tr("Show the session's folder in the file manager"))
        self._open_folder.clicked.connect(self._show_folder)
        self.inspect_button.setToolTip(
            tr("Show clouds, residuals, eyes and displays in a separate 3D window (needs Open3D)")
        )
        self.export_button.setToolTip(tr("Write a report, tables and calibration files"))
        form = QFormLayout()
        form.setVerticalSpacing(SPACING_PX // 2)
        form.addRow(tr("Wearer"), self._wearer)
        form.addRow(tr("Folder"), self._folder)
        form.addRow(tr("Started"), self._started)
        form.addRow(tr("Eye dis&tance (mm)"), self._eye_distance)
        form.addRow(self._eye_distance_problem)
        self._eye_distance_problem.hide()
        self._tabs.addTab(self._alignments, tr("Alignments"))
        self._tabs.addTab(self.notes, tr("Notes"))
        keep_space(self._strip.button)
        buttons = self._open_folder, self.inspect_button, self.export_button
        row = hbox(self._strip.button, 1, *buttons, spacing=SPACING_PX)
        meaning = tr("φ of each alignment alone; the result is in Results")
        self._tabs.setTabToolTip(0, meaning)
        parts = form, (self._tabs, 1), self._unwritten, self._strip, row
        vbox(*parts, on=self, margins=SPACING_PX, spacing=SPACING_PX)


def _read_eye_distance(text: str) -> EyeDistance:
    """Return an eye distance typed in millimetres; ValueError if no person has it."""
    try:
        value_mm = float(text.replace(",", "."))
    except ValueError:
        raise ValueError(tr("the eye distance must be a number; enter 45 to 85 mm")) from None
    return EyeDistance(1e-3 * value_mm)


class NotesEditor(QWidget):
    """Edits the notes on a session, and shows whether they are saved.

    Attributes
    ----------
    save : callable
        Given the complete notes to save, 0.8 s after the last key.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.save: Callable[[str], object] = lambda _text: None
        self._session: Path | None = None
        self._saved = ""
        self._edit = QPlainTextEdit()
        self._edit.setAccessibleName(tr("Notes on the session"))
        self._edit.setPlaceholderText(_WRITE)
        self._edit.setTabChangesFocus(True)
        self._edit.setEnabled(False)
        self._edit.textChanged.connect(self._begin)
        self._state = QLabel()
        self._state.setObjectName("notesState")
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setInterval(SAVE_MS)
        self._timer.timeout.connect(self._save)
        vbox(self._edit, self._state, on=self, margins=0, spacing=SPACING_PX // 2)

    def show_saved(self, session: Path, notes: str) -> None:
        """Set the saved notes; the text being edited is replaced only for another session."""
        self._saved = _as_shown(notes)
        if session != self._session:
            self._session = session
            self._timer.stop()
            with QSignalBlocker(self._edit):
                self._edit.setPlainText(notes)
            self._edit.setEnabled(True)
        self._refresh()

    def set_read_only(self, is_read_only: bool) -> None:
        """Set the editor read-only or editable."""
        self._edit.setReadOnly(is_read_only)
        self._edit.setPlaceholderText(_RESUME if is_read_only else _WRITE)
        self._refresh()

    @property
    def are_saved(self) -> bool:
        """True if what is written is what is stored."""
        return self._edit.toPlainText() == self._saved

    def save_now(self) -> None:
        """Save what is written, also if it is too long, which gives the reason."""
        self._timer.stop()
        self.save(self._edit.toPlainText())

    def flush(self) -> None:
        """Save now what is not saved, also what could not be saved before; at a session's end."""
        self._timer.stop()
        if not self.are_saved:
            self._saved = self._edit.toPlainText()  # the next session begins before it is shown
            self._save()

    def _begin(self) -> None:
        self._timer.start()
        self._refresh()

    def _save(self) -> None:
        if self._too_many() <= 0:
            self.save(self._edit.toPlainText())

    def _too_many(self) -> int:
        return len(self._edit.toPlainText()) - MAX_NOTES_CHARACTERS

    def _refresh(self) -> None:
        if self._session is None:
            text = ""
        elif self._edit.isReadOnly():
            text = _RESUME if self._saved else ""  # or the empty editor says it
        elif self._too_many() > 0:
            text = tr("⚠ Too long by {:,} characters: not saved").format(self._too_many())
        else:
            saved = tr("✓ Saved") if self._saved else ""  # nothing is written yet
            text = saved if self.are_saved else tr("Not saved yet")
        self._state.setText(text)
        self._state.setVisible(bool(text))  # empty, it was a bar below the notes


def _as_shown(notes: str) -> str:
    """Return notes as the editor does: with its own line ends, and without no-break spaces."""
    return QTextDocument(notes).toPlainText()
