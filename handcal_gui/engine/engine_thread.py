"""The engine's thread: owns the station and runs it, with commands between frames."""

from __future__ import annotations

import ctypes
import logging
import queue
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress

from PySide6.QtCore import QObject, Signal

from handcal.bridge.bridges import BridgeSettings, open_bridges
from handcal.calibration.procedure import Calibration
from handcal.core.errors import FileError, HandcalError
from handcal.session.unfinished import summarize
from handcal.station.snapshot import Snapshot
from handcal.station.station import Station
from handcal_gui.app.translation import tr
from handcal_gui.engine.worker import Worker

_LOG = logging.getLogger(__name__)

Command = Callable[[Station], object]
Submit = Callable[[str, Command], int]
"""Gives the engine a command by a name that completes "could not …"; returns its number."""
_NO_BRIDGES = BridgeSettings()


def no_engine(_name: str, _command: Command) -> int:
    """Take a command while no engine runs, and drop it."""
    return 0


def calibrating(command: Callable[[Calibration], object]) -> Command:
    """Return a command to the procedure, which keeps data that it cannot write yet."""

    def command_station(station: Station) -> None:
        with suppress(FileError):
            command(station.calibration)

    return command_station


class EngineThread(Worker):
    """Runs a station in a thread until it is closed.

    Only the newest snapshot is kept, so that polling returns the newest one however slow the window
    is.

    Parameters
    ----------
    open_station : callable
        Opens the station, in the engine's thread.
    bridges : BridgeSettings
        The calibration continues without bridges that cannot be opened.

    Attributes
    ----------
    opened : Signal(Station)
        The station is running. Other threads may only read its constants.
    arrived : Signal()
        There is a snapshot that `newest` has not returned yet.
    command_done : Signal(str, object)
        A command has finished: its name and its result.
    failed : Signal(str, str)
        A command failed: its name and the reason, as a message for the user.
    told : Signal(str)
        A line about a bridge that could not be opened or was dropped.
    ended : Signal(str)
        The reason why the station could not be opened or failed; empty if it was closed.
    """

    opened = Signal(object)
    arrived = Signal()
    command_done = Signal(str, object)
    failed = Signal(str, str)
    told = Signal(str)
    ended = Signal(str)

    def __init__(
        self,
        open_station: Callable[[], Station],
        parent: QObject | None = None,
        bridges: BridgeSettings = _NO_BRIDGES,
    ) -> None:
        super().__init__("handcal engine", parent)
        self._open_station = open_station
        self._bridges = bridges
        self._commands: queue.SimpleQueue[tuple[str, Command]] = queue.SimpleQueue()
        self._submitted = self._done = 0
        self._newest: tuple[Snapshot | None, int] = None, 0
        self._is_announced = False
        self._closing = threading.Event()

    def newest(self) -> tuple[Snapshot | None, int]:
        """Return the newest snapshot, None before the first, and the number of commands in it."""
        self._is_announced = False  # first, so that one that arrives meanwhile is announced
        return self._newest

    def submit(self, name: str, command: Command) -> int:
        """Have the engine's thread call `command` with the station before the next frame.

        Returns
        -------
        int
            Number of commands submitted, including this one.
        """
        self._commands.put((name, command))
        self._submitted += 1
        return self._submitted

    def settle(self, timeout_s: float) -> None:
        """Wait until the commands submitted so far are done, and deliver their signals."""
        done = threading.Event()
        self.submit("settle", lambda _station: done.set())
        done.wait(timeout_s)
        self._deliver_pending()

    def request_stop(self) -> None:
        """Ask the thread to end, without waiting; it then emits `ended`."""
        self._closing.set()

    def close(self) -> None:
        """End the thread, close the station and deliver pending signals; safe to call twice."""
        self.request_stop()
        self.wait()
        self._deliver_pending()

    def _run(self) -> None:
        why = ""
        try:
            with self._open_station() as station, self._watching(station):
                if not self._closing.is_set():
                    self._emit_later(self.opened.emit, station)
                _give_back_memory()
                try:
                    while not self._closing.is_set():
                        self._newest = station.step(), self._done
                        if not self._is_announced:
                            self._is_announced = True
                            self._emit_later(self.arrived.emit)
                        self._run_commands(station)
                finally:
                    self._run_commands(station)  # those submitted last, such as saving notes
        except HandcalError as error:
            why = str(error)
        except Exception as error:
            _LOG.exception("the engine failed unexpectedly")
            advice = tr("nothing was recorded: start again")
            snapshot, _ = self._newest
            if snapshot is not None and summarize(snapshot.record).is_worth_resuming:
                advice = tr("the session is kept: resume it")
            why = tr("handcal hit an unexpected error ({}); {}").format(_describe(error), advice)
        self._emit_later(self.ended.emit, why)

    @contextmanager
    def _watching(self, station: Station) -> Iterator[None]:
        """Have bridges watch the station."""
        with ExitStack() as stack:
            try:
                for bridge in stack.enter_context(open_bridges(self._bridges, self._tell)):
                    station.watch(bridge)
            except HandcalError as error:
                self._tell(str(error))
            yield

    def _tell(self, line: str) -> None:
        self._emit_later(self.told.emit, line)

    def _run_commands(self, station: Station) -> None:
        while not self._commands.empty():
            name, command = self._commands.get()
            try:
                self._emit_later(self.command_done.emit, name, command(station))
            except (HandcalError, ValueError) as error:
                self._emit_later(self.failed.emit, name, str(error))
            except Exception as error:
                _LOG.exception("a command failed unexpectedly: %s", name)
                self._emit_later(self.failed.emit, name, _describe(error))
            self._done += 1


def _give_back_memory() -> None:
    """Give back to the system what was freed since the last session.

    The C library keeps it, in pieces, for each of its threads: the program grew by some 10 MB with
    each session.
    """
    if sys.platform.startswith("linux"):
        with suppress(AttributeError):  # other C libraries than that of GNU
            ctypes.CDLL(None).malloc_trim(0)


def _describe(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
