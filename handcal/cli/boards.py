"""Options and printing that commands with boards, grids and their images share."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from handcal.cli.output import console, show_progress, table
from handcal.cli.terminal import arg, fail, flag, number, value
from handcal.core.errors import HandcalError
from handcal.rig.boards.board import Board, BoardKind

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from handcal.rig.boards.views import BoardImage
    from handcal.rig.displays.grid import Grid
    from handcal.rig.lens.fit import CalibrationVerdict

_BOARD = Board()
_SIDE = number(float, 1.0, 1000.0)
BOARD_OPTIONS = (
    arg("--kind", choices=get_args(BoardKind), default=_BOARD.kind, help="kind of board"),
    arg(
        "--squares",
        type=number(int, 3, 40),
        nargs=2,
        metavar=("COLUMNS", "ROWS"),
        default=_BOARD.squares,
        help="number of squares, not of inner corners",
    ),
    value("--square-mm", _SIDE, "MM", "measured side of a square", default=1e3 * _BOARD.square_m),
    value("--marker-mm", _SIDE, "MM", "measured side of a marker", default=1e3 * _BOARD.marker_m),
    arg("--dictionary", default=_BOARD.dictionary, help="ArUco dictionary of the markers"),
    flag("--legacy", "the board was made by OpenCV before 4.6"),
)
GRID_OPTION = value(
    "--square-px", number(int, 20, 2000), "PX", "side of the grid's squares", default=80
)


def board_of(arguments: argparse.Namespace) -> Board:
    """Return the board that the options describe; exit with code 2 if none can be."""
    try:
        return Board(
            kind=arguments.kind,
            squares=tuple(arguments.squares),
            square_m=arguments.square_mm / 1e3,
            marker_m=arguments.marker_mm / 1e3,
            dictionary=arguments.dictionary,
            legacy=arguments.legacy,
        )
    except ValueError as error:
        fail(str(error), 2)


def grid_of(arguments: argparse.Namespace, width_px: int, height_px: int) -> Grid:
    """Return the grid that the options describe; HandcalError if the display is too small."""
    from handcal.rig.displays.grid import grid_on

    return grid_on(width_px, height_px, arguments.square_px)


def views_of(
    paths: Iterable[Path], board: Board, dropped: Sequence[str] = ()
) -> tuple[BoardImage, ...]:
    """Look for a board in images, with progress; leave those out that are dropped."""
    from handcal.rig.boards.views import drop, image_files, read_views, require_names

    files = image_files(paths)
    require_names(dropped, (file.name for file in files))
    with show_progress() as progress:
        views = read_views(files, board, progress)
    return drop(views, dropped)


def show_views(views: Iterable[BoardImage], residuals_px: Mapping[str, float]) -> None:
    """Print the corners found in each image, and their residuals."""
    shown = table("image", "corners", "residual, px", "blur, px")
    for view in views:
        found, off_px = view.found, residuals_px.get(view.name)
        shown.add_row(
            f"{view.name} (left out)" if view.dropped else view.name,
            str(len(found.ids)) if found else "–",
            "–" if off_px is None else f"{off_px:.2f}",
            f"{found.blur_px:.1f}" if found else "–",
        )
    if shown.row_count:
        console.print(shown)
    for view in views:
        if view.problem:
            console.print(f"{view.name}: {view.problem}")


def show_verdict(verdict: CalibrationVerdict) -> None:
    """Print a verdict; HandcalError if it is bad, so that nothing is written."""
    text = f"{verdict.name}: {verdict.reason}"
    if verdict.name == "bad":
        raise HandcalError(text)
    console.print(text)
