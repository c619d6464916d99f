"""The folder of a cube test's captures: planned, present and missing images.

``POSITION/POSE/real.png`` is the real cube with the display off, ``virtual.png`` the drawn one with
the real one covered, or ``virtual-NAME.png`` where several are compared, such as before and after
a calibration. ``POSITION/grid.png``, if there, is the display's grid seen from that position.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from handcal.core.errors import FileError
from handcal.io.images import IMAGE_SUFFIXES

MAX_POSES = 1000
REAL, VIRTUAL, GRID = "real", "virtual", "grid"
"""Names of the images, without suffix."""


@dataclass(frozen=True, slots=True)
class PlannedCapture:
    """A planned image."""

    where: str
    """POSITION, or POSITION/POSE."""
    kind: str
    """`REAL`, `VIRTUAL` or `GRID`."""
    drawn: str = ""
    """Name of the way of drawing, if several are compared; else empty."""

    @property
    def name(self) -> str:
        """Name of the image, without suffix."""
        return f"{self.kind}-{self.drawn}" if self.drawn else self.kind

    @property
    def file(self) -> str:
        """Path of the image in the folder of all captures."""
        return f"{self.where}/{self.name}.png"


@dataclass(frozen=True, slots=True)
class CapturePlan:
    """The captures that a test needs."""

    positions: Sequence[str] = ("centre", "up", "down", "left", "right")
    """Of the camera in the eye box."""
    poses: int = 4
    """Of the cube at each position."""
    drawn: Sequence[str] = ()
    """Ways of drawing that are compared; empty for just one."""
    with_grid: bool = True
    """The display's grid is captured at each position."""

    def __post_init__(self) -> None:
        for names in (self.positions, self.drawn):
            for name in names:
                if not re.fullmatch(r"\w[\w-]*", name):
                    raise ValueError(f"a name is of letters, digits, _ and -, not {name!r}")
                if names.count(name) > 1:
                    raise ValueError(f"{name} is named twice")
        if not self.positions:
            raise ValueError("name a position of the camera, at least one")

    @property
    def captures(self) -> tuple[PlannedCapture, ...]:
        """All images, in the order to take them."""
        return tuple(one for position in self.positions for one in self._captures_at(position))

    def _captures_at(self, position: str) -> Iterator[PlannedCapture]:
        if self.with_grid:
            yield PlannedCapture(position, GRID)
        for pose in range(1, self.poses + 1):
            where = f"{position}/pose-{pose}"
            yield PlannedCapture(where, REAL)
            for drawn in self.drawn or ("",):
                yield PlannedCapture(where, VIRTUAL, drawn)


@dataclass(frozen=True, slots=True)
class CapturedPose:
    """The captures of one pose of the cube."""

    position: str
    pose: str
    """Of the camera in the eye box, and of the cube: the folders' names."""
    real: Path
    virtual: Mapping[str, Path]
    """By NAME, or ``virtual`` where there is none."""


def missing_captures(folder: Path, plan: CapturePlan) -> list[PlannedCapture]:
    """Return the images that are not there yet, in the order to take them.

    Raises
    ------
    FileError
        If a folder cannot be read.
    """

    def is_there(capture: PlannedCapture) -> bool:
        place = folder / capture.where
        return place.is_dir() and capture.name in images_in(place)

    return [capture for capture in plan.captures if not is_there(capture)]


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
            f"{folder} holds no captures: POSITION/POSE/real.png and virtual.png are looked for",
            "take them with Capture… in the window, or with handcal evaluate cube capture",
        )
    if len(poses) > MAX_POSES:
        raise FileError(f"{folder} holds {len(poses)} poses, more than the {MAX_POSES} allowed")
    return poses, incomplete


def images_in(folder: Path) -> dict[str, Path]:
    """Return the images in a folder by their names without suffix.

    Where there are both, it is the PNG, which comes last.

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
