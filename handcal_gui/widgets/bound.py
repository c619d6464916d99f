"""Fields bound to settings by their dotted names: shown, changed, and taken together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from typing import Any, TypeVar, cast

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from handcal_gui.widgets.entries_form import kind_of

Settings = TypeVar("Settings")


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

    def take(self, settings: Settings) -> Settings:
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
        return cast(Settings, _with(settings, changes))


def _with(settings: Any, changes: Mapping[str, Any]) -> object:
    """Return settings with all changes at once: some are valid only together."""
    return replace(
        settings,
        **{
            name: _with(getattr(settings, name), value) if isinstance(value, dict) else value
            for name, value in changes.items()
        },
    )
