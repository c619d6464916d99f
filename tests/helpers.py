"""Helpers that several test modules share."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from numpy.typing import ArrayLike

from handcal.core.display import eye_projection
from handcal.core.geometry import project
from handcal.core.types import EyeDisplay, Float64, Intrinsics
from handcal.io.resources import resource_path
from handcal.rig.example import example_rig
from handcal.rig.rig_file import write_rig
from handcal.session.session import Session
from handcal.sim.camera import CAMERA_FAULTS, SyntheticSettings
from handcal.station.faults import Fault

ROOT = Path(__file__).parents[1]
DATA = ROOT / "tests/data"
FOLDERS = {
    "HOME": "home",
    "XDG_CACHE_HOME": "cache",
    "XDG_CONFIG_HOME": "config",
    "XDG_DATA_HOME": "data",
    "XDG_STATE_HOME": "state",
    "TMPDIR": "temporary",
}
"""Variables that name a user's folders, and fresh folders for them."""
SILENCERS = "CI", "ORT_DISABLE_TELEMETRY", "ORT_TELEMETRY_DISABLED", "ORT_RUNNING_UNIT_TESTS"
"""Variables that switch a library's telemetry off; the tests may run where one is set."""

_PROBE = range(400_000)
_PROBE_PERIOD_S = 1.0
_WAITED_NS = 10_000_000
"""Waits for the processor in a second that are no sign of a busy machine."""


def eventually(is_true: Callable[[], object], timeout_s: float = 5.0) -> None:
    """Wait until a condition holds; fail after the timeout."""
    end_s = time.monotonic() + timeout_s
    while not is_true():
        assert time.monotonic() < end_s, "the condition never held"
        time.sleep(0.001)


class Patience:
    """A time limit that runs more slowly on a busy machine.

    If the threads of a process were ready to run ten times longer than they ran, a second counts
    as a tenth. Linux tells both; elsewhere `is_over` times a short computation once a second.

    Parameters
    ----------
    limit_s : float
    process : int, optional
        The process that is waited for; default: this one.
    """

    def __init__(self, limit_s: float, process: int | None = None) -> None:
        self._left_s = limit_s
        self._process = os.getpid() if process is None else process
        self._scheduled = _scheduled_ns(self._process)
        self._seen_s = time.monotonic()

    def is_over(self) -> bool:
        """Count the time since the last call; return whether the limit is reached."""
        now_s = time.monotonic()
        if now_s - self._seen_s < _PROBE_PERIOD_S:
            return self._left_s <= 0.0
        before, self._scheduled = self._scheduled, _scheduled_ns(self._process)
        slowness = _slowness_of(before, self._scheduled) if self._scheduled else _slowness()
        self._left_s -= (now_s - self._seen_s) / slowness
        self._seen_s = now_s
        return self._left_s <= 0.0


def output_of(process: subprocess.Popen[str], patience_s: float) -> tuple[str, str]:
    """Wait until a program ends, and return what it wrote to its pipes; fail if it goes on."""
    patience = Patience(patience_s, process.pid)
    while True:
        with suppress(subprocess.TimeoutExpired):
            return process.communicate(timeout=_PROBE_PERIOD_S)
        assert not patience.is_over(), "the program did not end"


def _scheduled_ns(process: int) -> dict[str, tuple[int, int]]:
    """Return how long each thread of a process ran, and how long it was ready to; empty if unknown.

    In ns, by Linux's ``schedstat``.
    """
    scheduled = {}
    for path in Path(f"/proc/{process}/task").glob("*/schedstat"):
        with suppress(OSError, ValueError):  # the thread has just ended
            ran_ns, waited_ns, _ = path.read_text().split()
            scheduled[path.parent.name] = int(ran_ns), int(waited_ns)
    return scheduled


def _slowness_of(before: dict[str, tuple[int, int]], after: dict[str, tuple[int, int]]) -> float:
    """Return how many times longer threads took because others ran; at least 1."""
    ran_ns, waited_ns = (
        sum(times[part] - before.get(thread, (0, 0))[part] for thread, times in after.items())
        for part in (0, 1)
    )
    return 1.0 + waited_ns / max(ran_ns, 1) if waited_ns > _WAITED_NS else 1.0


def _slowness() -> float:
    """Return the ratio of elapsed to processor time of a short computation; at least 1."""
    wall_s, worked_s = time.perf_counter(), time.thread_time()
    sum(_PROBE)
    wall_s, worked_s = time.perf_counter() - wall_s, time.thread_time() - worked_s
    return max(1.0, wall_s / max(worked_s, 1e-6))


def slow_simulator(patch: pytest.MonkeyPatch, rate_hz: float = 6.0) -> None:
    """Let this process's simulated cameras give few frames a second.

    A calibration in real time costs what its frames cost, and is robust to a slow camera.
    """
    for fault in get_args(Fault):  # a headset's fault leaves the camera as it is
        slow = replace(CAMERA_FAULTS.get(fault, SyntheticSettings()), rate_hz=rate_hz)
        patch.setitem(CAMERA_FAULTS, fault, slow)


def write_small_rig(path: Path) -> Path:
    """Write the example rig with a depth camera of half the resolution, for quicker programs."""
    rig = example_rig()
    camera = rig.depth_intrinsics
    fx, fy, cx, cy = (0.5 * value for value in (camera.fx, camera.fy, camera.cx, camera.cy))
    half = Intrinsics(camera.width // 2, camera.height // 2, fx, fy, cx, cy)
    write_rig(path, replace(rig, depth_intrinsics=half))
    return path


def write_thin_session(folder: Path) -> Path:
    """Write the example session with every eighth point: the paper's method takes 6 s for all."""
    example = Session.open(resource_path("example_session"))
    with Session.create(folder, example.rig, example.settings, wearer="thin") as session:
        for whole in example.alignments.values():
            session.save_alignment(
                replace(
                    whole,
                    cursor_m=whole.cursor_m[::8],
                    cursor_is_cut=whole.cursor_is_cut[::8],
                    hand_m=whole.hand_m[::8],
                    hand_is_cut=whole.hand_is_cut[::8],
                )
            )
    return session.path


def reprojection_error_px(
    display: EyeDisplay, shift_m: ArrayLike, true_shift_m: ArrayLike, points_E_m: Float64
) -> Float64:
    """Return the (N,) distances on the display between drawn points (N, 3) and their places."""
    drawn = project(eye_projection(display, shift_m), points_E_m)
    needed = project(eye_projection(display, true_shift_m), points_E_m)
    return np.asarray(np.linalg.norm(drawn - needed, axis=1))


def unity_transform(T: Float64) -> Float64:
    """Convert a (4, 4) transform between OpenCV's axes and Unity's left-handed ones, either way."""
    flip = np.diag([1.0, -1.0, 1.0, 1.0])
    return flip @ T @ flip
