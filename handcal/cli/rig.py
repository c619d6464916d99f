"""``handcal rig board, take, camera, stereo, convert``: boards and cameras from the command line.

Each command reads images or files, says what was found and how far to trust it, and writes one
part; they import what they need when they run.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from handcal.cli.camera_options import add_realsense_options, realsense_of
from handcal.cli.terminal import (
    Commands,
    Parser,
    add_command,
    console,
    fail,
    number,
    progress,
    table,
    until_interrupted,
)
from handcal.errors import FileError, HandcalError
from handcal.io.files import make_folder, write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from handcal.rig.board import Board
    from handcal.rig.grid import Grid
    from handcal.rig.verdict import CalibrationVerdict
    from handcal.rig.views import View, WorstView


def board(arguments: argparse.Namespace) -> None:
    """Make a board to put up: a PDF at true size, or a PNG for a screen."""
    from handcal.io.images import write_png
    from handcal.rig.board_print import draw_board, write_board_pdf

    if arguments.pdf is None and arguments.png is None:
        fail("say where the board goes: --pdf FILE, --png FILE or both", 2)
    made = board_of(arguments)
    try:
        if arguments.pdf:
            make_folder(arguments.pdf.parent)
            write_board_pdf(arguments.pdf, made, arguments.paper)
            console.print(f"{arguments.pdf}: print at 100 %, and measure the ruler", markup=False)
        if arguments.png:
            image = draw_board(made, arguments.square_px)
            make_folder(arguments.png.parent)
            write_png(arguments.png, image)
            size = f"{image.shape[1]}x{image.shape[0]}"
            console.print(f"{arguments.png}: {size} pixels", markup=False)
    except ValueError as error:
        raise HandcalError(str(error)) from error


def take(arguments: argparse.Namespace) -> None:
    """Take images of a board, or of a display's grid, from a camera, a recording or a video."""
    from handcal.camera.playback import PlaybackSettings
    from handcal.camera.take_board import TakeSettings, capture_views, keep_imager
    from handcal.camera.view_source import open_view_source
    from handcal.rig.choose import ALIKE, ChooseSettings

    sources = [arguments.source, arguments.headset] if arguments.headset else [arguments.source]
    if len(set(sources)) < len(sources):
        fail("one camera cannot be both of a pair", 2)
    folder = arguments.output.absolute()
    folders = [folder / "depth", folder / "headset"] if arguments.headset else [folder]
    if arguments.grid:
        choose, board = ALIKE, grid_of(arguments, *arguments.grid).board
    else:
        choose, board = ChooseSettings(), board_of(arguments)
    choose = replace(choose, most=arguments.most or choose.most)
    realsense = realsense_of(arguments)
    with ExitStack() as stack:
        cameras = [
            stack.enter_context(
                open_view_source(source, realsense, PlaybackSettings(), partial(keep_imager, into))
            )
            for source, into in zip(sources, folders, strict=True)
        ]
        names = " and ".join(one.name for one in cameras)
        console.print(f"From {names}; Ctrl+C ends it", markup=False)
        is_stopped = stack.enter_context(until_interrupted())
        report = stack.enter_context(progress())
        settings = TakeSettings(seconds=arguments.seconds, choose=choose)
        taken = capture_views(cameras, folders, board, settings, report, is_stopped)
    for why, count in taken.passed_over.items():
        console.print(f"{count} of {taken.looked_at} moments passed over: {why}")
    if not taken.kept:
        raise HandcalError("no image was kept; see above")
    console.print(f"{taken.kept} kept in {' and '.join(map(str, folders))}", markup=False)


def camera(arguments: argparse.Namespace) -> None:
    """Solve a camera's intrinsics from images of a board."""
    from handcal.rig.camera import CameraSettings, calibrate_camera
    from handcal.rig.formats import camera_json, write_intrinsics

    views = views_of(arguments.images, board_of(arguments), arguments.drop)
    result = calibrate_camera(views, CameraSettings(lens=arguments.lens))
    show_views(views, result.residuals_px)
    solved = result.intrinsics
    sigma = result.sigma
    console.print(
        f"f {solved.fx:.2f} ± {sigma[0]:.2f}, {solved.fy:.2f} ± {sigma[1]:.2f} px; "
        f"c {solved.cx:.2f} ± {sigma[2]:.2f}, {solved.cy:.2f} ± {sigma[3]:.2f} px; "
        f"{result.arcmin_per_px:.2f}′ per pixel"
    )
    console.print(f"Distortion: {' '.join(f'{one:.5f}' for one in solved.distortion) or 'none'}")
    _conclude(result.rms_px, result.worst, result.verdict)
    _write(
        arguments,
        camera_json(result),
        lambda path: write_intrinsics(path, solved, arguments.format),
    )


