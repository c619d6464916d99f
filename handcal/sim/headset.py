"""The virtual headset: a separate process that exchanges the real datagrams.

It hosts the simulated wearer, shows what the PC sends, and reports poses and confirmations on its
own clock, as a real headset does. The true poses go only to the simulated camera, as light. Without
the wearer it is a device at rest: it prints what a headset would show, and confirms on Enter.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import ClassVar

import numpy as np

from handcal.core.display import projection_matrix
from handcal.core.errors import LinkError
from handcal.core.geometry import rigid
from handcal.core.types import EYES, Eye, EyeDisplay, Float64, HeadsetIdentity, HeadsetView, Rig
from handcal.link.client import HeadsetClient, HeadsetState
from handcal.link.endpoint import Channel
from handcal.link.impair import UNIMPAIRED, Impairment
from handcal.link.wire import VERSION, Packet, Slot, hkdf
from handcal.rig.rig_file import read_rig
from handcal.sim.hand import HandSettings, Side, make_hand
from handcal.sim.scene import ScenePublisher, SceneState
from handcal.sim.wearer import DisplayView, Wearer, WearerAction
from handcal.sim.wearer_settings import WearerSettings

_STEP_AFTER_NS, _STEP_NS = 4_000_000_000, 300_000_000
_SUSPENDED_S = 2.0
"""Delay of an image from which on the computer has been suspended."""
_FORMER_SHIFT_M = (0.006, 0.0, 0.0)
_TRACKING_RAD, _TRACKING_M = 0.0003, 0.0002  # noise of the reported poses


@dataclass(frozen=True, slots=True)
class HeadsetSettings:
    """Settings of the virtual headset and its connection."""

    rig_path: str
    """The PC's rig, whose views the headset reports as its runtime's."""
    port: int
    """Address of the PC."""
    scene_port: int | None = None
    """Port of the simulated camera on this machine; None if there is none."""
    host: str = "127.0.0.1"
    seed: int = 0
    """Seed of the wearer, the wearer's hand and the tracking noise."""
    worn_rig_path: str = ""
    """The rig of the headset actually worn; empty for `rig_path`."""
    wearer: WearerSettings = field(default_factory=WearerSettings)
    impairment: Impairment = UNIMPAIRED
    """Impairment of the network, in both directions."""
    rate_hz: float = 90.0
    """Displayed images, and poses, per second."""
    clock_offset_s: float = 12.345
    clock_drift_ppm: float = 30.0
    """Headset's clock minus the host's: initial offset and drift."""
    patience_s: float = 10.0
    """Longest time without a connection."""
    duration_s: float | None = None
    """Time after which to end; None to run until stopped."""
    name: str = "Virtual headset"
    device_id: str = ""
    """Identity; empty for one made of the pairing key, the same after a restart."""
    is_stale: bool = False
    """Fault: acknowledges projections, but keeps drawing those of the wearer before."""
    loses_start: bool = False
    """Fault: the first projections never arrive."""
    steps_clock: bool = False
    """Fault: its clock is set during the calibration."""
    eye_distance_m: float | None = None
    """Eye distance that it reports; None: it measures none."""
    side: Side | None = None
    """The hand that is raised; None: drawn from the seed."""
    has_wearer: bool = True
    """False: a device at rest, without a simulated wearer."""


