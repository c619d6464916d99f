"""Export of a session: all requested formats are written, then published together."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from importlib import import_module
from pathlib import Path

from handcal.core.errors import CancelledError, FileError
from handcal.core.progress import Progress
from handcal.export.clouds import write_clouds
from handcal.export.formats import FORMATS, TOOL_FORMATS, Format
from handcal.export.north_star import write_northstar
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.export.tables import (
    TableRow,
    table_rows,
    write_tables,
)
from handcal.export.tools import (
    write_calibration_json,
    write_calibration_yaml,
    write_openxr,
    write_slicer,
    write_unity,
)
from handcal.export.wearers import summarise_wearers, summary_rows, wearers_report
from handcal.io.closable import Closable
from handcal.io.files import make_folder, open_no_link, refuse_links, sync_folder, write_atomic
from handcal.io.lock import FileLock
from handcal.report.cells import rows_csv
from handcal.session.journal import JOURNAL_END
from handcal.session.session import Session, SessionRecord

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


MAX_ARCHIVE_BYTES = 4 * 2**30
_CHUNK_BYTES = 2**19


def write_archive(
    path: Path, record: SessionRecord, excluded: Path, progress: Progress = Progress()
) -> None:
    """Write a session's folder as a zip file, under its own name.

    Equal sessions give equal bytes: files are sorted and have no timestamps. Left out are locks,
    hidden and temporary files, links, and events recorded after the record was read, with the
    file that names the last one.

    Parameters
    ----------
    path : Path
    record : SessionRecord
    excluded : Path
        A folder to leave out if it lies in the session's: that of the exports.
    progress : Progress
        Reported to every half megabyte at the latest.

    Raises
    ------
    FileError
        If a file cannot be read or written, or the session exceeds 4 GiB.
    """
    folder = record.path.absolute()
    try:
        sizes = {
            found: 0 if found.is_dir() else found.stat().st_size
            for found in _contents(folder, excluded.absolute())
        }
        sizes[folder / "journal.jsonl"] = record.journal_bytes
        total_bytes = sum(sizes.values())
        if total_bytes > MAX_ARCHIVE_BYTES:
            raise FileError(
                f"{folder} has {total_bytes:,} bytes, more than the {MAX_ARCHIVE_BYTES:,} "
                "that fit in one zip file",
                "copy the folder instead",
            )
        with path.open("xb") as stream:
            done_bytes = 0
            with zipfile.ZipFile(stream, "w") as archive:
                for found, left_bytes in sizes.items():
                    name = found.relative_to(folder.parent).as_posix()
                    if found.is_dir():
                        archive.writestr(_entry(f"{name}/"), b"")
                        continue
                    with (
                        open(found, "rb", opener=open_no_link) as source,
                        archive.open(_entry(name), "w") as target,
                    ):
                        while chunk := source.read(min(left_bytes, _CHUNK_BYTES)):
                            target.write(chunk)
                            left_bytes -= len(chunk)
                            done_bytes += len(chunk)
                            progress.at(done_bytes / total_bytes)
            stream.flush()
            os.fsync(stream.fileno())
    except OSError as error:
        raise FileError(f"cannot write {path}: {error.strerror or error}") from error


def _contents(folder: Path, excluded: Path) -> Iterator[Path]:
    """Yield the files and folders in a session's folder, sorted."""
    for path in sorted(folder.iterdir()):
        if path.is_symlink() or path.name.startswith(".") or path == excluded:
            continue
        if path.is_dir():
            yield path
            yield from _contents(path, excluded)
        elif path.is_file() and path.name not in ("lock", JOURNAL_END):
            yield path


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name)  # dated 1980, so that the bytes do not depend on the time
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = (0o40755 << 16) | 0x10 if entry.is_dir() else 0o100644 << 16
    return entry


class Staging(Closable):
    """A hidden folder for new files of another, which is unchanged unless `publish` succeeds.

    Parameters
    ----------
    folder : Path
        Destination of the files; it need not exist.

    Attributes
    ----------
    path : Path
        Folder to write them to.

    Raises
    ------
    FileError
        If another program is exporting to the same folder, or it cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder.absolute()
        # In the folder itself if it exists: it may be a separate disk.
        home = next(path for path in (self._folder, *self._folder.parents) if path.exists())
        if not home.is_dir():
            raise FileError(f"cannot write to {self._folder}: {home} is a file, not a folder")
        self._root = home / f".{self._folder.name}.handcal-export"
        refuse_links(self._root, home)
        try:
            self._lock = FileLock(make_folder(self._root) / "lock")
        except FileError as error:  # it names a folder that nobody chose
            what = error.what.replace(str(self._root), str(self._folder))
            raise FileError(what, error.advice) from error
        self.path = self._root / "new"
        self._old = self._root / "old"
        try:
            for leftover in (self.path, self._old):
                if leftover.exists():
                    shutil.rmtree(leftover)
                leftover.mkdir()
        except OSError as error:
            self.close()
            raise FileError(f"cannot write to {self._folder}: {error.strerror or error}") from error

    def publish(self, replaced: Sequence[str]) -> tuple[Path, ...]:
        """Move the files into place and return their new paths, sorted.

        Parameters
        ----------
        replaced : sequence of str
            Patterns, relative to the folder, of the files to replace: matching files that are not
            among the new ones are removed.

        Raises
        ------
        FileError
            If a file cannot be moved or replaced, or a subfolder is a link; the folder is then
            unchanged.
        """
        names = sorted(
            path.relative_to(self.path) for path in self.path.rglob("*") if path.is_file()
        )
        try:
            if self._folder.exists():
                self._merge(names, replaced)
            else:
                make_folder(self._folder.parent)
                for folder in {(self.path / name).parent for name in names}:
                    sync_folder(folder)
                self.path.rename(self._folder)
                sync_folder(self._folder.parent)
        except OSError as error:
            raise FileError(
                f"cannot write to {self._folder}: {error.strerror or error} "
                f"({Path(error.filename or self._folder).name})"
            ) from error
        return tuple(self._folder / name for name in names)

    def close(self) -> None:
        """Remove unpublished files; safe to call twice."""
        self._lock.release()
        shutil.rmtree(self._root, ignore_errors=True)

    def _merge(self, names: Sequence[Path], replaced: Sequence[str]) -> None:
        """Move each file atomically into the existing folder; undo all moves if one fails."""
        stale = {
            path.relative_to(self._folder)
            for pattern in replaced
            for path in self._folder.glob(pattern)
        } - set(names)
        affected = [*names, *stale]
        for name in affected:
            refuse_links((self._folder / name).parent, self._folder)
            if os.path.lexists(self._folder / name):
                make_folder((self._old / name).parent)
                shutil.copy2(self._folder / name, self._old / name, follow_symlinks=False)
        try:
            for name in names:
                make_folder((self._folder / name).parent)
                (self.path / name).replace(self._folder / name)
            for name in stale:
                (self._folder / name).unlink()
            for folder in {(self._folder / name).parent for name in affected}:
                sync_folder(folder)
        except (OSError, FileError):
            for name in affected:
                # A file that cannot be put back, such as one open elsewhere, was not moved.
                with contextlib.suppress(OSError):
                    self._put_back(name)
            raise

    def _put_back(self, name: Path) -> None:
        if os.path.lexists(self._old / name):
            (self._old / name).replace(self._folder / name)
        else:
            (self._folder / name).unlink(missing_ok=True)


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
