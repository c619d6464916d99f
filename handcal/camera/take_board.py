"""Images of a board taken by cameras, kept as files under numbers that belong together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from glob import escape
from pathlib import Path

from handcal.camera.viewpoint import ViewpointCamera
from handcal.errors import CameraEndError, CameraTimeoutError
from handcal.io.files import make_folder
from handcal.io.images import write_png
from handcal.rig.board import Board, BoardError, BoardView
from handcal.rig.board_finder import find_board
from handcal.rig.choose import ChooseSettings, ViewSelector
from handcal.rig.formats import write_intrinsics, write_pose
from handcal.types import Frame, UInt8

IMAGER, DEPTH_TO_COLOR = "depth-imager.json", "depth-to-color.json"
"""What a camera with depth tells of itself, as files beside its colour images."""

_TOGETHER_NS = 20_000_000
_PATIENCE = 4


@dataclass(frozen=True, slots=True)
class TakeSettings:
    """How long images are taken, and which."""

    seconds: float = 60.0
    """By the cameras' own time."""
    every_s: float = 0.1
    """Between two moments looked at."""
    choose: ChooseSettings = field(default_factory=ChooseSettings)


@dataclass(frozen=True, slots=True)
class Taken:
    """What was taken."""

    kept: int
    looked_at: int
    """Moments."""
    passed_over: Mapping[str, int]
    """How many were not kept, by reason."""


def capture_views(
    cameras: Sequence[ViewpointCamera],
    folders: Sequence[Path],
    board: Board,
    settings: TakeSettings,
    report: Callable[[str, float], None],
    is_stopped: Callable[[], bool] = lambda: False,
) -> Taken:
    """Take images of a board by itself: of one camera, or of the two of pairs.

    Parameters
    ----------
    cameras : sequence of ViewpointCamera
        Recordings and videos of a pair must begin at the same moment.
    folders : sequence of Path
        Where each one's images go; those that are there stay.
    board : Board
    settings : TakeSettings
    report : callable
        Told what is being done, and the share done.
    is_stopped : callable
        Asked at every moment; what is kept by then stays.

    Raises
    ------
    CameraError
        If a camera fails.
    FileError
        If an image cannot be written.
    """
    selector = ViewSelector(settings.choose)
    verdicts: Counter[str] = Counter()
    next_ns = 0
    for images, t_ns in _moments(cameras):
        share = 1e-9 * t_ns / settings.seconds
        if selector.is_done or share > 1.0 or is_stopped():
            break
        if t_ns < next_ns:
            continue
        next_ns = t_ns + round(1e9 * settings.every_s)
        report(f"{verdicts['']} views kept", share)
        why_not = selector.consider(see_board(images, board))
        if not why_not:
            keep_images(images, folders)
        verdicts[why_not] += 1
    kept = verdicts.pop("", 0)
    return Taken(kept, kept + verdicts.total(), dict(verdicts.most_common()))


def see_board(images: Sequence[UInt8], board: Board) -> tuple[BoardView | None, ...]:
    """Look for the board in each image; None where it is not found."""

    def see(image: UInt8) -> BoardView | None:
        with suppress(BoardError):
            return find_board(image, board, explain=False)
        return None

    return tuple(map(see, images))


def keep_images(images: Sequence[UInt8], folders: Sequence[Path]) -> tuple[str, ...]:
    """Write RGB images into a folder each, under the next number; return the files' names.

    Raises
    ------
    FileError
        If one cannot be written.
    """
    number = 1 + max(_last_number(make_folder(folder)) for folder in folders)
    names = tuple(f"{folder.name}-{number:03}.png" for folder in folders)
    for image, folder, name in zip(images, folders, names, strict=True):
        write_png(folder / name, image)
    return names


def keep_imager(folder: Path, frame: Frame) -> None:
    """Write where a camera's depth imager is, and its intrinsics, beside its colour images."""
    make_folder(folder)
    write_intrinsics(folder / IMAGER, frame.depth_intrinsics, "json")
    write_pose(folder / DEPTH_TO_COLOR, frame.T_C_D, "json")


def _moments(cameras: Sequence[ViewpointCamera]) -> Iterator[tuple[tuple[UInt8, ...], int]]:
    """Yield an image of each camera, and the nanoseconds since the first, until one ends.

    They belong together by the time since each camera's first.
    """
    begins_ns: list[int] = []
    try:
        while True:
            seen = [_read(camera) for camera in cameras]
            begins_ns = begins_ns or [t_ns for _, t_ns in seen]
            latest_ns = max(
                t_ns - begin_ns for (_, t_ns), begin_ns in zip(seen, begins_ns, strict=True)
            )
            for number, camera in enumerate(cameras):
                while seen[number][1] - begins_ns[number] < latest_ns - _TOGETHER_NS:
                    seen[number] = _read(camera)
            yield tuple(image for image, _ in seen), seen[0][1] - begins_ns[0]
    except CameraEndError:
        return


def _read(camera: ViewpointCamera) -> tuple[UInt8, int]:
    """Return the next image, with the patience that a camera needs that just begins."""
    for _ in range(_PATIENCE):
        with suppress(CameraTimeoutError):
            return camera.read()
    return camera.read()


def _last_number(folder: Path) -> int:
    names = (path.stem.rpartition("-")[2] for path in folder.glob(f"{escape(folder.name)}-*.png"))
    return max((int(name) for name in names if name.isdecimal()), default=0)
