"""The calibration in force: what the OpenXR layer gives to every program, of one wearer.

It is a file in the configuration, in the form of an export; here it only ends. It was made by
`handcal.export.openxr.use_calibration`, and is kept by the user if it expires never.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from handcal.core.errors import FileError
from handcal.io.configuration import configuration_folder
from handcal.io.files import read_json, read_limited

_MAX_RIG_BYTES = 2**20


def in_force_path() -> Path:
    """Return the path of the file; it need not exist."""
    return configuration_folder() / "openxr.json"


def rig_sha256(session: Path) -> str:
    """Return the digest of a session's rig file.

    Raises
    ------
    FileError
        If it cannot be read.
    """
    return hashlib.sha256(read_limited(session / "rig.yaml", _MAX_RIG_BYTES)).hexdigest()


def end_at_begin(session: Path) -> None:
    """End the calibration in force as another begins; one that is kept, only if the rig differs."""
    _end_unless(lambda data: _is_kept(data) and data.get("rigSha256") == rig_sha256(session))


def end_at_close(session: Path) -> None:
    """End the calibration in force with its session, unless it is kept."""
    path = str(session.absolute())
    _end_unless(lambda data: _is_kept(data) or data.get("sessionPath") != path)


def _is_kept(data: Mapping[str, Any]) -> bool:
    return data.get("expiresUnixS") == 0


def _end_unless(stays: Callable[[Mapping[str, Any]], bool]) -> None:
    """Remove the file; one that cannot be read is of no use to the layer either."""
    path = in_force_path()
    if not os.path.isfile(path):
        return
    with suppress(FileError):
        if stays(read_json(path)):
            return
    with suppress(OSError):
        path.unlink(missing_ok=True)
