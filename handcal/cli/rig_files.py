"""``handcal rig grid, gray, display, make, depth, check, compare``: displays and rig files."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from dataclasses import asdict, replace
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
from handcal.cli.cameras import REALSENSE_OPTIONS, open_source, realsense_of
from handcal.cli.output import console, save, show_progress, table, until_interrupted
from handcal.cli.run import KEYS, LISTEN
from handcal.cli.terminal import (
    arg,
    command,
    fail,
    file_option,
    flag,
    folder_option,
    number,
    one_of,
    output_file,
    patience,
    value,
)
from handcal.core.errors import HandcalError
from handcal.core.types import EYES
from handcal.io.files import make_folder

if TYPE_CHECKING:
    from handcal.camera.camera import Camera
    from handcal.core.types import Intrinsics, Rig
    from handcal.rig.lens.viewpoint import ViewpointPose

RIG_AND_OUTPUT = (
    file_option("--rig", "rig file to start from (default: the shipped example)"),
    output_file("--output", "rig file to write", required=True),
)


@command(
    file_option("--stereo", "JSON from 'handcal rig stereo'"),
    arg(
        "--factory",
        metavar="SOURCE",
        help="in place of --stereo: hololens2:HOST, a headset that knows its own depth camera",
    ),
    flag(
        "--headset",
        "with --factory: the app's poses are not of the headset's rig node; wait for the app, "
        "and measure the camera's pose against them while the wearer looks around",
    ),
    *LISTEN,
    KEYS,
    patience("until the headset connects"),
    file_option(
        "--depth-intrinsics",
        "intrinsics of the depth imager, if the stereo images are the colour imager's; "
        "depth-imager.json of 'handcal rig take' also holds the camera's serial number",
    ),
    file_option("--depth-to-color", "pose from the depth to the colour imager, in the same case"),
    arg("--name", help="name of the rig (default: unchanged)"),
    *RIG_AND_OUTPUT,
    example="handcal rig make --stereo stereo.json --name Lab --output rig.yaml",
)
def make(arguments: argparse.Namespace) -> None:
    """Write the depth camera's pose, from stereo calibration or the factory, into a rig file."""
    from handcal.rig.formats import read_stereo
    from handcal.rig.steps import identity_in, intrinsics_in, pose_in, with_stereo

    if (arguments.stereo is None) == (arguments.factory is None):
        fail("give either --stereo or --factory; see handcal rig make --help", 2)
    rig = rig_or_example(arguments.rig)
    if arguments.factory is not None:
        rig = _with_factory_pose(rig, arguments)
        write_rig_file(arguments.output, replace(rig, name=arguments.name or rig.name))
        return
    stereo = read_stereo(arguments.stereo)
    show_verdict(stereo.verdict)
    rig = with_stereo(
        rig,
        stereo,
        depth_intrinsics=intrinsics_in(arguments.depth_intrinsics),
        T_C_D=pose_in(arguments.depth_to_color),
        depth_camera=identity_in(arguments.depth_intrinsics),
    )
    write_rig_file(arguments.output, replace(rig, name=arguments.name or rig.name))


def _with_factory_pose(rig: Rig, arguments: argparse.Namespace) -> Rig:
    from handcal.camera.hololens2 import HoloLens2Camera, hololens2_settings
    from handcal.cli.display_check import network_server
    from handcal.rig.steps import with_factory_pose
    from handcal.station.poses import run_camera_pose

    settings = hololens2_settings(arguments.factory)
    if settings is None or settings.realsense_rig is not None:
        fail(f"--factory: a headset is hololens2:HOST, not {arguments.factory}", 2)
    with ExitStack() as stack:
        camera = stack.enter_context(HoloLens2Camera(settings))
        T_H_D = camera.T_H_D
        if arguments.headset:
            server = stack.enter_context(network_server(arguments))
            is_stopped = stack.enter_context(until_interrupted())
            progress = stack.enter_context(show_progress(is_stopped))
            found = run_camera_pose(server, camera, progress=progress)
            console.print(f"Single frames differ by {1e3 * found.spread_m:.1f} mm")
            T_H_D = found.T_H_D
        return with_factory_pose(rig, T_H_D, camera.depth_intrinsics, camera.identity)


