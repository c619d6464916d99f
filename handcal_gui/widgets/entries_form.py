"""A form for the entries of a dataclass."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar, cast

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QCheckBox,
    QComboBox,
    QFormLayout,
    QLineEdit,
    QSpinBox,
    QWidget,
)

from handcal_gui.app.theme import SPACING_PX
from handcal_gui.widgets.fields import label_for, make_equally_wide
from handcal_gui.widgets.path_field import PathField

Entries = TypeVar("Entries")


class EntriesForm(QWidget):
    """Shows fields of a dataclass: paths, choices, check boxes, texts and numbers.

    Parameters
    ----------
    fields : mapping of str to (str, QWidget)
        Label and widget of each field of the dataclass.

    Attributes
    ----------
    changed : Signal()
    """

    changed = Signal()

    def __init__(
        self, fields: Mapping[str, tuple[str, QWidget]], parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._fields = {name: field for name, (_, field) in fields.items()}
        make_equally_wide(one for one in self._fields.values() if isinstance(one, QSpinBox))
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.setHorizontalSpacing(SPACING_PX)
        form.setVerticalSpacing(SPACING_PX // 2)
        for text, field in fields.values():
            form.addRow(label_for(field, text), field)
            kind_of(field).change(field).connect(self.changed)

    def show_entries(self, entries: object) -> None:
        """Show the fields' values."""
        self.enter(**{name: getattr(entries, name) for name in self._fields})

    def enter(self, **values: object) -> None:
        """Show other values of some fields, as if typed."""
        for name, value in values.items():
            kind_of(self._fields[name]).show(self._fields[name], value)

    def take(self, entries: Entries) -> Entries:
        """Return the entered values."""
        shown = {name: kind_of(field).value(field) for name, field in self._fields.items()}
        return cast(Entries, replace(cast(Any, entries), **shown))


class _Kind(NamedTuple):
    """Functions that tell a change of a kind of field, show a value, and give the one entered."""

    change: Callable[[Any], Any]
    show: Callable[[Any, Any], object]
    value: Callable[[Any], Any]


_KINDS: dict[type[QWidget], _Kind] = {
    PathField: _Kind(lambda one: one.changed, PathField.set_path, lambda one: one.path),
    QComboBox: _Kind(
        lambda one: one.currentIndexChanged,
        lambda one, value: one.setCurrentIndex(one.findData(value)),
        QComboBox.currentData,
    ),
    QCheckBox: _Kind(lambda one: one.toggled, QCheckBox.setChecked, QCheckBox.isChecked),
    QLineEdit: _Kind(
        lambda one: one.textChanged, QLineEdit.setText, lambda one: one.text().strip()
    ),
    QAbstractSpinBox: _Kind(
        lambda one: one.valueChanged,
        lambda one, value: one.setValue(value),
        lambda one: one.value(),
    ),
}


def kind_of(field: QWidget) -> _Kind:
    """Return how a field is read and written."""
    return next(kind for of, kind in _KINDS.items() if isinstance(field, of))
