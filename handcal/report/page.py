"""Layout of A4 pages with matplotlib: headings, wrapped text, tables and axes.

Text is set literally, never as mathtext, and wrapped by its measured width, so that no name or note
can break a page. Lengths are in millimetres from the upper left corner.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Page
from matplotlib.font_manager import FontEntry, FontProperties, findfont, fontManager, get_font
from matplotlib.lines import Line2D

from handcal.report.document import Column, Figure

WIDTH_MM, HEIGHT_MM = 210.0, 297.0
_MARGIN_MM = 18.0
_TOP_MM, _BOTTOM_MM = 18.0, 20.0
CONTENT_MM = WIDTH_MM - 2 * _MARGIN_MM
MM_PER_INCH, _POINTS_PER_INCH = 25.4, 72.0
_LINE = 1.35
_FAMILY = "DejaVu Sans"
_PLACEHOLDERS = "Last Resort"
"""Beginning of the name of matplotlib's font that has a box for every character."""
_TABLE_PT, _TEXT_PT = 7.5, 9.0
_CELL_PAD_MM = 1.2
_GREY = "0.45"
_NO_BREAK = "\u00a0"
# Number of characters of a cell that count for its column's width.
_MEASURED = 300
# Most lines shown of a cell.
_CELL_LINES = 20
_CAPTION_MM = 9.0
# Space inside a cell of axes for tick labels and titles.
_AXES_RIGHT_MM, _AXES_TOP_MM, _AXES_BOTTOM_MM = 3.0, 6.0, 10.0


class Document:
    """Pages filled from the top; content that does not fit continues on the next page.

    Parameters
    ----------
    footer : str
        Printed at the bottom of every page, left of its number.
    """

    def __init__(self, footer: str) -> None:
        self._footer = footer
        self._pages: list[Page] = []
        self.new_page()

    def new_page(self) -> None:
        """Start a page."""
        inches = WIDTH_MM / MM_PER_INCH, HEIGHT_MM / MM_PER_INCH
        self._pages.append(Page(figsize=inches))
        self._y_mm = _TOP_MM

    def finish(self) -> list[Page]:
        """Add page numbers and return the pages."""
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
        """Set a section's heading, on the next page unless `room_mm` remain below it."""
        self._need(room_mm)
        if self._y_mm > _TOP_MM:
            self.space(5.0)
        self.text(text, points=12.5, weight="bold")
        self.space(1.5)

    def text(
        self, text: str, points: float = _TEXT_PT, weight: str = "normal", color: str = "black"
    ) -> None:
        """Set paragraphs of text across the page."""
        for line in _wrap(text, points, weight, CONTENT_MM):
            self._need(_line_mm(points))
            _put(self._pages[-1], line, _MARGIN_MM, self._y_mm, points, weight=weight, color=color)
            self._y_mm += _line_mm(points)

    def caption(self, text: str) -> None:
        """Set the caption below a figure or table."""
        self.text(text, points=_TABLE_PT, color="0.3")
        self.space(2.5)

    def space(self, height_mm: float) -> None:
        """Leave vertical space."""
        self._y_mm += height_mm

    def table(self, columns: Sequence[Column], rows: Sequence[Sequence[str]]) -> None:
        """Set a table across the page; its header is repeated on every page."""
        head = [column.title for column in columns]
        widths_mm = _column_widths_mm(columns, [head, *rows])

        def set_head() -> None:
            if any(head):
                self._row(columns, widths_mm, head, weight="bold")

        if rows:  # the header stays with the first row
            first_mm = _row_height_mm(widths_mm, rows[0])
            self._need(_row_height_mm(widths_mm, head, weight="bold") + first_mm)
        set_head()
        for row in rows:
            if self._y_mm + _row_height_mm(widths_mm, row) > HEIGHT_MM - _BOTTOM_MM:
                self.new_page()
                set_head()
            self._row(columns, widths_mm, row)
        self.space(1.5)

    def axes(self, figure: Figure) -> list[Axes]:
        """Return the axes of a figure, side by side across the page."""
        self._need(figure.height_mm + _CAPTION_MM)
        found = add_strip(self._pages[-1], (_MARGIN_MM, self._y_mm), figure)
        self._y_mm += figure.height_mm
        return found

    def _need(self, height_mm: float) -> None:
        if self._y_mm + height_mm > HEIGHT_MM - _BOTTOM_MM:
            self.new_page()

    def _row(
        self,
        columns: Sequence[Column],
        widths_mm: Sequence[float],
        cells: Sequence[str],
        weight: str = "normal",
    ) -> None:
        height_mm = _row_height_mm(widths_mm, cells, weight)
        self._need(height_mm)
        left_mm = _MARGIN_MM
        for column, width_mm, cell in zip(columns, widths_mm, cells, strict=True):
            x_mm = left_mm + (width_mm - _CELL_PAD_MM if column.align == "right" else _CELL_PAD_MM)
            lines = _cell_lines(cell, weight, width_mm)
            for number, line in enumerate(lines):
                y_mm = self._y_mm + _CELL_PAD_MM + number * _line_mm(_TABLE_PT)
                style = {"weight": weight, "ha": column.align}
                _put(self._pages[-1], line, x_mm, y_mm, _TABLE_PT, **style)
            left_mm += width_mm
        self._y_mm += height_mm
        self._rule(self._y_mm, "0.85" if weight == "normal" else "black", self._pages[-1])

    @staticmethod
    def _rule(y_mm: float, color: str, page: Page) -> None:
        y = 1.0 - y_mm / HEIGHT_MM
        ends = _MARGIN_MM / WIDTH_MM, 1.0 - _MARGIN_MM / WIDTH_MM
        page.add_artist(Line2D(ends, (y, y), color=color, linewidth=0.5))


