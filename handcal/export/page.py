"""A4 pages set from top to bottom with matplotlib: headings, wrapped text, tables and axes.

Every text is set as it is, never as mathtext, and wrapped by its measured width, so that no name
or note can spoil a page. Lengths are millimetres from the upper left corner.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.lines import Line2D

WIDTH_MM, HEIGHT_MM = 210.0, 297.0
_MARGIN_MM = 18.0
_TOP_MM, _BOTTOM_MM = 18.0, 20.0
CONTENT_MM = WIDTH_MM - 2 * _MARGIN_MM
_MM_PER_INCH, _POINTS_PER_INCH = 25.4, 72.0
_LINE = 1.35
_FAMILY = "DejaVu Sans"
_TABLE_PT, _TEXT_PT = 7.5, 9.0
_CELL_PAD_MM = 1.0
_GREY = "0.45"
# Inside a cell of axes: room for tick labels and titles.
_AXES_LEFT_MM, _AXES_RIGHT_MM, _AXES_TOP_MM, _AXES_BOTTOM_MM = 13.0, 3.0, 6.0, 10.0


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table; its width is a share of the page's."""

    title: str
    share: float
    align: Literal["left", "right"] = "right"


class Document:
    """Pages that fill from the top; what does not fit goes on the next one.

    Parameters
    ----------
    footer : str
        At the foot of every page, left of its number.
    """

    def __init__(self, footer: str) -> None:
        self._footer = footer
        self._pages: list[Figure] = []
        self.new_page()

    def new_page(self) -> None:
        """Begin a page."""
        inches = WIDTH_MM / _MM_PER_INCH, HEIGHT_MM / _MM_PER_INCH
        self._pages.append(Figure(figsize=inches))
        self._y_mm = _TOP_MM

    def finish(self) -> list[Figure]:
        """Give the pages their numbers and return them."""
        y_mm = HEIGHT_MM - 0.6 * _BOTTOM_MM
        footer = _wrap(self._footer, 7.0, "normal", 0.8 * CONTENT_MM)[0]
        for number, page in enumerate(self._pages, 1):
            self._rule(y_mm - 3.5, _GREY, page)
            _put(page, footer, _MARGIN_MM, y_mm, 7.0, color=_GREY)
            place = f"{number} / {len(self._pages)}"
            _put(page, place, WIDTH_MM - _MARGIN_MM, y_mm, 7.0, color=_GREY, ha="right")
        return self._pages

    def title(self, text: str) -> None:
        """Set the title of the document."""
        self.text(text, points=19.0, weight="bold")
        self.space(2.0)

    def heading(self, text: str, room_mm: float = 40.0) -> None:
        """Set the heading of a section, on the next page unless `room_mm` are left below it."""
        self._need(room_mm)
        if self._y_mm > _TOP_MM:
            self.space(5.0)
        self.text(text, points=12.5, weight="bold")
        self.space(1.5)

    def text(
        self, text: str, points: float = _TEXT_PT, weight: str = "normal", color: str = "black"
    ) -> None:
        """Set paragraphs of text over the page's width."""
        for line in _wrap(text, points, weight, CONTENT_MM):
            self._need(_line_mm(points))
            _put(self._pages[-1], line, _MARGIN_MM, self._y_mm, points, weight=weight, color=color)
            self._y_mm += _line_mm(points)

    def caption(self, text: str) -> None:
        """Set what a figure or table shows, below it."""
        self.text(text, points=_TABLE_PT, color="0.3")
        self.space(2.5)

    def space(self, height_mm: float) -> None:
        """Leave room."""
        self._y_mm += height_mm

    def table(self, columns: Sequence[Column], rows: Sequence[Sequence[str]]) -> None:
        """Set a table over the page's width; its head is repeated on every page it reaches."""
        total = sum(column.share for column in columns)
        widths_mm = [CONTENT_MM * column.share / total for column in columns]
        self._row(columns, widths_mm, [column.title for column in columns], head=True)
        for row in rows:
            height_mm = self._row_height(widths_mm, row)
            if self._y_mm + height_mm > HEIGHT_MM - _BOTTOM_MM:
                self.new_page()
                self._row(columns, widths_mm, [column.title for column in columns], head=True)
            self._row(columns, widths_mm, row)
        self.space(1.5)

    def axes(self, height_mm: float, columns: int, *, left_mm: float = _AXES_LEFT_MM) -> list[Axes]:
        """Return axes beside one another in a strip of the page's width."""
        self._need(height_mm)
        width_mm = CONTENT_MM / columns
        found = [
            self._pages[-1].add_axes(
                _box(
                    _MARGIN_MM + column * width_mm + left_mm,
                    self._y_mm + _AXES_TOP_MM,
                    width_mm - left_mm - _AXES_RIGHT_MM,
                    height_mm - _AXES_TOP_MM - _AXES_BOTTOM_MM,
                )
            )
            for column in range(columns)
        ]
        for axes in found:
            axes.tick_params(labelsize=7.0)
            axes.spines[["top", "right"]].set_visible(False)
        self._y_mm += height_mm
        return found

    def _need(self, height_mm: float) -> None:
        if self._y_mm + height_mm > HEIGHT_MM - _BOTTOM_MM:
            self.new_page()

    def _row(
        self,
        columns: Sequence[Column],
        widths_mm: Sequence[float],
        cells: Sequence[str],
        *,
        head: bool = False,
    ) -> None:
        weight = "bold" if head else "normal"
        height_mm = self._row_height(widths_mm, cells, weight)
        self._need(height_mm)
        left_mm = _MARGIN_MM
        for column, width_mm, cell in zip(columns, widths_mm, cells, strict=True):
            is_right = column.align == "right"
            x_mm = left_mm + (width_mm - _CELL_PAD_MM if is_right else _CELL_PAD_MM)
            lines = _wrap(cell, _TABLE_PT, weight, width_mm - 2 * _CELL_PAD_MM)
            for number, line in enumerate(lines):
                y_mm = self._y_mm + _CELL_PAD_MM + number * _line_mm(_TABLE_PT)
                align = column.align
                _put(self._pages[-1], line, x_mm, y_mm, _TABLE_PT, weight=weight, ha=align)
            left_mm += width_mm
        self._y_mm += height_mm
        self._rule(self._y_mm, "black" if head else "0.85", self._pages[-1])

    @staticmethod
    def _row_height(
        widths_mm: Sequence[float], cells: Sequence[str], weight: str = "normal"
    ) -> float:
        lines = max(
            len(_wrap(cell, _TABLE_PT, weight, width_mm - 2 * _CELL_PAD_MM))
            for cell, width_mm in zip(cells, widths_mm, strict=True)
        )
        return lines * _line_mm(_TABLE_PT) + 2 * _CELL_PAD_MM

    @staticmethod
    def _rule(y_mm: float, color: str, page: Figure) -> None:
        y = 1.0 - y_mm / HEIGHT_MM
        ends = _MARGIN_MM / WIDTH_MM, 1.0 - _MARGIN_MM / WIDTH_MM
        page.add_artist(Line2D(ends, (y, y), color=color, linewidth=0.5))


