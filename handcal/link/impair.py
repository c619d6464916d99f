"""A simulated bad network: loss, duplication, delay and reordering, by seed."""

from __future__ import annotations

import heapq
import itertools
import random
import threading
import time
from dataclasses import dataclass

from handcal.link.transport import Address, Transport


@dataclass(frozen=True, slots=True)
class Impairment:
    """Impairments of the datagrams, in each direction."""

    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    """Probabilities, 0 to 1."""
    delay_s: float = 0.0
    """Delay of every datagram."""
    reorder_delay_s: float = 0.01
    """Additional delay of a reordered datagram."""
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("loss", "duplicate", "reorder"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must lie between 0 and 1, got {getattr(self, name)}")
        if self.delay_s < 0 or self.reorder_delay_s < 0:
            raise ValueError("a delay cannot be negative")


UNIMPAIRED = Impairment()


class ImpairedTransport:
    """Impairs both directions of a transport."""

    def __init__(self, transport: Transport, impairment: Impairment) -> None:
        self._transport = transport
        self._outward = _Lane(impairment, f"outward {impairment.seed}")
        self._inward = _Lane(impairment, f"inward {impairment.seed}")
        self.address = transport.address

    def send(self, datagram: bytes, address: Address) -> None:
        """Send, drop, duplicate or delay a datagram; a delayed one is sent during `receive`."""
        self._outward.put(datagram, address)
        self._release()

    def receive(self, timeout_s: float) -> list[tuple[bytes, Address]]:
        """Return the datagrams that have arrived and are due."""
        self._release()
        for datagram, address in self._transport.receive(timeout_s):
            self._inward.put(datagram, address)
        self._release()
        return self._inward.take()

    def close(self) -> None:
        """Release the socket; delayed datagrams are lost."""
        self._transport.close()

    def _release(self) -> None:
        for datagram, address in self._outward.take():
            self._transport.send(datagram, address)


class _Lane:
    def __init__(self, impairment: Impairment, seed: str) -> None:
        self._impairment = impairment
        self._random = random.Random(seed)
        self._order = itertools.count()
        self._waiting: list[tuple[float, int, bytes, Address]] = []
        self._lock = threading.Lock()

    def put(self, datagram: bytes, address: Address) -> None:
        with self._lock:
            copies = 1 + (self._random.random() < self._impairment.duplicate)
            for _ in range(copies):
                if self._random.random() < self._impairment.loss:
                    continue
                due = time.monotonic() + self._impairment.delay_s
                if self._random.random() < self._impairment.reorder:
                    due += self._impairment.reorder_delay_s
                heapq.heappush(self._waiting, (due, next(self._order), datagram, address))

    def take(self) -> list[tuple[bytes, Address]]:
        with self._lock:
            now = time.monotonic()
            due = []
            while self._waiting and self._waiting[0][0] <= now:
                due.append(heapq.heappop(self._waiting)[2:])
            return due
