"""The content of a report, independent of its file format, and the provenance in it."""

from __future__ import annotations

import platform
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FigureRow: TypeAlias = Mapping[str, float | int | str | bool | None]
"""A row of numbers by column name; the names include units."""

AXES_LEFT_MM = 13.0
"""Space for tick labels and title to the left of axes."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table; a table whose titles are all empty has no header."""

    title: str = ""
    align: Literal["left", "right"] = "right"


@dataclass(frozen=True, slots=True)
class Table:
    """A table of texts; units belong in the columns' titles."""

    columns: Sequence[Column]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    name: str = ""
    """Tells it from the other tables of its section; not in the report."""


@dataclass(frozen=True, slots=True)
class Figure:
    """A row of axes across the width of a page.

    Raises
    ------
    ValueError
        If the name is not valid for a file.
    """

    name: str
    """Name of its files: lower-case letters, digits and hyphens, unique in a report."""
    caption: str
    draw: Callable[[Sequence[Axes]], None]
    """Draws into the given axes; called once for the PDF, and once for all images."""
    rows: Sequence[FigureRow]
    """Its data: the rows of its CSV file."""
    height_mm: float = 60.0
    columns: int = 1
    """Number of axes."""
    left_mm: float = AXES_LEFT_MM
    """Space for tick labels and title to the left of each."""

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", self.name):
            raise ValueError(
                f"a figure's name has lower-case letters, digits and hyphens, not {self.name!r}"
            )


Item: TypeAlias = str | Table | Figure
"""A paragraph of text, a table or a figure."""


@dataclass(frozen=True, slots=True)
class Section:
    """A section of a report; `title` may be empty."""

    title: str
    items: Sequence[Item]
    starts_page: bool = False


@dataclass(frozen=True, slots=True)
class Report:
    """The whole content of a report.

    Raises
    ------
    ValueError
        If two figures have the same name.
    """

    title: str
    subject: str
    """Its subject in one line, printed on every page."""
    lead: str
    """The finding in a sentence or two."""
    sections: Sequence[Section]

    def __post_init__(self) -> None:
        names = Counter(figure.name for figure in self.figures)
        twice = sorted(name for name, count in names.items() if count > 1)
        if twice:
            raise ValueError(f"more than one figure is named {', '.join(twice)}")

    @property
    def figures(self) -> list[Figure]:
        """Its figures, in order."""
        return [
            item for section in self.sections for item in section.items if isinstance(item, Figure)
        ]


def facts(values: Mapping[str, str], caption: str = "") -> Table:
    """Return a table of names and values, without header."""
    return Table([Column(align="left"), Column(align="left")], list(values.items()), caption)


# Most settings listed; the file holds the others.
_MAX_SETTINGS = 120
_MAX_CHARACTERS = 200


def made_with() -> dict[str, str]:
    """Return the software, machine and time with which a report is made."""
    return {
        "Made with": f"handcal {version('handcal')}, Python {platform.python_version()}, "
        f"NumPy {np.__version__}, on {platform.system()} {platform.machine()}",
        "Made at": at_minute(datetime.now(UTC).isoformat()),
    }


def settings_items(
    settings: Mapping[str, Any], file: str = "settings.json", defaults: Mapping[str, Any] = {}
) -> list[Item]:
    """Return nested settings that are not the defaults as a table.

    Below it stands how many more `file` has.
    """
    usual = dict(_flat(defaults))
    rows = [(name, value) for name, value in _flat(settings) if usual.get(name) != value]
    if not rows:
        return ["All settings are the defaults."]
    items: list[Item] = [facts(dict(rows[:_MAX_SETTINGS]))]
    if len(rows) > _MAX_SETTINGS:
        items.append(f"and {len(rows) - _MAX_SETTINGS:,} more, in {file}")
    return items


def at_minute(iso: str) -> str:
    """Return a time, ISO 8601 in UTC, to the minute."""
    return f"{iso[:10]} {iso[11:16]} UTC"


def _flat(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Return nested values as rows of a name with dots and a short text."""
    rows: list[tuple[str, str]] = []
    for name, value in values.items():
        if isinstance(value, Mapping) and value:
            rows += _flat(value, f"{prefix}{name}.")
        else:
            text = f"{value:.6g}" if isinstance(value, float) else str(value)
            rows.append((_short(f"{prefix}{name}"), _short(text)))
    return rows


def _short(text: str) -> str:
    return text if len(text) <= _MAX_CHARACTERS else f"{text[: _MAX_CHARACTERS - 1]}…"
