"""The state of the connected headset in one line, and the one thing that is wrong with it."""

from __future__ import annotations

from handcal.core.types import EYES, HeadsetIdentity, Rig
from handcal.link.statistics import LinkStatistics
from handcal.link.wire import VERSION, Rejection
from handcal.rig.plausible import check_headset

_LEAST_RATE_HZ = 55.0
_MOST_LOST = 0.1
_MOST_LATENCY_MS = 40.0
_MOST_CLOCK_MS = 5.0
_POLL_S = 0.05
_OTHER_VERSION = f"an app that does not speak protocol {VERSION} tried to; update it, or handcal"


def headset_state(device: HeadsetIdentity | None, link: LinkStatistics) -> str:
    """Return the connected headset by name, with version, rate, latency, loss and clock."""
    name = "unnamed headset" if device is None else device.name or device.device_id
    about = () if device is None else (device.runtime, device.app, f"protocol {device.protocol}")
    sent, received = _lost_shares(link)
    latency, clock = link.latency_ms, link.clock_uncertainty_ms
    return (
        f"{name} ({', '.join(one for one in about if one) or 'not introduced'}): "
        f"{link.pose_rate_hz:.0f} poses/s, "
        f"latency {'not known' if latency is None else f'{latency:.1f} ms'}, "
        f"lost {100 * sent:.0f} % to it and {100 * received:.0f} % from it, "
        f"clock {'not known' if clock is None else f'± {clock:.2f} ms'}"
    )


def headset_problem(
    device: HeadsetIdentity | None, link: LinkStatistics, rig: Rig | None = None
) -> str:
    """Return the most important thing that is wrong with a headset, and what to do; or nothing."""
    if not link.connected:
        return _absence(link)
    if device is None:
        return "it has not introduced itself; let its app send Device"
    if device.protocol != VERSION:
        return f"its app speaks protocol {device.protocol}, not {VERSION}; update the older one"
    if link.pose_rate_hz <= 0.0:
        return "it sends no poses; look around until it tracks the room, and keep its app in front"
    if link.failed:
        return f"it did not acknowledge {link.failed} messages; restart its app"
    sent, received = _lost_shares(link)
    if max(sent, received) > _MOST_LOST:
        return "the network loses many datagrams; use a free Wi-Fi channel, near the router"
    if link.latency_ms is not None and link.latency_ms > _MOST_LATENCY_MS:
        return "the network is slow; connect the computer to the router by cable"
    if link.pose_rate_hz < _LEAST_RATE_HZ:
        return "it sends fewer than 60 poses per second; close other apps on it"
    uncertainty_ms = link.clock_uncertainty_ms
    if uncertainty_ms is None or uncertainty_ms > _MOST_CLOCK_MS:
        return "its clock is not known well; wait, or improve the network"
    return "" if rig is None else _other_than_rig(device, rig)


def link_problem(link: LinkStatistics, address: tuple[str, int] | None) -> str:
    """Return what a calibration lacks from its headset, and what to do; empty if nothing.

    Parameters
    ----------
    link : LinkStatistics
    address : tuple of str and int or None
        Host and port that a network headset connects to, while none is connected; None for the
        virtual headset.
    """
    if link.notice:
        return link.notice
    if link.missing:
        missing = " and ".join(link.missing)
        return (
            f"the headset lacks the {missing}: it did not acknowledge it in time; improve the "
            "network, or restart the headset's app"
        )
    if link.connected:
        return ""
    if address is None:
        return "the virtual headset has not connected yet"
    host, port = address
    is_other = bool(link.rejected.get(Rejection.WRONG_VERSION, 0))
    return (
        f"no headset is connected; let it connect to {host}, UDP port {port}, with the pairing key"
        f"{f'; {_OTHER_VERSION}' if is_other else ''}"
    )


def _absence(link: LinkStatistics) -> str:
    if link.notice:
        return link.notice
    if link.rejected.get(Rejection.WRONG_VERSION, 0):
        return f"no headset is connected; {_OTHER_VERSION}"
    if link.rejected.get(Rejection.UNPAIRED, 0):
        return "a headset with another pairing key tries to connect; pair it with handcal pair"
    if any(link.rejected.values()):
        return "datagrams arrive that are not from a headset app; check the app's port"
    return (
        "nothing arrives; check the address in the headset, that both are in one network, and that "
        "the firewall allows UDP"
    )


def _lost_shares(link: LinkStatistics) -> tuple[float, float]:
    inbound = link.received + link.lost_inbound
    return link.lost / max(link.sent, 1), link.lost_inbound / max(inbound, 1)


def _other_than_rig(device: HeadsetIdentity, rig: Rig) -> str:
    try:
        check_headset(device)
    except ValueError as error:
        return f"what it reports is implausible, so its app or runtime is to be corrected: {error}"
    for eye in EYES:
        view, display = device.views.get(eye), rig.eyes[eye]
        if view is not None:
            size, own = (view.width_px, view.height_px), (display.width_px, display.height_px)
            if size != own:
                return (
                    f"its {eye} display has {size[0]}×{size[1]} px, the rig's {own[0]}×{own[1]}; "
                    "choose the rig file of this headset"
                )
    if rig.headset is not None and rig.headset.device_id != device.device_id:
        return "it is not the rig's headset; choose the rig file of this headset"
    check = rig.display_check
    if check is not None and (check.runtime, check.app) != (device.runtime, device.app):
        return (
            "its app or runtime has changed since the display check; check again with "
            "handcal rig display-check"
        )
    return ""
