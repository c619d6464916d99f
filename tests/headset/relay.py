"""A relay of UDP datagrams between a headset and a PC, as a bad network or a middlebox."""

from __future__ import annotations

import threading
from collections.abc import Callable

from handcal.io.closable import Closable
from handcal.link.impair import ImpairedTransport, Impairment
from handcal.link.transport import Address, UdpTransport

_WAIT_S = 0.0005


class Relay(Closable):
    """Passes datagrams on, impaired and changed, until closed; the headset connects to `address`.

    Parameters
    ----------
    pc : (host, port)
    impairment : Impairment
        Of both directions.
    change : callable
        What becomes of a datagram in either direction.
    """

    def __init__(
        self,
        pc: Address,
        impairment: Impairment,
        change: Callable[[bytes], bytes] = lambda datagram: datagram,
    ) -> None:
        self._pc = pc
        self._change = change
        self._inner = UdpTransport(("127.0.0.1", 0))
        outer = UdpTransport(("127.0.0.1", 0))
        self._outer = ImpairedTransport(outer, impairment)
        self.address = self._inner.address
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the relay; safe to call twice."""
        if not self._closing.is_set():
            self._closing.set()
            self._thread.join()
            self._inner.close()
            self._outer.close()

    def _run(self) -> None:
        headset: Address | None = None
        while not self._closing.is_set():
            for datagram, sender in self._inner.receive(_WAIT_S):
                headset = sender
                self._outer.send(self._change(datagram), self._pc)
            for datagram, _ in self._outer.receive(_WAIT_S):
                if headset is not None:
                    self._inner.send(self._change(datagram), headset)
