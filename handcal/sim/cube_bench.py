"""A simulated wearer in front of a cube: head, depth camera and eyes, over the real link."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

import numpy as np
from scipy.spatial import KDTree

from handcal.core.display import arcmin_from_px, eye_projection, view_of_eye
from handcal.core.errors import CameraTimeoutError, LinkError
from handcal.core.geometry import invert, project, rigid, transform
from handcal.core.types import CameraIdentity, Eye, EyeDisplay, Float64, Frame, HeadsetIdentity, Rig
from handcal.io.closable import Closable
from handcal.link.client import HeadsetClient
from handcal.link.pairing import new_device_id, new_pairing_key
from handcal.link.server import HeadsetServer
from handcal.rig.cube.cube import Cube
from handcal.rig.cube.track import cube_corners_m
from handcal.sim.boards import PictureSettings
from handcal.sim.cube import CubePainter
from handcal.sim.cube_captures import some_cube_pose
from handcal.sim.wearer import draw_eyes
from handcal.sim.wearer_settings import WearerSettings

_RATE_HZ = 30.0
_POSE_PERIOD_S = 1.0 / 90.0
_SWAY_M, _SWAY_RAD, _SWAY_S = 0.002, 0.004, 3.1
_TRACKING_M, _TRACKING_RAD = 0.0002, 0.0003
_LOOKS = 3
SEEING_SIGMA_ARCMIN = 1.0
"""Error with which the simulated wearer sees the distance of a corner from its place, each axis;
assumed."""
STEP_M = 0.00025


class CubeBench(Closable):
    """The wearer's head and the cube; implements `Camera` as the depth camera on the headset.

    The pictures have a constant latency, whatever rendering takes.

    Parameters
    ----------
    client : HeadsetClient
        The headset's end of the link, on the host's clock; it stays open.
    rig : Rig
    cube : Cube
    true_shifts_m : mapping of eye to (3,) float64
        φ of the true eyes.
    seed : int

    Attributes
    ----------
    T_W_T : (4, 4) float64
        True pose of the cube.
    """

    name = "Simulated camera"
    identity = CameraIdentity("Simulated camera", "simulated", "")
    latency_s = 0.03

    def __init__(
        self,
        client: HeadsetClient,
        rig: Rig,
        cube: Cube,
        true_shifts_m: Mapping[Eye, Float64],
        seed: int = 1,
    ) -> None:
        self._client, self._rig, self._cube = client, rig, cube
        self._true_shifts_m = true_shifts_m
        self._rng = np.random.default_rng(seed)
        self.depth_intrinsics = rig.depth_intrinsics
        self._painter = CubePainter(cube, rig.depth_intrinsics, PictureSettings(samples=1))
        self._index = 0
        self._next_s = self._start_s = time.monotonic()
        self.T_W_T = np.eye(4)
        self.place(0.5)
        self._ended = threading.Event()
        self._poses = threading.Thread(target=self._send_poses, daemon=True)
        self._poses.start()

    def place(self, depth_m: float) -> None:
        """Put the cube, turned at random, in front of the left eye at a distance."""
        left = self._rig.eyes["left"]
        T_E_T = some_cube_pose(left, depth_m, self._rng)
        self.T_W_T = invert(view_of_eye(left, self.head(time.monotonic_ns()))) @ T_E_T

    def head(self, t_ns: int) -> Float64:
        """Return the head's true pose T_W_H, which sways a little."""
        angle = 2.0 * np.pi * (1e-9 * t_ns - self._start_s) / _SWAY_S
        wave = np.sin(angle * np.array([1.0, 0.7, 0.4]))
        return rigid(_SWAY_RAD * wave[::-1], _SWAY_M * wave)

    def read(self, timeout_s: float = 1.0) -> Frame:
        """Render the next frame; CameraTimeoutError if it is due only after `timeout_s`."""
        wait_s = self._next_s - time.monotonic()
        if wait_s > timeout_s:
            raise CameraTimeoutError("the next picture is not due yet")
        time.sleep(max(0.0, wait_s))
        t_ns = time.monotonic_ns()
        self._next_s = max(self._next_s + 1.0 / _RATE_HZ, time.monotonic())
        T_W_D = self.head(t_ns) @ self._rig.T_H_D
        gray = self._painter.paint(invert(T_W_D) @ self.T_W_T, self._rng)
        self._index += 1
        camera = self.depth_intrinsics
        return Frame(
            index=self._index,
            t_camera_ns=t_ns,
            t_host_ns=t_ns + round(1e9 * self.latency_s),
            depth=np.zeros((camera.height, camera.width), np.uint16),
            depth_scale_m=0.001,
            depth_intrinsics=camera,
            color=np.repeat(gray[..., None], 3, axis=2),
            color_intrinsics=camera,
        )

    def adjust(self, eye: Eye, shift_m: Float64, draw: Callable[[Float64], None]) -> Float64:
        """Return φ after the wearer has moved it until the drawn corners cover the cube's.

        At each look the wearer compares what the headset draws with the cube as the true eye sees
        it, each corner with an error of sight, and moves φ in steps of `STEP_M`.

        Raises
        ------
        LinkError
            If the headset draws no target.
        """
        display = self._rig.eyes[eye]
        sigma_px = SEEING_SIGMA_ARCMIN / float(arcmin_from_px(display, 1.0))
        shift_m = shift_m.copy()
        seeing_px = self._rng.normal(0.0, sigma_px, (4, 2))
        for _ in range(_LOOKS):
            state = self._client.state()
            if state.shape is None or eye not in state.drawn:
                raise LinkError("the headset draws no target to adjust")
            T_W_H, corners_W_m = self.head(time.monotonic_ns()), state.shape.corners_W_m
            T_E_W = view_of_eye(display, T_W_H)
            T_V_W = state.drawn[eye].T_V_H @ invert(T_W_H)
            vertices_m = transform(T_E_W @ self.T_W_T, cube_corners_m(self._cube))
            shown_E_m = transform(T_E_W, corners_W_m)
            _, nearest = KDTree(vertices_m).query(shown_E_m)
            seen_px = project(
                eye_projection(display, self._true_shifts_m[eye]), vertices_m[nearest]
            )
            drawn_px = project(state.drawn[eye].P, transform(T_V_W, corners_W_m))
            gap_px = seen_px + seeing_px - drawn_px
            shift_m += STEP_M * np.rint(_move(display, shift_m, shown_E_m, gap_px) / STEP_M)
            draw(shift_m)
        return shift_m

    def _send_poses(self) -> None:
        rng = np.random.default_rng(0)
        while not self._ended.wait(_POSE_PERIOD_S):
            t_ns = time.monotonic_ns()
            noise = rigid(rng.normal(0.0, _TRACKING_RAD, 3), rng.normal(0.0, _TRACKING_M, 3))
            try:
                self._client.send_pose(self.head(t_ns) @ noise, t_ns)
            except LinkError:
                return

    def close(self) -> None:
        """Stop sending poses; safe to call twice."""
        self._ended.set()
        self._poses.join()


