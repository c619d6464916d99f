"""Arguments and errors of the command line.

Imports neither NumPy nor rich, so that ``handcal --help`` answers at once.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn, TypeAlias, TypeVar

from handcal.core.errors import CancelledError, HandcalError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance, SupportsWrite

    from handcal.core.types import Eye

Settings = TypeVar("Settings", bound="DataclassInstance")

Run: TypeAlias = Callable[[argparse.Namespace], None]
Option: TypeAlias = "Callable[[argparse._ActionsContainer], object]"
"""Adds one or more arguments to a parser."""


class Command(NamedTuple):
    """A function that can be called from the command line, and its options."""

    run: Run
    options: tuple[Option, ...]
    example: str
    """A command line for the help."""

    def add_to(self, parser: Parser) -> None:
        """Add the options to the command's parser."""
        parser.formatter_class = _Help
        parser.epilog = f"example:\n  {self.example}"
        for add in self.options:
            add(parser)
        parser.set_defaults(command=self.run)


def command(*options: Option, example: str, json: bool = False) -> Callable[[Run], Command]:
    """Make a function a command with these options; with `json`, also ``--json``."""
    if json:
        purpose = "also write the results as JSON; -: to standard output, and all else to stderr"
        options = (*options, value("--json", _json_file, "FILE", purpose))
    return lambda run: Command(run, options, example)


def arg(*names: str, **settings: Any) -> Option:
    """Return an argument of a command; takes the arguments of argparse's ``add_argument``."""
    return lambda parser: parser.add_argument(*names, **settings)


def file_option(name: str, purpose: str, **settings: Any) -> Option:
    """Return an option that takes a file; the settings are those of `arg`."""
    return arg(name, type=Path, metavar="FILE", help=purpose, **settings)


def output_file(name: str, purpose: str, **settings: Any) -> Option:
    """Return an option that takes a file to write; the settings are those of `arg`.

    A file that cannot be written ends the program before the work, not after it.
    """
    return arg(name, type=_writable, metavar="FILE", help=purpose, **settings)


def folder_option(name: str, purpose: str, **settings: Any) -> Option:
    """Return an option that takes a folder; the settings are those of `arg`."""
    return arg(name, type=Path, metavar="FOLDER", help=purpose, **settings)


def flag(name: str, purpose: str, **settings: Any) -> Option:
    """Return an option that is either given or not; the settings are those of `arg`."""
    return arg(name, action="store_true", help=purpose, **settings)


def value(
    name: str, convert: Callable[[str], Any], metavar: str, purpose: str, **settings: Any
) -> Option:
    """Return an option with a value to convert from text; the settings are those of `arg`."""
    return arg(name, type=convert, metavar=metavar, help=purpose, **settings)


def one_of(*options: Option) -> Option:
    """Return options of which exactly one must be given."""

    def add(parser: argparse._ActionsContainer) -> None:
        group = parser.add_mutually_exclusive_group(required=True)
        for add_option in options:
            add_option(group)

    return add


class Parser(argparse.ArgumentParser):
    """A parser that reports an error in one line."""

    def print_help(self, file: SupportsWrite[str] | None = None) -> None:
        """Print the help; unlike argparse, raise OSError if it cannot be written."""
        print(self.format_help(), end="", file=file)

    def error(self, message: str) -> NoReturn:
        """Print the error and exit with code 2."""
        fail(f"{message}; see {self.prog} --help", 2)

    # Any, since argparse overloads this method.
    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse the arguments; report unknown ones with the help of the command they were for."""
        parsed, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return parsed, unknown


class _Help(argparse.HelpFormatter):
    """Shows the default of every option that has one, and an example in one line, to be copied."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if text.startswith("example:") else super()._fill_text(text, width, indent)

    def _get_help_string(self, action: argparse.Action) -> str | None:
        default = action.default
        if default is None or isinstance(default, bool) or default in ("", (), argparse.SUPPRESS):
            return action.help
        shown = " ".join(map(str, default)) if isinstance(default, tuple) else default
        return f"{action.help} (default: {shown})"