def add_strip(canvas: Page, corner_mm: tuple[float, float], figure: Figure) -> list[Axes]:
    """Add a figure's axes side by side, `CONTENT_MM` wide, to a page or canvas.

    Parameters
    ----------
    canvas : matplotlib.figure.Figure
    corner_mm : tuple of float
        Upper left corner of the axes, relative to the canvas.
    figure : Figure
    """
    canvas_mm = canvas.get_size_inches() * MM_PER_INCH
    (x_mm, y_mm), width_mm = corner_mm, CONTENT_MM / figure.columns
    size_mm = np.array(
        [
            width_mm - figure.left_mm - _AXES_RIGHT_MM,
            figure.height_mm - _AXES_TOP_MM - _AXES_BOTTOM_MM,
        ]
    )
    found = []
    for column in range(figure.columns):
        left_mm = x_mm + column * width_mm + figure.left_mm
        bottom_mm = canvas_mm[1] - y_mm - figure.height_mm + _AXES_BOTTOM_MM
        axes = canvas.add_axes((*([left_mm, bottom_mm] / canvas_mm), *(size_mm / canvas_mm)))
        axes.tick_params(labelsize=7.0)
        axes.spines[["top", "right"]].set_visible(False)
        found.append(axes)
    return found


def plain(text: str) -> str:
    """Return a text without control characters, and with the codes of those that no font has.

    By their codes, wearers with such names can be told apart.
    """
    return "".join(map(_plain_char, text))


def families(text: str) -> list[str]:
    """Return the report's font, and those of the system for characters that it lacks."""
    return list(dict.fromkeys((_FAMILY, *filter(None, map(_family_of, text)))))


def _wrap(text: str, points: float, weight: str, width_mm: float) -> list[str]:
    """Break a text into lines that fit, within words if necessary; at least one line."""
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


