"""The example session that ships with handcal."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from handcal.core.errors import FileError
from handcal.io.files import make_folder
from handcal.io.resources import resource_path

_NAME = "example-session"


def copy_example(sessions: Path) -> Path:
    """Return the folder of the example in the session folder; copy it there if it is missing.

    Raises
    ------
    FileError
        If it cannot be copied.
    """
    target = make_folder(sessions) / _NAME
    if not target.exists():
        try:
            with tempfile.TemporaryDirectory(dir=sessions) as scratch:
                copy = shutil.copytree(resource_path("example_session"), Path(scratch, _NAME))
                copy.rename(target)
        except OSError as error:
            raise FileError(f"cannot write {target}: {error.strerror or error}") from error
    return target