def stereo(arguments: argparse.Namespace) -> None:
    """Solve where the depth camera is on the headset, from pairs of images of one board."""
    import numpy as np

    from handcal.rig.formats import stereo_json, write_pose
    from handcal.rig.steps import calibrate_depth_camera
    from handcal.rig.views import pair_views

    if arguments.format == "ros":
        raise HandcalError("ROS's camera_info holds no pose between cameras: use opencv or json")
    board = board_of(arguments)
    pairs = pair_views(
        views_of(arguments.depth, board, arguments.drop), views_of(arguments.headset, board)
    )
    result = calibrate_depth_camera(
        pairs, arguments.lens, arguments.depth_intrinsics, arguments.headset_intrinsics
    )
    show_views([first for first, _ in pairs], result.residuals_px)
    show_views([second for _, second in pairs if second.problem], {})
    shift_mm = 1e3 * result.T_H_D[:3, 3]
    angle_rad = np.arccos(np.clip((np.trace(result.T_H_D[:3, :3]) - 1) / 2, -1, 1))
    console.print(
        f"The depth camera is at {' '.join(f'{one:.2f}' for one in shift_mm)} mm in the headset's, "
        f"turned by {np.degrees(angle_rad):.2f}°; each pair alone differs by "
        f"{np.degrees(result.spread_rad):.2f}°, {1e3 * result.spread_m:.1f} mm"
    )
    _conclude(result.rms_px, result.worst, result.verdict)
    _write(
        arguments,
        stereo_json(result),
        lambda path: write_pose(path, result.T_H_D, arguments.format),
    )


def convert(arguments: argparse.Namespace) -> None:
    """Convert intrinsics, or a stereo pose, between OpenCV's, ROS's and handcal's files."""
    from handcal.rig.formats import read_intrinsics, read_pose, write_intrinsics, write_pose

    make_folder(arguments.output.parent)
    try:
        try:
            intrinsics = read_intrinsics(arguments.input)
        except FileError as no_camera:
            try:
                pose = read_pose(arguments.input)
            except FileError:
                raise no_camera from None
            write_pose(arguments.output, pose, arguments.format)
        else:
            write_intrinsics(arguments.output, intrinsics, arguments.format)
    except ValueError as error:
        raise HandcalError(str(error)) from error
    console.print(str(arguments.output), markup=False)


def add_rig_commands(commands: Commands) -> None:
    """Add ``handcal rig board, take, camera, stereo, convert``."""
    from handcal.rig.camera import LensModel
    from handcal.rig.formats import FORMATS
    from handcal.rig.print_page import PAPERS
    from handcal.rig.views import MAX_VIEWS

    one = add_command(commands, board, json=False)
    add_board_options(one)
    one.add_argument("--pdf", type=Path, metavar="FILE", help="to scale, with a ruler to check")
    one.add_argument("--paper", choices=tuple(PAPERS), default="a4", help="of the PDF")
    one.add_argument("--png", type=Path, metavar="FILE", help="for a screen")
    one.add_argument(
        "--square-px", type=number(int, 4, 2000), default=100, help="squares' side in the PNG"
    )

    one = add_command(commands, take, json=False)
    one.add_argument(
        "source",
        help="'realsense', the number of a camera, or a recording or video",
    )
    one.add_argument("--headset", metavar="SOURCE", help="the headset's camera, to take pairs")
    one.add_argument("--output", type=Path, metavar="FOLDER", required=True, help="of the images")
    one.add_argument(
        "--seconds", type=number(float, 0.1, 3600.0), default=60.0, help="by the camera's time"
    )
    one.add_argument("--most", type=number(int, 1, MAX_VIEWS), help="images; 25, of a grid 5")
    one.add_argument(
        "--grid",
        type=number(int, 60, 16384),
        nargs=2,
        metavar=("WIDTH", "HEIGHT"),
        help="look for the grid on a display of this size, and keep images that are alike",
    )
    add_square_option(one)
    add_board_options(one)
    add_realsense_options(one)

    one = add_command(commands, camera, json=False)
    one.add_argument("images", type=Path, nargs="+", help="images, or folders of images")
    _add_calibration(one, get_args(LensModel), FORMATS)

    one = add_command(commands, stereo, json=False)
    for which, whose in (("depth", "depth camera"), ("headset", "headset's camera")):
        one.add_argument(
            f"--{which}", type=Path, nargs="+", required=True, help=f"images by the {whose}"
        )
        one.add_argument(
            f"--{which}-intrinsics",
            type=Path,
            metavar="FILE",
            help="known already, as the camera itself tells; solved if absent",
        )
    _add_calibration(one, get_args(LensModel), FORMATS)

    one = add_command(commands, convert, json=False)
    one.add_argument("input", type=Path, help="any of the formats")
    one.add_argument("output", type=Path, help="the file to write")
    one.add_argument("--format", choices=FORMATS, required=True, help="of the output")


