"""A report as a self-contained HTML file with its figures beside it, and in all formats at once."""

from __future__ import annotations

import io
from base64 import b64encode
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib import rc_context

# matplotlib imports them by name, so that packagers would not find them.
from matplotlib.backends import backend_agg, backend_svg  # noqa: F401
from matplotlib.figure import Figure as Canvas

from handcal.core.progress import Progress
from handcal.io.files import make_folder, write_atomic
from handcal.io.resources import resource_path
from handcal.report.cells import rows_csv
from handcal.report.document import Figure, Report, Table
from handcal.report.page import CONTENT_MM, MM_PER_INCH, add_strip
from handcal.report.pdf import write_pdf

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


_NO_BREAK = "\u00a0"


def write_html(path: Path, report: Report, progress: Progress) -> None:
    """Write a report as HTML with embedded figures and data.

    The figures are also written beside it, as figures/NAME.png and figures/NAME.csv.

    Parameters
    ----------
    path : Path
    report : Report
    progress : Progress
        Told the share done before each figure.
    """
    drawn = {}
    for done, figure in enumerate(report.figures):
        progress.at(done / len(report.figures))
        drawn[figure.name] = draw_figure(figure)
    template = resource_path("report.html.jinja")
    environment = Environment(
        loader=FileSystemLoader(template.parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_printable,
    )
    environment.tests |= {
        "table": lambda item: isinstance(item, Table),
        "figure": lambda item: isinstance(item, Figure),
    }
    text = environment.get_template(template.name).render(
        report=report,
        drawn=lambda figure: _data_url("image/svg+xml", drawn[figure.name].svg),
        raw=lambda figure: _data_url("text/csv", drawn[figure.name].csv),
        version=version("handcal"),
    )
    write_atomic(path, text.encode())
    for name, files in drawn.items():
        folder = make_folder(path.parent / "figures", path.parent)
        write_atomic(folder / f"{name}.png", files.png)
        write_atomic(folder / f"{name}.csv", files.csv)


def _data_url(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{b64encode(content).decode()}"


def _printable(value: object) -> object:
    """Return a text without characters that cannot be shown, such as control characters."""
    if not isinstance(value, str) or value.isprintable():
        return value
    return "".join(
        char if char.isprintable() or char in ("\n", _NO_BREAK) else "\ufffd" for char in value
    )


def write_report(
    folder: Path, report: Report, progress: Progress = Progress()
) -> tuple[Path, Path]:
    """Write report.pdf, report.html, figures/NAME.png and figures/NAME.csv, each atomically.

    Parameters
    ----------
    folder : Path
        Created if needed.
    report : Report
    progress : Progress
        Told the share done before each item, page and figure.

    Returns
    -------
    tuple of Path
        The PDF and the HTML.

    Raises
    ------
    CancelledError
    FileError
        If a file cannot be written.
    """
    pdf, html = make_folder(folder) / "report.pdf", folder / "report.html"
    write_pdf(pdf, report, progress.part(0.0, 0.4))
    write_html(html, report, progress.part(0.4, 1.0))
    progress.at(1.0)
    return pdf, html


def may_be_replaced(file: Path) -> bool:
    """Return whether a PDF or HTML is empty, or was written by `write_report`."""
    marks = b"/Creator (handcal ", b'name="generator" content="handcal '
    try:
        content = file.read_bytes()
    except OSError:
        return False
    return not content or any(mark in content for mark in marks)
