"""UDP sockets behind a small interface that tests can replace."""

from __future__ import annotations

import select
import socket
from typing import Protocol, TypeAlias

from handcal.errors import LinkError
from handcal.link.wire import MAX_DATAGRAM_BYTES

Address: TypeAlias = tuple[str, int]

_MAX_BATCH = 256
_ANYWHERE: Address = ("192.0.2.1", 9)  # reserved for documentation; nothing is sent to it


class Transport(Protocol):
    """Sends and receives datagrams; only one thread may receive."""

    address: Address

    def send(self, datagram: bytes, address: Address) -> None:
        """Send a datagram; it may be lost."""
        ...

    def receive(self, timeout_s: float) -> list[tuple[bytes, Address]]:
        """Return the datagrams that have arrived; wait at most `timeout_s` for the first."""
        ...

    def close(self) -> None:
        """Release the socket."""
        ...


class UdpTransport:
    """A bound UDP socket.

    Raises
    ------
    LinkError
        If the address cannot be bound.
    """

    def __init__(self, bind: Address, receive_buffer_bytes: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer_bytes)
            self._socket.bind(bind)
        except OSError as error:
            self._socket.close()
            raise LinkError(f"cannot listen on {bind[0]}:{bind[1]}: {error.strerror}") from error
        self._socket.setblocking(False)
        self.address: Address = self._socket.getsockname()

    def send(self, datagram: bytes, address: Address) -> None:
        """Send a datagram; one that the system refuses is lost."""
        try:
            self._socket.sendto(datagram, address)
        except OSError:
            return

    def receive(self, timeout_s: float) -> list[tuple[bytes, Address]]:
        """Return the datagrams that have arrived; wait at most `timeout_s` for the first."""
        select.select([self._socket], [], [], timeout_s)
        arrived: list[tuple[bytes, Address]] = []
        for _ in range(_MAX_BATCH):
            try:
                # One byte more than allowed, so that an oversized datagram is noticed.
                arrived.append(self._socket.recvfrom(MAX_DATAGRAM_BYTES + 1))
            except BlockingIOError:
                break
            except OSError:
                # Windows reports here that an earlier datagram was refused, or one is too large.
                continue
        return arrived

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()


def local_address(server: Address) -> Address:
    """Return the address, with any port, from which this machine reaches `server`.

    Raises
    ------
    LinkError
        If the server's name or network is unknown.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(server)  # selects a route; sends nothing
        except OSError as error:
            raise LinkError(f"cannot reach {server[0]}:{server[1]}: {error.strerror}") from error
        return probe.getsockname()[0], 0


def reachable_address(bound: Address) -> Address:
    """Return the address at which others reach a socket bound to one network or to all.

    Raises
    ------
    LinkError
        If it is bound to all networks, but there is none.
    """
    host, port = bound
    return (local_address(_ANYWHERE)[0], port) if host == "0.0.0.0" else bound  # noqa: S104


def resolve(host: str, port: int) -> Address:
    """Return the IPv4 address of a host.

    Raises
    ------
    LinkError
        If its name is unknown.
    """
    try:
        return socket.gethostbyname(host), port
    except (OSError, UnicodeError) as error:  # UnicodeError: not a valid name
        raise LinkError(f"unknown host {host!r}; check its name or use its address") from error
