"""Sixteen faults of the camera in one running station: nothing is raised, and frames come again.

Faults of truth, which a station could mistake for a calibration, must also be told.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from handcal.calibration.states import State
from handcal.camera.camera import Camera
from handcal.core.errors import CameraError, CameraTimeoutError, HandcalError
from handcal.core.types import EYES, Frame
from handcal.io.closable import Closable
from handcal.station.settings import StationSettings
from handcal.station.station import Station
from tests.campaigns.campaign import Tally, campaign
from tests.helpers import write_small_rig

SECONDS, SHORT_SECONDS, SHORT_TRUTH_S = 8.0, 0.4, 0.8  # a truth shows only in several frames
RECOVERY_S = 30.0


def _noise(frame: Frame) -> Frame:
    rng = np.random.default_rng(frame.index)
    return replace(frame, depth=rng.integers(0, 65535, frame.depth.shape, dtype=np.uint16))


def _half(frame: Frame) -> Frame:
    one = frame.depth_intrinsics
    width, height = one.width // 2, one.height // 2
    half = replace(
        one,
        width=width, height=height, fx=one.fx / 2, fy=one.fy / 2, cx=one.cx / 2, cy=one.cy / 2,
    )  # fmt: skip
    depth = np.ascontiguousarray(frame.depth[: 2 * height : 2, : 2 * width : 2])
    return replace(frame, depth=depth, depth_intrinsics=half, color=None, color_intrinsics=None)


def _longer(frame: Frame) -> Frame:
    one = frame.depth_intrinsics
    return replace(frame, depth_intrinsics=replace(one, fx=1.2 * one.fx, fy=1.2 * one.fy))


FAULTS: Mapping[str, Callable[[Frame], Frame]] = {
    "black colour": lambda one: replace(
        one, color=None if one.color is None else np.zeros_like(one.color)
    ),
    "no colour": lambda one: replace(one, color=None, color_intrinsics=None),
    "no depth": lambda one: replace(one, depth=np.zeros_like(one.depth)),
    "greatest depth": lambda one: replace(one, depth=np.full_like(one.depth, 65535)),
    "noise": _noise,
    "half the size": _half,
    "depth ten times": lambda one: replace(one, depth_scale_m=10 * one.depth_scale_m),
    "clock backwards": lambda one: replace(one, t_camera_ns=one.t_camera_ns - one.index * 10**8),
    "clock an hour ahead": lambda one: replace(one, t_camera_ns=one.t_camera_ns + 3600 * 10**9),
    "clock negative": lambda one: replace(one, t_camera_ns=-one.t_camera_ns),
    "count backwards": lambda one: replace(one, index=max(0, 10_000 - one.index)),
}
TRUTHS = {"frozen picture": "does not change", "other camera": "not the rig's"}
"""Faults that must be told, and words of the message."""
BROKEN = "unplugged", "silent", "two frames a second"


class FaultyCamera(Closable):
    """A camera with the fault that is set."""

    def __init__(self, camera: Camera) -> None:
        self.fault = ""
        self.name, self.identity = camera.name, camera.identity
        self.depth_intrinsics = camera.depth_intrinsics
        self._camera = camera
        self._last: Frame | None = None

    def read(self, timeout_s: float = 1.0) -> Frame:
        if self.fault == "unplugged":
            raise CameraError("the camera is gone; plug it in again")
        if self.fault == "silent":
            time.sleep(timeout_s)
            raise CameraTimeoutError("no frame came")
        if self.fault == "two frames a second":
            time.sleep(0.5)
        frame = self._camera.read(timeout_s)
        if self.fault == "frozen picture" and self._last is not None:
            return replace(frame, depth=self._last.depth, color=self._last.color)
        self._last = frame
        if self.fault == "other camera":
            return _longer(frame)
        return FAULTS[self.fault](frame) if self.fault in FAULTS else frame

    def close(self) -> None:
        self._camera.close()


class FaultyStation(Station):
    """A station with that camera, opened again after it was unplugged."""

    camera: FaultyCamera | None = None

    def _open_camera(self) -> Camera:
        if self.camera is not None and self.camera.fault == "unplugged":
            raise CameraError("no camera was found")
        fault = "" if self.camera is None else self.camera.fault
        self.camera = FaultyCamera(super()._open_camera())
        self.camera.fault = fault
        return self.camera


def attack(tally: Tally, is_short: bool) -> None:
    # Another camera contradicts a calibration for good, so it comes last.
    names = [*BROKEN, *FAULTS, *TRUTHS]
    with tempfile.TemporaryDirectory() as folder:
        rig = write_small_rig(Path(folder) / "rig.yaml")
        settings = StationSettings(seed=3, rig=str(rig), sessions=folder)
        with FaultyStation(settings, "faults") as station:
            _watch(station, RECOVERY_S, tally, "the start", until_frame=True)
            for name in names:
                tally.tried += 1
                assert station.camera is not None
                station.camera.fault = name
                told = TRUTHS.get(name)
                short_s = SHORT_TRUTH_S if told else SHORT_SECONDS
                said = _watch(station, short_s if is_short else SECONDS, tally, name)
                if told and not any(told in one for one in said):
                    tally.fail(f"{name}: not told; said: {sorted(said)}")
                tally.seen["told"] += bool(said)
                assert station.camera is not None
                station.camera.fault = ""
                _watch(station, RECOVERY_S, tally, f"after {name}", until_frame=True)


def _watch(
    station: FaultyStation, seconds: float, tally: Tally, where: str, until_frame: bool = False
) -> set[str]:
    """Step for some time; return what the station said. With `until_frame`, wait for one."""
    calibration = station.calibration
    said: set[str] = set()
    end_s, steps = time.monotonic() + seconds, 0
    while time.monotonic() < end_s or steps < 8:
        steps += 1
        try:
            snapshot = station.step()
            if until_frame and snapshot.observation is not None:
                return said
            said |= {snapshot.camera.problem, snapshot.problem, snapshot.contradiction} - {""}
            seen = snapshot.observation
            if seen is not None and seen.is_steady and calibration.state is State.SHOW_HAND:
                calibration.make_cursor(EYES)
        except HandcalError as error:
            said.add(str(error))
        except Exception as error:
            tally.fail(f"{where}: {error!r}")
            return said
    if until_frame:
        tally.fail(f"{where}: no frame within {seconds:.0f} s; said: {sorted(said)}")
    return said


if __name__ == "__main__":
    campaign("faults of the camera in a running station", attack)
