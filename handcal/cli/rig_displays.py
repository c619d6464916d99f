"""``handcal rig grid, gray, display``: what a display shows, and its calibration from images."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.cli.boards import (
    BOARD_OPTIONS,
    GRID_OPTION,
    board_of,
    grid_of,
    show_verdict,
    show_views,
    views_of,
)
from handcal.cli.output import console
from handcal.cli.rig_files import RIG_AND_OUTPUT, rig_or_example, write_rig_file
from handcal.cli.terminal import (
    arg,
    command,
    file_option,
    flag,
    folder_option,
    number,
    one_of,
    value,
)
from handcal.core.errors import HandcalError
from handcal.core.types import EYES
from handcal.io.files import make_folder

if TYPE_CHECKING:
    from handcal.core.types import Intrinsics
    from handcal.rig.lens.viewpoint import ViewpointPose

_METRES = number(float, 0.1, 100.0)
_DISPLAY = arg(
    "--display",
    type=number(int, 60, 16384),
    nargs=2,
    metavar=("WIDTH", "HEIGHT"),
    default=(1268, 720),
    help="size of the display in pixels",
)


@command(
    _DISPLAY,
    file_option("--png", "image to write", required=True),
    GRID_OPTION,
)
def grid(arguments: argparse.Namespace) -> None:
    """Make the grid that a display shows to the viewpoint camera, pixel for pixel."""
    from handcal.io.images import write_png
    from handcal.rig.displays.grid import draw_grid

    made = grid_of(arguments, *arguments.display)
    make_folder(arguments.png.parent)
    write_png(arguments.png, draw_grid(made))
    columns, rows = made.squares
    console.print(
        f"{arguments.png}: {columns}×{rows} squares of {made.square_px} px; show it unscaled"
    )


@command(
    _DISPLAY,
    folder_option("--output", "folder for the patterns", required=True),
)
def gray(arguments: argparse.Namespace) -> None:
    """Make the Gray-code patterns that a display shows one after the other, in place of a grid."""
    from handcal.io.images import write_png
    from handcal.rig.displays.grid import gray_patterns

    made = dict(gray_patterns(*arguments.display))
    make_folder(arguments.output)
    for name, pattern in made.items():
        write_png(arguments.output / f"{name}.png", pattern)
    console.print(
        f"{arguments.output}: {len(made)} patterns; show each unscaled, and give the camera's "
        "image of it the same name",
        markup=False,
    )


@command(
    arg("images", type=Path, nargs="+", help="images of the grid, or folders of images"),
    flag(
        "--gray-code",
        "the images are one folder with those of the Gray-code patterns, with the same "
        "names (handcal rig gray)",
    ),
    arg("--eye", choices=EYES, required=True, help="eye whose display is calibrated"),
    file_option("--camera-intrinsics", "intrinsics of the viewpoint camera", required=True),
    one_of(
        file_option(
            "--stereo",
            "pose of the viewpoint camera: JSON from 'handcal rig stereo' with the viewpoint "
            "camera as its depth camera",
        ),
        file_option(
            "--tracked", "poses of the board in --board-images, as tracked by the headset: JSON"
        ),
    ),
    arg(
        "--board-images",
        type=Path,
        nargs="+",
        metavar="IMAGE",
        default=(),
        help="images of the tracked board, or folders of images",
    ),
    one_of(
        value("--distance-m", _METRES, "M", "measured distance z(C0→S) of the virtual image"),
        value(
            "--square-arcmin",
            number(float, 1.0, 10_000.0),
            "ARCMIN",
            "angle that a square of the grid subtends at --nominal-distance-m, to solve z(C0→S)",
        ),
    ),
    value(
        "--nominal-distance-m", _METRES, "M", "nominal distance of the virtual image", default=2.0
    ),
    file_option(
        "--view",
        "T_V_H, from the headset rig to this eye's rendering camera as the headset reports "
        "it: 4 rows of 4 numbers, metres, x right, y down, z forward (default: as in --rig)",
    ),
    arg("--drop", nargs="+", default=(), metavar="NAME", help="images to leave out"),
    GRID_OPTION,
    *BOARD_OPTIONS,
    *RIG_AND_OUTPUT,
)
def display(arguments: argparse.Namespace) -> None:
    """Calibrate one eye's display from the viewpoint camera's images of its grid."""
    import numpy as np

    from handcal.rig.displays.grid import flatness_arcmin, read_gray_code
    from handcal.rig.formats import read_intrinsics
    from handcal.rig.steps import (
        DisplayInputs,
        calibrate_by_gray_code,
        calibrate_eye_display,
        with_display,
    )

    rig, eye = rig_or_example(arguments.rig), arguments.eye
    camera = read_intrinsics(arguments.camera_intrinsics)
    viewpoint = _viewpoint(arguments, camera)
    inputs = DisplayInputs(
        square_px=arguments.square_px,
        distance_m=arguments.distance_m,
        nominal_m=arguments.nominal_distance_m,
        pose_V_H=arguments.view,
    )
    if arguments.square_arcmin is not None:
        inputs = replace(inputs, square_arcmin=arguments.square_arcmin)
    size = rig.eyes[eye].width_px, rig.eyes[eye].height_px
    if arguments.gray_code:
        if len(arguments.images) != 1:
            raise HandcalError("--gray-code takes one folder with the images of all patterns")
        seen = read_gray_code(arguments.images[0], *size)
        result = calibrate_by_gray_code(rig, eye, seen, camera, viewpoint, inputs)
        flat, bent = flatness_arcmin(seen, camera, *size)
        console.print(
            f"{len(seen.pixels)} points; a flat screen leaves {flat:.1f}′ between them, and with a "
            f"distortion by the display's pixels {bent:.1f}′"
        )
    else:
        views = views_of(arguments.images, grid_of(arguments, *size).board, arguments.drop)
        result = calibrate_eye_display(rig, eye, views, camera, viewpoint, inputs)
        show_views(views, result.homography.residuals_px)
    place_mm = " ".join(f"{one:.2f}" for one in -1e3 * result.display.t_C0_V_m)
    console.print(
        f"z(C0→S) {result.display.z_C0_S_m:.3f} m; C0 at {place_mm} mm in V; display rotated by "
        f"{np.degrees(result.turn_rad):.2f}° against V; RMS {result.homography.rms_px:.3f} px"
    )
    show_verdict(result.verdict)
    write_rig_file(arguments.output, with_display(rig, eye, result))


def _viewpoint(arguments: argparse.Namespace, camera: Intrinsics) -> ViewpointPose:
    from handcal.rig.steps import calibrate_viewpoint

    views = () if arguments.stereo else views_of(arguments.board_images, board_of(arguments))
    pose = calibrate_viewpoint(views, camera, arguments.stereo, arguments.tracked)
    if views:
        show_views(views, pose.residuals_px)
    return pose
