"""The simulated world of one station: room, hand, and the process that wears the headset."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from handcal.core.errors import LinkError
from handcal.io.closable import Closable
from handcal.link.pairing import KEY_VARIABLE
from handcal.sim.hand import HandSettings, Side, make_hand
from handcal.sim.render import World
from handcal.sim.room import make_room
from handcal.sim.scene import SceneReceiver, SceneState

_END_S = 5.0


def program_command() -> list[str]:
    """Return the command that starts the command line, also in a packaged program."""
    return [sys.executable, "-m", "handcal"]


class VirtualHeadset(Closable):
    """Runs ``handcal headset`` until closed.

    Parameters
    ----------
    rig_path, worn_rig_path : Path
        The rig used by the headset, and the rig of the headset actually worn.
    port, scene_port : int
        Ports of the PC's end of the link and of the simulated camera, on this machine.
    pairing_key : str
    seed : int
        Seed of the wearer.
    loss, reorder : float
        Share of the datagrams lost, and reordered, in each direction.
    is_stale, loses_start : bool
        Faults: it keeps drawing with the projections of the wearer before; the first projections
        never arrive.
    steps_clock : bool
        Fault: its clock is set during the calibration.
    side : {"left", "right"}, optional
    slip_m : (3,) tuple of float
    eye_distance_m : float or None
        Eye distance that it reports; None: it measures none.
    """

    def __init__(
        self,
        rig_path: Path,
        port: int,
        scene_port: int,
        pairing_key: str,
        *,
        seed: int,
        worn_rig_path: Path,
        loss: float = 0.0,
        reorder: float = 0.0,
        is_stale: bool = False,
        loses_start: bool = False,
        steps_clock: bool = False,
        eye_distance_m: float | None = None,
        side: Side | None = None,
        slip_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the process)
        options = {
            "--port": port,
            "--scene-port": scene_port,
            "--rig": rig_path,
            "--worn-rig": worn_rig_path,
            "--seed": seed,
            "--loss": loss,
            "--reorder": reorder,
        }
        command = [*program_command(), "headset"]
        command += [str(part) for option in options.items() for part in option]
        command += ["--stale"] if is_stale else []
        command += ["--lose-start"] if loses_start else []
        command += ["--step-clock"] if steps_clock else []
        if eye_distance_m is not None:
            command += ["--eye-distance-mm", str(1e3 * eye_distance_m)]
        command += ["--hand", side] if side else []
        if any(slip_m):
            command += ["--slip-mm", *(str(1e3 * one_m) for one_m in slip_m)]
        self._process = subprocess.Popen(  # noqa: S603 (our own program)
            command, env=os.environ | {KEY_VARIABLE: pairing_key}, stderr=self._errors
        )

    def require_running(self) -> None:
        """Raise LinkError with the process's error message if it has ended."""
        if self._process.poll() is None:
            return
        self._errors.seek(0)
        complaint = self._errors.read(1000).decode(errors="replace").strip()
        raise LinkError(f"the virtual headset has ended. {complaint}".strip())

    def close(self) -> None:
        """End the process; safe to call twice."""
        if self._errors.closed:
            return
        self._process.terminate()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._errors.close()


_REMEMBERED = 64


class Simulation(Closable):
    """Starts the virtual headset and receives its scene.

    Parameters
    ----------
    seed : int
        Seed of wearer, hand and room.
    start_headset : callable
        Starts the process, given the port to which it sends the scene.
    side : {"left", "right"}, optional
        The hand that is raised; default: drawn from the seed.

    Attributes
    ----------
    world : World
    """

    def __init__(
        self,
        seed: int,
        start_headset: Callable[[int], VirtualHeadset],
        side: Side | None = None,
    ) -> None:
        self.world = World(make_hand(seed, HandSettings(side=side)), make_room(seed))
        self._start_headset = start_headset
        self._recent: deque[SceneState] = deque(maxlen=_REMEMBERED)
        with ExitStack() as stack:
            self._receiver = stack.enter_context(SceneReceiver())
            self._headset = start_headset(self._receiver.port)
            self._stack = stack.pop_all()

    def scene(self) -> SceneState | None:
        """Return the present state of the moving part of the world, for the simulated camera."""
        state = self._receiver.latest()
        if state is not None:
            self._recent.append(state)
        return state

    def scene_at(self, t_ns: int) -> SceneState | None:
        """Return the scene seen by the camera nearest to a time of the host's monotonic clock."""
        return min(self._recent, key=lambda state: abs(state.t_ns - t_ns), default=None)

    def require_running(self) -> None:
        """Raise LinkError if the virtual headset has ended."""
        self._headset.require_running()

    def restart(self) -> None:
        """End the virtual headset, if it is running, and start another."""
        self._headset.close()
        self._headset = self._start_headset(self._receiver.port)

    def close(self) -> None:
        """End the virtual headset; safe to call twice."""
        self._headset.close()
        self._stack.close()
