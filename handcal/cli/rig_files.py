"""``handcal rig grid, display, make, check, compare, migrate``: displays and rig files."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.cli.output import console, save, table
from handcal.cli.rig import (
    BOARD_OPTIONS,
    GRID_OPTION,
    board_of,
    grid_of,
    show_verdict,
    show_views,
    views_of,
)
from handcal.cli.terminal import arg, command, number, one_of
from handcal.errors import HandcalError
from handcal.io.files import make_folder
from handcal.types import EYES

if TYPE_CHECKING:
    from handcal.rig.viewpoint import ViewpointPose
    from handcal.types import Intrinsics, Rig


_METRES = number(float, 0.1, 100.0)
_RIG_AND_OUTPUT = (
    arg(
        "--rig",
        type=Path,
        metavar="FILE",
        help="rig file to start from (default: the shipped example)",
    ),
    arg("--output", type=Path, metavar="FILE", required=True, help="rig file to write"),
)


@command(
    arg(
        "--display",
        type=number(int, 60, 16384),
        nargs=2,
        metavar=("WIDTH", "HEIGHT"),
        default=(1268, 720),
        help="size of the display in pixels",
    ),
    arg("--png", type=Path, metavar="FILE", required=True, help="image to write"),
    GRID_OPTION,
)
def grid(arguments: argparse.Namespace) -> None:
    """Make the grid that a display shows to the viewpoint camera, pixel for pixel."""
    from handcal.io.images import write_png
    from handcal.rig.grid import draw_grid

    made = grid_of(arguments, *arguments.display)
    make_folder(arguments.png.parent)
    write_png(arguments.png, draw_grid(made))
    columns, rows = made.squares
    console.print(
        f"{arguments.png}: {columns}×{rows} squares of {made.square_px} px; show it unscaled"
    )


@command(
    arg("images", type=Path, nargs="+", help="images of the grid, or folders of images"),
    arg("--eye", choices=EYES, required=True, help="eye whose display is calibrated"),
    arg(
        "--camera-intrinsics",
        type=Path,
        metavar="FILE",
        required=True,
        help="intrinsics of the viewpoint camera",
    ),
    one_of(
        arg(
            "--stereo",
            type=Path,
            metavar="FILE",
            help="pose of the viewpoint camera: JSON from 'handcal rig stereo' with the viewpoint "
            "camera as its depth camera",
        ),
        arg(
            "--tracked",
            type=Path,
            metavar="FILE",
            help="poses of the board in --board-images, as tracked by the headset: JSON",
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
        arg(
            "--distance-m",
            type=_METRES,
            metavar="M",
            help="measured distance z(C0→S) of the virtual image",
        ),
        arg(
            "--square-arcmin",
            type=number(float, 1.0, 10_000.0),
            metavar="ARCMIN",
            help="angle that a square of the grid subtends at --nominal-distance-m, to solve "
            "z(C0→S)",
        ),
    ),
    arg(
        "--nominal-distance-m",
        type=_METRES,
        metavar="M",
        default=2.0,
        help="nominal distance of the virtual image",
    ),
    arg(
        "--view",
        type=Path,
        metavar="FILE",
        help="T_V_H, from the headset rig to this eye's rendering camera as the headset reports "
        "it: 4 rows of 4 numbers, metres, x right, y down, z forward (default: as in --rig)",
    ),
    arg("--drop", nargs="+", default=(), metavar="NAME", help="images to leave out"),
    GRID_OPTION,
    *BOARD_OPTIONS,
    *_RIG_AND_OUTPUT,
)
def display(arguments: argparse.Namespace) -> None:
    """Calibrate one eye's display from the viewpoint camera's images of its grid."""
    import numpy as np

    from handcal.rig.assemble import with_display
    from handcal.rig.formats import read_intrinsics
    from handcal.rig.steps import DisplayInputs, calibrate_eye_display

    rig, eye = _read_rig(arguments.rig), arguments.eye
    camera = read_intrinsics(arguments.camera_intrinsics)
    viewpoint = _viewpoint(arguments, camera)
    grid = grid_of(arguments, rig.eyes[eye].width_px, rig.eyes[eye].height_px)
    views = views_of(arguments.images, grid.board, arguments.drop)
    inputs = DisplayInputs(
        square_px=arguments.square_px,
        distance_m=arguments.distance_m,
        nominal_m=arguments.nominal_distance_m,
        pose_V_H=arguments.view,
    )
    if arguments.square_arcmin is not None:
        inputs = replace(inputs, square_arcmin=arguments.square_arcmin)
    result = calibrate_eye_display(rig, eye, views, camera, viewpoint, inputs)
    show_views(views, result.homography.residuals_px)
    place_mm = " ".join(f"{one:.2f}" for one in -1e3 * result.display.t_C0_V_m)
    console.print(
        f"z(C0→S) {result.display.z_C0_S_m:.3f} m; C0 at {place_mm} mm in V; display rotated by "
        f"{np.degrees(result.turn_rad):.2f}° against V; RMS {result.homography.rms_px:.3f} px"
    )
    show_verdict(result.verdict)
    _write(arguments.output, with_display(rig, eye, result))


@command(
    arg(
        "--stereo",
        type=Path,
        metavar="FILE",
        required=True,
        help="JSON from 'handcal rig stereo'",
    ),
    arg(
        "--depth-intrinsics",
        type=Path,
        metavar="FILE",
        help="intrinsics of the depth imager, if the stereo images are the colour imager's",
    ),
    arg(
        "--depth-to-color",
        type=Path,
        metavar="FILE",
        help="pose from the depth to the colour imager, in the same case",
    ),
    arg("--name", help="name of the rig (default: unchanged)"),
    *_RIG_AND_OUTPUT,
)
def make(arguments: argparse.Namespace) -> None:
    """Write the depth camera's pose, from a stereo calibration, into a rig file."""
    from handcal.rig.assemble import with_stereo
    from handcal.rig.formats import read_stereo
    from handcal.rig.steps import intrinsics_in, pose_in

    stereo = read_stereo(arguments.stereo)
    show_verdict(stereo.verdict)
    rig = with_stereo(
        _read_rig(arguments.rig),
        stereo,
        depth_intrinsics=intrinsics_in(arguments.depth_intrinsics),
        T_C_D=pose_in(arguments.depth_to_color),
    )
    _write(arguments.output, replace(rig, name=arguments.name or rig.name))


