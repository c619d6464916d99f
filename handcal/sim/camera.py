"""A simulated depth camera: the embedded default, which needs no hardware."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, Frame, Intrinsics
from handcal.io.closable import Closable
from handcal.sim.ahat import UNITS_PER_M, AhatSettings, sense_depth_by_phase
from handcal.sim.hand import make_hand
from handcal.sim.raster import D415
from handcal.sim.render import World, render
from handcal.sim.room import make_room
from handcal.sim.scene import SceneState
from handcal.sim.sensor import SensorName, SensorSettings, fatten_of, sense_depth

_POLL_S = 0.002
# What rendering takes longer is the computer's doing, of which a camera knows nothing: if it
# counted, a busy computer would be told of a late camera that it does not have.
_LATENCY_NS = 30_000_000


@dataclass(frozen=True, slots=True)
class SyntheticSettings:
    """Settings of the simulated camera."""

    rate_hz: float = 30.0
    """Highest frame rate; lower if rendering takes longer."""
    clock_offset_s: float = 123.456
    clock_drift: float = 20e-6
    """The camera's clock shows ``(1 + clock_drift) t + clock_offset_s`` at host time t."""
    sensor: SensorSettings | AhatSettings = field(default_factory=SensorSettings)
    freeze_after_s: float = np.inf
    """Fault: from this time on every frame repeats the last picture, with running time stamps."""
    late_s: float = 0.0
    """Fault: every frame arrives this much later."""
    focal_scale: float = 1.0
    """Fault: another camera, whose focal length is that of `depth_intrinsics` times this."""
    depth_bias_m: float = 0.0
    """Fault: added to every measured depth."""


def sensor_settings(
    name: SensorName, fatten_px: float | None = None
) -> SensorSettings | AhatSettings:
    """Return the settings of a sensor; `fatten_px` replaces how much a D415's edges grow."""
    if name == "ahat":
        return AhatSettings()
    return SensorSettings(fatten_px=fatten_of(name, fatten_px))


CAMERA_FAULTS: Mapping[str, SyntheticSettings] = {
    "frozen-camera": SyntheticSettings(freeze_after_s=1.5),
    "other-camera": SyntheticSettings(focal_scale=1.04),
    "late-camera": SyntheticSettings(late_s=0.12),
    "depth-bias": SyntheticSettings(depth_bias_m=0.02),
}
"""Settings of a camera with a fault, by its name."""


