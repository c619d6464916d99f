"""A text that names the last deleted item, and a button to restore it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtWidgets import QToolButton, QWidget

from handcal_gui.app.keys import add_action
from handcal_gui.app.translation import tr
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.session_rows import Deletion

_TEXTS = {"alignment": tr("Alignment {} deleted."), "trial": tr("Trial {} deleted.")}


class UndoStrip(ElidedLabel):
    """Names the last deletion; hidden while there is nothing to undo.

    Parameters
    ----------
    parent : QWidget
        Widget in which Ctrl+Z undoes the deletion.
    restore : callable
        Undoes a deletion.

    Attributes
    ----------
    button : QToolButton
        Undoes the deletion; hidden with the text, and to be laid out beside or below it.
    """

    def __init__(self, parent: QWidget, restore: Callable[[Deletion], object]) -> None:
        super().__init__(parent)
        self.setObjectName("undoText")
        self._deletions: list[Deletion] = []
        self._undo = add_action(
            parent,
            tr("Undo"),
            "Ctrl+Z",
            lambda: restore(self._deletions[-1]),
            tooltip=tr("Restore the deleted item (Ctrl+Z)"),
        )
        self._undo.setObjectName("undo")
        self.button = QToolButton(parent)
        self.button.setDefaultAction(self._undo)
        self.show_deletions([])

    def show_deletions(self, deletions: Sequence[Deletion]) -> None:
        """Offer to restore the last of the deletions."""
        self._deletions = list(deletions)
        self._undo.setEnabled(bool(deletions))
        self.button.setVisible(bool(deletions))
        self.setVisible(bool(deletions))
        if deletions:
            self.setText(_TEXTS[deletions[-1].kind].format(deletions[-1].number))
        else:
            self.clear()
