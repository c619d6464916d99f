"""``handcal evaluate cube …``: the camera-based test with a cube, from its net to its report.

Commands import what they need when they run.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from handcal.cli.output import console, progress, save, table
from handcal.cli.rig import add_square_option, grid_of
from handcal.cli.terminal import Commands, Parser, add_command, number
from handcal.errors import CameraError, HandcalError
from handcal.io.files import make_folder

if TYPE_CHECKING:
    from handcal.rig.cube import Cube
    from handcal.rig.grid import Grid
    from handcal.types import Rig

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

    def ask(what: str) -> None:
        try:
            console.input(f"{escape(what)}, then press Enter ")
        except EOFError:
            raise HandcalError("no answer; the same command goes on with what is missing") from None

    try:
        plan = CapturePlan(
            arguments.positions, arguments.poses, arguments.drawn, not arguments.no_grid
        )
    except ValueError as error:
        raise HandcalError(str(error)) from error
    cube, grid = _cube(arguments), _grid(arguments)
    if not missing_captures(arguments.folder, plan):
        console.print("All captures are there.")
        return
    which = _only_camera() if arguments.camera is None else arguments.camera
    with open_viewpoint(which, arguments.size) as camera:
        take_captures(camera, arguments.folder, plan, cube, grid, ask, console.out)


def simulate(arguments: argparse.Namespace) -> None:
    """Render all captures of a test, the display calibrated by a simulated hand."""
    from handcal.sim.cube_captures import CaptureSettings, write_captures

    settings = CaptureSettings(
        seed=arguments.seed,
        eye=arguments.eye,
        poses=arguments.poses,
        alignments=arguments.alignments,
    )
    with progress() as show:
        write_captures(arguments.folder, _rig(arguments), settings, show)
    console.print(f"Captures: {arguments.folder}", markup=False)


def report(arguments: argparse.Namespace) -> None:
    """Tell from all captures how far the drawn cube is from the real one."""
    from handcal.lab.evaluate.cube_report import cube_report
    from handcal.lab.evaluate.cube_summary import cube_summary
    from handcal.lab.evaluate.cube_test import judge_captures
    from handcal.lab.study.store import free_of_studies
    from handcal.report.cells import mean_sd
    from handcal.report.write import write_report
    from handcal.rig.formats import read_intrinsics

    output = free_of_studies(arguments.output)
    cube, grid = _cube(arguments), _grid(arguments)
    camera = read_intrinsics(arguments.camera_intrinsics or arguments.folder / "camera.json")
    with progress() as show:
        test = judge_captures(arguments.folder, cube, camera, grid, show)
        for name, why in test.left_out.items():
            console.print(f"Left out: {name}: {why}", markup=False)
        if not test.rows:
            raise HandcalError("no pair of captures can be evaluated; see above")
        summary = cube_summary(test.rows)
        described = cube_report(test, summary, cube, camera)
        written = write_report(output, described, lambda share: show("Writing the report", share))
    errors = {
        drawn: {name: asdict(error) for name, error in found.items()}
        for drawn, found in summary.items()
    }
    save(arguments.json, {"errors": errors, "pairs": test.rows, "left_out": test.left_out})
    shown_table = table("drawn", "pairs", *(title for _, title in _SHOWN))
    for drawn, found in summary.items():
        spreads = [found[name].spread for name, _ in _SHOWN]
        shown_table.add_row(escape(drawn), str(spreads[0].count), *map(mean_sd, spreads))
    console.print(shown_table)
    for file in written:
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


def _cube(arguments: argparse.Namespace) -> Cube:
    from handcal.rig.cube_file import read_cube

    return read_cube(arguments.cube or arguments.folder / "cube.json")


def _grid(arguments: argparse.Namespace) -> Grid:
    display = _rig(arguments).eyes[arguments.eye]
    return grid_of(arguments, display.width_px, display.height_px)


def _rig(arguments: argparse.Namespace) -> Rig:
    from handcal.io.resources import resource_path
    from handcal.rig.rig_file import read_rig

    return read_rig(arguments.rig or resource_path("example_rig.yaml"))


def _only_camera() -> int:
    from handcal.camera.viewpoint import list_viewpoints

    cameras = list_viewpoints()
    if len(cameras) != 1:
        there = f"cameras {', '.join(map(str, cameras))} are there" if cameras else "there is none"
        raise CameraError(f"say which camera: --camera N; {there}")
    return cameras[0]
