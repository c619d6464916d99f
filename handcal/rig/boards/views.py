"""Sets of views of a board: reading, excluding, pairing, and the worst view of a fit."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handcal.core.errors import FileError, HandcalError
from handcal.core.progress import Progress
from handcal.core.types import Float64, Intrinsics, UInt8
from handcal.io.images import IMAGE_KINDS, IMAGE_SUFFIXES, read_grey
from handcal.rig.boards.board import Board, BoardError, BoardView
from handcal.rig.boards.finder import find_board
from handcal.rig.lens.fit import rms

MAX_VIEWS = 500
ASKED_VIEWS = 20
"""Views, or pairs of views, that a step asks for; fewer can be enough for a good verdict."""
_CELLS = (8, 6)
_STANDS_OUT = 1.5
# After so many images in a row with one problem, it is presumed for the next: finding out is slow.
_EXPLAINED = 3
_PRESUMED = "presumably as in the first images: "
_LEAST_MOVED_SHARE = 0.03
_FRACTION = r"(?:\D?(\d{1,9}))?"
"""Of a second, in the pattern of a time stamp."""


class ViewsError(HandcalError):
    """A set of views cannot be used; the text says why and what to do."""


@dataclass(frozen=True, slots=True)
class BoardImage:
    """An image, with the board found in it."""

    name: str
    """Unique among the views, as the file's name."""
    found: BoardView | None
    problem: str = ""
    """Reason why no board was found; empty if one was."""
    dropped: bool = False
    """True if excluded by the user."""


@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """The distribution of all views' corners over the image."""

    hits: NDArray[np.int64]
    """(6, 8); number of views with a corner in each cell of the image."""
    share: float
    """Number of cells with a corner."""


@dataclass(frozen=True, slots=True)
class WorstView:
    """The view with the largest residual, in pixels, and its likely cause."""

    name: str
    rms_px: float
    why: str


def board_image(name: str, image: UInt8, board: Board, presumed: str = "") -> BoardImage:
    """Look for the board in an image (H, W) or (H, W, 3).

    If it is not there, the reason is searched for, unless one is `presumed`.
    """
    try:
        return BoardImage(name, find_board(image, board, explain=not presumed))
    except BoardError as error:
        return BoardImage(name, None, f"{_PRESUMED}{presumed}" if presumed else str(error))


def image_files(paths: Iterable[Path]) -> list[Path]:
    """Return the image files among `paths` and in the folders among them, by name.

    Raises
    ------
    FileError
        If there are none, more than `MAX_VIEWS`, or two of the same name.
    """
    files: list[Path] = []
    paths = list(paths)
    for path in paths:
        try:
            inside = sorted(path.iterdir()) if path.is_dir() else [path]
        except OSError as error:
            raise FileError(f"cannot read {path}: {error.strerror or error}") from error
        files += [file for file in inside if file.suffix.lower() in IMAGE_SUFFIXES]
    if not files:
        missing = [str(path) for path in paths if not path.exists()]
        empty = [str(path) for path in paths if path.exists()]
        where = f" in {', '.join(empty[:3])}" if empty else ""
        why = f": {', '.join(missing[:3])} does not exist" if missing else ""
        raise FileError(f"no {IMAGE_KINDS} images{where}{why}")
    if len(files) > MAX_VIEWS:
        raise FileError(f"{len(files)} images are more than the {MAX_VIEWS} allowed")
    name, count = Counter(file.name for file in files).most_common(1)[0]
    if count > 1:
        raise FileError(f"{count} images are called {name}", "give each a different name")
    return files


def read_views(
    files: Sequence[Path],
    board: Board,
    progress: Progress = Progress(),
) -> tuple[BoardImage, ...]:
    """Look for the board in image files; one that cannot be read is a view with a problem.

    Parameters
    ----------
    files : sequence of Path
    board : Board
    progress : Progress
        Reports each file's name.
    """
    views: list[BoardImage] = []
    for number, file in enumerate(files):
        progress.at(number / len(files), file.name)
        try:
            views.append(board_image(file.name, read_grey(file), board, _presumed(views)))
        except (FileError, ValueError) as error:
            views.append(BoardImage(file.name, None, str(error)))
    return tuple(views)


