"""A cube's description as a file: JSON with ``handcal_cube`` 1 and the fields of `Cube`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from handcal.core.errors import FileError
from handcal.io.files import read_json, write_json
from handcal.io.settings import read_settings
from handcal.rig.cube.cube import Cube

CUBE_VERSION = 1


def read_cube(path: Path) -> Cube:
    """Read a cube's description.

    Raises
    ------
    FileError
        If the file cannot be read, is not a cube description, or a field is unknown or wrong.
    """
    values = read_json(path)
    if values.pop("handcal_cube", None) != CUBE_VERSION:
        raise FileError(f"{path}: handcal_cube must be {CUBE_VERSION}, the version known")
    return read_settings(Cube, values, str(path))


def write_cube(path: Path, cube: Cube) -> None:
    """Write a cube's description, atomically; FileError if it cannot be written."""
    write_json(path, {"handcal_cube": CUBE_VERSION, **asdict(cube)})
