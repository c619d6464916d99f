"""Capture of a cube test's images with a camera, one after the other, by key or at rest."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from handcal.camera.viewpoint import ViewpointCamera
from handcal.core.errors import CameraTimeoutError
from handcal.core.progress import Progress
from handcal.core.types import Float32, Float64, UInt8
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
from handcal.rig.boards.board import BoardError
from handcal.rig.boards.finder import find_board
from handcal.rig.cube import Cube, CubeError, find_cube
from handcal.rig.displays.grid import Grid

# Images buffered by the camera were taken before the operator was ready.
_STALE_IMAGES = 5
_LOOK_NS, _REST_NS = 100_000_000, 500_000_000
_REST_SHARE = 0.0005  # of the image's width: motion at rest between two looks
_CHANGE = 1.5  # difference from the image taken last, in differences between images at rest
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
    found = _find(_gray(image), capture, cube, grid)
    make_folder(folder / capture.where)
    write_png(folder / capture.file, image)
    things = "corners of the grid" if capture.kind == GRID else "faces of the cube"
    return f"{len(found)} {things}"


class RestWatch:
    """Decides when to take an image: its object is at rest, and not the one taken last.

    The cube must have been out of view since the last image of it, and the image must have changed:
    a hand in front of the camera does not make the real cube a drawn one.

    Parameters
    ----------
    cube : Cube
    grid : Grid
    """

    def __init__(self, cube: Cube, grid: Grid) -> None:
        self._cube, self._grid = cube, grid
        self._rest: tuple[int, Mapping[int, Float64], UInt8] | None = None
        self._taken: tuple[bool, UInt8] | None = None
        self._was_away = True

    def consider(self, image: UInt8, capture: PlannedCapture, t_ns: int) -> str:
        """Return the reason why an image is not to be taken; empty if it is.

        Parameters
        ----------
        image : (H, W, 3) uint8
            RGB.
        capture : PlannedCapture
            The image wanted.
        t_ns : int
            Time of the image.
        """
        gray = _gray(image)
        try:
            found = _find(gray, capture, self._cube, self._grid, explain=False)
        except (CubeError, BoardError) as error:
            self._rest, self._was_away = None, True
            return str(error)
        rest = self._rest
        if rest is None or not _is_near(rest[1], found, _REST_SHARE * gray.shape[1]):
            self._rest = t_ns, found, gray
            return "it moves: wait until it is at rest"
        if t_ns - rest[0] < _REST_NS:
            return "it moves: wait until it is at rest"
        if not self._is_new(capture.kind == GRID, gray, rest[2], found):
            return "it is the one taken last: cover it, then show the next"
        self.took(image, capture)
        return ""

    def took(self, image: UInt8, capture: PlannedCapture) -> None:
        """Note an image, (H, W, 3) uint8, that was taken automatically or by a person."""
        self._rest, self._was_away = None, False
        self._taken = capture.kind == GRID, _gray(image)

    def _is_new(
        self, is_grid: bool, gray: UInt8, at_rest: UInt8, found: Mapping[int, Float64]
    ) -> bool:
        """Return whether the object is another than that in the image taken last."""
        if self._taken is None or self._taken[0] != is_grid or self._taken[1].shape != gray.shape:
            return True
        box = cv2.boundingRect(np.concatenate([*found.values()]).astype(np.float32))
        taken, before, now = (
            _part(one, box).astype(np.float32) for one in (self._taken[1], at_rest, gray)
        )
        return self._was_away and _apart(taken, now) > _CHANGE * _apart(before, now)


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


def take_at_rest(
    camera: ViewpointCamera,
    folder: Path,
    plan: CapturePlan,
    cube: Cube,
    grid: Grid,
    say: Callable[[str], None],
    progress: Progress = Progress(),
) -> None:
    """Take the missing captures automatically, each once its object is at rest.

    Parameters
    ----------
    camera : ViewpointCamera
    folder : Path
        May hold part of the captures.
    plan : CapturePlan
    cube : Cube
    grid : Grid
    say : callable
        Called with what to do, with why nothing is taken when that changes, and with the result.
    progress : Progress

    Raises
    ------
    CameraError
        If the camera fails.
    FileError
        If an image cannot be written.
    CancelledError
    """
    watch = RestWatch(cube, grid)
    next_ns: int | None = None
    for capture in missing_captures(folder, plan):
        say(instruction(capture))
        why_not = said = ""
        while True:
            progress.check()
            try:
                image, t_ns = camera.read()
            except CameraTimeoutError:
                continue
            if next_ns is not None and t_ns < next_ns:
                continue
            next_ns = t_ns + _LOOK_NS
            why_not = watch.consider(image, capture, t_ns)
            if not why_not:
                break
            if why_not != said:
                say(f"Waiting: {why_not}")
                said = why_not
        say(f"{capture.file}: {keep_capture(image, folder, capture, cube, grid)}")


def _find(
    gray: UInt8, capture: PlannedCapture, cube: Cube, grid: Grid, explain: bool = True
) -> Mapping[int, Float64]:
    """Return the points (N, 2) of the grid's corners or of the cube's markers, by number."""
    if capture.kind != GRID:
        return find_cube(gray, cube)
    seen = find_board(gray, grid.board, explain=explain)
    return dict(zip(seen.ids.tolist(), seen.pixels[:, None], strict=True))


def _is_near(before: Mapping[int, Float64], now: Mapping[int, Float64], limit_px: float) -> bool:
    both = before.keys() & now.keys()
    moved_px = [np.linalg.norm(now[one] - before[one], axis=1).mean() for one in both]
    return 2 * len(both) > len(now) and float(np.mean(moved_px)) <= limit_px


def _apart(a: Float32, b: Float32) -> float:
    return float(np.abs(a - b).mean())


def _part(image: UInt8, box: Sequence[int]) -> UInt8:
    x, y, width, height = box
    return image[max(y, 0) : y + height, max(x, 0) : x + width]


def _gray(image: UInt8) -> UInt8:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)


def _fresh_image(camera: ViewpointCamera) -> UInt8:
    for _ in range(_STALE_IMAGES):
        camera.read()
    return camera.read()[0]
