"""Runs of a study: every case once, in any number of processes, resumed after an interruption."""

from __future__ import annotations

import asyncio
import json
import math
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from concurrent.futures import CancelledError as FutureCancelledError
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeAlias

from handcal.core.errors import CancelledError, HandcalError, extra_advice
from handcal.core.progress import Progress
from handcal.lab.study.store import StudyFolder, StudyRow, holds_study

Case: TypeAlias = dict[str, float | int | str]
"""Identifies a cell of the study and a wearer or trial in it; JSON-able."""

RUNNING = "Running the trials"
"""The activity that `run_study` reports."""

_MAX_CHUNKS = 200
_POLL_S = 0.2


@dataclass(frozen=True, slots=True)
class Study:
    """The cases of a study, and the function that runs one."""

    name: str
    settings: Any
    """A frozen dataclass of JSON-able fields, which can be pickled."""
    cases: Sequence[Case]
    trial: Callable[[Any, Case], list[StudyRow]]
    """Gives the rows of one case from `settings` and the case, its random numbers from these alone.
    Must be a function of a module, so that other processes can import it; its rows must not contain
    NaN or infinity."""


def run_study(
    study: Study,
    folder: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Progress = Progress(),
) -> list[StudyRow]:
    """Run the remaining cases of a study, and return the rows of all cases in their order.

    The rows do not depend on the number of workers. Completed chunks of cases are kept in `folder`,
    so that a study that was cancelled or killed can be resumed; ``rows.csv`` there holds all rows.

    Parameters
    ----------
    study : Study
    folder : Path
        A folder for this study only; may contain completed parts of it.
    workers : int, optional
        Processes; one per core by default, and no other process than this one for 1.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://HOST:PORT``, whose workers do the work instead.
    progress : Progress
        Checked several times a second.

    Returns
    -------
    list of dict

    Raises
    ------
    CancelledError
        If the study is to end; trials in other processes are stopped, and a trial in this process
        is completed first.
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
    with resumable():
        progress.at(len(done) / len(chunks) if chunks else 1.0, RUNNING)
        if todo:
            with open_workers(workers, scheduler) as executor:
                for number, rows in _run_chunks(study, todo, executor, progress):
                    store.write_chunk(number, rows)
                    done[number] = rows
                    progress.at(len(done) / len(chunks), RUNNING)
    table = [row for number in sorted(done) for rows in done[number] for row in rows]
    store.write_rows(table)
    return table


@contextmanager
def resumable() -> Iterator[None]:
    """Add to a cancellation in the block that the study can be resumed."""
    try:
        yield
    except CancelledError:
        raise CancelledError("the study was cancelled", "run it again to resume it") from None


def share_done(study: Study, folder: Path) -> float:
    """Return the completed share of a study in a folder, 0..1.

    A damaged chunk counts, although it will be repeated: to be quick, no file is read.

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
    progress: Progress,
) -> Iterator[tuple[int, list[list[StudyRow]]]]:
    """Yield the number of each chunk, and the rows of its cases, once all of them are done."""
    places = {
        executor.submit(_run_case, study.trial, study.settings, case): (number, place)
        for number, cases in chunks.items()
        for place, case in enumerate(cases)
    }
    finished: SimpleQueue[Future[str]] = SimpleQueue()
    for future in places:
        future.add_done_callback(finished.put)
    parts: dict[int, dict[int, list[StudyRow]]] = {number: {} for number in chunks}
    while parts:
        progress.check()
        try:
            future = finished.get(timeout=_POLL_S)
        except Empty:
            continue
        number, place = places[future]
        parts[number][place] = json.loads(future.result())
        if len(parts[number]) == len(chunks[number]):
            part = parts.pop(number)
            yield number, [part[place] for place in range(len(part))]


def _run_case(trial: Callable[[Any, Case], list[StudyRow]], settings: Any, case: Case) -> str:
    """Return the rows of a case as JSON, so that stored rows and new ones are identical."""
    try:
        return json.dumps(trial(settings, case), allow_nan=False)
    except Exception as error:
        error.add_note(f"in the study's case {case}")
        raise


