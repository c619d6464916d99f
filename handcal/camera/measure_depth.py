"""Measure the depth of a board in a camera's frames, to check the camera's depth."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from handcal.camera.camera import Camera
from handcal.camera.take_board import see_board
from handcal.core.errors import CameraEndError
from handcal.core.progress import Progress
from handcal.core.types import DepthCheck, DepthEdges, Frame
from handcal.rig.boards.board import Board, BoardError, BoardView
from handcal.rig.boards.choose import ChooseSettings, ViewSelector
from handcal.rig.boards.views import MAX_VIEWS, ViewsError
from handcal.rig.depth import MIN_DEPTH_VIEWS, DepthView, depth_view, fit_depth, on_real_board
from handcal.rig.depth_border import MIN_BORDER_VIEWS, border_outside_px, fit_edges
from handcal.rig.lens.shape import FLAT, BoardShape

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


@dataclass(frozen=True, slots=True)
class MeasuredDepth:
    """The depth and the edges of a depth camera, as views of a board show them."""

    check: DepthCheck
    edges: DepthEdges | None
    """None if the border of the board's sheet was not seen often enough."""
    why_no_edges: str
    """The most frequent reason; empty if the edges were measured."""
    board: BoardShape = FLAT
    """As its corners in colour show it."""


def run_depth_check(
    camera: Camera, board: Board, settings: DepthSettings, progress: Progress = Progress()
) -> MeasuredDepth:
    """Check depth and edges of a camera or recording that shows a board at several distances.

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
    boards: list[BoardView] = []
    last: Frame | None = None
    borders_px: list[float] = []
    passed_over: Counter[str] = Counter()
    no_border: Counter[str] = Counter()
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
            seen = _seen_in(frame, board, selector)
            views.append(depth_view(seen, frame))
            boards, last = [*boards, seen], frame
        except BoardError as error:
            passed_over[str(error)] += 1
            continue
        try:
            borders_px.append(border_outside_px(seen, frame))
        except BoardError as error:
            no_border[str(error)] += 1
    edges = fit_edges(borders_px)
    why_no_edges = ""
    if edges is None:
        why_no_edges = f"{len(borders_px)} views are too few: {MIN_BORDER_VIEWS} are needed"
        if no_border:
            reason, count = no_border.most_common(1)[0]
            why_no_edges += f"; in {count} others {reason}"
    try:
        board_shape = FLAT
        if last is not None and len(views) >= MIN_DEPTH_VIEWS:
            views, board_shape = on_real_board(views, boards, last)
        return MeasuredDepth(fit_depth(views), edges, why_no_edges, board_shape)
    except ViewsError as error:
        if not passed_over:
            raise
        reason, count = passed_over.most_common(1)[0]
        raise ViewsError(f"{error}; {count} frames were not used: {reason}") from error


def _seen_in(frame: Frame, board: Board, selector: ViewSelector) -> BoardView:
    """Return the board in a frame that is to be used, or raise BoardError with the reason."""
    if frame.color is None:
        raise BoardError("they have no colour, in which the board is found")
    (seen,) = see_board([frame.color], board)
    why_not = selector.consider([seen])
    if why_not or seen is None:
        raise BoardError(why_not)
    return seen