@command(
    arg(
        "source",
        help="a recording of the board with depth and colour, realsense, or hololens2:HOST",
    ),
    flag("--stills", "every frame of the recording is a still image: use all that show the board"),
    *RIG_AND_OUTPUT,
    *BOARD_OPTIONS,
    *REALSENSE_OPTIONS,
    example="handcal rig depth realsense --rig rig.yaml --output checked.yaml",
)
def depth(arguments: argparse.Namespace) -> None:
    """Check depth and edges of the depth camera by a board, and store them in a rig file."""
    import numpy as np

    from handcal.camera.measure_depth import STILLS, DepthSettings, run_depth_check
    from handcal.report.cells import signed
    from handcal.rig.depth import explain_depth
    from handcal.rig.findings import depth_finding, edges_finding

    rig, board = rig_or_example(arguments.rig), board_of(arguments)
    with ExitStack() as stack:
        source = open_source(arguments.source, realsense_of(arguments), keeps_wrapped=True)
        camera = stack.enter_context(source)
        _require_own(rig, camera)
        if camera.identity.serial_number:
            rig = replace(rig, depth_camera=camera.identity)
        is_stopped = stack.enter_context(until_interrupted())
        progress = stack.enter_context(show_progress(is_stopped))
        settings = STILLS if arguments.stills else DepthSettings()
        found = run_depth_check(camera, board, settings, progress)
    measured = found.check
    scale_sigma, offset_sigma_m = np.sqrt(np.diag(measured.covariance))
    console.print(
        f"Scale {measured.scale:.4f} ± {scale_sigma:.4f}, offset "
        f"{signed(1e3 * measured.offset_m, 1)} ± {1e3 * offset_sigma_m:.1f} mm"
    )
    shown = table("range, m", "flatness, mm")
    for (near_m, far_m), flat_m, sigma_m in zip(
        measured.ranges_m, measured.flatness_m, measured.flatness_sigma_m, strict=True
    ):
        shown.add_row(f"{near_m:.1f} to {far_m:.1f}", f"{1e3 * flat_m:.2f} ± {1e3 * sigma_m:.2f}")
    console.print(shown)
    finding = depth_finding(measured)
    console.print(f"{'good' if finding.is_fine else 'doubtful'}: {finding.found}")
    if not finding.is_fine:
        why = explain_depth(measured, board.square_m)
        console.print(why or "add views, at more distances")
    if found.board.words:
        console.print(f"The board is not as entered: {found.board.words}")
    if found.edges is None:
        console.print(f"Edges not measured: {found.why_no_edges}")
    else:
        rig = replace(rig, depth_edges=found.edges)
    console.print(f"Edges outside the true ones: {edges_finding(rig).found}")
    write_rig_file(arguments.output, replace(rig, depth_check=measured))


@command(arg("input", type=Path, help="rig file"), example="handcal rig check rig.yaml", json=True)
def check(arguments: argparse.Namespace) -> None:
    """Check a rig file: every field, its plausibility, and how it was calibrated."""
    from handcal.rig.findings import report_rig

    rig = rig_or_example(arguments.input)
    findings = report_rig(rig)
    console.print(rig.name)
    for one in findings:
        doubt = "" if one.is_fine else f"  → doubtful: {one.expected} is expected"
        judged = ("ok" if one.is_fine else "check") if one.is_judged else ""
        mark = judged if one.is_known else "–"
        missing = f": run '{one.command}'" if one.command else ""
        console.print(f"{mark:6} {one.what}: {one.found}{missing}{doubt}")
    save(arguments.json, {"findings": [asdict(one) for one in findings]})
    doubtful = sum(not one.is_fine for one in findings)
    if doubtful:
        raise HandcalError(f"{doubtful} of {len(findings)} findings are doubtful", "see above")


@command(
    arg("a", type=Path, help="rig file"),
    arg("b", type=Path, help="another rig file"),
    example="handcal rig compare rig.yaml former.yaml",
    json=True,
)
def compare(arguments: argparse.Namespace) -> None:
    """Compare two rig files, and show how far apart they draw a target."""
    from handcal.rig.compare import compare_rigs

    differences = compare_rigs(rig_or_example(arguments.a), rig_or_example(arguments.b))
    shown = table("what", "differs by")
    for one in differences:
        shown.add_row(one.name, f"{one.value:.3g} {one.unit}")
    console.print(shown)
    save(arguments.json, {"differences": [asdict(one) for one in differences]})


def _require_own(rig: Rig, camera: Camera) -> None:
    """Raise HandcalError, with the differences, if a camera is not the rig's depth camera."""
    from handcal.rig.compare import compare_camera

    differences = compare_camera(rig, camera.identity, camera.depth_intrinsics)
    if differences:
        raise HandcalError(
            f"{camera.name} is not the depth camera of this rig: {'; '.join(differences)}"
        )


def rig_or_example(path: Path | None) -> Rig:
    """Read a rig file, by default the shipped example; FileError if it cannot be read."""
    from handcal.io.resources import resource_path
    from handcal.rig.rig_file import read_rig

    return read_rig(path or resource_path("example_rig.yaml"))


def write_rig_file(path: Path, rig: Rig) -> None:
    """Write a rig file and print its path; HandcalError if it is implausible or not written."""
    from handcal.rig.rig_file import write_rig

    make_folder(path.parent)
    try:
        write_rig(path, rig)
    except ValueError as error:
        raise HandcalError(f"this rig is not plausible: {error}") from error
    console.print(str(path))


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
    output_file("--png", "image to write", required=True),
    GRID_OPTION,
    example="handcal rig grid --display 1268 720 --png grid.png",
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
    example="handcal rig gray --display 1268 720 --output patterns",
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
        "image of it the same name"
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
    example="handcal rig display grid --eye left --camera-intrinsics camera.json --stereo "
    "viewpoint.json --distance-m 2 --rig rig.yaml --output rig-left.yaml",
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
            fail("--gray-code takes one folder with the images of all patterns", 2)
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
