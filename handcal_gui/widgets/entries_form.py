"""A form with one or two columns of fields for the entries of a dataclass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar, cast

from PySide6.QtCore import Signal
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QGridLayout,
    QLineEdit,
    QSpinBox,
    QWidget,
)

from handcal_gui.app.theme import SPACING_PX
from handcal_gui.widgets.fields import label_for, make_equally_wide
from handcal_gui.widgets.layouts import fit_soon
from handcal_gui.widgets.path_field import PathField

Entries = TypeVar("Entries")


class EntriesForm(QWidget):
    """Shows fields of a dataclass: paths, choices, check boxes, texts and whole numbers.

    Parameters
    ----------
    fields : mapping of str to (str, QWidget)
        Label and widget of each field of the dataclass.

    Attributes
    ----------
    changed : Signal()
    narrow_px : int
        Width below which the fields stand in one column.
    """

    changed = Signal()

    def __init__(
        self, fields: Mapping[str, tuple[str, QWidget]], parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._fields = {name: field for name, (_, field) in fields.items()}
        self._labels = [label_for(field, text) for text, field in fields.values()]
        make_equally_wide(one for one in self._fields.values() if isinstance(one, QSpinBox))
        self.narrow_px = 0
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(SPACING_PX)
        self._grid.setVerticalSpacing(SPACING_PX // 2)
        self._fit_soon = fit_soon(self._fit, self)
        self._fit()
        for field in self._fields.values():
            _change_of(field).connect(self.changed)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Use as many columns as there is room for."""
        super().resizeEvent(event)
        self._fit_soon.start()

    def show_entries(self, entries: object) -> None:
        """Show the fields' values."""
        for name, field in self._fields.items():
            _show(field, getattr(entries, name))

    def enter(self, **values: object) -> None:
        """Show other values of some fields, as if typed."""
        for name, value in values.items():
            _show(self._fields[name], value)

    def take(self, entries: Entries) -> Entries:
        """Return the entered values."""
        shown = {name: _value(field) for name, field in self._fields.items()}
        return cast(Entries, replace(cast(Any, entries), **shown))

    def _fit(self) -> None:
        columns = 1 if self.width() < self.narrow_px else 2
        rows = -(-len(self._fields) // columns)
        columns = -(-len(self._fields) // rows)
        for number, field in enumerate(self._fields.values()):
            row, column = number % rows, 3 * (number // rows)
            self._grid.addWidget(self._labels[number], row, column)
            self._grid.addWidget(field, row, column + 1)
        self._grid.setColumnStretch(1, 1)
        self._grid.setColumnStretch(4, columns - 1)
        self._grid.setColumnMinimumWidth(2, SPACING_PX * (columns - 1))


def _change_of(field: QWidget) -> Any:
    if isinstance(field, PathField):
        return field.changed
    if isinstance(field, QComboBox):
        return field.currentIndexChanged
    if isinstance(field, QCheckBox):
        return field.toggled
    if isinstance(field, QLineEdit):
        return field.textChanged
    return cast(QSpinBox, field).valueChanged


def _show(field: QWidget, value: Any) -> None:
    if isinstance(field, PathField):
        field.set_path(value)
    elif isinstance(field, QComboBox):
        field.setCurrentIndex(field.findData(value))
    elif isinstance(field, QCheckBox):
        field.setChecked(value)
    elif isinstance(field, QLineEdit):
        field.setText(value)
    else:
        cast(QSpinBox, field).setValue(value)


def _value(field: QWidget) -> Any:
    if isinstance(field, PathField):
        return field.path
    if isinstance(field, QComboBox):
        return field.currentData()
    if isinstance(field, QCheckBox):
        return field.isChecked()
    if isinstance(field, QLineEdit):
        return field.text().strip()
    return cast(QSpinBox, field).value()
