"""A line that names the last deleted item, with a button to restore it."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QToolButton, QWidget

from handcal_gui.keys import add_action
from handcal_gui.theme import SPACING_PX
from handcal_gui.translation import tr
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.layouts import hbox, keep_space
from handcal_gui.widgets.session_rows import Deletion

_TEXTS = {"alignment": tr("Alignment {} deleted."), "trial": tr("Trial {} deleted.")}


class UndoStrip(QWidget):
    """Shows the last deletion; keeps its space while there is nothing to undo.

    Parameters
    ----------
    parent : QWidget
        Widget in which Ctrl+Z undoes the deletion.

    Attributes
    ----------
    restore_requested : Signal(Deletion)
    """

    restore_requested = Signal(object)

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setObjectName("undoStrip")
        self._deletions: list[Deletion] = []
        self._text = ElidedLabel()
        self._text.setObjectName("undoText")
        self._undo = add_action(
            parent,
            tr("Undo"),
            "Ctrl+Z",
            self._restore,
            tooltip=tr("Restore the deleted item (Ctrl+Z)"),
        )
        self._undo.setObjectName("undo")
        self._button = QToolButton()
        self._button.setDefaultAction(self._undo)
        keep_space(self._button)
        hbox(self._text, self._button, on=self, margins=0, spacing=SPACING_PX)
        self.show_deletions([])

    def show_deletions(self, deletions: Sequence[Deletion]) -> None:
        """Offer to restore the last of the deletions."""
        self._deletions = list(deletions)
        self._undo.setEnabled(bool(deletions))
        self._button.setVisible(bool(deletions))
        if deletions:
            self._text.setText(_TEXTS[deletions[-1].kind].format(deletions[-1].number))
        else:
            self._text.clear()

    def _restore(self) -> None:
        self.restore_requested.emit(self._deletions[-1])
