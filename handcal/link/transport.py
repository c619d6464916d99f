"""Where datagrams go out and come in."""

from __future__ import annotations

import select
import socket
from typing import Protocol, TypeAlias

from handcal.errors import LinkError
from handcal.link.wire import MAX_DATAGRAM_BYTES

Address: TypeAlias = tuple[str, int]

_MAX_BATCH = 256
_ANYWHERE: Address = ("192.0.2.1", 9)  # an address for documentation; nothing is sent there


class Transport(Protocol):
    """Sends and receives datagrams; only one thread may receive."""

    address: Address

    def send(self, datagram: bytes, address: Address) -> None:
        """Send, or lose, a datagram."""
        ...

    def receive(self, timeout_s: float) -> list[tuple[bytes, Address]]:
        """Return what has arrived, waiting at most `timeout_s` for the first."""
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
        """Send a datagram; one that the system refuses is lost, as any may be."""
        try:
            self._socket.sendto(datagram, address)
        except OSError:
            return

    def receive(self, timeout_s: float) -> list[tuple[bytes, Address]]:
        """Return what has arrived, waiting at most `timeout_s` for the first."""
        select.select([self._socket], [], [], timeout_s)
        arrived: list[tuple[bytes, Address]] = []
        for _ in range(_MAX_BATCH):
            try:
                # One byte more than allowed, so that an oversized one shows.
                arrived.append(self._socket.recvfrom(MAX_DATAGRAM_BYTES + 1))
            except BlockingIOError:
                break
            except OSError:
                # Windows reports here that an earlier datagram found nobody, or one too large.
                continue
        return arrived

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()


def local_address(server: Address) -> Address:
    """Return the address, any port, that this machine reaches `server` from.

    Raises
    ------
    LinkError
        If the server's name or network is unknown.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(server)  # chooses a way; sends nothing
        except OSError as error:
            raise LinkError(f"cannot reach {server[0]}:{server[1]}: {error.strerror}") from error
        return probe.getsockname()[0], 0


def reachable_address(bound: Address) -> Address:
    """Return where others reach a socket: on all networks, the address of the default one.

    Raises
    ------
    LinkError
        If it is bound on all networks, but there is none.
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
    except (OSError, UnicodeError) as error:  # UnicodeError: not even a name
        raise LinkError(f"unknown host {host!r}; check its name, or give its address") from error
