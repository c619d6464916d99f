"""The simulated world of one station: room, hand, and who wears the headset, in its own process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np

from handcal.core.display import eye_projection, view_of_eye
from handcal.core.errors import LinkError
from handcal.core.geometry import camera_matrix, invert, rigid
from handcal.core.types import Eye, EyeDisplay, Float64, Intrinsics, Rig, UInt8
from handcal.io.closable import Closable
from handcal.link.pairing import KEY_VARIABLE
from handcal.sim.hand import HandSettings, Side, make_hand
from handcal.sim.render import World, render
from handcal.sim.room import make_room
from handcal.sim.scene import SceneReceiver, SceneState
from handcal.sim.wearer import draw_eyes
from handcal.sim.wearer_settings import WearerSettings

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


_DISPLAY_PX_PER_PX = 2


class TrueEyes:
    """Both eyes of a simulated wearer.

    Parameters
    ----------
    world : World
        The visible world.
    rig : Rig
        Rig of the worn headset.
    seed : int
        Seed of the wearer, as for `handcal.sim.wearer.Wearer`.
    settings : WearerSettings, optional

    Attributes
    ----------
    shift_m : mapping of eye to (3,) float64
        True φ from C0, E axes.
    """

    def __init__(
        self, world: World, rig: Rig, seed: int, settings: WearerSettings | None = None
    ) -> None:
        self._world = world
        self._rig = rig
        self.shift_m: Mapping[Eye, Float64] = draw_eyes(
            np.random.default_rng(seed), settings or WearerSettings()
        )

    def look(self, eye: Eye, T_W_H: Float64, T_W_hand: Float64 | None) -> UInt8:
        """Return an eye's view of the world within its display, without anything drawn.

        Parameters
        ----------
        eye : {"left", "right"}
        T_W_H : (4, 4) float64
            True pose of the headset.
        T_W_hand : (4, 4) float64 or None
            True pose of the hand; None while it is out of sight.

        Returns
        -------
        (height_px // 2, width_px // 2, 3) uint8
            RGB, covering the display.
        """
        display, shift_m = self._rig.eyes[eye], self.shift_m[eye]
        size = display.width_px // _DISPLAY_PX_PER_PX, display.height_px // _DISPLAY_PX_PER_PX
        K = _image_from_display(display, size) @ eye_projection(display, shift_m)[:, :3]
        pinhole = _fit_pinhole(K, size)
        T_W_eye = invert(view_of_eye(display, T_W_H)) @ rigid(translation_m=shift_m)
        _, image = render(self._world, T_W_eye, T_W_hand, pinhole)
        H = K @ np.linalg.inv(camera_matrix(pinhole))
        seen = cv2.warpPerspective(image, H, size, borderMode=cv2.BORDER_REPLICATE)
        return seen.astype(np.uint8, copy=False)


def _image_from_display(display: EyeDisplay, size: tuple[int, int]) -> Float64:
    """Return the (3, 3) matrix from the display's pixels to those of an image over all of it."""
    x, y = size[0] / display.width_px, size[1] / display.height_px
    return np.array([[x, 0.0, (x - 1.0) / 2.0], [0.0, y, (y - 1.0) / 2.0], [0.0, 0.0, 1.0]])


def _fit_pinhole(K: Float64, size: tuple[int, int]) -> Intrinsics:
    """Return the upright pinhole camera that covers the view of one with any (3, 3) K.

    K may rotate and skew the image, as it includes the display's homography H0.
    """
    width, height = size
    corners_px = [[x, y, 1.0] for x in (-0.5, width - 0.5) for y in (-0.5, height - 0.5)]
    rays = np.linalg.solve(K, np.transpose(corners_px)).T
    (left, top), (right, bottom) = (f(rays[:, :2] / rays[:, 2:], axis=0) for f in (np.min, np.max))
    fx, fy = width / (right - left), height / (bottom - top)
    return Intrinsics(width, height, fx, fy, -0.5 - fx * left, -0.5 - fy * top)
