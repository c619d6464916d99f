"""The dialog that prepares an evaluation's data, and the button that opens it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QDialog, QPushButton, QWidget

from handcal_gui.widgets.fields import with_name


class PreparationDialog(QDialog):
    """Base of dialogs that prepare the data of an evaluation.

    Attributes
    ----------
    entries : object
        Entries of the evaluation, with the changes made here.
    """

    entries: Any


@dataclass(frozen=True, slots=True, eq=False)
class Preparation:
    """The specification of a preparation: its button and its dialog."""

    button: str
    help_text: str
    """Text and tooltip of the button."""
    is_possible: Callable[[Any], bool]
    """Returns whether the entries suffice to open the dialog."""
    dialog: Callable[[Any, QWidget], PreparationDialog]
    """Creates the dialog, given entries and a parent."""
    name: str = "prepare"
    """Object name of the button."""
    request: str = ""
    """Sentence that asks for what to enter first; shown while the dialog cannot be opened."""


class PreparationButton(QPushButton):
    """Opens the dialog over the window.

    Parameters
    ----------
    preparation : Preparation

    Attributes
    ----------
    closed : Signal(object)
        Entries with which the dialog was closed.
    """

    closed = Signal(object)

    def __init__(self, preparation: Preparation, parent: QWidget | None = None) -> None:
        super().__init__(preparation.button, parent, autoDefault=True)
        label = preparation.button.replace("&", "")
        with_name(self, preparation.name, label, preparation.help_text)
        self._preparation = preparation
        self._entries: Any = None
        self._dialog: PreparationDialog | None = None
        self.clicked.connect(self._open)

    def follow(self, entries: Any) -> None:
        """Set the entries; None disables the button."""
        self._entries = entries
        self.setEnabled(entries is not None and self._preparation.is_possible(entries))

    def request(self, entries: Any) -> str:
        """Return what to enter first; empty if nothing is missing."""
        return "" if self._preparation.is_possible(entries) else self._preparation.request

    def stop(self) -> None:
        """Close the dialog, if it is open."""
        if self._dialog is not None:
            self._dialog.reject()

    def _open(self) -> None:
        self._dialog = self._preparation.dialog(self._entries, self)
        self._dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._dialog.finished.connect(self._end)
        self._dialog.open()

    def _end(self) -> None:
        assert self._dialog is not None
        dialog, self._dialog = self._dialog, None
        self.closed.emit(dialog.entries)
