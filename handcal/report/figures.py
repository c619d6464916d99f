"""A report's figures as images, with their data as CSV."""

from __future__ import annotations

import io
from dataclasses import dataclass

from matplotlib import rc_context

# matplotlib imports them by name, so that packagers would not find them.
from matplotlib.backends import backend_agg, backend_svg  # noqa: F401
from matplotlib.figure import Figure as Canvas

from handcal.report.document import Figure
from handcal.report.page import CONTENT_MM, MM_PER_INCH, add_strip
from handcal.report.rows import rows_csv

_DPI = 200


@dataclass(frozen=True, slots=True)
class FigureFiles:
    """The contents of a figure's files."""

    png: bytes
    svg: bytes
    """Images, as wide as the text of a page."""
    csv: bytes
    """Its data."""


def draw_figure(figure: Figure) -> FigureFiles:
    """Draw a figure once, and return it in each format."""
    canvas = Canvas(figsize=(CONTENT_MM / MM_PER_INCH, figure.height_mm / MM_PER_INCH))
    figure.draw(add_strip(canvas, (0.0, 0.0), figure))
    png, svg = io.BytesIO(), io.BytesIO()
    canvas.savefig(png, format="png", dpi=_DPI)
    with rc_context({"svg.hashsalt": "handcal", "svg.fonttype": "path"}):  # reproducible bytes
        canvas.savefig(svg, format="svg", dpi=_DPI, metadata={"Date": None})
    return FigureFiles(png.getvalue(), svg.getvalue(), rows_csv(figure.rows))
