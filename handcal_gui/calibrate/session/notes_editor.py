"""An editor of notes that saves automatically."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QSignalBlocker, QTimer, Signal
from PySide6.QtGui import QTextDocument
from PySide6.QtWidgets import QLabel, QPlainTextEdit, QWidget

from handcal.session.session import MAX_NOTES_CHARACTERS
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.layouts import vbox

SAVE_MS = 800
_WRITE = tr("Notes on this session; saved automatically")
_RESUME = tr("This session is only shown. To write notes, resume it.")


class NotesEditor(QWidget):
    """Edits the notes on a session, and shows whether they are saved.

    Attributes
    ----------
    changed : Signal(str)
        The complete notes to save, 0.8 s after the last key.
    """

    changed = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
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
        self.changed.emit(self._edit.toPlainText())

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
            self.changed.emit(self._edit.toPlainText())

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