def plain(text: str) -> str:
    """Return a text without what the report's font lacks, control characters included."""
    known = _charmap()
    return "".join(
        char if char.isprintable() and ord(char) in known else " " if char.isspace() else "\ufffd"
        for char in text
    )


def _wrap(text: str, points: float, weight: str, width_mm: float) -> list[str]:
    """Break a text into lines that fit, within words where it must be; at least one line."""
    lines = [
        line
        for paragraph in text.splitlines()
        for line in _wrap_paragraph(plain(paragraph), points, weight, width_mm)
    ]
    return lines or [""]


def _wrap_paragraph(text: str, points: float, weight: str, width_mm: float) -> list[str]:
    lines = [""]
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}".strip()
        if _width_mm(longer, points, weight) <= width_mm:
            lines[-1] = longer
            continue
        pieces = _break(word, points, weight, width_mm)
        lines = [*lines, *pieces] if lines[-1] else pieces
    return lines


def _break(word: str, points: float, weight: str, width_mm: float) -> list[str]:
    pieces = [""]
    for char in word:
        if pieces[-1] and _width_mm(pieces[-1] + char, points, weight) > width_mm:
            pieces.append("")
        pieces[-1] += char
    return pieces


def _width_mm(text: str, points: float, weight: str) -> float:
    """Return the width of a text as it is printed, kerning left out."""
    return sum(_char_width_mm(char, weight) for char in text) * points


@lru_cache(maxsize=4096)
def _char_width_mm(char: str, weight: str) -> float:
    """Return the width of a character of one point."""
    font = get_font(findfont(FontProperties(family=_FAMILY, weight=weight)))
    font.set_size(100.0, _POINTS_PER_INCH)
    advance: int = font.load_char(ord(char)).linearHoriAdvance
    return advance / 2**16 / 100.0 * _MM_PER_INCH / _POINTS_PER_INCH


@lru_cache(maxsize=1)
def _charmap() -> frozenset[int]:
    return frozenset(get_font(findfont(FontProperties(family=_FAMILY))).get_charmap())


def _line_mm(points: float) -> float:
    return _LINE * points * _MM_PER_INCH / _POINTS_PER_INCH


def _put(page: Figure, text: str, x_mm: float, y_mm: float, points: float, **style: Any) -> None:
    """Put one line with its upper edge at `y_mm`."""
    baseline_mm = y_mm + 0.95 * points * _MM_PER_INCH / _POINTS_PER_INCH
    page.text(
        x_mm / WIDTH_MM,
        1.0 - baseline_mm / HEIGHT_MM,
        text,
        fontsize=points,
        family=_FAMILY,
        verticalalignment="baseline",
        parse_math=False,
        **style,
    )


def _box(
    x_mm: float, y_mm: float, width_mm: float, height_mm: float
) -> tuple[float, float, float, float]:
    return (
        x_mm / WIDTH_MM,
        1.0 - (y_mm + height_mm) / HEIGHT_MM,
        width_mm / WIDTH_MM,
        height_mm / HEIGHT_MM,
    )
