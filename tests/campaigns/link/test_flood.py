"""A flood of foreign datagrams on a running session: its frames and its processor time.

Flooder, headset and simulated camera run on the same machine. Where its processors are busy, the
flood's share of them is missing for frames; the processor time tells how much that is.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import socket
import time
from multiprocessing.synchronize import Event
from pathlib import Path

import numpy as np
import pytest

from handcal.link import wire
from handcal.link.transport import Address
from handcal.link.wire import Packet
from handcal.station.settings import StationSettings
from handcal.station.station import Station
from tests.helpers import Patience, write_small_rig

pytestmark = [pytest.mark.campaign, pytest.mark.process]

IS_SHORT = "HANDCAL_SHORT_CAMPAIGNS" in os.environ
FLOOD_HZ = 5_000
TURNS = 1 if IS_SHORT else 8
TURN_S = 1.0 if IS_SHORT else 10.0


def _foreign(chance: random.Random) -> list[bytes]:
    """Return datagrams of a stranger: hellos, of a session, and bytes."""
    made = [chance.randbytes(1300)]
    for _ in range(50):
        identity, session = chance.getrandbits(64), chance.getrandbits(63) | 1
        made.append(wire.seal(os.urandom(32), Packet(chance.randbytes(200), sequence=identity)))
        made.append(wire.seal(os.urandom(32), Packet(chance.randbytes(1000), session, 5)))
    return made


def _flood(address: Address, is_ready: Event, flows: Event, ended: Event) -> None:
    """Send `FLOOD_HZ` foreign datagrams a second while `flows` is set."""
    made, count = _foreign(random.Random(1)), 0
    is_ready.set()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        while not ended.is_set():
            flows.wait(0.1)
            start_s, sent = time.monotonic(), 0
            while flows.is_set():
                while sent < FLOOD_HZ * (time.monotonic() - start_s):
                    sender.sendto(made[count % len(made)], address)
                    sent, count = sent + 1, count + 1
                time.sleep(0.002)


def test_a_flood_costs_a_running_session_no_frame(tmp_path: Path) -> None:
    rig = write_small_rig(tmp_path / "rig.yaml")
    settings = StationSettings(seed=1, rig=str(rig), sessions=str(tmp_path))
    context = multiprocessing.get_context("spawn")
    is_ready, flows, ended = (context.Event() for _ in range(3))
    turns: dict[bool, list[tuple[float, float, int, int, int]]] = {False: [], True: []}
    with Station(settings, "flood") as station:
        patience = Patience(60.0)
        while station.step().link.pose_rate_hz == 0.0:
            assert not patience.is_over(), "no headset connected"
        address = station.link.address
        flooder = context.Process(target=_flood, args=(address, is_ready, flows, ended))
        flooder.start()
        try:
            while not is_ready.is_set():
                station.step()
                assert flooder.is_alive()
            for turn in range(2 * TURNS):
                is_flood = turn % 4 in (1, 2)  # off, on, on, off: a drift of the load cancels
                (flows.set if is_flood else flows.clear)()
                turns[is_flood].append(_measure(station))
            patience = Patience(60.0)
            while not station.step().link.connected:
                assert not patience.is_over(), "the headset stayed away after the flood"
        finally:
            flows.clear()
            ended.set()
            flooder.join()
        assert station.link.statistics().given_up == {}
    rows = {is_flood: np.array(measured) for is_flood, measured in turns.items()}
    for is_flood, row in rows.items():
        seconds, cpu_s, frames, rejected, lapses = row.sum(axis=0)
        print(  # noqa: T201 (the campaign's figures)
            f"{'flood' if is_flood else 'quiet'}: {frames:.0f} frames in {seconds:.0f} s, "
            f"{frames / seconds:.2f} a second, in turns {np.round(row[:, 2] / row[:, 0], 1)}; "
            f"{cpu_s / seconds:.3f} s of processor a second; {rejected:,.0f} datagrams rejected, "
            f"{lapses:.0f} steps without a connection"
        )
    measured = np.concatenate(list(rows.values()))
    (frame_s, datagram_s), *_ = np.linalg.lstsq(measured[:, 2:4], measured[:, 1], rcond=None)
    print(  # noqa: T201 (as above)
        f"processor time: {1e3 * frame_s:.1f} ms a frame, {1e6 * datagram_s:.1f} µs a foreign "
        f"datagram, {datagram_s * FLOOD_HZ:.1%} of one core at {FLOOD_HZ:,} a second; "
        f"load {os.getloadavg()[0]:.0f}"
    )
    assert rows[True][:, 3].min() > 0, "the flood did not arrive"


def _measure(station: Station) -> tuple[float, float, int, int, int]:
    """Step for a turn; return its duration, processor time, and counts as printed."""
    start_s, start_cpu_s = time.monotonic(), time.process_time()
    before = sum(station.link.statistics().rejected.values())
    frames = lapses = 0
    while time.monotonic() < start_s + TURN_S:
        snapshot = station.step()
        frames += snapshot.observation is not None
        lapses += not snapshot.link.connected
    rejected = sum(station.link.statistics().rejected.values()) - before
    seconds, cpu_s = time.monotonic() - start_s, time.process_time() - start_cpu_s
    return seconds, cpu_s, frames, rejected, lapses
