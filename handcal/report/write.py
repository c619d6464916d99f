"""Writing a report in all formats: PDF, HTML, and figures with their data."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from handcal.io.files import make_folder
from handcal.report.document import Report
from handcal.report.figures import write_figures
from handcal.report.html import write_html
from handcal.report.pdf import write_pdf


def write_report(
    folder: Path, report: Report, checkpoint: Callable[[float], None] = lambda _share: None
) -> tuple[Path, Path]:
    """Write report.pdf, report.html, figures/NAME.png and figures/NAME.csv, each atomically.

    Parameters
    ----------
    folder : Path
        Created if needed.
    report : Report
    checkpoint : callable
        Told the share done, many times a second; what it raises ends the writing.

    Returns
    -------
    tuple of Path
        The PDF and the HTML.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    pdf, html = make_folder(folder) / "report.pdf", folder / "report.html"
    write_pdf(pdf, report, lambda share: checkpoint(0.4 * share))
    write_html(html, report, lambda share: checkpoint(0.4 + 0.3 * share))
    write_figures(folder / "figures", report, lambda share: checkpoint(0.7 + 0.3 * share))
    checkpoint(1.0)
    return pdf, html
