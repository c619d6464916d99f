"""``handcal rig make, depth, check, compare``: rig files and the depth camera in them."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.cli.boards import BOARD_OPTIONS, board_of, show_verdict
from handcal.cli.cameras import REALSENSE_OPTIONS, open_source, realsense_of
from handcal.cli.output import console, save, show_progress, table, until_interrupted
from handcal.cli.run import KEYS, LISTEN
from handcal.cli.terminal import arg, command, file_option, flag, patience
from handcal.core.errors import HandcalError
from handcal.io.files import make_folder

if TYPE_CHECKING:
    from handcal.camera.camera import Camera
    from handcal.core.types import Rig

RIG_AND_OUTPUT = (
    file_option("--rig", "rig file to start from (default: the shipped example)"),
    file_option("--output", "rig file to write", required=True),
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
)
def make(arguments: argparse.Namespace) -> None:
    """Write the depth camera's pose, from stereo calibration or the factory, into a rig file."""
    from handcal.rig.formats import read_stereo
    from handcal.rig.steps import identity_in, intrinsics_in, pose_in, with_stereo

    if (arguments.stereo is None) == (arguments.factory is None):
        raise HandcalError("give either --stereo or --factory")
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
    from handcal.station.camera_pose import run_camera_pose

    settings = hololens2_settings(arguments.factory)
    if settings is None or settings.realsense_rig is not None:
        raise HandcalError(f"--factory: a headset is hololens2:HOST, not {arguments.factory}")
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
    console.print(f"{'good' if finding.is_fine else 'doubtful'}: {finding.found}", markup=False)
    if not finding.is_fine:
        why = explain_depth(measured, board.square_m)
        console.print(why or "add views, at more distances", markup=False)
    if found.board.words:
        console.print(f"The board is not as entered: {found.board.words}", markup=False)
    if found.edges is None:
        console.print(f"Edges not measured: {found.why_no_edges}", markup=False)
    else:
        rig = replace(rig, depth_edges=found.edges)
    console.print(f"Edges outside the true ones: {edges_finding(rig).found}", markup=False)
    write_rig_file(arguments.output, replace(rig, depth_check=measured))


@command(arg("input", type=Path, help="rig file"), json=True)
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
        console.print(f"{mark:6} {one.what}: {one.found}{doubt}")
    save(arguments.json, {"findings": [asdict(one) for one in findings]})
    doubtful = sum(not one.is_fine for one in findings)
    if doubtful:
        raise HandcalError(f"{doubtful} of {len(findings)} findings are doubtful", "see above")


@command(
    arg("a", type=Path, help="rig file"),
    arg("b", type=Path, help="another rig file"),
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
    console.print(str(path), markup=False)
