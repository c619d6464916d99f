"""Run a study: every case once, in any number of processes, and go on after an interruption."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import asdict, dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeAlias

from handcal.errors import CancelledError
from handcal.lab.study.store import Row, StudyFolder, holds_study
from handcal.lab.study.workers import open_workers

Case: TypeAlias = dict[str, float | int | str]
"""Names a cell of the study, and the wearer or trial in it: JSON-able."""

_MAX_CHUNKS = 200
_POLL_S = 0.2


@dataclass(frozen=True, slots=True)
class Study:
    """What there is to do."""

    name: str
    settings: Any
    """A frozen dataclass of JSON-able fields, which can be pickled."""
    cases: Sequence[Case]
    trial: Callable[[Any, Case], list[Row]]
    """Gives the rows of one case from `settings` and the case, its random numbers from these alone.
    A function of a module, so that other processes can import it; no number in its rows is NaN or
    infinite."""


def run_study(
    study: Study,
    folder: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[float], None] | None = None,
    is_cancelled: Callable[[], bool] | None = None,
) -> list[Row]:
    """Do what is not yet done of a study, and return the rows of all its cases in their order.

    The numbers are the same whoever does the work. Finished chunks of cases are kept in `folder`,
    so that a study goes on where it was cancelled or killed; ``rows.csv`` there holds all rows.

    Parameters
    ----------
    study : Study
    folder : Path
        Of this study alone; may hold part of it.
    workers : int, optional
        Processes; one per core by default, and no other process than this one for 1.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://HOST:PORT``, whose workers do the work instead.
    progress : callable, optional
        Told the share of the cases that are done.
    is_cancelled : callable, optional
        Asked several times a second.

    Returns
    -------
    list of dict

    Raises
    ------
    CancelledError
        Once `is_cancelled` says so; what other processes are at is given up, and the trial that
        this one is at comes to its end.
    FileError
        If `folder` holds another study, or cannot be read or written.
    HandcalError
        If the cluster cannot be reached, or a worker died.
    """
    chunks = _chunks(study.cases)
    store = StudyFolder(folder, study.name, asdict(study.settings), chunks)
    stored = {number: store.read_chunk(number) for number in range(len(chunks))}
    done = {number: rows for number, rows in stored.items() if rows is not None}
    todo = {number: cases for number, cases in enumerate(chunks) if number not in done}
    if todo:
        with open_workers(workers, scheduler) as executor:
            for number, rows in _run_chunks(study, todo, executor, is_cancelled):
                store.write_chunk(number, rows)
                done[number] = rows
                if progress is not None:
                    progress(len(done) / len(chunks))
    table = [row for number in sorted(done) for rows in done[number] for row in rows]
    store.write_rows(table)
    return table


def share_done(study: Study, folder: Path) -> float:
    """Return which share of a study a folder holds, 0..1.

    A damaged chunk counts, though it will be done again: files are not read, so that this is quick.

    Raises
    ------
    FileError
        If it holds another study, or cannot be read.
    """
    if not holds_study(folder):
        return 0.0
    chunks = _chunks(study.cases)
    store = StudyFolder(folder, study.name, asdict(study.settings), chunks)
    done = [store.has_chunk(number) for number in range(len(chunks))]
    return sum(done) / len(done)


def _chunks(cases: Sequence[Case]) -> list[Sequence[Case]]:
    length = math.ceil(len(cases) / _MAX_CHUNKS) or 1
    return [cases[start : start + length] for start in range(0, len(cases), length)]


def _run_chunks(
    study: Study,
    chunks: Mapping[int, Sequence[Case]],
    executor: Executor,
    is_cancelled: Callable[[], bool] | None,
) -> Iterator[tuple[int, list[list[Row]]]]:
    """Yield the number of each chunk, and the rows of its cases, once all of them are done."""
    places = {
        executor.submit(_run_case, study.trial, study.settings, case): (number, place)
        for number, cases in chunks.items()
        for place, case in enumerate(cases)
    }
    finished: SimpleQueue[Future[str]] = SimpleQueue()
    for future in places:
        future.add_done_callback(finished.put)
    parts: dict[int, dict[int, list[Row]]] = {number: {} for number in chunks}
    while parts:
        if is_cancelled is not None and is_cancelled():
            raise CancelledError("the study was cancelled; run it again to go on with it")
        try:
            future = finished.get(timeout=_POLL_S)
        except Empty:
            continue
        number, place = places[future]
        parts[number][place] = json.loads(future.result())
        if len(parts[number]) == len(chunks[number]):
            part = parts.pop(number)
            yield number, [part[place] for place in range(len(part))]


def _run_case(trial: Callable[[Any, Case], list[Row]], settings: Any, case: Case) -> str:
    """Return the rows of a case as JSON: what is read again is just what is returned at once."""
    try:
        return json.dumps(trial(settings, case), allow_nan=False)
    except Exception as error:
        error.add_note(f"in the study's case {case}")
        raise
