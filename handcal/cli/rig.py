"""``handcal rig board, take, camera, stereo, convert``: boards and cameras.

Each calibration reads images, prints the result with its residuals and a verdict, and writes one
part of the rig.
"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from handcal.cli.boards import (
    BOARD_OPTIONS,
    GRID_OPTION,
    board_of,
    grid_of,
    show_verdict,
    show_views,
    views_of,
)
from handcal.cli.cameras import REALSENSE_OPTIONS, realsense_of
from handcal.cli.output import console, show_progress, until_interrupted
from handcal.cli.terminal import (
    arg,
    command,
    fail,
    file_option,
    folder_option,
    number,
    output_file,
    value,
)
from handcal.core.errors import HandcalError
from handcal.io.files import make_folder, write_json
from handcal.rig.boards.printing import PAPERS
from handcal.rig.boards.views import MAX_VIEWS
from handcal.rig.formats import CALIBRATION_FORMATS
from handcal.rig.lens.camera import LENS_CHOICES

if TYPE_CHECKING:
    from collections.abc import Callable

    from handcal.rig.boards.views import WorstView
    from handcal.rig.lens.fit import CalibrationVerdict


_CALIBRATION_OPTIONS = (
    *BOARD_OPTIONS,
    arg(
        "--lens",
        choices=LENS_CHOICES,
        default="auto",
        help="lens model; auto: the one that best fits images not used to solve it",
    ),
    arg("--drop", nargs="+", default=(), metavar="NAME", help="images to leave out"),
    output_file("--output", "file for the result (default: only print it)"),
    arg(
        "--format",
        choices=CALIBRATION_FORMATS,
        default="json",
        help="format of the result; only json contains everything",
    ),
)


@command(
    *BOARD_OPTIONS,
    output_file("--pdf", "PDF at true size, with a ruler to check it"),
    arg("--paper", choices=tuple(PAPERS), default="a4", help="paper size of the PDF"),
    output_file("--png", "PNG for a screen"),
    value("--square-px", number(int, 4, 2000), "PX", "side of a square in the PNG", default=100),
    example="handcal rig board --pdf board.pdf --paper a3",
)
def board(arguments: argparse.Namespace) -> None:
    """Make a calibration board: a PDF at true size, or a PNG for a screen."""
    from handcal.io.images import write_png
    from handcal.rig.boards.printing import draw_board, write_board_pdf

    if arguments.pdf is None and arguments.png is None:
        fail("no output given; add --pdf FILE, --png FILE or both", 2)
    made = board_of(arguments)
    try:
        if arguments.pdf:
            make_folder(arguments.pdf.parent)
            write_board_pdf(arguments.pdf, made, arguments.paper)
            console.print(f"{arguments.pdf}: print at 100 %, and measure the ruler")
        if arguments.png:
            image = draw_board(made, arguments.square_px)
            make_folder(arguments.png.parent)
            write_png(arguments.png, image)
            size = f"{image.shape[1]}x{image.shape[0]}"
            console.print(f"{arguments.png}: {size} pixels")
    except ValueError as error:  # of the options: the board does not fit
        fail(str(error), 2)


@command(
    arg("source", help="realsense, the number of a camera, or a recording or video"),
    arg(
        "--headset",
        metavar="SOURCE",
        help="the headset's camera, to capture pairs of images (default: single images)",
    ),
    folder_option("--output", "folder for the images", required=True),
    value(
        "--seconds",
        number(float, 0.1, 3600.0),
        "S",
        "stop after this time on the camera's clock",
        default=60.0,
    ),
    value(
        "--most",
        number(int, 1, MAX_VIEWS),
        "N",
        "stop after this many images (default: 25; with --grid, 5)",
    ),
    arg(
        "--grid",
        type=number(int, 60, 16384),
        nargs=2,
        metavar=("WIDTH", "HEIGHT"),
        help="capture the grid on a display of this size; keeps similar images",
    ),
    GRID_OPTION,
    *BOARD_OPTIONS,
    *REALSENSE_OPTIONS,
    example="handcal rig take realsense --headset 0 --output pairs",
)
def take(arguments: argparse.Namespace) -> None:
    """Capture images of a board, or of a display's grid, from a camera, recording or video."""
    from handcal.camera.playback import PlaybackSettings
    from handcal.camera.take_board import TakeSettings, capture_views, keep_imager
    from handcal.camera.view_source import open_view_source
    from handcal.rig.boards.choose import ALIKE, ChooseSettings

    sources = [arguments.source, arguments.headset] if arguments.headset else [arguments.source]
    if len(set(sources)) < len(sources):
        fail("the two cameras of a pair must differ", 2)
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
        console.print(f"Capturing from {names}; press Ctrl+C to stop")
        is_stopped = stack.enter_context(until_interrupted())
        progress = stack.enter_context(show_progress(is_stopped))
        settings = TakeSettings(seconds=arguments.seconds, choose=choose)
        taken = capture_views(cameras, folders, board, settings, progress)
    for why, count in taken.passed_over.items():
        console.print(f"{count} of {taken.looked_at} moments skipped: {why}")
    if not taken.kept:
        raise HandcalError("no image was kept", "see the reasons above")
    console.print(f"{taken.kept} kept in {' and '.join(map(str, folders))}")


