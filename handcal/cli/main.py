"""The command line: ``handcal COMMAND``; exit code 0 for success, 1 for failure, 2 for misuse.

Commands import what they need when they run, so that ``handcal --help`` answers at once.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import get_args

from handcal.cli.cameras import add_realsense_options, record, replay, segment
from handcal.cli.checks import bench, doctor
from handcal.cli.evaluate import add_evaluate_commands
from handcal.cli.rig import add_rig_commands
from handcal.cli.rig_files import add_rig_file_commands
from handcal.cli.sessions import export, solve
from handcal.cli.simulate import demo, headset
from handcal.cli.study import add_study_commands
from handcal.cli.terminal import Parser, add_command, errors_in_one_line, number
from handcal.export.formats import FORMATS
from handcal.hand.settings import Roi
from handcal.types import METHODS


def main() -> None:
    """Run a command; every foreseen error is one line."""
    with errors_in_one_line():
        arguments = _parser().parse_args()
        arguments.command(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="handcal",
        description="Calibrate an optical see-through headset with the wearer's bare hand.",
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)

    def add(command: Callable[[argparse.Namespace], None], *, json: bool = True) -> Parser:
        return add_command(commands, command, json=json)

    share, count, seed = number(float, 0.0, 1.0), number(int, 1, 20), number(int, 0, 2**32 - 1)
    milliseconds = number(float, 0.0, 10_000.0)

    one = add(demo)
    one.add_argument(
        "--output", type=Path, default=Path("results/demo"), help="where to put the session"
    )
    one.add_argument("--seed", type=seed, default=1, help="of wearer, hand, room and noise")
    one.add_argument(
        "--alignments", type=count, default=1, metavar="K", help="how often, each eye if apart"
    )
    one.add_argument(
        "--eyes", choices=("both", "each"), default="both", help="aligned at once, or apart"
    )
    one.add_argument("--loss", type=share, default=0.0, help="share of datagrams lost")
    one.add_argument("--reorder", type=share, default=0.0, help="share of datagrams reordered")
    one.add_argument("--rig", type=Path, help="rig file; the shipped example if absent")
    one.add_argument(
        "--worn-rig", type=Path, help="the true rig of the simulated headset, if it is another"
    )

    one = add(segment, json=False)
    one.add_argument("--color", type=Path, required=True, help="colour image")
    one.add_argument("--depth", type=Path, required=True, help="16-bit PNG aligned to it")
    one.add_argument(
        "--intrinsics",
        type=Path,
        required=True,
        help="JSON with width, height, fx, fy, cx, cy and depth_scale (metres a unit)",
    )
    one.add_argument("--output", type=Path, required=True, help="folder for the results")
    _add_roi(one)

    one = add(solve)
    one.add_argument("session", type=Path, help="a session's folder")
    one.add_argument("--method", choices=METHODS, help="solver; the session's own if absent")

    one = add(export, json=False)
    metres = number(float, 1e-3, 1e6)
    one.add_argument("session", type=Path, help="a session's folder")
    one.add_argument(
        "--output", type=Path, help="folder for the files; results/export/NAME if absent"
    )
    one.add_argument(
        "--format", action="append", choices=tuple(FORMATS), help="may be repeated; all if absent"
    )
    one.add_argument("--near-m", type=metres, default=0.1, help="OpenGL's near plane")
    one.add_argument("--far-m", type=metres, default=100.0, help="OpenGL's far plane")

    one = add(replay)
    one.add_argument("recording", type=Path, help=".db3 or .bag file, or a recorded folder")
    one.add_argument(
        "--real-time", action="store_true", help="at the recorded pace, dropping frames"
    )
    _add_roi(one)

    one = add(record)
    one.add_argument("output", type=Path, help="a .db3 file, or a new folder")
    one.add_argument(
        "--source", default="realsense", help="realsense, simulator, or a recording to convert"
    )
    one.add_argument(
        "--seconds", type=number(float, 0.01, 86_400.0), default=60.0, help="end after so long"
    )
    one.add_argument(
        "--frames", type=number(int, 1, 100_000), default=100_000, help="end after so many"
    )
    one.add_argument("--seed", type=seed, default=1, help="of the simulated hand and room")
    add_realsense_options(one)

    one = add(headset, json=False)
    port = number(int, 1, 65535)
    one.add_argument("--port", type=port, required=True, help="where the PC listens")
    one.add_argument(
        "--scene-port",
        type=port,
        help="where a simulated camera listens on this computer; without, none sees the wearer",
    )
    one.add_argument("--host", default="127.0.0.1", help="the PC")
    one.add_argument("--key-file", type=Path, help="pairing key; else in HANDCAL_PAIRING_KEY")
    one.add_argument("--rig", type=Path, help="rig file; the shipped example if absent")
    one.add_argument("--worn-rig", type=Path, help="the true rig, if it is another")
    one.add_argument("--seed", type=seed, default=1, help="of the wearer")
    one.add_argument("--loss", type=share, default=0.0, help="share of datagrams lost")
    one.add_argument("--reorder", type=share, default=0.0, help="share of datagrams reordered")
    one.add_argument("--duplicate", type=share, default=0.0, help="share of datagrams doubled")
    one.add_argument("--delay-ms", type=milliseconds, default=0.0, help="of every datagram")
    one.add_argument(
        "--clock-offset-ms",
        type=number(float, -1e9, 1e9),
        default=12345.0,
        help="headset's clock less the PC's",
    )
    one.add_argument("--duration-s", type=number(float, 0.0, 1e6), help="end after so long")

    one = add(bench)
    one.add_argument("--quick", action="store_true", help="few repetitions: only a look")
    one.add_argument("--only", metavar="PART", default="", help="one part, such as offline")
    one.add_argument(
        "--gui",
        action="store_true",
        help="the desktop program instead: needs a display, 12 minutes",
    )
    add(doctor, json=False)

    text = "How well handcal does on given data."
    judged = commands.add_parser("evaluate", help=text, description=text)
    add_evaluate_commands(judged.add_subparsers(metavar="WHAT", required=True, parser_class=Parser))

    text = "Studies on simulated wearers, in many processes, each with a report."
    study = commands.add_parser("study", help=text, description=text)
    add_study_commands(study.add_subparsers(metavar="STUDY", required=True, parser_class=Parser))

    text = "The offline calibration: boards, cameras, displays, and the rig file made of them."
    rig = commands.add_parser("rig", help=text, description=text)
    steps = rig.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    add_rig_commands(steps)
    add_rig_file_commands(steps)
    return parser


def _add_roi(command: Parser) -> None:
    command.add_argument(
        "--roi",
        choices=get_args(Roi),
        default="detector",
        help="look for the hand where the detector sees it in the colour image (of several the "
        "nearest, leftmost or rightmost), or by depth alone",
    )
