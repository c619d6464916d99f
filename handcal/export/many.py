"""Export of several sessions: each into its own folder, and their numbers together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from handcal.core.errors import CancelledError, FileError
from handcal.core.progress import Progress
from handcal.export.export import ExportSettings, export_name, export_session, import_drawing
from handcal.export.formats import FORMATS
from handcal.export.outcome import SessionOutcome
from handcal.export.staging import Staging
from handcal.export.tables import TableRow, table_rows, write_tables
from handcal.export.wearers import summarise_wearers, summary_rows, wearers_report
from handcal.io.files import write_atomic
from handcal.report.rows import rows_csv
from handcal.session.session import Session


@dataclass(frozen=True, slots=True)
class Exported:
    """Result of an export of one or several sessions."""

    files: tuple[Path, ...]
    missing: tuple[str, ...] = ()
    """Sessions that were not exported, each with the reason."""
    sentence: str = ""
    """The results over wearers in words; empty for a single session."""


def export_sessions(
    paths: Sequence[Path], folder: Path, settings: ExportSettings, progress: Progress = Progress()
) -> Exported:
    """Export sessions, each into a folder named by its date and wearer, and all together.

    Beside these folders are parameters.csv, trials.csv and summary.csv over all sessions, and a
    report over wearers, as far as tables and reports are among the formats. A session that cannot
    be exported does not keep the others from it. If it is cancelled, the sessions exported before
    stay, and the files over all are those of these sessions.

    Parameters
    ----------
    paths : sequence of Path
        Sessions of different names, as in one folder.
    folder : Path
        Created if needed.
    settings : ExportSettings
    progress : Progress
        Its activity begins with the session's number and wearer.

    Raises
    ------
    CancelledError
        If it was cancelled before the first session was exported.
    FileError
        If the files over all sessions cannot be written.
    """
    files: list[Path] = []
    missing: list[str] = []
    together: dict[str, Mapping[str, Sequence[TableRow]]] = {}
    for done, path in enumerate(paths):
        part = progress.part(done / (len(paths) + 1), (done + 1) / (len(paths) + 1))
        number = f"{done + 1} of {len(paths)}"
        try:
            files += _export(path, folder, settings, part, number, together)
        except FileError as error:
            missing.append(f"{path.name}: {error}")
        except CancelledError:
            if not files:
                raise
            missing += (f"{one.name}: cancelled" for one in paths[done:])
            progress = Progress()
            break
    if not together:
        return Exported((), tuple(missing))
    tables: dict[str, list[TableRow]] = {}
    for each in together.values():
        for name, rows in each.items():
            tables.setdefault(name, []).extend(rows)
    last = progress.part(len(paths) / (len(paths) + 1), 1.0, "All sessions together")
    files += _export_together(tables, missing, folder, settings, last)
    return Exported(tuple(files), tuple(missing), summarise_wearers(tables).sentence)


def _export_together(
    tables: Mapping[str, Sequence[TableRow]],
    missing: Sequence[str],
    folder: Path,
    settings: ExportSettings,
    progress: Progress,
) -> tuple[Path, ...]:
    """Write the files over all sessions, and return them."""
    formats = [name for name in ("csv", "report", "html") if name in settings.formats]
    if not formats:
        return ()
    patterns = []
    with Staging(folder) as staging:
        if "csv" in formats:
            write_tables(staging.path, tables)
            rows = summary_rows(summarise_wearers(tables))
            write_atomic(staging.path / "summary.csv", rows_csv(rows))
            patterns += [*FORMATS["csv"].patterns, "summary.csv"]
        if formats != ["csv"]:
            import_drawing(progress)
            from handcal.report.html import write_html
            from handcal.report.pdf import write_pdf

            report = wearers_report(tables, missing)
            if "report" in formats:
                write_pdf(staging.path / "report.pdf", report, progress.part(0.0, 0.5))
                patterns += FORMATS["report"].patterns
            if "html" in formats:
                write_html(staging.path / "report.html", report, progress.part(0.5, 1.0))
                patterns += FORMATS["html"].patterns
        return staging.publish(patterns)


def _export(
    path: Path,
    folder: Path,
    settings: ExportSettings,
    progress: Progress,
    number: str,
    together: dict[str, Mapping[str, Sequence[TableRow]]],
) -> tuple[Path, ...]:
    """Export one session, and add its tables to `together`, by the name of its folder."""
    progress.at(0.0, f"{number}: {path.name}")
    record = Session.open(path)
    if not record.is_solvable:
        raise FileError("it has no alignments", "calibrate this wearer, or delete the session")
    called = f"{number}: {record.wearer or path.name}"

    def report(doing: str, share: float) -> None:
        progress.report(f"{called}, {doing[:1].lower()}{doing[1:]}", share)

    def collect(outcome: SessionOutcome) -> None:
        together[name] = table_rows(outcome)

    name = export_name(record)
    if name in together:  # begun within the same minute
        name = f"{name}-{record.path.absolute().name}"
    return export_session(
        record, folder / name, settings, replace(progress, report=report), collect
    )