def run_headset(
    settings: HeadsetSettings, pairing_key: bytes, is_stopped: Callable[[], bool]
) -> None:
    """Run the headset until it is stopped, dismissed by the PC, or the duration is over.

    Parameters
    ----------
    settings : HeadsetSettings
    pairing_key : bytes
    is_stopped : callable
        Called for every image.

    Raises
    ------
    LinkError
        If no PC has answered for `patience_s`.
    FileError
        If the rig cannot be read.
    """
    rig = read_rig(Path(settings.rig_path))
    worn_rig = read_rig(Path(settings.worn_rig_path or settings.rig_path))
    if settings.has_wearer:
        hand = make_hand(settings.seed, HandSettings(side=settings.side))
        act = _as_wearer(Wearer(settings.seed, worn_rig, hand, settings.wearer), rig)
    else:
        act = _at_keyboard()
    rng = np.random.default_rng(settings.seed)
    clock_ns = _clock(settings)
    start_s = heard_s = next_s = time.monotonic()
    port = settings.scene_port
    end_s = start_s + settings.duration_s if settings.duration_s is not None else np.inf
    with (
        (_StartLost if settings.loses_start else HeadsetClient)(
            (settings.host, settings.port),
            pairing_key,
            _identity(settings, pairing_key, rig),
            lambda: clock_ns(time.monotonic_ns()),
            impairment=settings.impairment,
        ) as client,
        nullcontext() if port is None else ScenePublisher(port) as scene,
    ):
        while not is_stopped() and not client.dismissed and next_s < end_s:
            t_ns = time.monotonic_ns()
            state = client.state()
            if settings.is_stale:
                state = _as_before(state, rig)
            action = act(state, t_ns / 1e9 - start_s)
            if scene is not None:
                scene.publish(SceneState(t_ns, action.T_W_H @ worn_rig.T_H_D, action.T_W_hand))
            noise = rigid(rng.normal(0.0, _TRACKING_RAD, 3), rng.normal(0.0, _TRACKING_M, 3))
            client.send_pose(action.T_W_H @ noise, clock_ns(t_ns))
            if action.confirm:
                client.confirm(clock_ns(t_ns), state)
            if action.nudge is not None and state.verify is not None:
                client.nudge(clock_ns(t_ns), state, action.nudge, action.fits)
            now_s = time.monotonic()
            if client.connected or now_s - next_s > _SUSPENDED_S:
                heard_s = now_s
            elif now_s - heard_s > settings.patience_s:
                if client.refusal:
                    raise LinkError(client.refusal)
                raise LinkError(
                    f"no PC answered at {settings.host}:{settings.port} for "
                    f"{settings.patience_s:g} s",
                    "check that it runs with the same pairing key",
                )
            next_s = max(next_s + 1.0 / settings.rate_hz, now_s)
            time.sleep(next_s - now_s)


class _StartLost(HeadsetClient):
    """Never receives the first projections."""

    _lost: ClassVar[dict[Slot, int]] = {}

    def _accept(self, channel: Channel, packet: Packet) -> None:
        if packet.slot in (Slot.PROJECTION_LEFT, Slot.PROJECTION_RIGHT):
            self._lost.setdefault(packet.slot, packet.message_id)
            if self._lost[packet.slot] == packet.message_id:
                return
        super()._accept(channel, packet)


def _as_before(state: HeadsetState, rig: Rig) -> HeadsetState:
    """Return what a headset shows that still draws with the last wearer's φ."""
    stale = {
        eye: replace(one, P=projection_matrix(rig.eyes[eye], _FORMER_SHIFT_M))
        for eye, one in state.projections.items()
    }
    return replace(state, projections=stale)


def _as_wearer(wearer: Wearer, rig: Rig) -> Callable[[HeadsetState, float], WearerAction]:
    return lambda state, t_s: wearer.step(_view(state, rig, t_s))


def _at_keyboard() -> Callable[[HeadsetState, float], WearerAction]:
    """Return the actions of a device at rest: it prints what is shown, and confirms on Enter."""
    presses: list[str] = []
    threading.Thread(target=lambda: presses.extend(sys.stdin), daemon=True).start()
    told = ""

    def act(state: HeadsetState, _t_s: float) -> WearerAction:
        nonlocal told
        telling = _told(state)
        if telling != told:
            told = telling
            print(told, flush=True)  # noqa: T201 (the display)
        is_pressed = bool(presses)
        presses.clear()
        return WearerAction(np.eye(4), np.eye(4), is_pressed and state.cursor_W_m is not None)

    return act


