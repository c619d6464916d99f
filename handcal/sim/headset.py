"""The virtual headset: a process of its own that speaks the real datagrams.

It hosts the simulated wearer, shows what the PC sends, and reports poses and confirmations on its
own clock, as a real headset does. The true poses go only to the simulated camera, as light.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from handcal.display import projection_matrix, view_of_eye
from handcal.errors import LinkError
from handcal.geometry import rigid
from handcal.link.client import HeadsetClient, HeadsetState
from handcal.link.impair import UNIMPAIRED, Impairment
from handcal.rig.rig_file import read_rig
from handcal.sim.hand import make_hand
from handcal.sim.scene import ScenePublisher, SceneState
from handcal.sim.wearer import DisplayView, Wearer, WearerSettings
from handcal.types import EYES, Eye, Float64, Rig


@dataclass(frozen=True, slots=True)
class HeadsetSettings:
    """Settings of the virtual headset and its connection."""

    rig_path: str
    """The PC's rig, which the headset uses."""
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
    tracking_sigma_m: float = 0.0002
    tracking_sigma_rad: float = 0.0003
    """Noise of the reported poses."""
    patience_s: float = 10.0
    """Longest time without a connection."""
    duration_s: float | None = None
    """Time after which to end; None to run until stopped."""


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
    wearer = Wearer(settings.seed, worn_rig, make_hand(settings.seed), settings.wearer)
    rng = np.random.default_rng(settings.seed)
    clock_ns = _clock(settings)
    start_s = heard_s = next_s = time.monotonic()
    port = settings.scene_port
    end_s = start_s + settings.duration_s if settings.duration_s is not None else np.inf
    with (
        HeadsetClient(
            (settings.host, settings.port),
            pairing_key,
            lambda: clock_ns(time.monotonic_ns()),
            impairment=settings.impairment,
        ) as client,
        nullcontext() if port is None else ScenePublisher(port) as scene,
    ):
        while not is_stopped() and not client.dismissed and next_s < end_s:
            t_ns = time.monotonic_ns()
            view = _view(client.state(), rig, t_ns / 1e9 - start_s)
            action = wearer.step(view)
            if scene is not None:
                scene.publish(SceneState(t_ns, action.T_W_H @ worn_rig.T_H_D, action.T_W_hand))
            T_W_H = action.T_W_H @ _tracking_error(rng, settings)
            client.send_pose(T_W_H, clock_ns(t_ns))
            if action.confirm:
                T_E_W = {eye: view_of_eye(rig.eyes[eye], T_W_H) for eye in EYES}
                client.confirm(T_E_W, clock_ns(t_ns), view.cursor_id)
            now_s = time.monotonic()
            if client.connected:
                heard_s = now_s
            elif now_s - heard_s > settings.patience_s:
                raise LinkError(
                    f"no PC answered at {settings.host}:{settings.port} for "
                    f"{settings.patience_s:g} s; check that it runs with the same pairing key"
                )
            next_s = max(next_s + 1.0 / settings.rate_hz, now_s)
            time.sleep(next_s - now_s)


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
        return host_ns + offset_ns + drift_ns

    return clock_ns


def _view(state: HeadsetState, rig: Rig, t_s: float) -> DisplayView:
    """Return the displays' content; an eye without a new projection shows the rig's."""

    def rendered(eye: Eye) -> Float64:
        projection = state.projections.get(eye)
        return projection_matrix(rig.eyes[eye]) if projection is None else projection.P

    return DisplayView(
        t_s=t_s,
        cursor_W_m=state.cursor_W_m,
        cursor_id=state.cursor_id,
        P={eye: rendered(eye) for eye in EYES},
        T_V_H={eye: rig.eyes[eye].T_V_H for eye in EYES},
        eyes=state.eyes,
        guard_red=state.is_over_limit,
        prompt=state.prompt,
    )


def _tracking_error(rng: np.random.Generator, settings: HeadsetSettings) -> Float64:
    return rigid(
        rng.normal(0.0, settings.tracking_sigma_rad, 3),
        rng.normal(0.0, settings.tracking_sigma_m, 3),
    )