def _move(display: EyeDisplay, shift_m: Float64, points_E_m: Float64, gap_px: Float64) -> Float64:
    """Return the change of φ, (3,), that best moves the drawn points by `gap_px`, (N, 2)."""
    here_px = project(eye_projection(display, shift_m), points_E_m)
    moved_px = [
        project(eye_projection(display, shift_m + m), points_E_m) for m in STEP_M * np.eye(3)
    ]
    J = np.column_stack([(px - here_px).ravel() / STEP_M for px in moved_px])
    return np.asarray(np.linalg.lstsq(J, gap_px.ravel(), rcond=None)[0], np.float64)


@contextmanager
def simulated_wearer(rig: Rig, cube: Cube, seed: int) -> Iterator[tuple[HeadsetServer, CubeBench]]:
    """Yield a link with a simulated headset, and the wearer, whose eyes are those of a seed."""
    key = new_pairing_key().encode()
    identity = HeadsetIdentity(new_device_id(), "Simulated headset", "simulator")
    eyes = draw_eyes(np.random.default_rng(seed), WearerSettings())
    with (
        HeadsetServer(key) as server,
        HeadsetClient(server.address, key, identity) as client,
    ):
        server.wait_connected(10.0)
        with CubeBench(client, rig, cube, eyes, seed) as bench:
            yield server, bench
