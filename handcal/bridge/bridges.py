"""The bridges that run beside one calibration."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

from handcal.bridge.bridge import Bridge
from handcal.bridge.lsl import LslOutput
from handcal.bridge.slicer import DEFAULT_PORT, SlicerOutput


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
