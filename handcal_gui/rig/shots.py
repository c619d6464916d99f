"""The images of a step for display: detected corners and a thumbnail of each."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.core.types import UInt8
from handcal.io.images import read_image
from handcal.rig.boards.board import Board
from handcal.rig.boards.finder import shown_instead
from handcal.rig.boards.views import BoardImage, image_files, pair_views, read_views
from handcal_gui.app.translation import tr

_SMALL_PX = 96
_LOOKED_AT = 3
"""Images that tell which board they show, if not the one entered."""
_AS_STORED = cv2.IMREAD_IGNORE_ORIENTATION


@dataclass(frozen=True, slots=True)
class Shot:
    """One image, or the two of a pair taken at the same time."""

    views: tuple[BoardImage, ...]
    """One for each camera."""
    files: tuple[Path, ...]
    small: UInt8 | None
    """(h, w, 3): thumbnail of the first image; None if it cannot be read."""

    @property
    def name(self) -> str:
        """Name of the first image."""
        return self.views[0].name

    @property
    def problem(self) -> str:
        """Reason why the board was not found; empty if it was."""
        problems = dict.fromkeys(view.problem for view in self.views if view.problem)
        return "; ".join(problems)


def look(
    folders: Sequence[Path], board: Board, progress: Progress = Progress()
) -> tuple[Shot, ...]:
    """Search for the board in one folder of images, or in two folders of paired images.

    Raises
    ------
    CancelledError
    FileError, ViewsError
        If there are no images, too many, or no pairs.
    """
    of_camera = []
    files: dict[tuple[int, str], Path] = {}
    for number, folder in enumerate(folders):

        def report(name: str, share: float, number: int = number) -> None:
            progress.at(
                (number + share) / len(folders), tr("Looking for the board in {}").format(name)
            )

        paths = image_files([folder])
        views = read_views(paths, board, Progress(report))
        files |= {(number, path.name): path for path in paths}
        of_camera.append(views)
    together = pair_views(*of_camera) if len(of_camera) == 2 else [(one,) for one in of_camera[0]]
    shots = []
    for views in together:
        of_views = tuple(files[number, view.name] for number, view in enumerate(views))
        shots.append(Shot(views, of_views, _small(of_views[0])))
    return tuple(shots)


def other_board(shots: Sequence[Shot], board: Board) -> Board | None:
    """Return the board that the first images show in place of `board`; None if not certain."""
    if any(view.found for shot in shots for view in shot.views):
        return None
    shown = []
    for shot in shots[:_LOOKED_AT]:
        with suppress(FileError):
            shown.append(shown_instead(read_color(shot.files[0]), board))
    found = [one for one in shown if one is not None]
    return found[0] if found and found == len(found) * found[:1] else None


def excluding(shots: Sequence[Shot], names: Collection[str]) -> list[tuple[BoardImage, ...]]:
    """Return the views; those of the named shots are marked as excluded."""
    return [
        tuple(replace(view, dropped=shot.name in names) for view in shot.views) for shot in shots
    ]


def read_color(path: Path) -> UInt8:
    """Return an image (H, W, 3), RGB, or raise FileError."""
    return np.asarray(read_image(path, cv2.IMREAD_COLOR_RGB | _AS_STORED), np.uint8)


def _small(path: Path) -> UInt8 | None:
    try:
        image = read_image(path, cv2.IMREAD_REDUCED_COLOR_4 | _AS_STORED)
    except FileError:
        return None
    scale = _SMALL_PX / max(image.shape[:2])
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.ascontiguousarray(small[..., ::-1], np.uint8)
