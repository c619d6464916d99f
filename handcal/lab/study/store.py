"""A study's folder: its settings, the completed trials, and the table of all trials.

Rows are stored in chunks, each written at once and checked by its SHA-256 when read; one that is
damaged counts as not run.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeAlias

from handcal.core.errors import FileError
from handcal.io.files import make_folder, read_json, write_atomic, write_json
from handcal.report.cells import rows_csv

StudyRow: TypeAlias = dict[str, float | int | str | bool | None]
"""One row of a study's table; None for an empty cell."""

_STUDY = "study.json"
_ENTERED = "seed", "wearers", "open3d", "noise_scale"
"""Settings that a user enters; several others differ only between sizes."""
_LIBRARIES = "handcal", "numpy", "scipy", "opencv-python-headless"


def holds_study(folder: Path) -> bool:
    """Return whether a folder contains a study."""
    return (folder / _STUDY).exists()


def free_of_studies(folder: Path) -> Path:
    """Return a folder that may take other results.

    Raises
    ------
    FileError
        If it is the folder of a study, whose report would be replaced.
    """
    if holds_study(folder):
        raise FileError(f"{folder} holds a study", "choose another folder for the results")
    return folder


class StudyFolder:
    """The folder of one study.

    Parameters
    ----------
    path : Path
        Created if missing.
    name : str
    settings : dict
        JSON-able.
    chunks : sequence of sequence of dict
        The cases, JSON-able, as they are stored together.

    Raises
    ------
    FileError
        If the folder holds another study, or cannot be read or written.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        settings: Mapping[str, Any],
        chunks: Sequence[Sequence[Mapping[str, Any]]],
    ) -> None:
        self._path = make_folder(path)
        self._chunks = make_folder(path / "chunks", path)
        file = path / _STUDY
        study = json.loads(
            json.dumps(
                {
                    "name": name,
                    "settings": settings,
                    "cases": sum(map(len, chunks)),
                    "cases_sha256": _sha256(chunks),
                    "versions": {library: version(library) for library in _LIBRARIES}
                    | {"python": platform.python_version()},
                }
            )
        )
        if not file.exists():
            write_json(file, study)
        elif others := _differences(read_json(file, path), study):
            raise FileError(
                f"{path} holds another study ({others})",
                "choose another folder, or the same entries",
            )

    def has_chunk(self, number: int) -> bool:
        """Return whether a chunk exists, complete or damaged, without reading it."""
        return self._file(number).exists()

    def read_chunk(self, number: int) -> list[list[StudyRow]] | None:
        """Return the rows of each case of a chunk; None if it is not there, or damaged."""
        file = self._file(number)
        try:
            stored = read_json(file, self._path)
        except FileError:
            return None
        rows: list[list[StudyRow]] | None = stored.get("rows")
        return rows if stored.get("sha256") == _sha256(rows) else None

    def write_chunk(self, number: int, rows: list[list[StudyRow]]) -> None:
        """Store the rows of each case of a chunk."""
        write_json(self._file(number), {"sha256": _sha256(rows), "rows": rows})

    def write_rows(self, rows: Sequence[StudyRow]) -> None:
        """Write ``rows.csv``."""
        write_atomic(self._path / "rows.csv", rows_csv(rows))

    def _file(self, number: int) -> Path:
        return self._chunks / f"{number:04d}.json"


def _sha256(value: object) -> str:
    return hashlib.sha256(json.dumps(value).encode()).hexdigest()


def _differences(stored: Mapping[str, Any], study: Mapping[str, Any]) -> str:
    """Return the differences as one line, by what was entered; empty if there are none."""
    if name := _changes({"name": stored.get("name")}, {"name": study["name"]}):
        return name["name"]
    changes = _changes(stored.get("settings"), study["settings"])
    entered = {key: change for key, change in changes.items() if key in _ENTERED}
    if len(changes) > len(entered) + 1:
        changes = {"size": "another size"} | entered
    changes |= _changes(stored.get("versions"), study["versions"])
    if not changes:
        changes = _changes(stored, {"cases": study["cases"]})
    if not changes and stored.get("cases_sha256") != study["cases_sha256"]:
        changes = {"cases": "other cases"}
    return "; ".join(changes.values())


def _changes(stored: Any, values: Mapping[str, Any]) -> dict[str, str]:
    """Return by key what differs from what is stored, in words."""
    old = stored if isinstance(stored, dict) else {}
    return {
        key: f"{key} {old.get(key)!r} there, {new!r} here"
        for key, new in values.items()
        if old.get(key) != new
    }
