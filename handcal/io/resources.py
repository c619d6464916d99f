"""Paths of the files shipped with handcal, in a checkout and in an installed wheel."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from handcal.core.errors import FileError


def resource_path(name: str) -> Path:
    """Return the path of the shipped file or folder `name`, such as ``docs/guide.md``.

    Raises
    ------
    FileError
        If it is missing, because the installation is damaged.
    """
    for folder in _folders():
        if (path := folder / name).exists():
            return path
    raise FileError(f"the shipped file {name} is missing", "install handcal again")


@cache  # a window asks for hundreds of icons
def _folders() -> tuple[Path, ...]:
    package = Path(__file__).parents[1]
    root = package.parent
    if (root / "pyproject.toml").exists():  # a checkout
        return root / "resources", root
    return (package / "_resources",)
