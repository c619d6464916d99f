"""Forms of dataclasses: fields bound to their entries by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any, NamedTuple, TypeVar, cast

from PySide6.QtCore import QObject, Signal, SignalInstance
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QCheckBox,
    QComboBox,
    QFormLayout,
    QLineEdit,
    QSpinBox,
    QWidget,
)

from handcal.core.entry import Entry, entries_of
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import (
    choice,
    label_for,
    make_equally_wide,
    number,
    whole_number,
    with_name,
)
from handcal_gui.widgets.path_field import PathField

Entries = TypeVar("Entries")


class EntriesForm(QWidget):
    """A row for each field of a dataclass that has an `Entry`.

    Parameters
    ----------
    kind : type
        The dataclass.
    names : sequence of str
        The fields shown, in this order; default: all.
    """

    def __init__(
        self, kind: type, names: Sequence[str] = (), parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        entries = entries_of(kind)
        self._fields = {name: _field(name, *entries[name]) for name in names or entries}
        self._bound = Bound(self._fields, parent=self)
        make_equally_wide(one for one in self._fields.values() if isinstance(one, QSpinBox))
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.setHorizontalSpacing(SPACING_PX)
        form.setVerticalSpacing(SPACING_PX // 2)
        for name, field in self._fields.items():
            form.addRow(label_for(field, tr(entries[name][0].label)), field)

    @property
    def changed(self) -> SignalInstance:
        """The signal of another value."""
        return self._bound.changed

    def show_entries(self, entries: object) -> None:
        """Show the fields' values."""
        self._bound.show(entries)

    def field(self, name: str) -> QWidget:
        """Return the widget of a field."""
        return self._fields[name]

    def enter(self, **values: object) -> None:
        """Show other values of some fields, as if typed."""
        for name, value in values.items():
            kind_of(self._fields[name]).show(self._fields[name], value)

    def take(self, entries: Entries) -> Entries:
        """Return the entered values."""
        return self._bound.take(entries)


_UNITS = {"_px": (" px", 1.0), "_m": (" m", 0.01), "_arcmin": ("′", 0.1)}
"""A number's unit as shown, and the step of its arrows, by the end of its field's name."""


def _field(name: str, entry: Entry, kind: object) -> QWidget:
    """Return the widget of a field, by its type."""
    unit, step = next((one for end, one in _UNITS.items() if name.endswith(end)), ("", 0.01))
    title, help_text, hint = tr(entry.title), tr(entry.help), tr(entry.hint)
    if entry.path:
        path = PathField(title, entry.path, tr(entry.files), hint, read=entry.read)
        path.setToolTip(help_text)
        return path
    if entry.options is not None:
        texts = {option: tr(text) for option, text in entry.options.items()}
        return choice(name, title, texts, help_text)
    if kind is bool:
        return with_name(QCheckBox(hint), name, title, help_text)
    if kind is float:
        return number(name, *entry.limits, step, unit, help_text)
    if kind is int:
        low, high = map(int, entry.limits)
        whole = whole_number(name, low, high, help_text)
        whole.setSuffix(unit)
        whole.setSpecialValueText(hint)
        return whole
    line = QLineEdit(placeholderText=hint, clearButtonEnabled=bool(hint))
    return with_name(line, name, title, help_text)


class Bound(QObject):
    """Fields, wherever they stand, of settings that are nested dataclasses.

    Parameters
    ----------
    fields : mapping of str to QWidget
        By the name of the setting, such as ``segment.depth_min_m``.
    factors : mapping of str to float
        What is shown for 1, for numbers in another unit.
    parent : QObject, optional

    Attributes
    ----------
    changed : Signal()
    """

    changed = Signal()

    def __init__(
        self,
        fields: Mapping[str, QWidget],
        factors: Mapping[str, float] = {},
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self._fields, self._factors = fields, factors
        for field in fields.values():
            kind_of(field).change(field).connect(self.changed)

    def show(self, settings: object) -> None:
        """Show settings; an option that is None is shown as an empty one."""
        for name, field in self._fields.items():
            value: Any = reduce(getattr, name.split("."), settings)
            if name in self._factors:
                value = self._factors[name] * value
            kind_of(field).show(field, "" if value is None else value)

    def take(self, settings: Entries) -> Entries:
        """Return settings with the values shown."""
        changes: dict[str, Any] = {}
        for name, field in self._fields.items():
            value = kind_of(field).value(field)
            if name in self._factors:
                value = value / self._factors[name]
            if value == "" and reduce(getattr, name.split("."), settings) is None:
                value = None
            *parents, last = name.split(".")
            reduce(lambda part, parent: part.setdefault(parent, {}), parents, changes)[last] = value
        return cast(Entries, _with(settings, changes))


def _with(settings: Any, changes: Mapping[str, Any]) -> object:
    """Return settings with all changes at once: some are valid only together."""
    return replace(
        settings,
        **{
            name: _with(getattr(settings, name), value) if isinstance(value, dict) else value
            for name, value in changes.items()
        },
    )


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
