"""Capture of a cube test's images with a camera, one after the other, with an operator."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2

from handcal.camera.viewpoint import ViewpointCamera
from handcal.io.files import make_folder
from handcal.io.images import write_png
from handcal.lab.evaluate.cube_folder import (
    GRID,
    REAL,
    VIRTUAL,
    CapturePlan,
    PlannedCapture,
    missing_captures,
)
from handcal.rig.board import BoardError
from handcal.rig.cube import Cube, CubeError, find_cube
from handcal.rig.grid import Grid, find_grid
from handcal.types import UInt8

# Images buffered by the camera were taken before the operator was ready.
_STALE_IMAGES = 5
_WHAT_TO_DO = {
    GRID: "show the grid on the display, darken the room",
    REAL: "switch the display off",
    VIRTUAL: "show the virtual cube, cover the real one",
}


def instruction(capture: PlannedCapture) -> str:
    """Return what to do before an image is taken."""
    drawn = f" ({capture.drawn})" if capture.drawn else ""
    return f"{capture.where}: {_WHAT_TO_DO[capture.kind]}{drawn}"


def keep_capture(
    image: UInt8, folder: Path, capture: PlannedCapture, cube: Cube, grid: Grid
) -> str:
    """Write an image if it shows the expected object; it replaces an earlier one.

    Parameters
    ----------
    image : (H, W, 3) uint8
        RGB.
    folder : Path
        Of all captures.
    capture : PlannedCapture
    cube : Cube
    grid : Grid

    Returns
    -------
    str
        Description of the objects found.

    Raises
    ------
    CubeError, BoardError
        If the cube, or the grid, is not seen.
    FileError
        If the image cannot be written.
    """
    gray = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype("uint8", copy=False)
    if capture.kind == GRID:
        seen = f"{len(find_grid(gray, grid).pixels)} corners of the grid"
    else:
        seen = f"{len(find_cube(gray, cube))} faces of the cube"
    make_folder(folder / capture.where)
    write_png(folder / capture.file, image)
    return seen


def take_captures(
    camera: ViewpointCamera,
    folder: Path,
    plan: CapturePlan,
    cube: Cube,
    grid: Grid,
    ask: Callable[[str], None],
    say: Callable[[str], None],
) -> None:
    """Take the missing captures; explain and repeat one in which nothing is found.

    Parameters
    ----------
    camera : ViewpointCamera
    folder : Path
        May hold part of the captures.
    plan : CapturePlan
    cube : Cube
    grid : Grid
    ask : callable
        Called with the instruction; returns when it is done, or raises to cancel.
    say : callable
        Called with the result.

    Raises
    ------
    CameraError
        If the camera fails.
    FileError
        If an image cannot be written.
    """
    for capture in missing_captures(folder, plan):
        is_taken = False
        while not is_taken:
            ask(instruction(capture))
            image = _fresh_image(camera)
            try:
                seen = keep_capture(image, folder, capture, cube, grid)
            except (CubeError, BoardError) as error:
                say(f"Not taken: {error}")
                continue
            say(f"{capture.file}: {seen}")
            is_taken = True


def _fresh_image(camera: ViewpointCamera) -> UInt8:
    for _ in range(_STALE_IMAGES):
        camera.read()
    return camera.read()[0]
