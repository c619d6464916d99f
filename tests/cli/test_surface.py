"""All commands with their options, and all formats: what users' scripts rely on stays there.

After a deliberate change, write the list again: ``python -m tests.cli.test_surface``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import get_args

from handcal.cli.main import COMMANDS, Entry, load
from handcal.cli.terminal import Parser
from handcal.export.formats import FORMATS, TOOL_FORMATS, Format
from tests.helpers import DATA

COMMAND_LIST = DATA / "commands.json"
FORMAT_LIST = [
    "report", "html", "csv", "yaml", "json", "ply", "zip", "unity", "openxr", "northstar", "slicer",
]  # fmt: skip


def leaves(entries: Mapping[str, Entry], *groups: str) -> Iterator[tuple[tuple[str, ...], str]]:
    for name, entry in entries.items():
        if isinstance(entry.home, str):
            yield (*groups, name), entry.home
        else:
            yield from leaves(entry.home, *groups, name)


def listed() -> dict[str, list[str]]:
    """Return the options and arguments of each command."""
    commands = {}
    for words, home in leaves(COMMANDS):
        parser = Parser(add_help=False)
        load(words[-1], home).add_to(parser)
        names = (
            action.option_strings or [str(action.metavar or action.dest.upper())]
            for action in parser._actions
        )
        commands[" ".join(words)] = sorted(name for those in names for name in those)
    return commands


def test_every_command_and_option_is_there() -> None:
    assert listed() == json.loads(COMMAND_LIST.read_text())


def test_every_format_of_an_export_is_there() -> None:
    assert [*FORMATS, *TOOL_FORMATS] == FORMAT_LIST == list(get_args(Format))


if __name__ == "__main__":
    COMMAND_LIST.write_text(json.dumps(listed(), indent=1, sort_keys=True) + "\n")
