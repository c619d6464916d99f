"""Export of a session: all requested formats are written, then published together."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from importlib import import_module
from pathlib import Path

from handcal.core.progress import Progress
from handcal.export.archive import write_archive
from handcal.export.calibration_file import write_calibration_json, write_calibration_yaml
from handcal.export.clouds import write_clouds
from handcal.export.formats import FORMATS, TOOL_FORMATS, Format
from handcal.export.north_star import write_northstar
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.export.staging import Staging
from handcal.export.tables import table_rows, write_tables
from handcal.export.tools import write_openxr, write_slicer, write_unity
from handcal.session.session import SessionRecord

_ALL = {**FORMATS, **TOOL_FORMATS}
_NAME_CHARACTERS = 40


@dataclass(frozen=True, slots=True)
class ExportSettings:
    """Settings of an export."""

    formats: tuple[Format, ...] = tuple(FORMATS)
    """A selection of `FORMATS` and `TOOL_FORMATS`."""
    near_m: float = 0.1
    far_m: float = 100.0
    """Clipping distances of the OpenGL and Unity matrices."""
    northstar_into: Path | None = None
    """A North Star configuration whose other contents are kept."""

    def __post_init__(self) -> None:
        unknown = [name for name in self.formats if name not in _ALL]
        if unknown or not self.formats:
            raise ValueError(f"choose formats from {', '.join(_ALL)}")
        if not 0.0 < self.near_m < self.far_m < float("inf"):
            raise ValueError(
                f"0 < near_m < far_m is needed, got {self.near_m:g} and {self.far_m:g}"
            )


def export_session(
    record: SessionRecord,
    folder: Path,
    settings: ExportSettings,
    progress: Progress = Progress(),
    collect: Callable[[SessionOutcome], object] = lambda _: None,
) -> tuple[Path, ...]:
    """Export a session into a folder, and return the files.

    The files appear together when all are complete, and replace those of an earlier export of the
    same formats; after an error the folder is unchanged.

    Parameters
    ----------
    record : SessionRecord
    folder : Path
        Created if needed. Use one folder for each session: file names are fixed.
    settings : ExportSettings
    progress : Progress
        Reported to many times a second; while solving, before each alignment.
    collect : callable, optional
        Called with the session's outcome once its files are in place.

    Raises
    ------
    CancelledError
        If it was cancelled.
    FileError
        If the session cannot be solved, or a file cannot be written or replaced.
    """
    formats = [name for name in _ALL if name in settings.formats]
    with Staging(folder) as staging:
        outcome = load_outcome(record, _part(progress, 0, formats))
        for done, name in enumerate(formats, 1):
            part = _part(progress, done, formats)
            part.at(0.0)
            _write(name, outcome, staging.path, folder, settings, part)
        progress.at(1.0, "Moving the files in place")
        files = staging.publish([pattern for name in formats for pattern in _ALL[name].patterns])
    collect(outcome)
    return files


def export_name(record: SessionRecord) -> str:
    """Return the name of the folder for a session's files: begun, local time, and the wearer."""
    try:
        begun = datetime.fromisoformat(record.events[0].time).astimezone()
    except (ValueError, OverflowError):  # of a damaged journal
        return record.path.absolute().name
    wearer = re.sub(r"[^\w.-]+", "_", record.wearer)[:_NAME_CHARACTERS].strip("._")
    return f"{begun:%Y-%m-%d-%H%M}-{wearer or 'not-named'}"


def _part(progress: Progress, done: int, formats: Sequence[Format]) -> Progress:
    """Return the progress of one part: solving, or one format, which its messages name.

    Solving counts towards the first format, because the user asked for files.
    """
    number, parts = max(done, 1), 1 + len(formats)
    title = f"Exporting {number} of {len(formats)}, {_ALL[formats[number - 1]].title}"

    def report(what: str, share: float) -> None:
        progress.report(f"{title}: {what[0].lower()}{what[1:]}" if what else title, share)

    return replace(progress, report=report).part(done / parts, (done + 1) / parts)


def _write(
    name: Format,
    outcome: SessionOutcome,
    place: Path,
    folder: Path,
    settings: ExportSettings,
    progress: Progress,
) -> None:
    """Write the files of one format, destined for `folder`, into `place`."""
    match name:
        case "report" | "html":
            import_drawing(progress)
            from handcal.export.report import session_report
            from handcal.report.html import write_html
            from handcal.report.pdf import write_pdf

            report = session_report(outcome)
            if name == "report":
                write_pdf(place / "report.pdf", report, progress)
            else:
                write_html(place / "report.html", report, progress)
        case "csv":
            write_tables(place, table_rows(outcome))
        case "yaml":
            write_calibration_yaml(place / "calibration.yaml", outcome)
        case "json":
            write_calibration_json(
                place / "calibration.json", outcome, settings.near_m, settings.far_m
            )
        case "ply":
            write_clouds(place / "clouds", outcome, progress)
        case "zip":
            write_archive(place / "session.zip", outcome.record, folder, progress)
        case "unity":
            write_unity(place / "unity.json", outcome, settings.near_m, settings.far_m)
        case "openxr":
            write_openxr(place / "openxr.json", outcome)
        case "northstar":
            write_northstar(place, outcome, settings.northstar_into)
        case "slicer":
            write_slicer(place / "slicer", outcome, progress)


def import_drawing(progress: Progress) -> None:
    """Import what draws reports; where matplotlib first lists all fonts, that takes up to 20 s."""
    from matplotlib import get_cachedir

    lists = Path(get_cachedir()).glob("fontlist-*.json")
    if "matplotlib.font_manager" not in sys.modules and not any(lists):
        progress.at(0.0, "Preparing fonts, once on this computer")
    for heavy in ("matplotlib.figure", "matplotlib.backends.backend_pdf", "jinja2"):
        import_module(heavy)
        progress.check()