def _presumed(views: Sequence[BoardImage]) -> str:
    """Return the reason that the first images have in common; empty if a board was found."""
    reasons = {view.problem for view in views[:_EXPLAINED]}
    is_common = len(views) >= _EXPLAINED and len(reasons) == 1 and not any(v.found for v in views)
    return reasons.pop() if is_common else ""


def require_names(dropped: Iterable[str], names: Iterable[str]) -> None:
    """Raise ViewsError if an image to drop is not among the names."""
    if unknown := set(dropped) - set(names):
        raise ViewsError(f"there is no image {', '.join(sorted(unknown))} to drop")


def drop(views: Iterable[BoardImage], names: Collection[str]) -> tuple[BoardImage, ...]:
    """Return the views with exactly those in `names` left out.

    Raises
    ------
    ViewsError
        If a name is not that of a view.
    """
    views = tuple(views)
    require_names(names, (view.name for view in views))
    return tuple(replace(view, dropped=view.name in names) for view in views)


def used(views: Iterable[BoardImage], at_least: int) -> dict[str, BoardView]:
    """Return the boards found in the views that are not left out, by name.

    Raises
    ------
    ViewsError
        If there are fewer than `at_least`, or their sizes differ.
    """
    views = tuple(views)
    found = {view.name: view.found for view in views if view.found and not view.dropped}
    if len(found) < at_least:
        problems = Counter(view.problem.removeprefix(_PRESUMED) for view in views if view.problem)
        mostly = ""
        if problems:
            (problem, count), *_ = problems.most_common(1)
            names = [view.name for view in views if view.problem.removeprefix(_PRESUMED) == problem]
            listed = ", ".join(names[:3]) + (" …" if count > 3 else "")
            mostly = f"; mostly: {problem} ({listed})"
        raise ViewsError(
            f"the board was found in {len(found)} of {len(views)} images used, at least "
            f"{at_least} {'is' if at_least == 1 else 'are'} needed{mostly}"
        )
    one_size(found)
    return found


def check_moved(found: Mapping[str, BoardView]) -> None:
    """Raise ViewsError if the board is at nearly the same place in all views."""
    first, *others = found.values()
    moved_px = [moved(first, other) for other in others]
    limit_px = _LEAST_MOVED_SHARE * first.size[0]
    if moved_px and max(moved_px) < limit_px:
        raise ViewsError(
            f"the board hardly moved between the images, by {max(moved_px):.0f} px at most: show "
            "it at other places, distances and angles"
        )


def moved(a: BoardView, b: BoardView) -> float:
    """Return the mean distance in pixels of the corners found in both; infinite without any."""
    _, of_a, of_b = np.intersect1d(a.ids, b.ids, assume_unique=True, return_indices=True)
    if not len(of_a):
        return np.inf
    return float(np.linalg.norm(a.pixels[of_a] - b.pixels[of_b], axis=1).mean())


def one_size(found: Mapping[str, BoardView]) -> tuple[int, int]:
    """Return the width and height that all views share.

    Raises
    ------
    ViewsError
        If they do not, naming those that differ.
    """
    sizes = Counter(board_view.size for board_view in found.values())
    (width, height), _ = sizes.most_common(1)[0]
    others = [
        f"{name} ({seen.size[0]}x{seen.size[1]})"
        for name, seen in found.items()
        if seen.size != (width, height)
    ]
    if others:
        raise ViewsError(
            f"the images have mixed resolutions: most are {width}x{height}, but not "
            f"{', '.join(others[:5])}{' …' if len(others) > 5 else ''}",
            "drop those",
        )
    return width, height


def require_size(sizes: Mapping[str, tuple[int, int]], camera: Intrinsics) -> None:
    """Raise ViewsError unless images, given by name, are of the viewpoint camera's size."""
    for name, (width, height) in sizes.items():
        if (width, height) != (camera.width, camera.height):
            raise ViewsError(
                f"{name} has {width}×{height} pixels, the viewpoint camera's calibration "
                f"{camera.width}×{camera.height}: take all at one resolution"
            )


def coverage(found: Iterable[BoardView]) -> Coverage:
    """Count in how many views each cell of the image has a corner."""
    columns, rows = _CELLS
    hits = np.zeros((rows, columns), np.int64)
    for seen in found:
        cells = ((seen.pixels + 0.5) / seen.size * _CELLS).astype(int)
        x, y = np.clip(cells, 0, [columns - 1, rows - 1]).T
        hit = np.zeros_like(hits)
        hit[y, x] = 1
        hits += hit
    return Coverage(hits, float(np.mean(hits > 0)))


