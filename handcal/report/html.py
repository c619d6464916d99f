"""A report as a self-contained HTML file."""

from __future__ import annotations

from base64 import b64encode
from importlib.metadata import version
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from handcal.io.files import write_atomic
from handcal.io.resources import resource_path
from handcal.progress import Progress
from handcal.report.document import Figure, Report, Table
from handcal.report.figures import picture
from handcal.report.rows import rows_csv

_NO_BREAK = "\u00a0"


def write_html(path: Path, report: Report, progress: Progress) -> None:
    """Write a report as HTML with embedded figures and data.

    Parameters
    ----------
    path : Path
    report : Report
    progress : Progress
        Told the share done before each figure.
    """
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
    done = 0

    def drawn(figure: Figure) -> str:
        nonlocal done
        progress.at(done / len(report.figures))
        done += 1
        return _data_url("image/svg+xml", picture(figure, "svg"))

    text = environment.get_template(template.name).render(
        report=report,
        drawn=drawn,
        raw=lambda figure: _data_url("text/csv", rows_csv(figure.rows)),
        version=version("handcal"),
    )
    write_atomic(path, text.encode())


def _data_url(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{b64encode(content).decode()}"


def _printable(value: object) -> object:
    """Return a text without characters that cannot be shown, such as control characters."""
    if not isinstance(value, str) or value.isprintable():
        return value
    return "".join(
        char if char.isprintable() or char in ("\n", _NO_BREAK) else "\ufffd" for char in value
    )
