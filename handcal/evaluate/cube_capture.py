"""The captures of a cube test taken with a camera, one after the other, a person beside it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2

from handcal.camera.viewpoint import ViewpointCamera
from handcal.evaluate.cube_captures import GRID, REAL, VIRTUAL, images_in
from handcal.files import make_folder
from handcal.image_file import write_png
from handcal.rig.board import BoardError
from handcal.rig.cube import Cube, CubeError, find_cube
from handcal.rig.grid import Grid, find_grid
from handcal.types import UInt8

# What a camera has waiting was seen before the person was ready.
_STALE_IMAGES = 5
_WHAT_TO_DO = {
    GRID: "show the grid on the display, darken the room",
    REAL: "switch the display off",
    VIRTUAL: "show the virtual cube, cover the real one",
}


@dataclass(frozen=True, slots=True)
class CapturePlan:
    """What shall be captured.

    Attributes
    ----------
    positions : sequence of str
        Of the camera in the eye box.
    poses : int
        Of the cube at each position.
    drawn : sequence of str
        Ways of drawing that are compared; empty for just one.
    with_grid : bool
        Whether the display's grid is captured at each position.
    """

    positions: Sequence[str] = ("centre", "up", "down", "left", "right")
    poses: int = 4
    drawn: Sequence[str] = ()
    with_grid: bool = True

    def __post_init__(self) -> None:
        for name in (*self.positions, *self.drawn):
            if not re.fullmatch(r"\w[\w-]*", name):
                raise ValueError(f"a name is of letters, digits, _ and -, not {name!r}")


def missing_captures(folder: Path, plan: CapturePlan) -> list[tuple[Path, str]]:
    """Return the folder and name of each image that is not there yet, in the order to take them."""

    def planned() -> Iterator[tuple[Path, str]]:
        virtual = [f"{VIRTUAL}-{name}" for name in plan.drawn] or [VIRTUAL]
        for position in plan.positions:
            if plan.with_grid:
                yield folder / position, GRID
            for pose in range(1, plan.poses + 1):
                for name in (REAL, *virtual):
                    yield folder / position / f"pose-{pose}", name

    return [(place, name) for place, name in planned() if not _is_there(place, name)]


def take_captures(
    camera: ViewpointCamera,
    folder: Path,
    plan: CapturePlan,
    cube: Cube,
    grid: Grid,
    ask: Callable[[str], None],
    say: Callable[[str], None],
) -> None:
    """Take what is missing; an image in which nothing is found is told why, and taken again.

    Parameters
    ----------
    camera : ViewpointCamera
    folder : Path
        May hold part of the captures.
    plan : CapturePlan
    cube : Cube
    grid : Grid
    ask : callable
        Given what to do; returns once that is done, or raises to give up.
    say : callable
        Given what became of it.

    Raises
    ------
    CameraError
        If the camera fails.
    FileError
        If an image cannot be written.
    """
    for place, name in missing_captures(folder, plan):
        where, is_taken = place.relative_to(folder).as_posix(), False
        while not is_taken:
            kind, _, drawn = name.partition("-")
            ask(f"{where}: {_WHAT_TO_DO[kind]}{f' ({drawn})' if drawn else ''}")
            image = _fresh_image(camera)
            try:
                seen = _look(image, kind, cube, grid)
            except (CubeError, BoardError) as error:
                say(f"Not taken: {error}")
                continue
            write_png(make_folder(place) / f"{name}.png", image)
            say(f"{where}/{name}.png: {seen}")
            is_taken = True


def _is_there(place: Path, name: str) -> bool:
    return place.is_dir() and name in images_in(place)


def _fresh_image(camera: ViewpointCamera) -> UInt8:
    for _ in range(_STALE_IMAGES):
        camera.read()
    return camera.read()[0]


def _look(image: UInt8, kind: str, cube: Cube, grid: Grid) -> str:
    """Return what is seen; CubeError or BoardError if that is not enough."""
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype("uint8", copy=False)
    if kind == GRID:
        return f"{len(find_grid(gray, grid).pixels)} corners of the grid"
    return f"{len(find_cube(gray, cube))} faces of the cube"
