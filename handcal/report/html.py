"""A report as a self-contained HTML file, with its figures beside it."""

from __future__ import annotations

from base64 import b64encode
from importlib.metadata import version
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from handcal.core.progress import Progress
from handcal.io.files import make_folder, write_atomic
from handcal.io.resources import resource_path
from handcal.report.document import Figure, Report, Table
from handcal.report.figures import draw_figure

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
