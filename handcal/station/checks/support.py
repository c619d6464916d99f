"""One file to send with a bug report: doctor, versions, log without names, frames if wanted."""

from __future__ import annotations

import getpass
import importlib.metadata
import os
import re
import zipfile
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.io.configuration import configuration_folder
from handcal.io.files import make_folder, read_json, read_limited, sync_folder
from handcal.session.library import DELETED, read_library
from handcal.station.checks.doctor import Finding, examine

MAX_FRAMES_BYTES = 512 * 2**20
_MAX_LOG_BYTES = 4 * 2**20
_LOGS = ("handcal.log", "handcal.log.1")
_NAME, _USER, _HOME = "[wearer]", "[user]", "~"
_ABOUT = """\
Made by handcal for a bug report.

doctor.txt     the checks of handcal doctor
versions.txt   installed packages and their versions
handcal.log    the log; names of wearers, of the user and the home folder are replaced
frames/        recorded frames of the camera, only if they were added; they show hand and room

Nothing of a session, of the preferences or of a pairing key is in here.
"""


@dataclass(frozen=True, slots=True)
class SupportSettings:
    """Contents of a support bundle."""

    log_folder: Path
    """Folder of the desktop program's log and preferences."""
    session_folder: Path | None = None
    """Folder of sessions, read only for the names of wearers to take out. It may be missing or
    empty: no session may have been made yet."""
    sessions: tuple[Path, ...] = ()
    """Further folders for it, each with at least one session: a wrong one would leave the names."""
    frames: Path | None = None
    """Recording, a file or a folder, to add."""


def default_settings() -> SupportSettings:
    """Return the settings for this user's log, with the session folder of the preferences."""
    folder = configuration_folder()
    try:
        station = read_json(folder / "preferences.json").get("station")
    except FileError:
        station = None
    named = station.get("sessions") if isinstance(station, dict) else None
    return SupportSettings(folder, Path(named) if isinstance(named, str) and named else None)


def run_support(
    output: Path, settings: SupportSettings, progress: Progress = Progress()
) -> tuple[str, ...]:
    """Write a support bundle, a ZIP file, and return the names of what it holds.

    The file appears when it is complete.

    Parameters
    ----------
    output : Path
        Replaced if it exists.
    settings : SupportSettings
    progress : Progress

    Raises
    ------
    FileError
        If it cannot be written, one of `sessions` holds no session, or the frames are missing or
        larger than 512 MiB.
    CancelledError
        If it was cancelled.
    """
    frames = _frames(settings.frames)
    progress.at(0.0, "Looking for names")
    names = known_names(settings)
    progress.at(0.2, "Checking the installation")
    texts = {
        "README.txt": _ABOUT,
        "doctor.txt": "\n".join(map(_line, examine())),
        "versions.txt": "\n".join(_versions()),
    }
    for name in _LOGS:
        with suppress(FileError):
            log = read_limited(settings.log_folder / name, _MAX_LOG_BYTES)
            texts[name] = log.decode(errors="replace")
    part = output.with_name(f".{output.name}.part")
    make_folder(output.absolute().parent)
    try:
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as bundle:
            for name, text in texts.items():
                bundle.writestr(name, without_names(text, names))
            for done, (file, name) in enumerate(frames):
                progress.at(0.4 + 0.6 * done / len(frames), "Adding frames")
                bundle.write(file, name)
            written = tuple(bundle.namelist())
        part.replace(output)
        sync_folder(output.absolute().parent)
    except OSError as error:
        raise FileError(f"cannot write {output}: {error.strerror or error}") from error
    finally:
        part.unlink(missing_ok=True)
    return written


def known_names(settings: SupportSettings) -> frozenset[str]:
    """Return the wearers' names in the journals of all sessions.

    Raises
    ------
    FileError
        If one of `sessions` is missing or holds no session.
    """
    names: set[str] = set()
    own = (settings.session_folder,) if settings.session_folder else ()
    for folder in (*own, *settings.sessions):
        entries = (*read_library(folder), *read_library(folder / DELETED))
        if not entries and folder in settings.sessions:
            what = "holds no session" if folder.is_dir() else "is not a folder"
            raise FileError(
                f"{folder} {what}, so that the names of its wearers would stay in the log",
                "give the folder in which the sessions are",
            )
        for entry in entries:
            names |= {entry.wearer, *entry.former_wearers}
    return frozenset(names - {""})


def without_names(text: str, names: Collection[str]) -> str:
    """Return a text with wearers' names, the user's name and the home folder replaced.

    Names are found as whole words, in upper or lower case.
    """
    with suppress(RuntimeError):  # no home folder
        text = text.replace(str(Path.home()), _HOME)
    for name in sorted(names, key=len, reverse=True):  # a longer one may contain a shorter
        text = _replaced(text, name, _NAME)
    with suppress(OSError, KeyError, ImportError):  # no user's name
        text = _replaced(text, getpass.getuser(), _USER)
    return text


def _replaced(text: str, name: str, by: str) -> str:
    return re.sub(rf"(?<!\w){re.escape(name)}(?!\w)", by, text, flags=re.IGNORECASE)


def _line(finding: Finding) -> str:
    advice = f" -> {finding.advice}" if finding.advice else ""
    return f"{finding.health.value:8} {finding.what}: {finding.found}{advice}"


def _versions() -> Iterator[str]:
    found = {
        str(one.metadata["Name"]): one.version
        for one in importlib.metadata.distributions()
        if one.metadata["Name"]
    }
    return (f"{name} {found[name]}" for name in sorted(found, key=str.casefold))


def _frames(source: Path | None) -> Sequence[tuple[Path, str]]:
    """Return the files of a recording with their names in the bundle."""
    if source is None:
        return ()
    if source.is_dir():
        inside = (Path(folder) / name for folder, _, names in os.walk(source) for name in names)
        files = sorted(one for one in inside if one.is_file())
    else:
        files = [source] if source.is_file() else []
    if not files:
        raise FileError(f"there are no frames in {source}", "choose a recording, or leave it out")
    total_bytes = sum(one.stat().st_size for one in files)
    if total_bytes > MAX_FRAMES_BYTES:
        raise FileError(
            f"{source} has {total_bytes / 2**20:,.0f} MiB",
            f"choose a recording of at most {MAX_FRAMES_BYTES // 2**20} MiB",
        )
    root = source if source.is_dir() else source.parent
    return [(one, f"frames/{one.relative_to(root).as_posix()}") for one in files]
