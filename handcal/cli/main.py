"""The command line: ``handcal COMMAND``; exit code 0 for success, 1 for failure, 2 for misuse.

Only the module of the chosen command is imported, so that ``handcal --help`` answers at once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from io import TextIOWrapper
from typing import NamedTuple

from handcal.cli.terminal import Command, Parser, errors_in_one_line, require_writable


class Entry(NamedTuple):
    """A command or a group of commands, as ``--help`` lists it."""

    purpose: str
    """The docstring of the command's function."""
    home: str | Mapping[str, Entry]
    """The module of the function, or the commands of the group."""


_CUBE: Mapping[str, Entry] = {
    "track": Entry(
        "Track a cube with the depth camera, and have the headset draw it where it is.",
        "cube_live",
    ),
    "net": Entry(
        "Make a cube: its net to print at true size, and the file that describes it.", "cube"
    ),
    "capture": Entry(
        "Capture the real and the drawn cube with a camera, guided step by step.", "cube"
    ),
    "simulate": Entry(
        "Render all captures of a test, with a display calibrated by a simulated hand.", "cube"
    ),
    "report": Entry(
        "Report the errors of the drawn cube against the real one, over all captures.", "cube"
    ),
}

_EVALUATE: Mapping[str, Entry] = {
    "cube": Entry("Camera-based test: the error between a drawn cube and the real one.", _CUBE),
    "detector": Entry(
        "Measure the hand detector's precision on annotated photographs.", "evaluate"
    ),
    "segmentation": Entry(
        "Measure the segmentation of the hand on frames with true masks.", "evaluate"
    ),
    "trials": Entry(
        "Record the user test's trials with a cube in the room, for a calibrated session.",
        "cube_live",
    ),
    "users": Entry(
        "Evaluate the user test: the errors that wearers saw after calibration.",
        "evaluate",
    ),
}

_STUDY: Mapping[str, Entry] = {
    "noise": Entry(
        "Repeat the paper's simulation, and add disturbances that it left out.", "study"
    ),
    "methods": Entry("Compare calibration methods on the same simulated wearers.", "study"),
    "procedures": Entry("Compare calibration procedures on the same simulated wearers.", "study"),
    "recorded": Entry(
        "Run SPAAM and INDICA on the public recordings of Itoh and Klinker.", "study"
    ),
}

_RIG: Mapping[str, Entry] = {
    "board": Entry("Make a calibration board: a PDF at true size, or a PNG for a screen.", "rig"),
    "take": Entry(
        "Capture images of a board, or of a display's grid, from a camera, recording or video.",
        "rig",
    ),
    "camera": Entry("Calibrate a camera's intrinsics from images of a board.", "rig"),
    "stereo": Entry(
        "Calibrate the depth camera's pose on the headset from image pairs of one board.", "rig"
    ),
    "convert": Entry(
        "Convert intrinsics or a stereo pose between the files of OpenCV, ROS and handcal.", "rig"
    ),
    "grid": Entry(
        "Make the grid that a display shows to the viewpoint camera, pixel for pixel.",
        "rig_displays",
    ),
    "gray": Entry(
        "Make the Gray-code patterns that a display shows one after the other, in place of a grid.",
        "rig_displays",
    ),
    "display": Entry(
        "Calibrate one eye's display from the viewpoint camera's images of its grid.",
        "rig_displays",
    ),
    "make": Entry(
        "Write the depth camera's pose, from stereo calibration or the factory, into a rig file.",
        "rig_files",
    ),
    "depth": Entry(
        "Check depth and edges of the depth camera by a board, and store them in a rig file.",
        "rig_files",
    ),
    "display-check": Entry(
        "Check that a connected headset draws what it is sent, and store the check in a rig file.",
        "display_check",
    ),
    "check": Entry(
        "Check a rig file: every field, its plausibility, and how it was calibrated.", "rig_files"
    ),
    "compare": Entry(
        "Compare two rig files, and show how far apart they draw a target.", "rig_files"
    ),
    "accept": Entry(
        "Check a rig without a wearer, with a camera in the eye's place; exit code 1 if it fails.",
        "accept",
    ),
    "simulate": Entry(
        "Render the images of an offline calibration and of an acceptance, to practise with.",
        "accept",
    ),
}

_SESSION: Mapping[str, Entry] = {
    "check": Entry(
        "Check all of a session, and solve it; exit code 1 if any is bad, 2 if it is none.",
        "sessions",
    ),
    "repair": Entry("Copy the sound parts of a damaged session into a new one.", "sessions"),
}

