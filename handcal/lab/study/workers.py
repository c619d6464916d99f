"""Workers of a study: this process, processes on this machine, or a Dask cluster."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection

from handcal.core.errors import HandcalError

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
        raise HandcalError(
            "studies on a cluster need Dask: install it with pip install handcal[cluster]"
        ) from error

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
        except (KilledWorker, CancelledError) as error:
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
