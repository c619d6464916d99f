"""A report's figures as files: images, and their data as CSV."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, Literal

from matplotlib import rc_context

# matplotlib imports them by name, so that packagers would not find them.
from matplotlib.backends import backend_agg, backend_svg  # noqa: F401
from matplotlib.figure import Figure as Canvas

from handcal.io.files import make_folder, write_atomic
from handcal.progress import Progress
from handcal.report.document import Figure, Report
from handcal.report.page import CONTENT_MM, MM_PER_INCH, add_strip
from handcal.report.rows import rows_csv

_DPI = 200


def write_figures(folder: Path, report: Report, progress: Progress) -> None:
    """Write NAME.png and NAME.csv for each of a report's figures.

    Parameters
    ----------
    folder : Path
        Created if there is any figure.
    report : Report
    progress : Progress
        Told the share done before each figure.
    """
    for done, figure in enumerate(report.figures):
        progress.at(done / len(report.figures))
        make_folder(folder)
        write_atomic(folder / f"{figure.name}.png", picture(figure, "png"))
        write_atomic(folder / f"{figure.name}.csv", rows_csv(figure.rows))


def picture(figure: Figure, kind: Literal["png", "svg"]) -> bytes:
    """Return a figure as an image, as wide as the text of a page."""
    canvas = Canvas(figsize=(CONTENT_MM / MM_PER_INCH, figure.height_mm / MM_PER_INCH))
    figure.draw(add_strip(canvas, (0.0, 0.0), figure))
    stream = io.BytesIO()
    metadata: dict[str, Any] = {"Date": None} if kind == "svg" else {}
    with rc_context({"svg.hashsalt": "handcal", "svg.fonttype": "path"}):  # reproducible bytes
        canvas.savefig(stream, format=kind, dpi=_DPI, metadata=metadata)
    return stream.getvalue()