def pair_views(
    first: Sequence[BoardImage], second: Sequence[BoardImage]
) -> tuple[tuple[BoardImage, BoardImage], ...]:
    """Pair the views of two cameras by their names.

    Equal names belong together, then names with the same numbers, with the nearest time stamps,
    and with the same last number, as left07 and right07: what pairs most images is taken. If one
    view of a pair is left out, so is the other.

    Raises
    ------
    ViewsError
        If none belong together, or the last number, if nothing else pairs, occurs twice in one set.
    """
    pairings = [_by_key(first, second, _stem), _by_key(first, second, _numbers)]
    pairings.append(_by_time(first, second))
    try:
        numbered = [_by_number(views) for views in (first, second)]
    except ViewsError:
        if not any(pairings):
            raise
    else:
        shared = sorted(numbered[0].keys() & numbered[1].keys())
        pairings.append([(numbered[0][number], numbered[1][number]) for number in shared])
    pairs = max(pairings, key=len)
    if not pairs:
        raise ViewsError(
            "no two images belong together: give the two of a pair the same name, or let them end "
            "in the same number, as depth07.png and headset07.png"
        )
    return tuple(_as_pair(*pair) for pair in pairs)


def _stem(view: BoardImage) -> str:
    return Path(view.name).stem.lower()


def _numbers(view: BoardImage) -> tuple[int, ...]:
    return tuple(int(one[-18:]) for one in re.findall(r"\d+", Path(view.name).stem))


def _by_key(
    first: Iterable[BoardImage], second: Iterable[BoardImage], key: Callable[[BoardImage], Any]
) -> list[tuple[BoardImage, BoardImage]]:
    """Return the pairs whose key is the same, where it is unique and not empty."""
    ours, theirs = ({key(view): view for view in views if key(view)} for views in (first, second))
    counts = [Counter(map(key, views)) for views in (first, second)]
    shared = sorted(one for one in ours.keys() & theirs.keys() if counts[0][one] == counts[1][one])
    return [(ours[one], theirs[one]) for one in shared if counts[0][one] == 1]


def _by_time(
    first: Sequence[BoardImage], second: Sequence[BoardImage]
) -> list[tuple[BoardImage, BoardImage]]:
    """Return the pairs whose time stamps are each other's nearest.

    They must be less than half as far apart as the images of a camera are.
    """
    stamps_s = [np.array([_stamp_s(view.name) for view in views]) for views in (first, second)]
    if any(len(one) < 2 or np.isnan(one).any() for one in stamps_s):
        return []
    limit_s = 0.5 * min(np.diff(np.sort(one)).min() for one in stamps_s)
    apart_s = np.abs(stamps_s[0][:, None] - stamps_s[1])
    nearest = apart_s.argmin(axis=1)
    return [
        (first[row], second[column])
        for row, column in enumerate(nearest)
        if apart_s[row, column] < limit_s and apart_s[:, column].argmin() == row
    ]


def _stamp_s(name: str) -> float:
    """Return the time in a name, as a date with a time, or since 1970; NaN without one."""
    stem = Path(name).stem
    if match := re.search(rf"(20\d{{6}})\D?(\d\d)\D?(\d\d)\D?(\d\d){_FRACTION}", stem):
        day, hours, minutes, seconds, fraction = match.groups(default="0")
        try:
            whole_s = 86400 * datetime.strptime(day, "%Y%m%d").toordinal()
        except ValueError:
            return np.nan
        whole_s += 3600 * int(hours) + 60 * int(minutes) + int(seconds)
    elif match := re.search(rf"(?<!\d)([12]\d{{9}}){_FRACTION}(?!\d)", stem):
        seconds, fraction = match.groups(default="0")
        whole_s = int(seconds)
    else:
        return np.nan
    return whole_s + float(f"0.{fraction}")


def _as_pair(first: BoardImage, second: BoardImage) -> tuple[BoardImage, BoardImage]:
    dropped = first.dropped or second.dropped
    return replace(first, dropped=dropped), replace(second, dropped=dropped)


