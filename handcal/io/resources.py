"""Paths of the files shipped with handcal, in a checkout and in an installed wheel."""

from __future__ import annotations

from pathlib import Path

from handcal.errors import FileError


def resource_path(name: str) -> Path:
    """Return the path of the shipped file `name`.

    Raises
    ------
    FileError
        If it is missing, because the installation is damaged.
    """
    package = Path(__file__).parents[1]
    return _existing(name, package / "_resources", package.parent / "resources")


def documentation_path(name: str) -> Path:
    """Return the path of a page of the documentation, which is shipped too; raises likewise."""
    package = Path(__file__).parents[1]
    return _existing(name, package / "_resources" / "docs", package.parent / "docs")


def _existing(name: str, *folders: Path) -> Path:
    for folder in folders:
        if (path := folder / name).exists():
            return path
    raise FileError(f"the shipped file {name} is missing; install handcal again")
