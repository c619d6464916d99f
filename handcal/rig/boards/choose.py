"""Selection of views of a moving board: at rest, sharp, and different from earlier ones."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from handcal.rig.boards.board import Board, BoardView
from handcal.rig.boards.views import moved

_NEAR_SHARE, _FAR_SHARE = 1 / 2, 1 / 3
_TILTED_RAD = np.radians(20.0)
# Width of the squares' edges.
_MOST_BLUR_PX = 4.0


@dataclass(frozen=True, slots=True)
class ChooseSettings:
    """Limits of the views that are kept."""

    most: int = 25
    """Views, or pairs of views."""
    rest_share: float | None = 0.003
    """Largest motion of a board at rest since the previous images: mean distance of its corners, as
    a share of the image's width. The images of a pair are rarely exactly simultaneous. None if each
    is a still image."""
    apart_share: float = 0.06
    """Minimum difference from every view kept before; 0 keeps similar views as well."""


ALIKE = ChooseSettings(most=5, apart_share=0.0)
"""A few views from a fixed camera, as of a display's grid."""


class ViewSelector:
    """A selector of views, taken one after the other by one camera or by the two of a pair.

    Parameters
    ----------
    settings : ChooseSettings, optional
    cameras : sequence of str
        Their names in reasons, such as "depth camera"; empty to name none.
    """

    def __init__(self, settings: ChooseSettings | None = None, cameras: Sequence[str] = ()) -> None:
        self._settings, self._cameras = settings or ChooseSettings(), cameras
        self._kept: list[BoardView] = []
        self._before: BoardView | None = None

    @property
    def is_done(self) -> bool:
        """True if enough views are kept."""
        return len(self._kept) >= self._settings.most

    def consider(self, seen: Sequence[BoardView | None]) -> str:
        """Return the reason why a view is not kept; empty if it is.

        Parameters
        ----------
        seen : sequence of BoardView or None
            By each camera; None where the board was not found.
        """
        settings = self._settings
        first, before = seen[0], self._before
        self._before = first
        views = [one for one in seen if one is not None]
        if first is None or len(views) < len(seen):
            cameras = zip(self._cameras, seen, strict=False)
            blind = " and the ".join(name for name, one in cameras if one is None)
            by = f" by the {blind}" if blind else ""
            return f"the board is not seen{by}: bring it into view, and see to focus and light"
        rest_share = settings.rest_share
        if rest_share is not None and (before is None or _moved_share(before, first) > rest_share):
            return "the board moves: hold it still for a moment"
        if max(one.blur_px for one in views) > _MOST_BLUR_PX:
            return "the image is blurred: hold the board still, and see to focus and light"
        if any(_moved_share(one, first) < settings.apart_share for one in self._kept):
            return "the board was seen like this before: tilt it, or move it elsewhere"
        self._kept.append(first)
        return ""


class Variety(NamedTuple):
    """Numbers of views in which the board is near, far and tilted."""

    near: int
    far: int
    tilted: int


def variety(found: Iterable[BoardView], board: Board) -> Variety:
    """Count the views in which the board is near, far and tilted, without the camera's intrinsics.

    Near: seen from the front, the board would be half as wide as the image or more. Far: a third
    or less. Tilted: its squares are foreshortened as if tilted by 20° or more.
    """
    width_m = max(board.squares) * board.square_m
    seen = [one for one in map(_scale_and_tilt, found) if one is not None]
    share, tilt_rad = np.array(seen).reshape(-1, 2).T * [[width_m], [1.0]]
    counts = (share >= _NEAR_SHARE, share <= _FAR_SHARE, tilt_rad >= _TILTED_RAD)
    return Variety(*(int(which.sum()) for which in counts))


@lru_cache(maxsize=1024)
def _scale_and_tilt(seen: BoardView) -> tuple[float, float] | None:
    """Return the largest scale, as a share of the image's width per metre, and the tilt in rad."""
    H, _ = cv2.findHomography(seen.points_m[:, :2], seen.pixels)
    if H is None:
        return None
    x, y, scale = H @ [*seen.points_m[:, :2].mean(axis=0), 1.0]
    px_per_m = (H[:2, :2] - np.outer([x, y], H[2, :2]) / scale) / scale
    most, least = np.linalg.svd(px_per_m, compute_uv=False)
    return float(most) / seen.size[0], float(np.arccos(least / most))


def _moved_share(a: BoardView, b: BoardView) -> float:
    """Return the mean distance of the corners found in both, as a share of the image's width."""
    return moved(a, b) / b.size[0]