# Workers of a study: this process, processes on this machine, or a Dask cluster.

OVERSUBSCRIBE = "HANDCAL_OVERSUBSCRIBE"
"""Variable of the environment that allows more workers than cores."""
_CONNECT_S = 30
_MOST_ON_WINDOWS = 61  # processes that a ProcessPoolExecutor can wait for there
_THREAD_LIMITS = "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"


@contextmanager
def open_workers(workers: int | None, scheduler: str | None) -> Iterator[Executor]:
    """Yield an executor; at the end of the context, functions not yet started are discarded.

    Parameters
    ----------
    workers : int or None
        Processes on this machine, as many as cores if None, at most 61 on Windows; 1 means a
        thread of this process. More than cores, and more than two, only if the environment has
        `OVERSUBSCRIBE`.
    scheduler : str or None
        Address of a Dask scheduler whose workers do the work instead.

    Raises
    ------
    HandcalError
        If there is no such scheduler, Dask is not installed, a worker dies, or there would be too
        many workers.
    """
    cores = os.cpu_count() or 1
    workers = workers or cores
    if scheduler is None and workers > max(cores, 2) and not os.environ.get(OVERSUBSCRIBE):
        raise HandcalError(
            f"{workers} processes on the {cores} cores of this computer are slower than {cores}, "
            f"and may fill its memory",
            f"choose fewer, or set {OVERSUBSCRIBE}=1 if you insist",
        )
    if scheduler is not None:
        opened = _cluster(scheduler)
    elif workers == 1:
        opened = _shut_down(ThreadPoolExecutor(1))
    else:
        opened = _processes(workers)
    with opened as executor:
        yield executor


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    try:
        from distributed import Client, KilledWorker
        from distributed.comm.core import connect
    except ImportError as error:
        raise HandcalError("studies on a cluster need Dask", extra_advice("cluster")) from error

    async def reach() -> None:
        # A client that cannot connect prints a traceback when Python ends.
        (await connect(address, timeout=_CONNECT_S)).abort()  # type: ignore[no-untyped-call]

    try:
        asyncio.run(reach())
        client = Client(  # type: ignore[no-untyped-call]
            address, timeout=_CONNECT_S, set_as_default=False
        )
    except (OSError, ValueError) as error:
        raise HandcalError(
            f"no Dask scheduler answers at {address!r}",
            "start one with `dask scheduler` and "
            "give the address that it shows, as tcp://HOST:PORT",
        ) from error
    with client:
        try:
            yield client.get_executor(pure=False)  # type: ignore[no-untyped-call]
        except (KilledWorker, FutureCancelledError) as error:
            raise HandcalError(
                "the Dask cluster lost its scheduler or its workers",
                "restart it, and run the study again to resume it",
            ) from error


@contextmanager
def _processes(workers: int) -> Iterator[Executor]:
    if sys.platform == "win32":
        workers = min(workers, _MOST_ON_WINDOWS)
    # One thread of linear algebra per process: more would compete with the other processes.
    before = {name: os.environ.get(name) for name in _THREAD_LIMITS}
    os.environ.update(dict.fromkeys(_THREAD_LIMITS, "1"))
    context = multiprocessing.get_context("spawn")
    theirs, ours = context.Pipe(duplex=False)
    try:
        with (
            theirs,
            ours,
            _shut_down(
                ProcessPoolExecutor(workers, context, _prepare_process, (theirs,))
            ) as executor,
        ):
            try:
                yield executor
            except BaseException:
                ours.close()  # trials may take long, and their results are no longer wanted
                raise
    except BrokenExecutor as error:
        raise HandcalError(
            "a process of the study died, perhaps for lack of memory",
            "run the study again with fewer processes to resume it",
        ) from error
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _shut_down(executor: Executor) -> Iterator[Executor]:
    try:
        yield executor
    finally:
        executor.shutdown(cancel_futures=True)


def _prepare_process(parent: Connection) -> None:
    """Leave Ctrl+C to the process that started this one, and end with it, even if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Connection) -> None:
    """End this process once the other end of a pipe is closed."""
    with suppress(EOFError):
        parent.recv()
    os._exit(1)
