"""A stranger's datagrams do not stop the display of the headset's app in C#."""

from __future__ import annotations

import socket
import struct
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from handcal.link.server import HeadsetServer

pytestmark = [pytest.mark.process, pytest.mark.slow]
SECONDS = 3.0
PER_SECOND = 20_000
SIZE = 1300
FRAME_MS = 11
ATTEMPTS = 3
# An answer to the hello of device 7, which only its MAC tells from the PC's.
FORGED = struct.pack(">2sBBQQIHH", b"hC", 2, 0, 0, 7, 0, 0, 1).ljust(SIZE, b"\7")


def test_forged_datagrams_delay_no_frame(program: Path) -> None:
    """A busy machine delays frames as well: of three attempts one has to hold."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as pc:
        pc.bind(("127.0.0.1", 0))
        command = ["mono", str(program), "frames", str(pc.getsockname()[1])]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as app:
            _, headset = pc.recvfrom(2048)
            found = []
            for _ in range(ATTEMPTS):
                calm_ms, _ = _frames(app)
                is_over, sent = threading.Event(), list[float]()
                flood = threading.Thread(target=_send, args=(pc, headset, is_over, sent))
                flood.start()
                flooded_ms, checked = _frames(app)
                is_over.set()
                flood.join()
                found.append((calm_ms, flooded_ms, round(sent[0]), checked))
                is_flooded = sent[0] > 0.8 * PER_SECOND and checked > PER_SECOND
                if is_flooded and flooded_ms <= max(2 * calm_ms, FRAME_MS):
                    break
            else:
                pytest.fail(
                    f"slowest frame without and with the flood, ms; sent each s; checked: {found}"
                )
            assert app.stdin is not None
            app.stdin.close()


def test_forged_datagrams_do_not_keep_a_pairing_from_its_end(program: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as pc:
        pc.bind(("127.0.0.1", 0))
        port = str(pc.getsockname()[1])
        command = ["mono", str(program), "pair", "127.0.0.1", port, "12345678", "7"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as app:
            _, headset = pc.recvfrom(2048)
            is_over, sent = threading.Event(), list[float]()
            flood = threading.Thread(target=_send, args=(pc, headset, is_over, sent))
            flood.start()
            try:
                answer, _ = app.communicate(timeout=20.0)
            finally:
                is_over.set()
                flood.join()
                app.kill()
    assert "No PC answered" in answer


def _frames(app: subprocess.Popen[str]) -> tuple[int, int]:
    """Return the slowest frame, ms, and the number of forged datagrams that were checked."""
    assert app.stdin is not None
    assert app.stdout is not None
    app.stdin.write(f"{SECONDS}\n")
    app.stdin.flush()
    slowest_ms, checked = map(int, app.stdout.readline().split())
    return slowest_ms, checked


def _send(
    pc: socket.socket, headset: tuple[str, int], is_over: threading.Event, rate: list[float]
) -> None:
    start_s, sent = time.monotonic(), 0
    while not is_over.is_set():
        while sent < PER_SECOND * (time.monotonic() - start_s):
            pc.sendto(FORGED, headset)
            sent += 1
        time.sleep(0.0005)
    rate.append(sent / (time.monotonic() - start_s))


KEY = b"a pairing key of the tests"
TIMED_S = 10
LIVE_HZ = 30
POINTS = 3000
MOST_MS = 0.5


def test_a_frame_takes_half_a_millisecond_of_one_core(program: Path) -> None:
    hand = np.random.default_rng(1).normal(0.0, 0.05, (POINTS, 3))
    with HeadsetServer(KEY) as server:
        host, port = server.address
        command = ["mono", str(program), "time", host, str(port), KEY.decode(), str(TIMED_S)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        next_s = time.monotonic()
        while process.poll() is None:
            server.send_live_hand(hand, False)
            next_s = max(next_s + 1 / LIVE_HZ, time.monotonic())
            time.sleep(max(0.0, next_s - time.monotonic()))
        answer, _ = process.communicate()
    frames, cpu_ms, points = map(int, answer.split())
    assert points > 0.8 * POINTS * LIVE_HZ * TIMED_S
    assert cpu_ms / frames < MOST_MS, f"{cpu_ms / frames:.3f} ms"
