"""The command line: ``handcal COMMAND``; exit code 0 for success, 1 for failure, 2 for misuse.

Only the module of the chosen command is imported, so that ``handcal --help`` answers at once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, redirect_stdout
from importlib import import_module
from importlib.abc import InspectLoader
from importlib.util import find_spec
from io import TextIOWrapper
from types import CodeType
from typing import NamedTuple, cast

from handcal.cli.terminal import STANDARD_OUTPUT, Command, Parser, errors_in_one_line


class Group(NamedTuple):
    """Commands with a common first word."""

    purpose: str
    commands: Mapping[str, str | Group]
    """As `COMMANDS`."""


COMMANDS: Mapping[str, str | Group] = {
    "demo": "simulate",
    "run": "run",
    "headset": "simulate",
    "pair": "pairing",
    "devices": "pairing",
    "record": "cameras",
    "replay": "recordings",
    "segment": "recordings",
    "solve": "sessions",
    "prior": "sessions",
    "export": "sessions",
    "openxr": Group(
        "Give the calibrated eyes to every OpenXR program of this user.",
        {
            "install": "openxr",
            "use": "openxr",
            "status": "openxr",
            "remove": "openxr",
            "client": "openxr",
        },
    ),
    "session": Group(
        "Check and repair stored sessions.",
        {
            "check": "sessions",
            "repair": "sessions",
        },
    ),
    "inspect": "sessions",
    "rig": Group(
        "Calibrate the rig offline: boards, cameras, displays, and the rig file.",
        {
            "board": "rig",
            "take": "rig",
            "camera": "rig",
            "stereo": "rig",
            "convert": "rig",
            "grid": "rig_files",
            "gray": "rig_files",
            "display": "rig_files",
            "make": "rig_files",
            "depth": "rig_files",
            "display-check": "display_check",
            "check": "rig_files",
            "compare": "rig_files",
            "accept": "accept",
            "simulate": "accept",
        },
    ),
    "evaluate": Group(
        "Evaluate handcal on given images and sessions.",
        {
            "cube": Group(
                "Camera-based test: the error between a drawn cube and the real one.",
                {
                    "track": "cube_live",
                    "net": "cube",
                    "capture": "cube",
                    "simulate": "cube",
                    "report": "cube",
                },
            ),
            "detector": "evaluate",
            "segmentation": "evaluate",
            "trials": "cube_live",
            "users": "evaluate",
        },
    ),
    "study": Group(
        "Run a study on simulated wearers, in many processes, with a report.",
        {
            "noise": "study",
            "methods": "study",
            "procedures": "study",
            "recorded": "study",
        },
    ),
    "bench": "checks",
    "doctor": "checks",
    "support": "checks",
}
"""The module of `handcal.cli` that holds a command's function, by the command's name."""


def main() -> None:
    """Run a command; every expected error is one line."""
    os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")  # its warnings would be further lines
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # Windows writes files and pipes without φ and →
            stream.reconfigure(errors="replace")
    with errors_in_one_line():
        arguments = parse(sys.argv[1:])
        # Imported late: --help needs nothing of it.
        from handcal.io.configuration import keep_font_list_in_configuration

        keep_font_list_in_configuration()
        is_piped = getattr(arguments, "json", None) == STANDARD_OUTPUT
        with redirect_stdout(sys.stderr) if is_piped else nullcontext():
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
    loaded: Command = getattr(import_module(f"handcal.cli.{module}"), name.replace("-", "_"))
    return loaded


def purpose(name: str, module: str) -> str:
    """Return the docstring of a command's function.

    It is read from the compiled module: importing all commands takes seconds, and ``--help`` must
    not.
    """
    spec = find_spec(f"handcal.cli.{module}")
    assert spec is not None
    # Not asserted: the loader of a packaged program has the method without the class.
    code = cast(InspectLoader, spec.loader).get_code(spec.name)
    assert code is not None
    functions = (part for part in code.co_consts if isinstance(part, CodeType))
    function = next(part for part in functions if part.co_name == name.replace("-", "_"))
    return str(function.co_consts[0])  # Python's place for a docstring


def _add(parser: Parser, entries: Mapping[str, str | Group], words: Sequence[str]) -> None:
    """Add commands to a parser; only the command that begins `words` gets its options."""
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    # No option before a command takes a value.
    place = next((i for i, word in enumerate(words) if not word.startswith("-")), len(words))
    for name, entry in entries.items():
        text = entry.purpose if isinstance(entry, Group) else purpose(name, entry)
        subparser = commands.add_parser(name, help=text, description=text)
        if [name] != list(words[place : place + 1]):
            continue
        if isinstance(entry, Group):
            _add(subparser, entry.commands, words[place + 1 :])
        else:
            load(name, entry).add_to(subparser)


class _Version(argparse.Action):
    """Prints the version; it is looked up only on request."""

    def __call__(self, *_: object) -> None:
        from importlib.metadata import version

        print(f"handcal {version('handcal')}")  # noqa: T201
        sys.exit()
