"""The state of the connected headset in one line, and the one thing that is wrong with it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from handcal.camera.camera import Camera
from handcal.core.errors import (
    CameraTimeoutError,
    HandcalError,
    HandError,
    PoseError,
    PosePendingError,
)
from handcal.core.geometry import transform
from handcal.core.progress import Progress
from handcal.core.types import EYES, Float64, HeadsetIdentity, Rig
from handcal.hand.settings import SegmentSettings
from handcal.hand.shipped import make_finder
from handcal.link.server import HeadsetServer
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


@dataclass(frozen=True, slots=True)
class PoseDelay:
    """Time by which poses are for a later moment than their stamps say."""

    delay_s: float
    """Positive: the poses are for later. An error of the camera's assumed latency enters too."""
    sigma_s: float

    @property
    def is_wrong(self) -> bool:
        """True if the stamps are certainly off by more than the camera's latency is uncertain."""
        return abs(self.delay_s) - 2.0 * self.sigma_s > CAMERA_UNCERTAINTY_S

    def __str__(self) -> str:
        way = "later" if self.delay_s > 0 else "earlier"
        ms, sigma_ms = 1e3 * abs(self.delay_s), 1e3 * self.sigma_s
        return f"poses are for {ms:.0f} ± {sigma_ms:.0f} ms {way} than their stamps say"


CAMERA_UNCERTAINTY_S = 0.015
"""Error of the camera's assumed latency, from exposure to arrival."""
STAMP_ADVICE = (
    "stamp each pose with the time that it is for: of a predicted pose, that of display; if the "
    "stamps are right, the camera's latency is not the assumed one"
)
_MOST_DELAY_S = 0.12
_STEP_S = 0.004
_LEAST_SEEN = 30
_MOST_SIGMA_S = 0.006


def find_pose_delay(
    seen: Sequence[tuple[int, Float64]],
    pose_at_host_ns: Callable[[int], Float64],
    T_H_D: Float64,
) -> PoseDelay | None:
    """Return the error of the poses' stamps, from a hand at rest that a turning head sees.

    With the right stamps the hand stays where it is in the world. The delay is that with which it
    moves least, and its σ follows from the curvature there.

    Parameters
    ----------
    seen : sequence of (t_host_ns, (3,) float64)
        Time of exposure and the hand's place in D, m.
    pose_at_host_ns : callable
        Returns T_W_H (4, 4), or raises PosePendingError or PoseError.
    T_H_D : (4, 4) float64

    Returns
    -------
    PoseDelay or None
        None if the head has not turned enough, or the hand has not been seen often enough.
    """
    steps = round(_MOST_DELAY_S / _STEP_S)
    shifts_s = _STEP_S * np.arange(-steps, steps + 1)
    placed = []
    for t_host_ns, place_D_m in seen:
        place_H_m = transform(T_H_D, place_D_m[None])
        try:
            placed.append(
                [
                    transform(pose_at_host_ns(t_host_ns + round(1e9 * shift_s)), place_H_m)[0]
                    for shift_s in shifts_s
                ]
            )
        except (PosePendingError, PoseError):
            continue
    if len(placed) < _LEAST_SEEN:
        return None
    places_m = np.array(placed)
    spread_m2 = ((places_m - places_m.mean(axis=0)) ** 2).sum(axis=(0, 2))
    best = int(np.argmin(spread_m2[1:-1])) + 1
    below, least, above = spread_m2[best - 1 : best + 2]
    curvature = (below - 2.0 * least + above) / _STEP_S**2
    if curvature <= 0.0 or best in (1, len(shifts_s) - 2):
        return None
    shift_s = float(shifts_s[best] - (above - below) / (2.0 * _STEP_S * curvature))
    variance_m2 = float(least) / (3.0 * (len(placed) - 1))
    sigma_s = float(np.sqrt(2.0 * variance_m2 / curvature))
    return PoseDelay(-shift_s, sigma_s) if sigma_s < _MOST_SIGMA_S else None


def run_pose_delay(
    server: HeadsetServer,
    camera: Camera,
    T_H_D: Float64,
    latency_s: float,
    duration_s: float = 8.0,
    progress: Progress = Progress(),
) -> PoseDelay:
    """Measure the error of a connected headset's pose stamps; the wearer turns the head.

    Parameters
    ----------
    server : HeadsetServer
        With a connected headset.
    camera : Camera
        The rig's depth camera.
    T_H_D : (4, 4) float64
    latency_s : float
        From a frame's exposure to its earliest arrival, as in a calibration.
    duration_s : float
    progress : Progress

    Raises
    ------
    CameraError
        If the camera fails.
    HandcalError
        If the head was not turned enough, or the hand was not seen.
    CancelledError
        If it was cancelled.
    """
    server.send_prompt("Hold your hand still. Turn your head left and right.")
    finder = make_finder(SegmentSettings())
    frames: list[tuple[int, int, Float64]] = []
    start_s = time.monotonic()
    try:
        while (passed_s := time.monotonic() - start_s) < duration_s:
            progress.at(passed_s / duration_s, "Turn the head, and hold the hand still")
            try:
                frame = camera.read(_POLL_S)
                points_m = np.asarray(finder.find(frame).points_m, np.float64)
                place_D_m: Float64 = np.median(points_m, axis=0)
                frames.append((frame.t_camera_ns, frame.t_host_ns, place_D_m))
            except (CameraTimeoutError, HandError):
                continue
    finally:
        server.send_prompt("")
    # As FrameClock, but with the shortest delay of all frames for each.
    delays_ns = [arrived_ns - exposed_ns for exposed_ns, arrived_ns, _ in frames]
    offset_ns = min(delays_ns, default=0) - round(1e9 * latency_s)
    seen = [(exposed_ns + offset_ns, place_D_m) for exposed_ns, _, place_D_m in frames]
    found = find_pose_delay(seen, server.pose_at_host_ns, T_H_D)
    if found is None:
        raise HandcalError(
            f"the pose stamps could not be checked ({len(seen)} hands seen): hold the hand still "
            "in view of the camera, and turn the head left and right about once a second"
        )
    return found
