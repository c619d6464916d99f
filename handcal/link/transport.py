"""UDP sockets behind a small interface that tests can replace."""

from __future__ import annotations

import errno
import select
import socket
from contextlib import suppress
from ipaddress import ip_address
from typing import Any, Protocol, TypeAlias

from handcal.core.errors import LinkError
from handcal.link.wire import MAX_DATAGRAM_BYTES

Address: TypeAlias = tuple[str, int]

EVERY_NETWORK = ("0.0.0.0", "::")  # noqa: S104
"""The addresses that listen on all networks: of IPv4, and of both where the system can."""
_MAX_BATCH = 256
_RECEIVE_BUFFER_BYTES = 4 * 2**20  # a burst of cursor and live hand waits in it
_MAPPED = "::ffff:"
_ANYWHERE: tuple[Address, ...] = (("192.0.2.1", 9), ("2001:db8::1", 9))
"""Reserved for documentation, of IPv4 and IPv6; nothing is sent to them."""


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
    """A bound UDP socket, of IPv4 or IPv6; bound to ``::``, it serves both where it can.

    Raises
    ------
    LinkError
        If the address cannot be bound.
    """

    def __init__(self, bind: Address) -> None:
        family = _family(bind[0])
        self._is_ipv6 = family is socket.AF_INET6
        try:
            self._socket = socket.socket(family, socket.SOCK_DGRAM)
        except OSError as error:  # no IPv6 in this system
            raise _not_bound(bind, error) from error
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
            if self._is_ipv6:
                self._socket.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 0)
            self._socket.bind(bind)
        except OSError as error:
            self._socket.close()
            raise _not_bound(bind, error) from error
        self._socket.setblocking(False)
        self.address: Address = self._socket.getsockname()[:2]

    def send(self, datagram: bytes, address: Address) -> None:
        """Send a datagram; one that the system refuses is lost."""
        host, port = address
        if self._is_ipv6 and ":" not in host:
            host = _MAPPED + host
        try:
            self._socket.sendto(datagram, (host, port))
        except OSError:
            return

    def receive(self, timeout_s: float) -> list[tuple[bytes, Address]]:
        """Return the datagrams that have arrived; wait at most `timeout_s` for the first."""
        select.select([self._socket], [], [], timeout_s)
        arrived: list[tuple[bytes, Address]] = []
        for _ in range(_MAX_BATCH):
            try:
                # One byte more than allowed, so that an oversized datagram is noticed.
                datagram, sender = self._socket.recvfrom(MAX_DATAGRAM_BYTES + 1)
            except BlockingIOError:
                break
            except OSError:
                # Windows reports here that an earlier datagram was refused, or one is too large.
                continue
            arrived.append((datagram, _plain(sender) if self._is_ipv6 else sender))
        return arrived

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()


def _not_bound(address: Address, error: OSError) -> LinkError:
    """Return the error of an address that cannot be bound."""
    if error.errno == errno.EADDRINUSE:
        reason = "another program, perhaps another handcal, uses this port"
        advice = "end it, or choose another"
    elif error.errno == errno.EADDRNOTAVAIL:
        reason = "this computer has no such address"
        advice = "enter one of its own, or 0.0.0.0 for all"
    else:
        reason, advice = f"{error.strerror}", "choose another address or port"
    return LinkError(f"cannot listen on {address[0]}:{address[1]}: {reason}", advice)


def local_address(server: Address) -> Address:
    """Return the address, with any port, from which this machine reaches `server`.

    Raises
    ------
    LinkError
        If the server's name or network is unknown.
    """
    try:
        with socket.socket(_family(server[0]), socket.SOCK_DGRAM) as probe:
            probe.connect(server)  # selects a route; sends nothing
            return _plain(probe.getsockname())[0], 0
    except OSError as error:
        raise LinkError(f"cannot reach {server[0]}:{server[1]}: {error.strerror}") from error


def reachable_address(bound: Address) -> Address:
    """Return the address at which others reach a socket bound to one network or to all.

    Of several networks, that which leads farther; IPv6 only if there is no IPv4.

    Raises
    ------
    LinkError
        If it is bound to all networks, but there is none.
    """
    from ifaddr import get_adapters  # starts ldconfig when it is imported

    host, port = bound
    if host not in EVERY_NETWORK:
        return bound
    families = 2 if host == "::" else 1
    for anywhere in _ANYWHERE[:families]:
        with suppress(LinkError):  # no route leads there
            return local_address(anywhere)[0], port
    own = [ip for adapter in get_adapters() for ip in adapter.ips]
    v4 = [str(ip.ip) for ip in own if ip.is_IPv4]
    v6 = [ip.ip[0] for ip in own if ip.is_IPv6 and families == 2]
    for address in (*v4, *v6):
        number = ip_address(address)
        if not (number.is_loopback or number.is_link_local):
            return address, port
    missing = "no network" if families == 2 else "no IPv4 network (:: listens on IPv6, too)"
    raise LinkError(f"this computer has {missing}", "connect it to the headset's network")


def resolve(host: str, port: int) -> Address:
    """Return the address of a host: of IPv4 if it has one, else of IPv6.

    Raises
    ------
    LinkError
        If its name is unknown.
    """
    try:
        addresses = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:  # UnicodeError: not a valid name
        raise LinkError(f"unknown host {host!r}", "check its name or use its address") from error
    best = min(addresses, key=lambda address: address[0] is not socket.AF_INET)
    return _plain(best[4])


def _family(host: str) -> socket.AddressFamily:
    return socket.AF_INET6 if ":" in host else socket.AF_INET


def _plain(address: tuple[Any, ...]) -> Address:
    """Return host and port of a socket's address: IPv4 as such, a local IPv6 with its network."""
    host, port, *more = address
    host = host.removeprefix(_MAPPED) if "." in host else host
    if len(more) == 2 and more[1] and "%" not in host:
        host = f"{host}%{more[1]}"
    return host, port
