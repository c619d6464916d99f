"""Measure the depth of a board in a camera's frames, to check the camera's depth."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from handcal.camera.camera import Camera
from handcal.camera.take_board import see_board
from handcal.core.errors import CameraEndError
from handcal.core.progress import Progress
from handcal.core.types import DepthCheck, Frame
from handcal.rig.boards.board import Board, BoardError
from handcal.rig.boards.choose import ChooseSettings, ViewSelector
from handcal.rig.boards.views import MAX_VIEWS, ViewsError
from handcal.rig.depth import DepthView, depth_view, fit_depth

_SILENT_S = 5.0


@dataclass(frozen=True, slots=True)
class DepthSettings:
    """Settings of a depth check."""

    every_s: float = 0.1
    """Interval between two frames examined, in camera time."""
    choose: ChooseSettings = field(default_factory=lambda: ChooseSettings(apart_share=0.03))
    """Views may be more similar than for intrinsics: their distances matter, not their places."""


STILLS = DepthSettings(
    every_s=0.0, choose=ChooseSettings(most=MAX_VIEWS, rest_share=None, apart_share=0.0)
)
"""For recordings in which every frame is a still image."""


def run_depth_check(
    camera: Camera, board: Board, settings: DepthSettings, progress: Progress = Progress()
) -> DepthCheck:
    """Check the depth of a camera or recording that shows a board at several distances.

    Parameters
    ----------
    camera : Camera
        With colour; stays open.
    board : Board
    settings : DepthSettings
    progress : Progress
        Cancelling it ends the search and uses the views so far.

    Raises
    ------
    CameraError
        If the camera fails.
    ViewsError
        If the views do not suffice; the text gives the most frequent reason why frames were not
        used.
    """
    selector, views = ViewSelector(settings.choose), list[DepthView]()
    passed_over: Counter[str] = Counter()
    next_ns: int | None = None
    while not selector.is_done and not progress.is_cancelled():
        try:
            frame = camera.read(_SILENT_S)
        except CameraEndError:
            break
        if next_ns is not None and frame.t_camera_ns < next_ns:
            continue
        next_ns = frame.t_camera_ns + round(1e9 * settings.every_s)
        progress.show(len(views) / settings.choose.most, f"{len(views)} views used")
        try:
            views.append(_view_of(frame, board, selector))
        except BoardError as error:
            passed_over[str(error)] += 1
    try:
        return fit_depth(views)
    except ViewsError as error:
        if not passed_over:
            raise
        why, count = passed_over.most_common(1)[0]
        raise ViewsError(f"{error}; {count} frames were not used: {why}") from error


def _view_of(frame: Frame, board: Board, selector: ViewSelector) -> DepthView:
    """Return the depth of the board in a frame, or raise BoardError with the reason."""
    if frame.color is None:
        raise BoardError("they have no colour, in which the board is found")
    (seen,) = see_board([frame.color], board)
    why_not = selector.consider([seen])
    if why_not or seen is None:
        raise BoardError(why_not)
    return depth_view(seen, frame)
