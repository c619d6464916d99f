"""``handcal evaluate cube …``: the camera-based test with a cube, from its net to its report.

Commands import what they need when they run.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from handcal.cli.rig import add_square_option
from handcal.cli.terminal import (
    Commands,
    Parser,
    add_command,
    console,
    number,
    progress,
    save,
    table,
)
from handcal.errors import CameraError, HandcalError
from handcal.io.files import make_folder

if TYPE_CHECKING:
    from handcal.lab.settings import CubeTestSettings

_SHOWN = (
    ("err_t_xy_arcmin", "xy, arcmin"),
    ("err_t_xy_mm", "xy, mm"),
    ("err_t_z_mm", "z, mm"),
    ("err_R_deg", "rotation, °"),
)


def net(arguments: argparse.Namespace) -> None:
    """Make a cube: its net to print at true size, and the file that describes it."""
    from handcal.rig.cube import Cube
    from handcal.rig.cube_file import write_cube
    from handcal.rig.cube_print import write_cube_pdf

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
        raise HandcalError(str(error)) from error
    console.print(f"{arguments.pdf}: print at 100 %, and measure the ruler", markup=False)
    if arguments.cube is not None:
        make_folder(arguments.cube.parent)
        write_cube(arguments.cube, cube)
        console.print(f"{arguments.cube}: put the sides there as measured", markup=False)


def capture(arguments: argparse.Namespace) -> None:
    """Capture the real and the drawn cube with a camera, told at each step what to do."""
    from handcal.camera.viewpoint import open_viewpoint
    from handcal.lab.evaluate.cube_capture import take_captures
    from handcal.lab.evaluate.cube_folder import CapturePlan, missing_captures
    from handcal.lab.evaluate.run import cube_and_grid

    def ask(what: str) -> None:
        try:
            console.input(f"{escape(what)}, then press Enter ")
        except EOFError:
            raise HandcalError("no answer; repeat the command to take what is missing") from None

    try:
        plan = CapturePlan(
            arguments.positions, arguments.poses, arguments.drawn, not arguments.no_grid
        )
    except ValueError as error:
        raise HandcalError(str(error)) from error
    cube, grid = cube_and_grid(_settings(arguments), arguments.folder)
    if not missing_captures(arguments.folder, plan):
        console.print("All captures are there.")
        return
    which = _only_camera() if arguments.camera is None else arguments.camera
    with open_viewpoint(which, arguments.size) as camera:
        take_captures(camera, arguments.folder, plan, cube, grid, ask, console.out)


def simulate(arguments: argparse.Namespace) -> None:
    """Render all captures of a test, the display calibrated by a simulated hand."""
    from handcal.lab.evaluate.run import render_captures
    from handcal.lab.settings import CubeTestSettings
    from handcal.progress import Progress

    settings = CubeTestSettings(
        rig=_text(arguments.rig),
        eye=arguments.eye,
        seed=arguments.seed,
        poses=arguments.poses,
        alignments=arguments.alignments,
    )
    with progress() as show:
        render_captures(settings, arguments.folder, Progress(show))
    console.print(f"Captures: {arguments.folder}", markup=False)


def report(arguments: argparse.Namespace) -> None:
    """Report the errors of the drawn cube against the real one, over all captures."""
    from handcal.lab.evaluate.run import run_cube_test
    from handcal.progress import Progress
    from handcal.report.cells import mean_sd

    settings = replace(
        _settings(arguments),
        camera=_text(arguments.camera_intrinsics),
        output=str(arguments.output),
    )
    with progress() as show:
        found = run_cube_test(settings, Progress(show))
    for name, why in found.test.left_out.items():
        console.print(f"Left out: {name}: {why}", markup=False)
    errors = {
        drawn: {name: asdict(error) for name, error in by_name.items()}
        for drawn, by_name in found.summary.items()
    }
    result = {"errors": errors, "pairs": found.test.rows, "left_out": found.test.left_out}
    save(arguments.json, result)
    shown_table = table("drawn", "pairs", *(title for _, title in _SHOWN))
    for drawn, by_name in found.summary.items():
        spreads = [by_name[name].spread for name, _ in _SHOWN]
        shown_table.add_row(escape(drawn), str(spreads[0].count), *map(mean_sd, spreads))
    console.print(shown_table)
    for file in found.files:
        console.print(str(file), markup=False)


def add_cube_commands(commands: Commands) -> None:
    """Add ``handcal evaluate cube net, capture, simulate, report``."""
    from handcal.lab.evaluate.cube_folder import CapturePlan
    from handcal.rig.cube import Cube
    from handcal.rig.print_page import PAPERS

    usual, plan = Cube(), CapturePlan()
    one = add_command(commands, net, json=False)
    one.add_argument("--pdf", type=Path, metavar="FILE", required=True, help="to scale")
    one.add_argument("--paper", choices=tuple(PAPERS), default="a4", help="of the PDF")
    one.add_argument("--cube", type=Path, metavar="FILE", help="where to write its description")
    side = number(float, 1.0, 1000.0)
    one.add_argument("--side-mm", type=side, default=1e3 * usual.side_m, help="of the cube")
    one.add_argument("--marker-mm", type=side, default=1e3 * usual.marker_m, help="markers' side")
    one.add_argument("--dictionary", default=usual.dictionary, help="of the markers")
    one.add_argument(
        "--ids",
        type=number(int, 0, 9999),
        nargs=6,
        metavar=("FRONT", "RIGHT", "BACK", "LEFT", "TOP", "BOTTOM"),
        default=usual.ids,
        help="the markers",
    )

    one = add_command(commands, capture, json=False)
    _add_captures(one)
    one.add_argument("--camera", type=number(int, 0, 99), help="its number; the only one if absent")
    one.add_argument(
        "--size", type=number(int, 1, 8192), nargs=2, metavar=("W", "H"), help="asked of the camera"
    )
    one.add_argument(
        "--positions", nargs="+", default=plan.positions, metavar="NAME", help="of the camera"
    )
    one.add_argument("--poses", type=number(int, 1, 100), default=plan.poses, help="at each")
    one.add_argument(
        "--drawn", nargs="+", default=(), metavar="NAME", help="ways of drawing that are compared"
    )
    one.add_argument("--no-grid", action="store_true", help="do not capture the display's grid")

    one = add_command(commands, simulate, json=False)
    one.add_argument("folder", type=Path, help="a new folder for the captures")
    one.add_argument("--seed", type=number(int, 0, 2**32 - 1), default=1, help="of all that varies")
    one.add_argument("--poses", type=number(int, 1, 100), default=plan.poses, help="at each place")
    one.add_argument(
        "--alignments", type=number(int, 1, 20), default=1, help="of the hand at each place"
    )
    _add_rig(one)

    one = add_command(commands, report)
    _add_captures(one)
    one.add_argument(
        "--camera-intrinsics",
        type=Path,
        metavar="FILE",
        help="the eye-replacement camera's; FOLDER/camera.json if absent",
    )
    one.add_argument(
        "--output", type=Path, default=Path("results/cube"), help="folder for the report"
    )


def _add_captures(command: Parser) -> None:
    command.add_argument("folder", type=Path, help="POSITION/POSE/real.png, virtual.png")
    command.add_argument(
        "--cube", type=Path, metavar="FILE", help="its description; FOLDER/cube.json if absent"
    )
    _add_rig(command)
    add_square_option(command)


def _add_rig(command: Parser) -> None:
    from handcal.types import EYES

    command.add_argument("--rig", type=Path, help="whose display; the shipped example if absent")
    command.add_argument("--eye", choices=EYES, default="left", help="whose display")


def _settings(arguments: argparse.Namespace) -> CubeTestSettings:
    """Return the settings that the options of captures describe."""
    from handcal.lab.settings import CubeTestSettings

    return CubeTestSettings(
        captures=str(arguments.folder),
        cube=_text(arguments.cube),
        rig=_text(arguments.rig),
        eye=arguments.eye,
        square_px=arguments.square_px,
    )


def _text(path: Path | None) -> str:
    return "" if path is None else str(path)


def _only_camera() -> int:
    from handcal.camera.viewpoint import list_viewpoints

    cameras = list_viewpoints()
    if len(cameras) != 1:
        there = f"cameras {', '.join(map(str, cameras))} are there" if cameras else "there is none"
        raise CameraError(f"say which camera: --camera N; {there}")
    return cameras[0]