@command(arg("input", type=Path, help="rig file"), json=True)
def check(arguments: argparse.Namespace) -> None:
    """Check a rig file: every field, its plausibility, and how it was calibrated."""
    from handcal.rig.report import report_rig

    rig = _read_rig(arguments.input)
    findings = report_rig(rig)
    console.print(rig.name)
    for one in findings:
        doubt = "" if one.is_fine else f"  → doubtful: {one.expected} is expected"
        console.print(f"{'ok' if one.is_fine else 'check':6} {one.what}: {one.found}{doubt}")
    save(arguments.json, {"findings": [asdict(one) for one in findings]})
    doubtful = sum(not one.is_fine for one in findings)
    if doubtful:
        raise HandcalError(f"{doubtful} of {len(findings)} findings are doubtful; see above")


@command(
    arg("a", type=Path, help="rig file"),
    arg("b", type=Path, help="another rig file"),
    json=True,
)
def compare(arguments: argparse.Namespace) -> None:
    """Compare two rig files, and show how far apart they draw a target."""
    from handcal.rig.compare import compare_rigs

    differences = compare_rigs(_read_rig(arguments.a), _read_rig(arguments.b))
    shown = table("what", "differs by")
    for one in differences:
        shown.add_row(one.name, f"{one.value:.3g} {one.unit}")
    console.print(shown)
    save(arguments.json, {"differences": [asdict(one) for one in differences]})


@command(
    arg("input", type=Path, help="rig file"),
    arg("--output", type=Path, metavar="FILE", required=True, help="rig file to write"),
)
def migrate(arguments: argparse.Namespace) -> None:
    """Convert a rig file of any known version to the newest."""
    _write(arguments.output, _read_rig(arguments.input))


def _viewpoint(arguments: argparse.Namespace, camera: Intrinsics) -> ViewpointPose:
    from handcal.rig.steps import calibrate_viewpoint

    views = () if arguments.stereo else views_of(arguments.board_images, board_of(arguments))
    pose = calibrate_viewpoint(views, camera, arguments.stereo, arguments.tracked)
    if views:
        show_views(views, pose.residuals_px)
    return pose


def _read_rig(path: Path | None) -> Rig:
    from handcal.io.resources import resource_path
    from handcal.rig.rig_file import read_rig

    return read_rig(path or resource_path("example_rig.yaml"))


def _write(path: Path, rig: Rig) -> None:
    from handcal.rig.rig_file import write_rig

    make_folder(path.parent)
    try:
        write_rig(path, rig)
    except ValueError as error:
        raise HandcalError(f"this rig is not plausible: {error}") from error
    console.print(str(path), markup=False)
