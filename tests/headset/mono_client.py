"""The headset's link in C# in place of `HeadsetClient`, so that the simulated wearer can wear it.

`program` is the command of a virtual headset whose datagrams are those of the C# link, and whose
wearer sees what the C# link says is drawn.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from base64 import b64decode
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import handcal.cli.main
import handcal.sim.headset
from handcal.core.types import EYES, Eye, Float64, HeadsetIdentity, Projection
from handcal.io.closable import Closable
from handcal.link.client import HeadsetState
from handcal.link.impair import UNIMPAIRED, Impairment
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.link.shapes import Shape, Target
from handcal.link.transport import Address
from tests.headset.relay import Relay
from tests.helpers import ROOT

_EYES: dict[int, tuple[Eye, ...]] = {1: ("left",), 2: ("right",), 3: EYES}
_END_S = 10.0


def command(program: Path) -> list[str]:
    """Return the command of the virtual headset with the C# link, before its arguments."""
    code = f"import sys; sys.path.insert(0, {str(ROOT)!r}); "
    code += "from tests.headset.mono_client import run; run()"
    return [sys.executable, "-c", code, str(program)]


def run() -> None:
    """Run ``handcal`` with the C# link; its program is the first argument."""
    program = Path(sys.argv.pop(1))

    def client(
        server: Address,
        key: bytes,
        identity: HeadsetIdentity,
        clock_ns: Callable[[], int],
        impairment: Impairment = UNIMPAIRED,
    ) -> MonoClient:
        return MonoClient(program, server, key, identity, clock_ns, impairment)

    vars(handcal.sim.headset)["HeadsetClient"] = client
    handcal.cli.main.main()


class MonoClient(Closable):
    """The interface of `HeadsetClient`, answered by the C# link in a process of its own."""

    def __init__(
        self,
        program: Path,
        server: Address,
        key: bytes,
        identity: HeadsetIdentity,
        clock_ns: Callable[[], int],
        impairment: Impairment = UNIMPAIRED,
        kept: Path | None = None,
    ) -> None:
        self._relay = None if impairment == UNIMPAIRED else Relay(server, impairment)
        self._folder = tempfile.TemporaryDirectory()
        host, port = server if self._relay is None else self._relay.address
        offset_ns, rate = _line(clock_ns)
        command = ["mono", str(program), "run", host, str(port), key.decode(), identity.device_id]
        command += [identity.name.replace(" ", "-"), repr(offset_ns), repr(rate)]
        command += [str(kept or Path(self._folder.name) / "kept")]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._state = HeadsetState()
        self.told: dict[str, str] = {}

    @property
    def connected(self) -> bool:
        return self.told.get("connected") == "1"

    @property
    def dismissed(self) -> bool:
        return self.told.get("dismissed") == "1"

    @property
    def refusal(self) -> str:
        """The problem of the connection, for the wearer."""
        return _text(self.told.get("problem", ""))

    def state(self) -> HeadsetState:
        self._tell("state")
        assert self._process.stdout is not None
        answer = self._process.stdout.readline()
        assert answer, "the C# link has ended"
        self.told = dict(part.split("=", 1) for part in answer.split())
        self._state = _read(self.told, self._state)
        return self._state

    def send_pose(self, T_W_H: Float64, t_headset_ns: int) -> None:
        numbers = " ".join(repr(float(number)) for number in T_W_H[:3].ravel())
        self._tell(f"pose {t_headset_ns} {numbers}")

    def confirm(self, t_headset_ns: int, state: HeadsetState) -> None:
        assert state is self._state
        self._tell(f"confirm {t_headset_ns}")

    def nudge(
        self, t_headset_ns: int, state: HeadsetState, moved: NudgeSum, fits: bool = False
    ) -> None:
        assert state is self._state
        sums = moved.right_arcmin, moved.down_arcmin, moved.size, fits
        self._tell(" ".join(["nudge", str(t_headset_ns), *(f"{float(one)!r}" for one in sums)]))

    def show_kept(self, wearer: str) -> None:
        self._tell(f"kept {wearer}")

    def close(self) -> None:
        """Have it say good-bye; safe to call twice."""
        if self._process.poll() is None:
            self._process.communicate(timeout=_END_S)
        if self._relay is not None:
            self._relay.close()
        self._folder.cleanup()

    def kill(self) -> None:
        """End it as a crash does."""
        self._process.kill()
        self._process.communicate()

    def _tell(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n")
        self._process.stdin.flush()


def _line(clock_ns: Callable[[], int]) -> tuple[float, float]:
    """Return offset and rate of a headset's clock over the machine's monotonic one."""
    first_ns, first = time.monotonic_ns(), clock_ns()
    time.sleep(0.2)
    second_ns, second = time.monotonic_ns(), clock_ns()
    rate = (second - first) / (second_ns - first_ns)
    return first - rate * first_ns, rate


def _read(told: dict[str, str], before: HeadsetState) -> HeadsetState:
    """Return the state; points that the program does not repeat are those from before."""
    fields: dict[str, Any] = {
        "prompt": _text(told["prompt"]),
        "eyes": _EYES[int(told["open"])],
        "projections": {
            eye: _projection(eye, told[eye.title()]) for eye in EYES if eye.title() in told
        },
        "is_offline": told["offline"] == "1",
        "target": None,
        "shape": None,
        "verify": None,
    }
    if "cursor" in told:
        number, eyes, points = told["cursor"].split(",")
        fields |= {"cursor_id": int(number), "cursor_W_m": _points(points)}
        fields |= {"cursor_eyes": _EYES[int(eyes)]}
    if "live" in told:
        red, outline, eyes, points = told["live"].split(",")
        fields |= {"is_over_limit": red == "1", "is_outline": outline == "1"}
        fields |= {"live_eyes": _EYES[int(eyes)], "live_W_m": _points(points)}
    if "target" in told:
        eye, corners = told["target"].split(",")
        fields["target"] = Target(_EYES[int(eye)][0], _numbers(corners).reshape(4, 3))
    if "shape" in told:
        eyes, corners = told["shape"].split(",")
        fields["shape"] = Shape(_numbers(corners).reshape(-1, 3), _EYES[int(eyes)])
    if "verify" in told:
        number, eye, steps = told["verify"].split(",")
        fields["verify"] = VerifyRequest(int(number), _EYES[int(eye)][0], *_numbers(steps))
    return replace(before, **fields)


def _projection(eye: Eye, told: str) -> Projection:
    P, T_V_H, offline, width, height, wearer, rig = told.split(",")
    return Projection(
        eye,
        _numbers(P).reshape(3, 4),
        int(width),
        int(height),
        np.vstack([_numbers(T_V_H).reshape(3, 4), [0.0, 0.0, 0.0, 1.0]]),
        _numbers(offline).reshape(3, 4),
        _text(wearer),
        _text(rig),
    )


def _numbers(encoded: str) -> Float64:
    return np.frombuffer(b64decode(encoded), "<f8").astype(np.float64)


def _points(encoded: str) -> Float64 | None:
    points = np.frombuffer(b64decode(encoded), "<f4").astype(np.float64).reshape(-1, 3)
    return points if len(points) else None


def _text(encoded: str) -> str:
    return b64decode(encoded).decode()
