"""Paths of the files shipped with handcal, in a checkout and in an installed wheel."""

from __future__ import annotations

from pathlib import Path

from handcal.errors import FileError


def resource_path(name: str) -> Path:
    """Return the path of the shipped file or folder `name`, such as ``docs/guide.md``.

    Raises
    ------
    FileError
        If it is missing, because the installation is damaged.
    """
    package = Path(__file__).parents[1]
    root = package.parent
    folders = [package / "_resources"]
    if (root / "pyproject.toml").exists():  # a checkout
        folders = [root / "resources", root]
    for folder in folders:
        if (path := folder / name).exists():
            return path
    raise FileError(f"the shipped file {name} is missing; install handcal again")
