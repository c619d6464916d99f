"""Words and limits of a form's field, kept beside the type and default in a settings dataclass."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Literal, TypeVar, get_type_hints

RIG_FILES = "Rig files (*.yaml *.yml)"
CUBE_FILES = "Cubes (*.json)"
INTRINSICS_FILES = "Intrinsics (*.yaml *.yml *.xml *.json)"
"""Kinds of files, as a file dialog names them."""
Value = TypeVar("Value", bound=bool | int | float | str)


@dataclass(frozen=True, slots=True)
class Entry:
    """Words and limits of a field; its type, and the unit at the end of its name, say the rest."""

    label: str
    """With & before the letter that leads to it."""
    help: str = ""
    hint: str = ""
    """Meaning of an empty text, or of the lowest number; of a bool, the text beside the box."""
    limits: tuple[float, float] = (0, 0)
    """Of a number, both included."""
    options: Mapping[str, str] | None = None
    """Of a choice: the values, each with its text."""
    path: Literal["", "file", "folder"] = ""
    files: str = ""
    """Of a path to a file: the kinds of file, as ``Cubes (*.json)``."""
    read: Callable[[Path], object] | None = None
    """Reads such a file; HandcalError if it cannot be used."""

    @property
    def title(self) -> str:
        """The label without its letter's mark."""
        return self.label.replace("&", "")


def entry(default: Value, label: str, help_text: str = "", **how: Any) -> Value:
    """Return the default of a dataclass's field with the `Entry` of a label, a help, and `how`."""
    told: Value = field(default=default, metadata={"entry": Entry(label, help_text, **how)})
    return told


def entries_of(kind: type) -> dict[str, tuple[Entry, Any]]:
    """Return the entry and the type of each field that has one, by name, in order."""
    hints = get_type_hints(kind)
    found = {one.name: one.metadata.get("entry") for one in fields(kind)}
    return {name: (told, hints[name]) for name, told in found.items() if told is not None}
