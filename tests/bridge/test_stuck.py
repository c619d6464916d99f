"""Clients of OpenIGTLink that take nothing."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Mapping

import pytest

pytest.importorskip("pyigtl")

from handcal.bridge import slicer
from handcal.bridge.slicer import SlicerOutput


def test_clients_that_never_read_delay_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    def large(_: object) -> Mapping[str, tuple[object, Callable[[], bytes]]]:
        return {"Cloud": (time.monotonic(), lambda: bytes(100_000))}

    monkeypatch.setattr(slicer, "igtl_messages", large)
    said: list[str] = []
    output = SlicerOutput(said.append, port=0, send_s=0.3)
    stuck = [socket.create_connection(output.address) for _ in range(7)]
    with socket.create_connection(output.address) as good:
        good.settimeout(1.0)
        slowest_s = 0.0
        end_s = time.monotonic() + 10.0
        while len(said) < 7 and time.monotonic() < end_s:
            began_s = time.monotonic()
            output.send(None)  # type: ignore[arg-type]
            slowest_s = max(slowest_s, time.monotonic() - began_s)
            good.recv(1 << 20)
        assert len(said) == 7
        assert all("takes no data" in one for one in said)
        assert slowest_s < 1.0  # seven that block would take 2.1 s
    for one in stuck:
        one.close()
    output.close()
