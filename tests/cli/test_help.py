"""The table of commands, which ``--help`` shows without importing them."""

from __future__ import annotations

import pkgutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.metadata import version

import pytest

import handcal.cli
from handcal.cli.main import COMMANDS, Entry, load, main
from handcal.cli.terminal import Command

pytestmark = pytest.mark.process

HEAVY = {"numpy", "scipy", "cv2", "rich", "matplotlib", "onnxruntime", "handcal.core.types"}
HELP = f"""
import sys
from handcal.cli.main import main
try:
    main()
finally:
    sys.stderr.write(" ".join({HEAVY} & sys.modules.keys()))
"""


def leaves(entries: Mapping[str, Entry], *groups: str) -> Iterator[tuple[tuple[str, ...], Entry]]:
    for name, entry in entries.items():
        if isinstance(entry.home, str):
            yield (*groups, name), entry
        else:
            yield from leaves(entry.home, *groups, name)


LEAVES = tuple(leaves(COMMANDS))
NAMES = [" ".join(words) for words, _ in LEAVES]


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> object:
    """Return the exit code."""
    monkeypatch.setattr(sys, "argv", ["handcal", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code or 0


@pytest.mark.parametrize(("words", "entry"), LEAVES, ids=NAMES)
def test_the_purpose_of_a_command_is_its_docstring(words: tuple[str, ...], entry: Entry) -> None:
    assert isinstance(entry.home, str)
    assert entry.purpose == load(words[-1], entry.home).run.__doc__


def test_every_command_is_in_the_table() -> None:
    there = set()
    for module in pkgutil.iter_modules(handcal.cli.__path__):
        for name, value in vars(import_module(f"handcal.cli.{module.name}")).items():
            if isinstance(value, Command):
                there.add((name.replace("_", "-"), module.name))
                assert value.run.__name__ == name
    assert there == {(words[-1], entry.home) for words, entry in LEAVES}


@pytest.mark.parametrize("words", ["", "rig", "evaluate", "evaluate cube", "study"])
def test_the_help_of_a_group_imports_no_command(words: str) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", HELP, *words.split(), "--help"], capture_output=True, text=True
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    assert "COMMAND" in ended.stdout


@pytest.mark.parametrize("words", [words for words, _ in LEAVES], ids=NAMES)
def test_every_command_has_help(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    assert run(monkeypatch, *words, "--help") == 0
    shown = capsys.readouterr().out
    assert shown.startswith(f"usage: handcal {' '.join(words)} ")
    assert "None" not in shown


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("", "required: COMMAND; see handcal --help"),
        ("nonsense", "invalid choice: 'nonsense'"),
        ("sol", "invalid choice: 'sol'"),
        ("--nonsense solve", "required: session; see handcal solve --help"),
        ("--nonsense solve a", "unrecognized arguments: --nonsense; see handcal --help"),
        ("solve a --nonsense", "unrecognized arguments: --nonsense; see handcal solve --help"),
        ("rig check a b", "unrecognized arguments: b; see handcal rig check --help"),
        ("rig", "required: COMMAND; see handcal rig --help"),
        ("rig solve", "invalid choice: 'solve'"),
        ("-- nonsense", "invalid choice: "),
    ],
)
def test_a_wrong_name_is_one_line(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    line: str,
    problem: str,
) -> None:
    assert run(monkeypatch, *line.split()) == 2
    error = capsys.readouterr().err
    assert error.startswith("handcal: ")
    assert error.endswith(" --help\n")
    assert error.count("\n") == 1
    assert problem in error


@pytest.mark.parametrize("words", [("--version",), ("--version", "solve")])
def test_the_version_is_printed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    assert run(monkeypatch, *words) == 0
    assert capsys.readouterr().out == f"handcal {version('handcal')}\n"