class SyntheticCamera(Closable):
    """Renders the world as measured by a D415; implements `Camera`.

    Parameters
    ----------
    world : World
    scene : callable
        Returns the present state of the moving part of the world, or None if there is none.
    depth_intrinsics : Intrinsics
        Distortion is ignored.
    seed : int
        Seed of the sensor's noise.
    settings : SyntheticSettings
    """

    name = "Simulated camera"
    identity = CameraIdentity("Simulated camera", "simulated", "")

    def __init__(
        self,
        world: World,
        scene: Callable[[], SceneState | None],
        *,
        depth_intrinsics: Intrinsics = D415,
        seed: int = 0,
        settings: SyntheticSettings | None = None,
    ) -> None:
        self._settings = settings or SyntheticSettings()
        self.depth_intrinsics = replace(
            depth_intrinsics,
            fx=self._settings.focal_scale * depth_intrinsics.fx,
            fy=self._settings.focal_scale * depth_intrinsics.fy,
            distortion=(),
        )
        if self._settings.focal_scale != 1.0:
            self.identity = replace(self.identity, serial_number="another one")
        self._world = world
        self._scene = scene
        self._opened_s: float | None = None
        self._frozen: Frame | None = None
        self._under_way: deque[Frame] = deque()
        self._rng = np.random.default_rng(seed)
        self._index = 0
        self._next_s = time.monotonic()
        self._is_open = True

    def read(self, timeout_s: float = 1.0) -> Frame:
        """Render the next frame, at the camera's rate.

        Its host time is that of its arrival from a real camera, 30 ms after the exposure at the
        latest, however long the rendering takes.

        Raises
        ------
        CameraTimeoutError
            If there is nothing to see within `timeout_s`.
        CameraError
            If the camera was closed.
        """
        if not self._is_open:
            raise CameraError("the simulated camera is closed", "open it again")
        while True:
            self._under_way.append(self._expose(self._wait_for_scene(timeout_s)))
            if not self._settings.late_s:
                return self._under_way.popleft()
            now_ns = time.monotonic_ns()
            if now_ns >= self._under_way[0].t_host_ns + 1e9 * self._settings.late_s:
                return replace(self._under_way.popleft(), t_host_ns=now_ns)

    def _wait_for_scene(self, timeout_s: float) -> SceneState:
        deadline_s = time.monotonic() + timeout_s
        state = None
        while state is None:
            now_s = time.monotonic()
            if now_s >= self._next_s:
                state = self._scene()
            if state is None and now_s >= deadline_s:
                raise CameraTimeoutError(
                    f"the simulated camera saw nothing within {timeout_s:g} s",
                    "start the virtual headset, which simulates the wearer",
                )
            if state is None:
                time.sleep(np.clip(self._next_s - now_s, _POLL_S, deadline_s - now_s + _POLL_S))
        self._next_s = max(self._next_s + 1.0 / self._settings.rate_hz, time.monotonic())
        return state

    def _expose(self, state: SceneState) -> Frame:
        settings, world = self._settings, self._world
        if self._opened_s is None:
            self._opened_s = time.monotonic()
        if self._frozen is not None and time.monotonic() - self._opened_s > settings.freeze_after_s:
            return self._repeat(self._frozen, state)
        depth_m, color = render(world, state.T_W_D, state.T_W_hand, self.depth_intrinsics)
        biased_m = np.where(depth_m > 0.0, depth_m + settings.depth_bias_m, depth_m)
        sensor = settings.sensor
        if isinstance(sensor, AhatSettings):
            scale_m = 1.0 / UNITS_PER_M
            depth = sense_depth_by_phase(biased_m, self.depth_intrinsics, self._rng, sensor)
        else:
            scale_m = sensor.depth_scale_m
            depth = sense_depth(biased_m, self.depth_intrinsics.fx, self._rng, sensor)
        frame = Frame(
            index=self._index,
            t_camera_ns=self._camera_ns(state),
            t_host_ns=_arrival_ns(state),
            depth=depth,
            depth_scale_m=scale_m,
            depth_intrinsics=self.depth_intrinsics,
            color=color,
            color_intrinsics=self.depth_intrinsics,
        )
        self._index += 1
        self._frozen = frame
        return frame

    def _repeat(self, frame: Frame, state: SceneState) -> Frame:
        """Return the same picture again, as if it were new."""
        self._index += 1
        return replace(
            frame,
            index=self._index,
            t_camera_ns=self._camera_ns(state),
            t_host_ns=_arrival_ns(state),
        )

    def _camera_ns(self, state: SceneState) -> int:
        clock_rate = 1.0 + self._settings.clock_drift
        return round(state.t_ns * clock_rate + 1e9 * self._settings.clock_offset_s)

    def close(self) -> None:
        """Stop; safe to call twice."""
        self._is_open = False


def _arrival_ns(state: SceneState) -> int:
    """Return the host time at which a frame exposed at a state, and rendered now, has arrived."""
    return min(time.monotonic_ns(), state.t_ns + _LATENCY_NS)


def simulated_frame(seed: int = 1) -> Frame:
    """Return one frame of a hand held up half a metre away, in a room.

    Parameters
    ----------
    seed : int
        Of the hand, the room and the sensor's noise.

    Returns
    -------
    Frame
        Depth and colour, aligned, with their intrinsics.

    Examples
    --------
    >>> import handcal
    >>> frame = handcal.simulated_frame()
    >>> frame.depth.shape, frame.color.shape
    ((720, 1280), (720, 1280, 3))
    """
    held_up = rigid([0.1, 0.1, 0.05], [0.0, 0.02, 0.5])
    world = World(make_hand(seed), make_room(seed))
    with SyntheticCamera(world, lambda: SceneState(0, np.eye(4), held_up), seed=seed) as camera:
        return camera.read()
