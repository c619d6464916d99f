"""Benchmark of the window: ``python -m handcal_gui.benchmark``, run by ``handcal bench --gui``.

A camera of rendered frames streams 1280x720 at 30, 60 or 90 Hz through a real station. A
separate process sends poses in place of a headset and never confirms, so that every frame is
segmented, and about 30 a second are checked by the guard and shown in all panels.
"""

from __future__ import annotations

import argparse
import gc
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PySide6.QtCore import QEvent, QObject, Qt, QTimer
from PySide6.QtWidgets import QApplication

from handcal.calibration.states import State
from handcal.camera.feed import CameraFeed
from handcal.core.errors import HandcalError
from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, Frame
from handcal.io.closable import Closable
from handcal.lab.bench.speed import noisy_frames
from handcal.lab.bench.trials import BenchFigure
from handcal.link.pairing import new_pairing_key
from handcal.link.transport import UdpTransport
from handcal.station.settings import StationSettings
from handcal.station.snapshot import Snapshot
from handcal.station.station import Station
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.app.start import keep_window_quick, use_english_capitals
from handcal_gui.calibrate.guide.view import Action
from handcal_gui.engine.garbage import collect_in_this_thread

RATES_HZ = (30, 60, 90)
_LIMITS = {30: (None, 30.0, 80.0), 60: (59.0, 12.0, 33.0), 90: (80.0, None, None)}
"""Targets at each rate: frames taken (Hz), delay of the event loop and frame to screen (ms)."""
_HEARTBEAT_MS = 5
_NOISES = 8
_WARM_UP = 150
_STARTS = 5
_KEY = new_pairing_key()
_T_D_CURSOR = rigid([-0.2, 0.0, 0.0], [-0.01, 0.01, 0.50])
_TURN = rigid([0.0, 0.0, 0.1])
_HEADSET = """
import sys, time
import numpy as np
from handcal.link.client import HeadsetClient
from handcal.link.pairing import new_device_id
from handcal.core.types import HeadsetIdentity
pc, key = ("127.0.0.1", int(sys.argv[1])), sys.stdin.readline().strip().encode()
with HeadsetClient(pc, key, HeadsetIdentity(new_device_id())) as headset:
    while not headset.dismissed:
        headset.send_pose(np.eye(4), time.monotonic_ns())
        time.sleep(1 / 60)
"""
_FIRST_WINDOW = (
    "from handcal_gui.app.start import first_window as show; from PySide6.QtCore import QSize; "
    "from PySide6.QtWidgets import QApplication; a = QApplication([]); a.setStyle('Fusion'); "
    "w = show(QSize(1280, 800))"
)
_BARE_WINDOW = (
    "from PySide6.QtWidgets import QApplication, QWidget; a = QApplication([]); "
    "a.setStyle('Fusion'); w = QWidget(); w.resize(1280, 800); w.show(); a.processEvents()"
)


class _ReplayCamera(Closable):
    """Plays frames from memory at the camera's rate; those that nobody takes are lost."""

    name = "Replay"
    identity = CameraIdentity()

    def __init__(self, replay: _ReplayFrames) -> None:
        self._replay = replay
        self.depth_intrinsics = replay.frames[0][0].depth_intrinsics
        self._index = 0
        self._next_s = time.monotonic()

    def read(self, timeout_s: float = 1.0) -> Frame:  # noqa: ARG002 (it never fails)
        time.sleep(max(0.0, self._next_s - time.monotonic()))
        steps = 1 + int((time.monotonic() - self._next_s) / self._replay.period_s)
        self._next_s += steps * self._replay.period_s
        self._index += steps
        self._replay.taken += 1
        now_ns = time.monotonic_ns()
        frame = self._replay.frames[self._replay.is_turned][self._index % _NOISES]
        return replace(frame, index=self._index, t_camera_ns=now_ns, t_host_ns=now_ns)

    def close(self) -> None:
        pass