_OPENXR: Mapping[str, Entry] = {
    "install": Entry(
        "Have every OpenXR program of this user render with the calibration in force.", "openxr"
    ),
    "use": Entry("Put a session's final calibration in force for OpenXR programs.", "openxr"),
    "status": Entry(
        "Show whether the layer is installed, whose calibration is in force, and what it last did.",
        "openxr",
    ),
    "remove": Entry("Remove the layer and end the calibration in force.", "openxr"),
}

COMMANDS: Mapping[str, Entry] = {
    "demo": Entry(
        "Calibrate a simulated wearer from start to end, and compare with the truth.", "simulate"
    ),
    "run": Entry(
        "Calibrate one wearer without a window, for scripts and for testing headset apps.", "run"
    ),
    "headset": Entry(
        "Run a virtual headset with a simulated wearer, connected by the real protocol.", "simulate"
    ),
    "pair": Entry(
        "Pair a headset: show a QR code and a short code, and wait for the headset.", "pairing"
    ),
    "devices": Entry("List the paired headsets; rename or revoke one, by its identity.", "pairing"),
    "record": Entry("Record a camera into a .db3 file or a folder of images.", "cameras"),
    "replay": Entry("Play a recording and segment the hand in every frame.", "cameras"),
    "segment": Entry(
        "Segment the hand in one image pair: cloud, contour, mask and overlay.", "cameras"
    ),
    "solve": Entry("Solve a stored session again; the session itself is not changed.", "sessions"),
    "prior": Entry(
        "Show what finished sessions with one rig tell of eyes, and of what wearers see wrongly.",
        "sessions",
    ),
    "export": Entry(
        "Export sessions: report, tables, calibration, clouds, and the session as one file.",
        "sessions",
    ),
    "openxr": Entry("Give the calibrated eyes to every OpenXR program of this user.", _OPENXR),
    "session": Entry("Check and repair stored sessions.", _SESSION),
    "inspect": Entry(
        "Show a session's clouds, residuals, eyes and displays in a 3D window.", "sessions"
    ),
    "rig": Entry("Calibrate the rig offline: boards, cameras, displays, and the rig file.", _RIG),
    "evaluate": Entry("Evaluate handcal on given images and sessions.", _EVALUATE),
    "study": Entry("Run a study on simulated wearers, in many processes, with a report.", _STUDY),
    "bench": Entry(
        "Measure accuracy and speed, and compare them with targets and a baseline.", "checks"
    ),
    "doctor": Entry(
        "Check the installation, the camera and the headset, with advice for each problem.",
        "checks",
    ),
    "support": Entry(
        "Write one file for a bug report: doctor, versions, log without names, frames if wanted.",
        "checks",
    ),
}


def main() -> None:
    """Run a command; every expected error is one line."""
    os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")  # its warnings would be further lines
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # Windows writes files and pipes without φ and →
            stream.reconfigure(errors="replace")
    with errors_in_one_line():
        arguments = parse(sys.argv[1:])
        if results := getattr(arguments, "json", None):
            require_writable(results)  # before a long task, not after it
        # Imported late: --help needs nothing of it.
        from handcal.io.configuration import keep_font_list_in_configuration

        keep_font_list_in_configuration()
        arguments.command(arguments)


def parse(words: Sequence[str]) -> argparse.Namespace:
    """Return the arguments, with the function to call as ``command``.

    Raises
    ------
    SystemExit
        If the arguments are wrong, or ask only for help or the version.
    """
    parser = Parser(
        prog="handcal",
        description="Calibrate an optical see-through headset with the wearer's bare hand.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and exit")
    _add(parser, COMMANDS, words)
    return parser.parse_args(words)


def load(name: str, module: str) -> Command:
    """Import a command from a module of `handcal.cli`."""
    found: Command = getattr(import_module(f"handcal.cli.{module}"), name.replace("-", "_"))
    return found


def _add(parser: Parser, entries: Mapping[str, Entry], words: Sequence[str]) -> None:
    """Add commands to a parser; only the command that begins `words` gets its options."""
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    # No option before a command takes a value.
    place = next((i for i, word in enumerate(words) if not word.startswith("-")), len(words))
    for name, entry in entries.items():
        made = commands.add_parser(name, help=entry.purpose, description=entry.purpose)
        if [name] != list(words[place : place + 1]):
            continue
        if isinstance(entry.home, str):
            load(name, entry.home).add_to(made)
        else:
            _add(made, entry.home, words[place + 1 :])


class _Version(argparse.Action):
    """Prints the version; it is looked up only on request."""

    def __call__(self, *_: object) -> None:
        from importlib.metadata import version

        print(f"handcal {version('handcal')}")  # noqa: T201
        sys.exit()
