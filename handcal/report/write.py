"""Writing a report in all formats: PDF, HTML, and figures with their data."""

from __future__ import annotations

from pathlib import Path

from handcal.core.progress import Progress
from handcal.io.files import make_folder
from handcal.report.document import Report
from handcal.report.html import write_html
from handcal.report.pdf import write_pdf


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