class _ReplayFrames:
    """Frames of the hand in the cursor's pose and rotated, each with its own noise."""

    def __init__(self, rate_hz: int) -> None:
        self.period_s = 1.0 / rate_hz
        self.taken = 0
        self.is_turned = False
        poses = (_T_D_CURSOR, _T_D_CURSOR @ _TURN)
        self.frames = [noisy_frames(T_D_hand, _NOISES) for T_D_hand in poses]


class _ReplayStation(Station):
    """A station that replays frames instead of opening a camera."""

    def __init__(self, replay: _ReplayFrames, settings: StationSettings) -> None:
        super().__init__(settings, "Benchmark", pairings=_KEY)
        self._feed = CameraFeed(lambda: _ReplayCamera(replay))  # the other never opened


class _Measurement(QObject):
    """Measures the window for a number of frames, then ends the program.

    Attributes
    ----------
    taken : int
        Frames that the station has taken.
    delays_ms, ages_ms, memory_mb : list of float
        Delay of every heartbeat beyond its period, age of every frame when it is on the screen,
        and memory of the process every hundred frames.
    failure : str
        The reason why the program ended early, if it did.
    """

    def __init__(self, program: Program, replay: _ReplayFrames, frames: int) -> None:
        super().__init__()
        self.delays_ms: list[float] = []
        self.ages_ms: list[float] = []
        self.memory_mb: list[float] = []
        self.started_s = self.ended_s = 0.0
        self.taken = 0
        self.failure = "the window was closed before the end"
        self._program = program
        self._replay = replay
        self._frames = frames
        self._seen = 0
        self._shown_ns = 0
        self._beat_s = time.perf_counter()
        self._heart = QTimer(timerType=Qt.TimerType.PreciseTimer, interval=_HEARTBEAT_MS)
        self._heart.timeout.connect(self._beat)
        program.live.polled.connect(self._take)
        program.live.ended.connect(self._fail)
        program.window.installEventFilter(self)
        self._heart.start()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Take the time when the window has painted the current frame."""
        if event.type() == QEvent.Type.UpdateRequest and self._shown_ns:
            shown_ns, self._shown_ns = self._shown_ns, 0
            QTimer.singleShot(0, lambda: self._painted(shown_ns))
        return super().eventFilter(watched, event)

    def _fail(self, why: str) -> None:
        self.failure = why or self.failure
        QApplication.quit()

    def _beat(self) -> None:
        now_s = time.perf_counter()
        if self._seen > _WARM_UP:
            self.delays_ms.append(max(0.0, 1e3 * (now_s - self._beat_s) - _HEARTBEAT_MS))
        self._beat_s = now_s

    def _painted(self, shown_ns: int) -> None:
        if self._seen > _WARM_UP:
            self.ages_ms.append((time.monotonic_ns() - shown_ns) / 1e6)

    def _take(self, snapshot: Snapshot) -> None:
        seen = snapshot.observation
        if seen is None or snapshot.frame is None:
            return
        if snapshot.procedure.state is State.SHOW_HAND and seen.is_steady:
            self._program.live.do(Action.TAKE_STEP)
        self._replay.is_turned = snapshot.procedure.state is State.ALIGN
        self._shown_ns = snapshot.frame.t_host_ns
        self._seen = snapshot.frame.index
        if self._seen > _WARM_UP and not self.started_s:
            self.started_s, self.taken = time.perf_counter(), -self._replay.taken
        if self._seen > _WARM_UP + 100 * len(self.memory_mb):
            self.memory_mb.append(_resident_mb())
            sys.stderr.write(f"frames seen: {self._seen - _WARM_UP}\n")
            sys.stderr.flush()
        if self._seen > _WARM_UP + self._frames:
            self.ended_s = time.perf_counter()
            self.taken += self._replay.taken
            QApplication.quit()


def measure(frames: int, rate_hz: int) -> list[BenchFigure]:
    """Return the figures of a number of frames after a warm-up.

    Parameters
    ----------
    frames : int
    rate_hz : int
        Rate of the camera, one of `RATES_HZ`.

    Raises
    ------
    HandcalError
        If the calibration fails, or the window is closed.
    """
    app = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(app, QApplication)
    keep_window_quick()
    use_english_capitals()
    app.setStyle("Fusion")
    replay = _ReplayFrames(rate_hz)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = Program(PreferencesFile(folder / "preferences.json"))
        program.window.resize(1920, 1080)
        program.window.show()
        gc.freeze()  # as the program
        collect_in_this_thread(program.window)
        # No camera is opened for a recording, and the frames are in memory.
        settings = StationSettings(
            source="recording",
            headset="network",
            host="127.0.0.1",
            port=_free_port(),
            sessions=str(folder / "sessions"),
        )
        program.live.opened.connect(lambda _path: _show_every_panel(program))
        program.live.start(lambda: _ReplayStation(replay, settings))
        watch = _Measurement(program, replay, frames)
        with _headset(settings.port):
            app.exec()
        program.close()
    if not watch.ended_s:
        raise HandcalError(watch.failure)
    taken_hz = watch.taken / (watch.ended_s - watch.started_s)
    least_hz, delay_ms, age_ms = _LIMITS[rate_hz]
    grown = watch.memory_mb[-1] / watch.memory_mb[len(watch.memory_mb) // 4]
    bare_s, first_s = (_start_s(code) for code in (_BARE_WINDOW, _FIRST_WINDOW))
    return [
        BenchFigure("camera frames taken", taken_hz, "Hz", at_least=least_hz),
        BenchFigure(
            "event loop's delay, p99", _percentile(watch.delays_ms, 99), "ms", at_most=delay_ms
        ),
        BenchFigure("frame to screen, p95", _percentile(watch.ages_ms, 95), "ms", at_most=age_ms),
        BenchFigure("first window / bare window", first_s / bare_s, "", at_most=1.5),
        BenchFigure(
            f"memory at the end of {frames:,} frames / after a quarter", grown, "", at_most=1.05
        ),
        BenchFigure("memory at the end", watch.memory_mb[-1], "MB"),
    ]


def main() -> None:
    """Measure; print progress to stderr, and at the end the figures as JSON."""
    parser = argparse.ArgumentParser(prog="handcal_gui.benchmark", description=__doc__)
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--rate", type=int, default=RATES_HZ[0], choices=RATES_HZ)
    arguments = parser.parse_args()
    try:
        measured = measure(arguments.frames, arguments.rate)
    except HandcalError as error:
        sys.exit(str(error))
    figures: list[dict[str, Any]] = [figure.to_json() for figure in measured]
    print(json.dumps({"figures": figures}))  # noqa: T201 (the output of this command)


def _show_every_panel(program: Program) -> None:
    """Open every section, and the wearer's view, which is the slowest of the tabs."""
    for name in (*program.window.sections, "wearer_view"):
        program.window.go_to(name)


@contextmanager
def _headset(port: int) -> Iterator[None]:
    """Run a process in place of the headset, which in reality is another computer."""
    command = [sys.executable, "-c", _HEADSET, str(port)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, text=True)  # noqa: S603
    assert process.stdin is not None
    process.stdin.write(f"{_KEY}\n")
    process.stdin.flush()
    yield
    process.kill()
    process.communicate()


def _free_port() -> int:
    transport = UdpTransport(("127.0.0.1", 0))
    transport.close()
    return transport.address[1]


def _start_s(code: str) -> float:
    """Return the median duration of a process that ends once its first window is shown."""
    took_s = []
    for _ in range(_STARTS):
        started_s = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], check=True)  # noqa: S603 (our own code)
        took_s.append(time.perf_counter() - started_s)
    return float(np.median(took_s))


def _percentile(values: list[float], percent: float) -> float:
    return float(np.percentile(values, percent)) if values else float("nan")


def _resident_mb() -> float:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    raise OSError("the memory in use can be measured on Linux only")


if __name__ == "__main__":
    main()
