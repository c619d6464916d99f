"""The content of a report, independent of its file format."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

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
