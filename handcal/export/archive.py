"""The session folder as one zip file; extracting it restores the session."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterator
from pathlib import Path

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.io.files import open_no_link
from handcal.session.journal import JOURNAL_END
from handcal.session.session import SessionRecord

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
