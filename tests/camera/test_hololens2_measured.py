"""Boards and hands as a HoloLens 2's depth camera measures them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from handcal.camera.hololens2 import HoloLens2Camera
from handcal.camera.measure_depth import STILLS, run_depth_check
from handcal.camera.settings import HoloLens2Settings
from handcal.core.errors import CameraEndError
from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, Float32, Float64, Frame, Intrinsics
from handcal.hand.settings import SegmentSettings
from handcal.hand.shipped import make_finder
from handcal.lab.evaluate.masked_frames import read_masked_frames, read_masked_names
from handcal.rig.boards.board import Board, corners_m
from handcal.rig.findings import depth_finding
from handcal.sim.ahat import AhatSettings, ahat_rays, sense_distance
from handcal.sim.boards import BoardPainter, PictureSettings, pixel_rays
from tests.camera.hl2ss_server import Hl2ssServer, ahat_payload, calibration_of, packet_of

# Markers of fewer than 4 px a bit are not found in its 512 px.
BOARD = Board(squares=(5, 4), square_m=0.07, marker_m=0.0525, dictionary="DICT_4X4_100")
SHARP = Intrinsics(720, 720, 360.0, 360.0, 359.5, 359.5)
CALIBRATION = calibration_of(ahat_rays(), np.eye(4))


def measured(
    depth_m: Float32,
    reflectance: Float32,
    camera: Intrinsics,
    *,
    offset_m: float = 0.0,
    keeps_wrapped: bool = False,
) -> Frame:
    """Return the frame of a scene, given by an ideal image."""
    rng, how = np.random.default_rng(0), AhatSettings(offset_m=offset_m)
    payload = ahat_payload(*sense_distance(depth_m, reflectance, camera, rng, how))
    packet = packet_of(1, payload, np.eye(4))
    with Hl2ssServer(CALIBRATION, lambda: packet) as server:
        settings = HoloLens2Settings("127.0.0.1", port=server.port, keeps_wrapped=keeps_wrapped)
        with HoloLens2Camera(settings) as own:
            return own.read(20.0)


class Played:
    """A camera that gives frames made before."""

    name = "Played"
    identity = CameraIdentity()

    def __init__(self, frames: Sequence[Frame]) -> None:
        self._frames = iter(frames)
        self.depth_intrinsics = frames[0].depth_intrinsics

    def read(self, timeout_s: float = 1.0) -> Frame:
        frame = next(self._frames, None)
        if frame is None:
            raise CameraEndError("all were shown")
        return frame


def boards(count: int) -> list[Float64]:
    """Return poses T_D_B of a tilted board, 0.4 to 0.6 m away."""
    rng = np.random.default_rng(1)
    middle_m = corners_m(BOARD).mean(axis=0)
    made = []
    for z_m in np.linspace(0.4, 0.6, count):
        R = rigid([*rng.uniform(-0.3, 0.3, 2), 0.1])[:3, :3]
        made.append(rigid(R, [0.0, 0.0, z_m] - R @ middle_m))
    return made


def test_a_bias_of_20_mm_is_found_by_the_depth_check() -> None:
    painter = BoardPainter(BOARD, SHARP, PictureSettings(samples=1, noise=0.0))
    frames = []
    for T_D_B in boards(5):
        normal = T_D_B[:3, 2]
        depth_m = normal @ T_D_B[:3, 3] / (pixel_rays(SHARP, 1) @ normal)
        ink = painter.paint(T_D_B, np.random.default_rng(0))
        reflectance = (ink / 255.0).astype(np.float32)
        frames.append(
            measured(
                depth_m.astype(np.float32), reflectance, SHARP, offset_m=0.02, keeps_wrapped=True
            )
        )
    check = run_depth_check(Played(frames), BOARD, STILLS).check  # type: ignore[arg-type]
    assert check.bias_m(0.5)[0] == pytest.approx(0.02, abs=0.003)
    assert not depth_finding(check).is_fine


@pytest.mark.parametrize("name", ["color_aligned_640", "color_aligned_640_b", "sr300_320"])
def test_a_real_hand_is_found_as_by_the_camera_that_recorded_it(
    shared_data: Path, name: str
) -> None:
    folder = shared_data / "rgbd" / name
    shot = next(iter(read_masked_frames(folder, read_masked_names(folder))))
    frame = shot.frame
    gate = SegmentSettings(depth_min_m=0.25)
    theirs = make_finder(gate).find(frame)
    assert frame.color is not None
    depth_m = (frame.depth * frame.depth_scale_m).astype(np.float32)
    reflectance = 0.3 + 0.5 * frame.color[..., 0] / np.float32(255.0)
    ours = make_finder(gate).find(measured(depth_m, reflectance, frame.depth_intrinsics))
    assert ours.median_depth_m == pytest.approx(theirs.median_depth_m, abs=0.005)
    np.testing.assert_allclose(
        np.median(ours.points_m, axis=0), np.median(theirs.points_m, axis=0), atol=0.008
    )
