"""Discovery of the PC on the local network: DNS-SD over multicast DNS (RFC 6762, RFC 6763)."""

from __future__ import annotations

import ipaddress
import socket

from zeroconf import Error, IPVersion, ServiceInfo, Zeroconf

from handcal.core.errors import LinkError
from handcal.io.closable import Closable
from handcal.link.transport import Address
from handcal.link.wire import VERSION

SERVICE = "_handcal._udp.local."
_MAX_NAME = 60


class Announcement(Closable):
    """Announces the PC on the local network until closed; construction takes about a second.

    Raises
    ------
    LinkError
        If the network does not allow it; pairing works without, if the address is typed.
    """

    def __init__(self, address: Address, name: str = "", interface: str = "") -> None:
        name = (name or socket.gethostname()).split(".")[0][:_MAX_NAME] or "handcal"
        host, port = address
        info = ServiceInfo(
            SERVICE,
            f"{name}.{SERVICE}",
            port=port,
            addresses=[ipaddress.ip_address(host.partition("%")[0]).packed],
            properties={"protocol": str(VERSION)},
            server=f"{name}.local.",
        )
        self._zeroconf = _open(interface, is_ipv6=":" in host)
        try:
            self._zeroconf.register_service(info, allow_name_change=True)
        except (Error, OSError) as error:
            self._zeroconf.close()
            raise LinkError(f"cannot announce this PC on the local network: {error}") from error

    def close(self) -> None:
        """Withdraw the announcement; safe to call twice."""
        self._zeroconf.close()


def _open(interface: str, *, is_ipv6: bool = False) -> Zeroconf:
    try:
        if interface:
            return Zeroconf(interfaces=[interface])
        return Zeroconf(ip_version=IPVersion.V6Only) if is_ipv6 else Zeroconf()
    except (Error, OSError) as error:
        raise LinkError(f"cannot use multicast on the local network: {error}") from error