def _told(state: HeadsetState) -> str:
    """Return in words what is shown."""
    what = [
        f"projections of {state.owner.wearer or 'nobody'}: {' and '.join(state.drawn) or 'none'}",
        "offline calibration" if state.is_offline else "",
        "" if state.cursor_W_m is None else _cursor_told(state),
        "" if state.live_W_m is None else f"live {'outline' if state.is_outline else 'hand'}",
        "" if state.target is None else f"target for the {state.target.eye} eye",
        "" if state.shape is None else f"shape of {len(state.shape.corners_W_m)} corners",
        "" if state.verify is None else f"verify the {state.verify.eye} eye",
        f"open: {' and '.join(state.eyes)}",
        state.prompt,
    ]
    return "; ".join(part for part in what if part)


def _cursor_told(state: HeadsetState) -> str:
    of_eyes = "" if state.cursor_eyes == EYES else f" of the {state.cursor_eyes[0]} eye"
    return f"cursor {state.cursor_id}{of_eyes}"


def _identity(settings: HeadsetSettings, pairing_key: bytes, rig: Rig) -> HeadsetIdentity:
    return HeadsetIdentity(
        settings.device_id or hkdf(pairing_key, b"", b"virtual headset", 8).hex(),
        name=settings.name,
        runtime="simulator",
        app=f"handcal {version('handcal')}",
        protocol=VERSION,
        views={eye: _runtime_view(rig.eyes[eye]) for eye in EYES},
        eye_distance_m=settings.eye_distance_m,
    )


def _runtime_view(display: EyeDisplay) -> HeadsetView:
    """Return the view as a runtime would report it: without the display's homography."""
    (fx, _, cx), (_, fy, cy) = display.K[:2]
    width, height = display.width_px, display.height_px
    tangents = [-cx / fx, (width - cx) / fx, -cy / fy, (height - cy) / fy]
    return HeadsetView(display.T_V_H, np.array(tangents), width, height)


def until_terminated() -> Callable[[], bool]:
    """Return a function that reports termination signals; call from the main thread."""
    received: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _frame: received.append(number))
    return lambda: bool(received)


def _clock(settings: HeadsetSettings) -> Callable[[int], int]:
    """Return the headset's clock as a function of the host's, ns."""
    start_ns = time.monotonic_ns()
    offset_ns = round(settings.clock_offset_s * 1e9)

    def clock_ns(host_ns: int) -> int:
        drift_ns = round(settings.clock_drift_ppm * (host_ns - start_ns) / 1e6)
        is_set = settings.steps_clock and host_ns - start_ns > _STEP_AFTER_NS
        return host_ns + offset_ns + drift_ns + (_STEP_NS if is_set else 0)

    return clock_ns


def _view(state: HeadsetState, rig: Rig, t_s: float) -> DisplayView:
    """Return the displays' content; nothing is drawn before both projections have arrived."""
    drawn = state.drawn
    is_ready = len(drawn) == len(EYES)
    is_outlined = (
        state.is_outline and state.verify is not None and state.verify.eye in state.live_eyes
    )

    has_cursor = is_ready and state.cursor_W_m is not None
    seeing = tuple(eye for eye in state.eyes if not has_cursor or eye in state.cursor_eyes)

    def rendered(eye: Eye) -> Float64:
        return drawn[eye].P if is_ready else projection_matrix(rig.eyes[eye])

    return DisplayView(
        t_s=t_s,
        cursor_W_m=state.cursor_W_m if has_cursor and seeing else None,
        cursor_id=state.cursor_id,
        P={eye: rendered(eye) for eye in EYES},
        T_V_H={eye: drawn[eye].T_V_H if is_ready else rig.eyes[eye].T_V_H for eye in EYES},
        eyes=seeing,  # an open eye without the cursor has no part in the alignment
        guard_red=state.is_over_limit,
        prompt=state.prompt,
        verify=state.verify if is_ready else None,
        outline_W_m=state.live_W_m if is_outlined else None,
    )
