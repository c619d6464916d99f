"""What the commands share: how arguments are read, and results and progress shown."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypeAlias

from handcal.errors import HandcalError

if TYPE_CHECKING:
    from _typeshed import SupportsWrite


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Print the help; unlike argparse, OSError if it cannot be written."""
        print(self.format_help(), end="", file=file)

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the arguments, and end."""
        fail(f"{message}; see {self.prog} --help", 2)


Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


class _Help(argparse.ArgumentDefaultsHelpFormatter):
    def _get_help_string(self, action: argparse.Action) -> str | None:
        has_default = action.default is not None and action.default is not False
        return super()._get_help_string(action) if has_default else action.help


def add_command(
    commands: Commands, command: Callable[[argparse.Namespace], None], *, json: bool = True
) -> Parser:
    """Add a command that is called and described as its function; with `json`, ``--json`` too."""
    text = command.__doc__
    added: Parser = commands.add_parser(
        command.__name__, help=text, description=text, formatter_class=_Help
    )
    added.set_defaults(command=command)
    if json:
        added.add_argument("--json", type=Path, metavar="FILE", help="write the results here too")
    return added


def fail(message: str, code: int) -> NoReturn:
    """Say one line on standard error, and end with an exit code."""
    sys.stderr.write(f"handcal: {' '.join(message.split())}\n")
    sys.exit(code)


@contextmanager
def errors_in_one_line() -> Iterator[None]:
    """End the program with one line for every foreseen error inside the block."""
    try:
        with _flushed():
            yield
    except HandcalError as error:
        fail(str(error), 1)
    except KeyboardInterrupt:
        fail("interrupted", 130)
    except BrokenPipeError:
        _discard_output()
        sys.exit(1)
    except OSError as error:
        _discard_output()
        fail(f"cannot write the output: {error.strerror or error}", 1)


@contextmanager
def _flushed() -> Iterator[None]:
    """Write out what the block printed, also if it ends the program, as ``--help`` does."""
    try:
        yield
    except SystemExit:
        _flush()
        raise
    _flush()


def _flush() -> None:
    if sys.stdout is not None:  # None where the output is closed
        sys.stdout.flush()


def _discard_output() -> None:
    """Discard buffered output: flushing it at exit would fail again, with exit code 120."""
    sink = os.open(os.devnull, os.O_WRONLY)
    os.dup2(sink, sys.stdout.fileno())
    os.close(sink)


def number(kind: type[int] | type[float], low: float, high: float) -> Callable[[str], float]:
    """Return a converter for argparse that accepts numbers from `low` to `high`."""

    def convert(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            what = "whole number" if kind is int else "number"
            raise argparse.ArgumentTypeError(f"{text!r} is no {what} from {low} to {high}")
        return value

    return convert
