"""Export of several sessions, each into its own folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from handcal.core.errors import CancelledError, FileError
from handcal.core.progress import Progress
from handcal.export.export import ExportSettings, export_session
from handcal.session.session import Session


@dataclass(frozen=True, slots=True)
class Exported:
    """Result of an export of one or several sessions."""

    files: tuple[Path, ...]
    missing: tuple[str, ...] = ()
    """Sessions that were not exported, each with the reason."""


def export_sessions(
    paths: Sequence[Path], folder: Path, settings: ExportSettings, progress: Progress = Progress()
) -> Exported:
    """Export sessions, each into a folder of its name.

    A session that cannot be exported does not keep the others from it. If it is cancelled, the
    sessions exported before stay.

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
    """
    files: list[Path] = []
    missing: list[str] = []
    for done, path in enumerate(paths):
        try:
            files += _export(path, folder, settings, progress, done, len(paths))
        except FileError as error:
            missing.append(f"{path.name}: {error}")
        except CancelledError:
            if not files:
                raise
            missing += (f"{one.name}: cancelled" for one in paths[done:])
            break
    return Exported(tuple(files), tuple(missing))


def _export(
    path: Path, folder: Path, settings: ExportSettings, progress: Progress, done: int, count: int
) -> tuple[Path, ...]:
    name = f"{done + 1} of {count}: {path.name}"
    progress.at(done / count, name)
    record = Session.open(path)
    if not record.is_solvable:
        raise FileError("it has no alignments")
    name = f"{done + 1} of {count}: {record.wearer or path.name}"

    def report(what: str, share: float) -> None:
        progress.report(f"{name}, {what[:1].lower()}{what[1:]}", share)

    part = replace(progress, report=report).part(done / count, (done + 1) / count)
    return export_session(record, folder / path.name, settings, part)
