"""A report as PDF."""

from __future__ import annotations

import io
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure as Page

from handcal.core.progress import Progress
from handcal.io.files import write_atomic
from handcal.report.document import Figure, Item, Report, Table
from handcal.report.page import Document, plain

# Space needed by a heading, and by the content that must follow it.
_HEADING_MM, _PARAGRAPH_MM, _TABLE_MM = 15.0, 12.0, 25.0


def write_pdf(path: Path, report: Report, progress: Progress) -> None:
    """Write a report as PDF, A4, with embedded fonts.

    Parameters
    ----------
    path : Path
    report : Report
    progress : Progress
        Told the share done before each item and page.
    """
    pages = compose(report, progress.part(0.0, 0.4))
    stream = io.BytesIO()
    # TrueType, as publishers refuse Type 3; images at 200 dots per inch.
    with rc_context({"pdf.fonttype": 42, "savefig.dpi": 200}):
        pdf: Any = PdfPages(stream, metadata=_metadata(report))
        for done, page in enumerate(pages):
            progress.at(0.4 + 0.5 * done / len(pages))
            pdf.savefig(page)
        progress.at(0.9)
        pdf.close()  # not after an error, when it would continue writing
    write_atomic(path, stream.getvalue())


def compose(report: Report, progress: Progress) -> list[Page]:
    """Return the report's pages; parameters as in `write_pdf`."""
    document = Document(report.subject)
    document.title(report.title)
    document.text(report.lead, points=11.0)
    document.space(4.0)
    count = sum(len(section.items) for section in report.sections)
    done = 0
    for section in report.sections:
        if section.starts_page:
            document.new_page()
        if section.title:
            document.heading(section.title, _HEADING_MM + _room_mm(section.items))
        for item in section.items:
            progress.at(done / count)
            done += 1
            _set(document, item)
    return document.finish()


def _set(document: Document, item: Item) -> None:
    match item:
        case Table():
            document.table(item.columns, item.rows)
        case Figure():
            item.draw(document.axes(item))
        case _:
            document.text(item)
            document.space(1.5)
            return
    if item.caption:
        document.caption(item.caption)


def _room_mm(items: Sequence[Item]) -> float:
    """Return the space for the content that must stay with a heading: up to a table or figure."""
    room_mm = 0.0
    for item in items:
        match item:
            case Figure():
                return room_mm + item.height_mm
            case Table():
                return room_mm + _TABLE_MM
        room_mm += _PARAGRAPH_MM
    return room_mm


def _metadata(report: Report) -> dict[str, str]:
    return {
        "Title": plain(f"{report.title}: {report.subject}"),
        "Subject": plain(report.subject),
        "Creator": f"handcal {version('handcal')}",
    }
