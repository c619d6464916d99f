"""The processor time that the headset's link in C# takes of a frame."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from handcal.link.server import HeadsetServer

pytestmark = [pytest.mark.process, pytest.mark.slow]
KEY = b"a pairing key of the tests"
SECONDS = 10
LIVE_HZ = 30
POINTS = 3000
MOST_MS = 0.5


def test_a_frame_takes_half_a_millisecond_of_one_core(program: Path) -> None:
    hand = np.random.default_rng(1).normal(0.0, 0.05, (POINTS, 3))
    with HeadsetServer(KEY) as server:
        host, port = server.address
        command = ["mono", str(program), "time", host, str(port), KEY.decode(), str(SECONDS)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        next_s = time.monotonic()
        while process.poll() is None:
            server.send_live_hand(hand, False)
            next_s = max(next_s + 1 / LIVE_HZ, time.monotonic())
            time.sleep(max(0.0, next_s - time.monotonic()))
        answer, _ = process.communicate()
    frames, cpu_ms, points = map(int, answer.split())
    assert points > 0.8 * POINTS * LIVE_HZ * SECONDS
    assert cpu_ms / frames < MOST_MS, f"{cpu_ms / frames:.3f} ms"
