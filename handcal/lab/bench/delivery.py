"""Latency of sending a cursor to the headset, on a good network and on a bad one."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from handcal.core.progress import Progress
from handcal.core.types import HeadsetIdentity
from handcal.lab.bench.figure import BenchFigure
from handcal.lab.bench.settings import BenchSettings
from handcal.lab.bench.trials import Measured
from handcal.link.client import HeadsetClient
from handcal.link.impair import Impairment
from handcal.link.pairing import new_device_id, new_pairing_key
from handcal.link.server import HeadsetServer

_LOSSES = 0.0, 0.3
_PATIENCE_S = 5.0


def measure_delivery(settings: BenchSettings, progress: Progress) -> Measured:
    """Measure the time until a cursor is acknowledged over loopback."""
    figures = []
    worst_ms = {}
    for done, loss in enumerate(_LOSSES, 1):
        durations_ms = _cursor_durations_ms(loss, settings)
        median_ms = float(np.median(durations_ms))
        figures.append(BenchFigure(f"cursor acknowledged, {loss:.0%} loss", median_ms, "ms"))
        worst_ms[f"{loss:g}"] = max(durations_ms)
        progress.at(done / len(_LOSSES))
    return Measured(figures, {"worst_ms_at_loss": worst_ms})


def _cursor_durations_ms(loss: float, settings: BenchSettings) -> list[float]:
    """Time successive cursors, with datagrams lost and reordered with probability `loss`."""
    rng = np.random.default_rng(0)
    key = new_pairing_key().encode()
    identity = HeadsetIdentity(new_device_id())
    impairment = Impairment(loss, reorder=loss)
    durations_ms = []
    with (
        HeadsetServer(key) as server,
        HeadsetClient(server.address, key, identity, impairment=impairment),
    ):
        server.wait_connected(_PATIENCE_S)
        for number in range(1, settings.repeats + 1):
            cursor_m = rng.uniform(-0.1, 0.1, (settings.points, 3))
            start_s = perf_counter()
            server.wait_acked(server.send_cursor(cursor_m, number), _PATIENCE_S)
            durations_ms.append(1e3 * (perf_counter() - start_s))
    return durations_ms