def _by_number(views: Iterable[BoardImage]) -> dict[int, BoardImage]:
    numbered: dict[int, BoardImage] = {}
    for one in views:
        numbers = re.findall(r"\d+", Path(one.name).stem)
        if not numbers:
            continue
        number = int(numbers[-1][-18:])
        if number in numbered:
            raise ViewsError(
                f"{numbered[number].name} and {one.name} end in the same number: give the two of a "
                "pair the same name"
            )
        numbered[number] = one
    return numbered


def worst_view(
    found: Mapping[str, BoardView], off_px: Mapping[str, Float64], tilt_rad: Mapping[str, float]
) -> WorstView:
    """Return the view with the largest residual, and its likely cause.

    Parameters
    ----------
    found : mapping of name to BoardView
    off_px : mapping of name to (N, 2) float64
        Detected minus predicted pixels.
    tilt_rad : mapping of name to float
        Angle between the board's normal and the line of sight.
    """
    residuals_px = {name: rms(off) for name, off in off_px.items()}
    name = max(residuals_px, key=lambda one: residuals_px[one])
    others = [one for one in found if one != name] or [name]
    usual_px = float(np.median([residuals_px[one] for one in others]))
    reasons = [
        *_stray_corners(found[name], off_px[name], usual_px),
        *_unlike(found, tilt_rad, name, others),
    ]
    if _alike_beside(found[name], off_px[name]) > 0.5:
        reasons.append(
            "neighbouring corners are off the same way: the board bent or moved, or the lens "
            "model does not hold there"
        )
    why = "; ".join(reasons) or "nothing else about it stands out"
    if residuals_px[name] < _STANDS_OUT * usual_px:
        why = f"hardly more than the others' {usual_px:.2f} px; {why}"
    return WorstView(name, residuals_px[name], why)


def _stray_corners(seen: BoardView, off_px: Float64, usual_px: float) -> list[str]:
    lengths_px = np.linalg.norm(off_px, axis=1)
    stray = lengths_px > 4 * max(usual_px, float(np.median(lengths_px)))
    if not 0 < stray.sum() <= 0.3 * len(stray):
        return []
    x, y = seen.pixels[np.argmax(lengths_px)]
    return [
        f"{stray.sum()} of {len(stray)} corners are off by up to {lengths_px.max():.1f} px, most "
        f"at ({x:.0f}, {y:.0f}): glare, a finger or a mistaken corner"
    ]


def _unlike(
    found: Mapping[str, BoardView], tilt_rad: Mapping[str, float], name: str, others: list[str]
) -> list[str]:
    """Return the difference between the view and the others: blur, size, tilt or place."""

    def compare(values: Mapping[str, float]) -> tuple[float, float]:
        return values[name], float(np.median([values[one] for one in others]))

    reasons = []
    blur, usual = compare({one: seen.blur_px for one, seen in found.items()})
    if blur > 1.3 * usual:
        reasons.append(f"it is blurred: edges {blur:.1f} px wide, {usual:.1f} in others")
    square, usual = compare({one: _square_px(seen) for one, seen in found.items()})
    if square < 0.7 * usual:
        reasons.append(
            f"the board is small in it: squares of {square:.0f} px, {usual:.0f} in others"
        )
    tilt, usual = np.degrees(compare(tilt_rad))
    if tilt > max(40.0, usual + 10.0):
        reasons.append(f"the board is steep in it: {tilt:.0f}°, {usual:.0f}° in others")
    reach, usual = compare({one: _reach(seen) for one, seen in found.items()})
    if reach > max(0.8, 1.15 * usual):
        reasons.append("it reaches into a corner of the image, where the lens bends most")
    return reasons


def _square_px(seen: BoardView) -> float:
    apart_px = seen.pixels - seen.pixels[seen.beside[:, 0]]
    return float(np.median(np.linalg.norm(apart_px, axis=1)))


def _reach(seen: BoardView) -> float:
    """Return how far out the corners lie: 1 in a corner of the image."""
    half = np.array(seen.size) / 2
    return float(np.linalg.norm(seen.pixels - half, axis=1).max() / np.linalg.norm(half))


def _alike_beside(seen: BoardView, off_px: Float64) -> float:
    """Return the correlation of residuals between nearest corners: 1 if equal, 0 if by chance."""
    beside = seen.beside[:, 0]
    square = float(np.sum(off_px**2))
    return float(np.sum(off_px * off_px[beside])) / square if square > 0 else 0.0
