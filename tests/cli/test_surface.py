"""All commands with their options, and all formats: what users' scripts rely on stays there.

After a deliberate change, write the list again: ``python -m tests.cli.test_surface``.
"""

from __future__ import annotations

import json
import os
import pkgutil
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import get_args

import pytest

import handcal.cli
from handcal.cli.main import COMMANDS, Group, load, parse, purpose
from handcal.cli.terminal import Command, Parser
from handcal.export.formats import FORMATS, TOOL_FORMATS, Format
from tests.helpers import DATA, ROOT

COMMAND_LIST = DATA / "commands.json"
FORMAT_LIST = [
    "report", "html", "csv", "yaml", "json", "ply", "zip", "unity", "openxr", "northstar", "slicer",
]  # fmt: skip
HEAVY = {"numpy", "scipy", "cv2", "rich", "matplotlib", "onnxruntime", "handcal.core.types"}
HELP = f"""
import sys
from handcal.cli.main import main
try:
    main()
finally:
    sys.stderr.write(" ".join({HEAVY} & sys.modules.keys()))
"""


def leaves(entries: Mapping[str, str | Group] = COMMANDS, *words: str) -> Iterator[tuple[str, str]]:
    """Yield the words of each command, and its module."""
    for name, entry in entries.items():
        if isinstance(entry, Group):
            yield from leaves(entry.commands, *words, name)
        else:
            yield " ".join([*words, name]), entry


def listed() -> dict[str, list[str]]:
    """Return the options and arguments of each command."""
    commands = {}
    for words, module in leaves():
        parser = Parser(add_help=False)
        load(words.split()[-1], module).add_to(parser)
        names = (
            action.option_strings or [str(action.metavar or action.dest.upper())]
            for action in parser._actions
        )
        commands[words] = sorted(name for those in names for name in those)
    return commands


def test_every_command_and_option_is_there() -> None:
    assert listed() == json.loads(COMMAND_LIST.read_text())


def test_every_format_of_an_export_is_there() -> None:
    assert [*FORMATS, *TOOL_FORMATS] == FORMAT_LIST == list(get_args(Format))


def test_every_command_is_in_the_table_with_its_purpose() -> None:
    there = {
        (name.replace("_", "-"), module.name, value.run.__doc__)
        for module in pkgutil.iter_modules(handcal.cli.__path__)
        for name, value in vars(import_module(f"handcal.cli.{module.name}")).items()
        if isinstance(value, Command)
    }
    names = [(words.split()[-1], module) for words, module in leaves()]
    assert there == {(name, module, purpose(name, module)) for name, module in names}


@pytest.mark.process
@pytest.mark.parametrize("words", ["", "rig", "evaluate cube"])
def test_the_help_of_a_group_imports_no_command(words: str) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", HELP, *words.split(), "--help"], capture_output=True, text=True
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "COMMAND" in ended.stdout


def test_every_command_has_help(
    handcal: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    for words, _ in leaves():
        with pytest.raises(SystemExit, match="0"):
            handcal(*words.split(), "--help")
        shown = capsys.readouterr().out
        assert shown.startswith(f"usage: handcal {words} ")
        assert "None" not in shown
        assert f"\nexample:\n  handcal {words}" in shown


def test_every_example_is_understood(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for words, module in leaves():
        command = load(words.split()[-1], module)
        assert parse(shlex.split(command.example)[1:]).command is command.run


COMPLETE = """
source "$0"
COMP_WORDS=(handcal "$@")
COMP_CWORD=$#
_handcal
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.mark.process
@pytest.mark.skipif(shutil.which("bash") is None, reason="completes in bash")
@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (["so"], {"solve"}),
        (["rig", "c"], {"camera", "check", "compare", "convert"}),
        (["evaluate", "cube", ""], {"capture", "net", "report", "simulate", "track"}),
        (["pair", "--m"], {"--minutes"}),
        (["rig", "board", "--png", "a.png", "--pa"], {"--paper"}),
        (["rig", "board", "--paper", "a"], {"a0", "a1", "a2", "a3", "a4"}),
        (["openxr", "use", "a session", "--k"], {"--keep"}),
        (["rig", "nonsense", ""], {""}),
    ],
)
def test_bash_completes(line: list[str], expected: set[str], tmp_path: Path) -> None:
    program = tmp_path / "handcal"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m handcal "$@"\n')
    program.chmod(0o755)
    ended = subprocess.run(
        ["bash", "-c", COMPLETE, ROOT / "installer/linux/handcal.bash", *line],
        env=os.environ | {"PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"},
        capture_output=True,
        check=True,
        text=True,
    )
    assert set(ended.stdout.splitlines()) == expected
    assert ended.stderr == ""


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("", "required: COMMAND; see handcal --help"),
        ("sol", "invalid choice: 'sol'"),
        ("--nonsense solve", "required: session; see handcal solve --help"),
        ("--nonsense solve a", "unrecognized arguments: --nonsense; see handcal --help"),
        ("solve a --nonsense", "unrecognized arguments: --nonsense; see handcal solve --help"),
        ("rig", "required: COMMAND; see handcal rig --help"),
        ("-- nonsense", "invalid choice: "),
    ],
)
def test_a_wrong_name_is_one_line(
    fails: Callable[..., tuple[int, str]], line: str, problem: str
) -> None:
    code, error = fails(*line.split())
    assert code == 2
    assert problem in error


def test_the_version_is_printed(
    handcal: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        handcal("--version", "solve")
    assert capsys.readouterr().out == f"handcal {version('handcal')}\n"


if __name__ == "__main__":
    COMMAND_LIST.write_text(json.dumps(listed(), indent=1, sort_keys=True) + "\n")
