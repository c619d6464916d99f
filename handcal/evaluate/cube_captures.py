"""The captures of a cube test: images in folders.

``POSITION/POSE/real.png`` is the real cube with the display off, ``virtual.png`` the drawn one with
the real one covered, or ``virtual-NAME.png`` where several are compared, such as before and after
a calibration. ``POSITION/grid.png``, if there, is the display's grid seen from that position.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from handcal.errors import FileError
from handcal.image_file import IMAGE_SUFFIXES

MAX_POSES = 1000
REAL, VIRTUAL, GRID = "real", "virtual", "grid"
"""What the images are called, without suffix."""


@dataclass(frozen=True, slots=True)
class CapturedPose:
    """The captures of one pose of the cube.

    Attributes
    ----------
    position, pose : str
        Of the camera in the eye box, and of the cube: the folders' names.
    real : Path
    virtual : mapping of str to Path
        By NAME, or ``virtual`` where there is none.
    """

    position: str
    pose: str
    real: Path
    virtual: Mapping[str, Path]


def find_captures(folder: Path) -> tuple[list[CapturedPose], dict[str, str]]:
    """Return the poses in a folder, position by position, and what each incomplete one lacks.

    Raises
    ------
    FileError
        If the folder cannot be read, or holds no complete pose or more than `MAX_POSES`.
    """
    poses: list[CapturedPose] = []
    incomplete: dict[str, str] = {}
    for position in _folders(folder):
        for pose in _folders(position):
            images = images_in(pose)
            virtual = {
                name.removeprefix(VIRTUAL).removeprefix("-") or VIRTUAL: path
                for name, path in images.items()
                if name == VIRTUAL or name.startswith(f"{VIRTUAL}-")
            }
            if REAL in images and virtual:
                poses.append(CapturedPose(position.name, pose.name, images[REAL], virtual))
            else:
                lacking = VIRTUAL if REAL in images else REAL
                incomplete[f"{position.name}/{pose.name}"] = f"there is no {lacking}.png"
    if not poses:
        raise FileError(
            f"{folder} holds no captures: POSITION/POSE/real.png and virtual.png are looked for"
        )
    if len(poses) > MAX_POSES:
        raise FileError(f"{folder} holds {len(poses)} poses, more than the {MAX_POSES} allowed")
    return poses, incomplete


def images_in(folder: Path) -> dict[str, Path]:
    """Return the PNG and JPEG images in a folder by their names without suffix.

    Raises
    ------
    FileError
        If it cannot be read.
    """
    return {path.stem: path for path in _listed(folder) if path.suffix.lower() in IMAGE_SUFFIXES}


def _folders(folder: Path) -> list[Path]:
    return [path for path in _listed(folder) if path.is_dir()]


def _listed(folder: Path) -> list[Path]:
    try:
        return sorted(folder.iterdir())
    except OSError as error:
        raise FileError(f"cannot read {folder}: {error.strerror or error}") from error