@command(
    arg("images", type=Path, nargs="+", help="images, or folders of images"),
    *_CALIBRATION_OPTIONS,
    example="handcal rig camera images --output camera.json",
)
def camera(arguments: argparse.Namespace) -> None:
    """Calibrate a camera's intrinsics from images of a board."""
    from handcal.rig.formats import camera_json, write_intrinsics
    from handcal.rig.lens.camera import calibrate_camera

    views = views_of(arguments.images, board_of(arguments), arguments.drop)
    result = calibrate_camera(views, arguments.lens)
    show_views(views, result.residuals_px)
    solved = result.intrinsics
    sigma = result.sigma
    console.print(
        f"f {solved.fx:.2f} ± {sigma[0]:.2f}, {solved.fy:.2f} ± {sigma[1]:.2f} px; "
        f"c {solved.cx:.2f} ± {sigma[2]:.2f}, {solved.cy:.2f} ± {sigma[3]:.2f} px; "
        f"{result.arcmin_per_px:.2f}′ per pixel"
    )
    coefficients = " ".join(f"{one:.5f}" for one in solved.distortion) or "no distortion"
    console.print(f"Lens {result.lens}: {coefficients}")
    for one in result.compared:
        console.print(
            f"  {one.lens}: RMS {one.fit.rms_px:.3f} px, of views left out {one.held_out_px:.3f} px"
        )
    if result.left_out:
        console.print(
            f"{result.left_out} single corners left out: they contradict those beside them"
        )
    _conclude(result.rms_px, result.worst, result.verdict)
    _write(
        arguments,
        camera_json(result),
        lambda path: write_intrinsics(path, result.pinhole, arguments.format),
    )


@command(
    arg(
        "--depth",
        type=Path,
        nargs="+",
        metavar="IMAGE",
        required=True,
        help="images from the depth camera, or folders of images",
    ),
    file_option(
        "--depth-intrinsics",
        "known intrinsics, such as the camera's own (default: solved from the images)",
    ),
    arg(
        "--headset",
        type=Path,
        nargs="+",
        metavar="IMAGE",
        required=True,
        help="images from the headset's camera, or folders of images",
    ),
    file_option(
        "--headset-intrinsics",
        "known intrinsics, such as the camera's own (default: solved from the images)",
    ),
    *_CALIBRATION_OPTIONS,
    example="handcal rig stereo --depth pairs/depth --headset pairs/headset --output stereo.json",
)
def stereo(arguments: argparse.Namespace) -> None:
    """Calibrate the depth camera's pose on the headset from image pairs of one board."""
    import numpy as np

    from handcal.rig.boards.views import image_files, pair_views
    from handcal.rig.formats import stereo_json, write_pose
    from handcal.rig.steps import calibrate_depth_camera

    if arguments.format == "ros":
        fail("ROS camera_info has no pose between cameras; use --format opencv or json", 2)
    board = board_of(arguments)
    image_files(arguments.headset)  # an error before the other images are read, not after it
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
        f"Pose of the depth camera in the headset camera's frame: "
        f"{' '.join(f'{one:.2f}' for one in shift_mm)} mm, "
        f"rotated by {np.degrees(angle_rad):.2f}°; spread of single pairs "
        f"{np.degrees(result.spread_rad):.2f}°, {1e3 * result.spread_m:.1f} mm"
    )
    _conclude(result.rms_px, result.worst, result.verdict)
    _write(
        arguments,
        stereo_json(result),
        lambda path: write_pose(path, result.T_H_D, arguments.format),
    )


@command(
    arg("input", type=Path, help="file by OpenCV, ROS, Kalibr, RealSense, Open3D or Azure Kinect"),
    output_file("--output", "file to write", required=True),
    arg("--format", choices=CALIBRATION_FORMATS, required=True, help="format of the output"),
    arg("--camera", metavar="NAME", help="which camera of the file (default: the first)"),
    arg(
        "--size",
        type=int,
        nargs=2,
        metavar=("WIDTH", "HEIGHT"),
        help="size of the images in pixels, where the file does not say it",
    ),
    example="handcal rig convert camchain.yaml --format opencv --output camera.yaml",
)
def convert(arguments: argparse.Namespace) -> None:
    """Convert intrinsics or a stereo pose between the files of OpenCV, ROS and handcal."""
    from handcal.rig.formats import has_pose, read_camera, read_pose, write_intrinsics, write_pose

    make_folder(arguments.output.parent)
    source, output, kind = arguments.input, arguments.output, arguments.format
    try:
        if has_pose(source):
            write_pose(output, read_pose(source), kind)
        else:
            write_intrinsics(output, read_camera(source, arguments.camera, arguments.size), kind)
    except ValueError as error:
        raise HandcalError(str(error)) from error
    console.print(str(output))


def _conclude(rms_px: float, worst: WorstView, verdict: CalibrationVerdict) -> None:
    console.print(f"RMS {rms_px:.3f} px. Worst: {worst.name}, {worst.rms_px:.2f} px: {worst.why}")
    show_verdict(verdict)


def _write(
    arguments: argparse.Namespace, result: dict[str, Any], in_another: Callable[[Path], None]
) -> None:
    """Write a result if asked: all of it as JSON, or the part that another format holds."""
    if arguments.output is None:
        return
    make_folder(arguments.output.parent)
    if arguments.format == "json":
        write_json(arguments.output, result)
    else:
        try:
            in_another(arguments.output)
        except ValueError as error:
            raise HandcalError(str(error)) from error
    console.print(str(arguments.output))