def add_board_options(command: Parser) -> None:
    """Add the options that say which board is used."""
    from handcal.rig.board import Board, BoardKind

    usual = Board()
    squares = number(int, 3, 40)
    command.add_argument("--kind", choices=get_args(BoardKind), default=usual.kind, help="of board")
    command.add_argument(
        "--squares",
        type=squares,
        nargs=2,
        metavar=("COLUMNS", "ROWS"),
        default=usual.squares,
        help="squares, not inner corners",
    )
    side = number(float, 1.0, 1000.0)
    command.add_argument(
        "--square-mm", type=side, default=1e3 * usual.square_m, help="squares' side as measured"
    )
    command.add_argument(
        "--marker-mm", type=side, default=1e3 * usual.marker_m, help="markers' side as measured"
    )
    command.add_argument("--dictionary", default=usual.dictionary, help="of the markers")
    command.add_argument("--legacy", action="store_true", help="printed by OpenCV before 4.6")


def add_square_option(command: Parser) -> None:
    """Add the option that says how large a grid's squares are."""
    command.add_argument(
        "--square-px", type=number(int, 20, 2000), default=80, help="side of the grid's squares"
    )


def _add_calibration(command: Parser, lenses: tuple[str, ...], formats: tuple[str, ...]) -> None:
    add_board_options(command)
    command.add_argument("--lens", choices=lenses, default="full", help="model of distortion")
    command.add_argument(
        "--drop", nargs="+", default=(), metavar="NAME", help="images to leave out"
    )
    command.add_argument("--output", type=Path, metavar="FILE", help="where to write the result")
    command.add_argument(
        "--format", choices=formats, default="json", help="of the result; json holds all of it"
    )


def board_of(arguments: argparse.Namespace) -> Board:
    """Return the board that the options describe; HandcalError if there can be none."""
    from handcal.rig.board import Board

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
        raise HandcalError(str(error)) from error


def grid_of(arguments: argparse.Namespace, width_px: int, height_px: int) -> Grid:
    """Return the grid that the options describe; HandcalError if the display has no room."""
    from handcal.rig.grid import grid_on

    return grid_on(width_px, height_px, arguments.square_px)


def views_of(paths: Iterable[Path], board: Board, dropped: Sequence[str] = ()) -> tuple[View, ...]:
    """Look for a board in images, with progress; leave those out that are dropped."""
    from handcal.progress import Progress
    from handcal.rig.views import drop, image_files, read_views

    with progress() as report:
        views = read_views(image_files(paths), board, Progress(report))
    return drop(views, dropped)


def show_views(views: Iterable[View], residuals_px: Mapping[str, float]) -> None:
    """Print what was found on each image, and how far off that is."""
    shown = table("image", "corners", "off, px", "edges, px")
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
            console.print(f"{view.name}: {view.problem}", markup=False)


def _conclude(rms_px: float, worst: WorstView, verdict: CalibrationVerdict) -> None:
    console.print(
        f"RMS {rms_px:.3f} px. Worst: {worst.name}, {worst.rms_px:.2f} px: {worst.why}",
        markup=False,
    )
    show_verdict(verdict)


def show_verdict(verdict: CalibrationVerdict) -> None:
    """Print a verdict; HandcalError if it is bad, so that nothing is written."""
    text = f"{verdict.name}: {verdict.reason}"
    if verdict.name == "bad":
        raise HandcalError(text)
    console.print(text)


def _write(
    arguments: argparse.Namespace, result: dict[str, Any], in_another: Callable[[Path], None]
) -> None:
    """Write a result where asked: all of it as JSON, or what another format holds."""
    if arguments.output is None:
        return
    make_folder(arguments.output.parent)
    if arguments.format == "json":
        write_json(arguments.output, result)
    else:
        in_another(arguments.output)
    console.print(str(arguments.output), markup=False)