def _column_widths_mm(columns: Sequence[Column], rows: Sequence[Sequence[str]]) -> list[float]:
    """Return widths that fill the page, by the cells' needs; long cells break between words."""
    pad_mm = 2 * _CELL_PAD_MM + 0.5  # margin, so that rounding does not break a line
    least_mm, most_mm = [], []
    for cells in zip(*rows, strict=True):
        texts = [plain(cell)[:_MEASURED] for cell in cells]
        words = [word for text in texts for word in text.split(" ")]
        least_mm.append(pad_mm + max((_width_mm(w, _TABLE_PT, "bold") for w in words), default=0.0))
        most_mm.append(pad_mm + max(_width_mm(text, _TABLE_PT, "bold") for text in texts))
    left_mm = CONTENT_MM - sum(most_mm)
    if sum(least_mm) > CONTENT_MM:
        return [CONTENT_MM * width_mm / sum(least_mm) for width_mm in least_mm]
    if left_mm < 0.0:
        share = (CONTENT_MM - sum(least_mm)) / (sum(most_mm) - sum(least_mm))
        pairs = zip(least_mm, most_mm, strict=True)
        return [least + share * (most - least) for least, most in pairs]
    if columns[-1].align == "left":
        return [*most_mm[:-1], most_mm[-1] + left_mm]
    return [width_mm + left_mm / len(columns) for width_mm in most_mm]


def _cell_lines(cell: str, weight: str, width_mm: float) -> list[str]:
    lines = _wrap(cell, _TABLE_PT, weight, width_mm - 2 * _CELL_PAD_MM)
    return lines if len(lines) <= _CELL_LINES else [*lines[: _CELL_LINES - 1], "…"]


def _row_height_mm(
    widths_mm: Sequence[float], cells: Sequence[str], weight: str = "normal"
) -> float:
    lines = max(
        len(_cell_lines(cell, weight, width_mm))
        for cell, width_mm in zip(cells, widths_mm, strict=True)
    )
    return lines * _line_mm(_TABLE_PT) + 2 * _CELL_PAD_MM


def _width_mm(text: str, points: float, weight: str) -> float:
    """Return the printed width of a text, without kerning."""
    return sum(_char_width_mm(char, weight) for char in text) * points


@lru_cache(maxsize=4096)
def _char_width_mm(char: str, weight: str) -> float:
    """Return the width of a character of one point."""
    family = _family_of(char) or _FAMILY
    properties = FontProperties(family=family, weight=weight if family == _FAMILY else "normal")
    font = get_font(findfont(properties))
    font.set_size(100.0, _POINTS_PER_INCH)
    advance: int = font.load_char(ord(char)).linearHoriAdvance
    return advance / 2**16 / 100.0 * MM_PER_INCH / _POINTS_PER_INCH


@lru_cache(maxsize=4096)
def _plain_char(char: str) -> str:
    if char == _NO_BREAK:
        return char
    if not char.isprintable():
        return " " if char.isspace() else "\ufffd"
    return char if _family_of(char) else f"[U+{ord(char):04X}]"


@lru_cache(maxsize=4096)
def _family_of(char: str) -> str:
    """Return the report's font, or one of the system that has a character; empty if none has."""
    if get_font(findfont(FontProperties(family=_FAMILY))).get_char_index(ord(char)):
        return _FAMILY
    regular = (font for font in fontManager.ttflist if font.style == "normal")
    fonts = sorted(regular, key=lambda font: ("Sans" not in font.name, font.name))
    return next((font.name for font in fonts if _has(font, char)), "")


def _has(font: FontEntry, char: str) -> bool:
    if font.weight != 400 or font.name.startswith(_PLACEHOLDERS):
        return False
    return bool(get_font(font.fname).get_char_index(ord(char)))


def _line_mm(points: float) -> float:
    return _LINE * points * MM_PER_INCH / _POINTS_PER_INCH


def _put(page: Page, text: str, x_mm: float, y_mm: float, points: float, **style: Any) -> None:
    """Draw one line with its upper edge at `y_mm`."""
    family = families(text)
    if len(family) > 1:  # the others may have no bold font
        style["weight"] = "normal"
    baseline_mm = y_mm + 0.95 * points * MM_PER_INCH / _POINTS_PER_INCH
    page.text(
        x_mm / WIDTH_MM,
        1.0 - baseline_mm / HEIGHT_MM,
        text,
        fontsize=points,
        family=family,
        verticalalignment="baseline",
        parse_math=False,
        **style,
    )
