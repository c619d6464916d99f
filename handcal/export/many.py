"""Export of several sessions, each into its own folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from handcal.errors import FileError
from handcal.export.export import ExportSettings, export_session
from handcal.progress import Progress
from handcal.session.session import Session


def export_sessions(
    paths: Sequence[Path], folder: Path, settings: ExportSettings, progress: Progress = Progress()
) -> tuple[Path, ...]:
    """Export sessions, each into a folder of its name, and return the files.

    A session that cannot be exported does not keep the others from it.

    Parameters
    ----------
    paths : sequence of Path
        Sessions of different names, as in one folder.
    folder : Path
        Created if needed.
    settings : ExportSettings
    progress : Progress

    Raises
    ------
    CancelledError
        If it was cancelled; the sessions exported before stay.
    FileError
        After all others are exported, if one could not be; it names each with the reason.
    """
    files: list[Path] = []
    failed: list[str] = []
    for done, path in enumerate(paths):
        part = progress.part(done / len(paths), (done + 1) / len(paths))
        try:
            record = Session.open(path)
            if not record.alignments:
                raise FileError("it has no alignments")
            files += export_session(record, folder / path.name, settings, part)
        except FileError as error:
            failed.append(f"{path.name}: {error}")
    if failed:
        count = len(paths) - len(failed)
        raise FileError(f"{count} of {len(paths)} exported; not exported: {'; '.join(failed)}")
    return tuple(files)
