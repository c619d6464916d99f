"""Tables, progress bars and result files of the commands."""

from __future__ import annotations

import json
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console, ConsoleOptions, RenderResult
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.table import Table

from handcal.cli.terminal import STANDARD_OUTPUT
from handcal.core.progress import Progress
from handcal.io.files import make_folder, write_json

# Names and paths may hold brackets and colons: they are printed as they are.
console = Console(soft_wrap=True, highlight=False, markup=False, emoji=False)
_WIDEST = 10_000  # characters


class _WholeTable(Table):
    """A table that rich does not cut to a width: a pipe has none, and terminals wrap lines."""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        return super().__rich_console__(console, options.update(max_width=_WIDEST))


def table(*columns: str) -> Table:
    """Return an empty table: a first column of names, and right-aligned columns of numbers."""
    made = _WholeTable(box=box.SIMPLE_HEAD, pad_edge=False)
    for place, column in enumerate(columns):
        made.add_column(column, justify="right" if place else "left", no_wrap=True)
    return made


def save(path: Path | None, result: dict[str, Any]) -> None:
    """Write a result as JSON, if there is a path; create its folder."""
    if path == STANDARD_OUTPUT:
        print(json.dumps(result, indent=2, allow_nan=False), file=sys.__stdout__)
    elif path is not None:
        make_folder(path.parent)
        write_json(path, result)


@contextmanager
def show_progress(is_cancelled: Callable[[], bool] = lambda: False) -> Iterator[Progress]:
    """Show the progress of a task: a bar on a terminal, else plain lines."""
    if not console.is_terminal:
        last = ("", 0)

        def say(what: str, share: float) -> None:
            nonlocal last
            if last != (what, int(10 * share)):
                last = what, int(10 * share)
                console.print(f"{100 * share:3.0f} % {what}")

        yield Progress(say, is_cancelled)
        return
    columns = TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn()
    with Bar(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield Progress(
            lambda what, share: bar.update(task, description=what, completed=share), is_cancelled
        )


@contextmanager
def until_interrupted() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns whether Ctrl+C was pressed; a second press interrupts."""
    is_stopped = threading.Event()

    def stop(*_: object) -> None:
        is_stopped.set()
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield is_stopped.is_set
    finally:
        signal.signal(signal.SIGINT, before)


def triple(values: Iterable[float]) -> str:
    """Return a vector's components in one cell, to a tenth."""
    return " ".join(f"{value:.1f}" for value in values)