def settings_of(kind: type[Settings], arguments: argparse.Namespace, **others: object) -> Settings:
    """Return settings from the arguments that have the names of fields, and from `others`.

    Paths become texts, and lists tuples, if the field is one. A field whose argument is not there
    or was not given keeps its default.
    """
    from dataclasses import fields  # slow to import, and not needed for --help

    conversions: dict[object, Callable[[Any], object]] = {"str": str, "tuple": tuple}
    values = {}
    for field in fields(kind):
        value = getattr(arguments, field.name, None)
        if value is not None:
            convert = conversions.get(str(field.type).partition("[")[0])
            values[field.name] = convert(value) if convert else value
    return kind(**values | others)


def fail(message: str, code: int) -> NoReturn:
    """Print one line to standard error and exit with a code."""
    sys.stderr.write(f"handcal: {' '.join(message.split())}\n")
    sys.exit(code)


STANDARD_OUTPUT = Path("-")
"""Names standard output as the file of ``--json``."""


def _json_file(text: str) -> Path:
    return STANDARD_OUTPUT if text in ("-", "/dev/stdout") else _writable(text)


def _writable(text: str) -> Path:
    """Return the path of a file to write; exit with code 1 if it cannot be written."""
    from tempfile import TemporaryFile  # slow to import, and not needed for --help

    path = Path(text)
    if path.exists() and not path.is_file():
        fail(f"cannot write {path}: it is a folder, a device or a pipe; choose another file", 1)
    folder = next(one for one in path.absolute().parents if one.exists())
    try:
        with TemporaryFile(dir=folder) as file:
            file.write(b" ")  # a full disk takes an empty file
    except OSError as error:
        why = f"nothing can be written in {folder} ({error.strerror or error})"
        fail(f"cannot write {path}: {why}; choose another file", 1)
    return path


@contextmanager
def errors_in_one_line() -> Iterator[None]:
    """Turn every expected error inside the block into one line and an exit code."""
    try:
        with _flushed():
            yield
    except CancelledError as error:
        fail(str(error), 130)
    except HandcalError as error:
        fail(str(error), 1)
    except KeyboardInterrupt:
        fail("interrupted", 130)
    except BrokenPipeError:
        _discard_output()
        sys.exit(1)
    except OSError as error:
        if error.filename is not None:  # not of the output
            fail(f"cannot use {error.filename}: {error.strerror or error}", 1)
        _discard_output()
        fail(f"cannot write the output: {error.strerror or error}", 1)


@contextmanager
def _flushed() -> Iterator[None]:
    """Flush the output of the block, also if it exits the program, as ``--help`` does."""
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
    if sys.stdout is None:  # closed: nothing is buffered
        return
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
            raise argparse.ArgumentTypeError(f"{text!r} is not a {what} from {low} to {high}")
        return value

    return convert


def seed(of: str = "") -> Option:
    """Return the option ``--seed``; `of` names what is random, if not everything."""
    help_text = f"random seed of {of}" if of else "random seed"
    limits = number(int, 0, 2**32 - 1)
    return value("--seed", limits, "N", help_text, default=1)


def patience(until: str, default_s: float = 120.0) -> Option:
    """Return the option ``--patience-s``; `until` continues "longest time"."""
    limits = number(float, 1.0, 86_400.0)
    return value("--patience-s", limits, "S", f"longest time {until}", default=default_s)


def eyes_option(purpose: str) -> Option:
    """Return the option ``--eyes``, which `eyes_of` reads."""
    return arg("--eyes", choices=("both", "left", "right"), default="both", help=purpose)


def eyes_of(arguments: argparse.Namespace) -> tuple[Eye, ...]:
    """Return the eyes that ``--eyes`` names."""
    return ("left", "right") if arguments.eyes == "both" else (arguments.eyes,)
