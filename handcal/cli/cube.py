"""``handcal evaluate cube``: the camera-based test with a cube, from its net to its report."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.cli.boards import GRID_OPTION
from handcal.cli.output import console, save, show_progress, table
from handcal.cli.terminal import (
    arg,
    command,
    fail,
    file_option,
    flag,
    folder_option,
    number,
    output_file,
    seed,
    settings_of,
    value,
)
from handcal.core.errors import CameraError, HandcalError
from handcal.core.types import EYES
from handcal.io.files import make_folder
from handcal.lab.evaluate.cube_folder import CapturePlan
from handcal.rig.boards.printing import PAPERS
from handcal.rig.cube import Cube

if TYPE_CHECKING:
    from handcal.lab.settings import CubeTestSettings

_SHOWN = (
    ("err_t_xy_arcmin", "xy, arcmin"),
    ("err_t_xy_mm", "xy, mm"),
    ("err_t_z_mm", "z, mm"),
    ("err_R_deg", "rotation, °"),
)


_USUAL, _PLAN = Cube(), CapturePlan()
_SIDE = number(float, 1.0, 1000.0)
_COUNT = number(int, 1, 100)
_POSES = value("--poses", _COUNT, "N", "poses of the cube at each position", default=_PLAN.poses)
_RIG_AND_EYE = (
    file_option("--rig", "rig file (default: the shipped example)"),
    arg("--eye", choices=EYES, default="left", help="eye whose display is tested"),
)
_CAPTURES = (
    arg("folder", type=Path, help="folder of the captures: POSITION/POSE/real.png, virtual.png"),
    file_option("--cube", "description of the cube (default: FOLDER/cube.json)"),
    *_RIG_AND_EYE,
    GRID_OPTION,
)


@command(
    output_file("--pdf", "net at true size", required=True),
    arg("--paper", choices=tuple(PAPERS), default="a4", help="paper size of the PDF"),
    output_file("--cube", "description of the cube (default: not written)"),
    value("--side-mm", _SIDE, "MM", "side of the cube", default=1e3 * _USUAL.side_m),
    value("--marker-mm", _SIDE, "MM", "side of a marker", default=1e3 * _USUAL.marker_m),
    arg("--dictionary", default=_USUAL.dictionary, help="ArUco dictionary of the markers"),
    arg(
        "--ids",
        type=number(int, 0, 9999),
        nargs=6,
        metavar=("FRONT", "RIGHT", "BACK", "LEFT", "TOP", "BOTTOM"),
        default=_USUAL.ids,
        help="markers of the six faces",
    ),
    example="handcal evaluate cube net --pdf net.pdf --cube cube.json",
)
def net(arguments: argparse.Namespace) -> None:
    """Make a cube: its net to print at true size, and the file that describes it."""
    from handcal.rig.cube import write_cube, write_cube_pdf

    try:
        cube = Cube(
            side_m=arguments.side_mm / 1e3,
            marker_m=arguments.marker_mm / 1e3,
            dictionary=arguments.dictionary,
            ids=tuple(arguments.ids),
        )
        make_folder(arguments.pdf.parent)
        write_cube_pdf(arguments.pdf, cube, arguments.paper)
    except ValueError as error:
        fail(str(error), 2)
    console.print(f"{arguments.pdf}: print at 100 %, and measure the ruler")
    if arguments.cube is not None:
        make_folder(arguments.cube.parent)
        write_cube(arguments.cube, cube)
        console.print(f"{arguments.cube}: enter the measured sides there")


@command(
    *_CAPTURES,
    value("--camera", number(int, 0, 99), "N", "number of the camera (default: the only one)"),
    arg(
        "--size",
        type=number(int, 1, 8192),
        nargs=2,
        metavar=("WIDTH", "HEIGHT"),
        help="image size to request (default: the camera's own)",
    ),
    arg(
        "--positions",
        nargs="+",
        default=_PLAN.positions,
        metavar="NAME",
        help="positions of the camera",
    ),
    _POSES,
    arg(
        "--drawn",
        nargs="+",
        default=(),
        metavar="NAME",
        help="names of the drawing methods to compare (default: a single one, unnamed)",
    ),
    flag("--no-grid", "do not capture the display's grid"),
    flag(
        "--automatic",
        "take each image once the cube or the grid is at rest, without Enter; between two "
        "images of the cube, cover it",
    ),
    example="handcal evaluate cube capture captures --camera 0 --automatic",
)
def capture(arguments: argparse.Namespace) -> None:
    """Capture the real and the drawn cube with a camera, guided step by step."""
    from handcal.camera.viewpoint import open_viewpoint
    from handcal.lab.evaluate.cube_capture import take_at_rest, take_captures
    from handcal.lab.evaluate.cube_folder import missing_captures
    from handcal.lab.evaluate.cube_test import cube_and_grid

    def ask(what: str) -> None:
        try:
            console.input(f"{what}, then press Enter ", markup=False)
        except EOFError:
            raise HandcalError("no answer", "repeat the command to take what is missing") from None

    try:
        plan = CapturePlan(
            arguments.positions, arguments.poses, arguments.drawn, not arguments.no_grid
        )
    except ValueError as error:
        fail(str(error), 2)
    cube, grid = cube_and_grid(_settings(arguments), arguments.folder)
    if not missing_captures(arguments.folder, plan):
        console.print("All captures have been taken.")
        return
    which = _only_camera() if arguments.camera is None else arguments.camera
    with open_viewpoint(which, arguments.size) as camera:
        if arguments.automatic:
            take_at_rest(camera, arguments.folder, plan, cube, grid, console.out)
        else:
            take_captures(camera, arguments.folder, plan, cube, grid, ask, console.out)


@command(
    arg("folder", type=Path, help="new folder for the captures"),
    seed(),
    _POSES,
    value(
        "--alignments",
        number(int, 1, 20),
        "K",
        "alignments of the hand at each position",
        default=1,
    ),
    arg(
        "--prior",
        choices=("camera", "wearer"),
        default="camera",
        help="prior of the solver: the placement of the camera, or the eye box of wearers",
    ),
    *_RIG_AND_EYE,
    example="handcal evaluate cube simulate captures --poses 2",
)
def simulate(arguments: argparse.Namespace) -> None:
    """Render all captures of a test, with a display calibrated by a simulated hand."""
    from handcal.lab.evaluate.cube_test import render_captures
    from handcal.lab.settings import CubeTestSettings

    with show_progress() as progress:
        render_captures(settings_of(CubeTestSettings, arguments), arguments.folder, progress)
    console.print(f"Captures: {arguments.folder}")


@command(
    *_CAPTURES,
    file_option(
        "--camera-intrinsics",
        "intrinsics of the camera in the eye's place (default: FOLDER/camera.json)",
    ),
    folder_option("--output", "folder for the report", default=Path("results/cube")),
    example="handcal evaluate cube report captures --output report",
    json=True,
)
def report(arguments: argparse.Namespace) -> None:
    """Report the errors of the drawn cube against the real one, over all captures."""
    from handcal.lab.evaluate.cube_test import run_cube_test
    from handcal.report.cells import mean_sd

    settings = replace(
        _settings(arguments),
        camera=str(arguments.camera_intrinsics or ""),
        output=str(arguments.output),
    )
    with show_progress() as progress:
        found = run_cube_test(settings, progress)
    for name, why in found.test.left_out.items():
        console.print(f"Left out: {name}: {why}")
    errors = {
        drawn: {name: asdict(error) for name, error in by_name.items()}
        for drawn, by_name in found.summary.items()
    }
    result = {"errors": errors, "pairs": found.test.rows, "left_out": found.test.left_out}
    save(arguments.json, result)
    shown_table = table("drawn", "pairs", *(title for _, title in _SHOWN))
    for drawn, by_name in found.summary.items():
        spreads = [by_name[name].spread for name, _ in _SHOWN]
        shown_table.add_row(drawn, str(spreads[0].count), *map(mean_sd, spreads))
    console.print(shown_table)
    for file in found.files:
        console.print(str(file))


def _settings(arguments: argparse.Namespace) -> CubeTestSettings:
    """Return the settings that the options of captures describe."""
    from handcal.lab.settings import CubeTestSettings

    # The captures' option --camera is a number, and that of the settings a file.
    return settings_of(CubeTestSettings, arguments, captures=str(arguments.folder), camera="")


def _only_camera() -> int:
    from handcal.camera.viewpoint import list_viewpoints

    cameras = list_viewpoints()
    if len(cameras) != 1:
        there = f"cameras {', '.join(map(str, cameras))} are there" if cameras else "there is none"
        raise CameraError(there, "say which camera: --camera N")
    return cameras[0]
