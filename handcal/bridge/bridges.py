"""Bridges: they pass a station's snapshots on to other programs, each in its own thread.

Each program's output is a module of its own, as each needs a package that may be missing.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from handcal.bridge.lsl import LslOutput
from handcal.bridge.slicer import DEFAULT_PORT, SlicerOutput
from handcal.io.closable import Closable
from handcal.station.snapshot import Snapshot

_PATIENCE_S = 3.0

Item = TypeVar("Item")


class Output(Protocol[Item]):
    """The part of a bridge that knows the other program."""

    name: str
    capacity: int
    """Number of items that may wait; the oldest is lost when another comes."""

    def take(self, snapshot: Snapshot) -> Item | None:
        """Return what to send of a snapshot, in the engine's thread: within microseconds."""
        ...

    def send(self, item: Item) -> None:
        """Send it, in the bridge's thread; any exception ends the bridge."""
        ...

    def close(self) -> None:
        """Release what it holds, in the bridge's thread."""
        ...


class Bridge(Closable, Generic[Item]):
    """Runs one output; `Station.watch` calls it with every snapshot.

    A bridge whose output fails, or has not sent an item after three seconds, is dropped with one
    line. It never keeps the engine waiting.

    Parameters
    ----------
    output : Output
    tell : callable
        Called with that line, from any thread.
    patience_s : float
        Longest time for sending one item.
    """

    def __init__(
        self,
        output: Output[Item],
        tell: Callable[[str], object],
        patience_s: float = _PATIENCE_S,
    ) -> None:
        self._output = output
        self._tell = tell
        self._patience_s = patience_s
        self._waiting: deque[Item] = deque(maxlen=output.capacity)
        self._wake = threading.Event()
        self._is_over = False
        self._sending_since_s: float | None = None
        self._lock = threading.Lock()
        # A daemon, as an output that hangs cannot be ended.
        self._thread = threading.Thread(target=self._run, name=output.name, daemon=True)
        self._thread.start()

    @property
    def is_over(self) -> bool:
        """True if it was dropped or closed."""
        return self._is_over

    def __call__(self, snapshot: Snapshot) -> None:
        """Hand a snapshot over."""
        if self._is_over:
            return
        since_s = self._sending_since_s
        if since_s is not None and time.monotonic() - since_s > self._patience_s:
            self._drop(f"nothing could be sent for {self._patience_s:g} s")
            return
        item = self._output.take(snapshot)
        if item is not None:
            self._waiting.append(item)
            self._wake.set()

    def close(self) -> None:
        """Send what waits, and end; safe to call twice."""
        self._is_over = True
        self._wake.set()
        self._thread.join(self._patience_s)

    def _drop(self, reason: str) -> None:
        with self._lock:
            if self._is_over:
                return
            self._is_over = True
        self._wake.set()
        self._tell(f"{self._output.name} is off: {reason}")

    def _run(self) -> None:
        try:
            while not (self._is_over and not self._waiting):
                if not self._waiting:
                    self._wake.wait()
                    self._wake.clear()
                    continue
                self._sending_since_s = time.monotonic()
                self._output.send(self._waiting.popleft())
                self._sending_since_s = None
        except Exception as error:  # a library of others may raise anything
            self._drop(str(error) or type(error).__name__)
        finally:
            self._output.close()


@dataclass(frozen=True, slots=True)
class BridgeSettings:
    """The bridges to run; by default none."""

    slicer_host: str = ""
    """Address on which OpenIGTLink is served, such as 127.0.0.1; empty: it is not."""
    slicer_port: int = DEFAULT_PORT
    lsl: bool = False
    """Send the events to the Lab Streaming Layer."""

    def __post_init__(self) -> None:
        if not 0 < self.slicer_port < 65536:
            raise ValueError(f"slicer_port must be from 1 to 65535, not {self.slicer_port}")


@contextmanager
def open_bridges(
    settings: BridgeSettings, tell: Callable[[str], object]
) -> Iterator[list[Bridge[Any]]]:
    """Run bridges for `Station.watch`, and close them at the end.

    Parameters
    ----------
    settings : BridgeSettings
    tell : callable
        Called with one line, from any thread, when a bridge or its peer is dropped.

    Raises
    ------
    HandcalError
        If a bridge needs a package that is not installed.
    LinkError
        If the address cannot be bound.
    """
    with ExitStack() as stack:
        running: list[Bridge[Any]] = []
        if settings.slicer_host:
            slicer = SlicerOutput(tell, settings.slicer_host, settings.slicer_port)
            running.append(stack.enter_context(Bridge(slicer, tell)))
        if settings.lsl:
            running.append(stack.enter_context(Bridge(LslOutput(), tell)))
        yield running
