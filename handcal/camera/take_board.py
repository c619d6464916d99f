"""Capture images of a board, stored under numbers that pair the images of two cameras."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from glob import escape
from pathlib import Path

from handcal.camera.viewpoint import ViewpointCamera
from handcal.core.errors import CameraEndError, CameraTimeoutError
from handcal.core.progress import Progress
from handcal.core.types import CameraIdentity, Frame, UInt8
from handcal.io.files import make_folder
from handcal.io.images import png_bytes, write_png
from handcal.rig.boards.board import Board, BoardError, BoardView
from handcal.rig.boards.choose import ChooseSettings, ViewSelector
from handcal.rig.boards.finder import find_board
from handcal.rig.formats import write_intrinsics, write_pose

IMAGER, DEPTH_TO_COLOR = "depth-imager.json", "depth-to-color.json"
"""Files with the calibration of a depth camera, beside its colour images."""

_TOGETHER_NS = 20_000_000
_PATIENCE = 4


@dataclass(frozen=True, slots=True)
class TakeSettings:
    """Settings of a capture."""

    seconds: float = 60.0
    """In camera time."""
    every_s: float = 0.1
    """Interval between two moments examined."""
    choose: ChooseSettings = field(default_factory=ChooseSettings)


@dataclass(frozen=True, slots=True)
class Taken:
    """Summary of a capture."""

    kept: int
    looked_at: int
    """Number of moments examined."""
    passed_over: Mapping[str, int]
    """Number of moments not kept, by reason."""


def capture_views(
    cameras: Sequence[ViewpointCamera],
    folders: Sequence[Path],
    board: Board,
    settings: TakeSettings,
    progress: Progress = Progress(),
) -> Taken:
    """Capture images of a board automatically with one camera, or pairs with two.

    Parameters
    ----------
    cameras : sequence of ViewpointCamera
        Recordings and videos of a pair must start at the same moment.
    folders : sequence of Path
        A folder for each camera's images; existing images are kept.
    board : Board
    settings : TakeSettings
    progress : Progress
        Reported to at every moment; cancelling it ends the search and keeps the images so far.

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
        if selector.is_done or share > 1.0 or progress.is_cancelled():
            break
        if t_ns < next_ns:
            continue
        next_ns = t_ns + round(1e9 * settings.every_s)
        progress.show(share, f"{verdicts['']} views kept")
        why_not = selector.consider(see_board(images, board))
        if not why_not:
            keep_images(images, folders)
        verdicts[why_not] += 1
    kept = verdicts.pop("", 0)
    return Taken(kept, kept + verdicts.total(), dict(verdicts.most_common()))


def see_board(images: Sequence[UInt8], board: Board) -> tuple[BoardView | None, ...]:
    """Return the board found in each image; None if it is not found."""

    def see(image: UInt8) -> BoardView | None:
        with suppress(BoardError):
            return find_board(image, board, explain=False)
        return None

    return tuple(map(see, images))


def keep_images(images: Sequence[UInt8], folders: Sequence[Path]) -> tuple[str, ...]:
    """Write each RGB image into its folder, under the next number; return the file names.

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


def are_kept(images: Sequence[UInt8], folders: Sequence[Path]) -> bool:
    """Return whether each image is already in its folder, as when a recording starts again."""
    return all(
        any(
            path.stat().st_size == len(data) and path.read_bytes() == data
            for path in sorted(folder.glob("*.png"))
        )
        for folder, data in zip(folders, map(png_bytes, images), strict=True)
    )


def keep_imager(folder: Path, frame: Frame, identity: CameraIdentity) -> None:
    """Write the pose, intrinsics and identity of a depth imager beside its colour images."""
    make_folder(folder)
    write_intrinsics(folder / IMAGER, frame.depth_intrinsics, "json", identity)
    write_pose(folder / DEPTH_TO_COLOR, frame.T_C_D, "json")


def _moments(cameras: Sequence[ViewpointCamera]) -> Iterator[tuple[tuple[UInt8, ...], int]]:
    """Yield an image of each camera, and the nanoseconds since the first, until one ends.

    Images are matched by the time since each camera's first image.
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
    """Return the next image, with retries for a camera that is just starting."""
    for _ in range(_PATIENCE):
        with suppress(CameraTimeoutError):
            return camera.read()
    return camera.read()


def _last_number(folder: Path) -> int:
    names = (path.stem.rpartition("-")[2] for path in folder.glob(f"{escape(folder.name)}-*.png"))
    return max((int(name) for name in names if name.isdecimal()), default=0)
