"""Stand-ins: a camera with a script, and the libraries of Orbbec and OAK-D cameras."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta
from itertools import count
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, Frame, Intrinsics
from handcal.io.closable import Closable

T_C_D = rigid([0.01, -0.02, 0.03], [0.015, 0.001, -0.002])
PERIOD_US = 33_000


class OrbbecStandIn(ModuleType):
    """The module pyorbbecsdk, with one camera of 64x48 depth and 80x60 colour."""

    def __init__(self) -> None:
        super().__init__("pyorbbecsdk")
        self.is_plugged, self.is_silent, self.has_color = True, False, True
        self.lens_model, self.k1 = "K6", 0.1
        self.OBError = type("OBError", (RuntimeError,), {})
        self.OBSensorType = SimpleNamespace(DEPTH_SENSOR="depth", COLOR_SENSOR="color")
        self.OBFormat = SimpleNamespace(Y16="Y16", RGB="RGB")
        self.OBCameraDistortionModel = SimpleNamespace(BROWN_CONRADY="BC", BROWN_CONRADY_K6="K6")
        self.OBLogLevel = SimpleNamespace(NONE=5)
        self.Context = type(
            "Context",
            (),
            {"query_devices": lambda _: self, "set_logger_level": staticmethod(lambda _: None)},
        )
        self.Config = lambda: SimpleNamespace(enable_stream=lambda _profile: None)
        self.Pipeline = lambda _device: _OrbbecPipeline(self)

    def get_count(self) -> int:
        return int(self.is_plugged)

    def get_device_by_index(self, index: int) -> Any:
        assert index == 0
        return self.get_device_by_serial_number("AB1")

    def get_device_by_serial_number(self, serial: str) -> Any:
        if serial != "AB1":
            raise self.OBError("no such device")
        about = SimpleNamespace(
            get_name=lambda: "Orbbec Femto Bolt",
            get_serial_number=lambda: "AB1",
            get_firmware_version=lambda: "1.0.9",
        )
        return SimpleNamespace(get_device_info=lambda: about)


class _OrbbecPipeline:
    def __init__(self, sdk: OrbbecStandIn) -> None:
        self._sdk, self._numbers = sdk, count(1)

    def get_stream_profile_list(self, sensor: str) -> Any:
        width, height, form = (64, 48, "Y16") if sensor == "depth" else (80, 60, "RGB")
        lens = SimpleNamespace(fx=60.0, fy=61.0, cx=width / 2, cy=height / 2)
        terms = dict.fromkeys(("k2", "k3", "k4", "k5", "k6", "p1", "p2"), 0.0)
        k1 = self._sdk.k1 if sensor == "depth" else 0.0
        bent = SimpleNamespace(k1=k1, model=self._sdk.lens_model, **terms)
        moved = SimpleNamespace(rot=T_C_D[:3, :3], transform=1e3 * T_C_D[:3, 3])
        default = form if sensor == "depth" else "MJPG"

        def profile(form: str) -> Any:
            return SimpleNamespace(
                get_format=lambda: form,
                get_width=lambda: width,
                get_height=lambda: height,
                get_intrinsic=lambda: lens,
                get_distortion=lambda: bent,
                get_extrinsic_to=lambda _other: moved,
            )

        return SimpleNamespace(
            get_default_video_stream_profile=lambda: profile(default),
            get_video_stream_profile=lambda _width, _height, wanted, _rate: profile(wanted),
        )

    def enable_frame_sync(self) -> None:
        pass

    def start(self, _config: Any) -> None:
        pass

    def stop(self) -> None:
        self._numbers = count(10**9)

    def wait_for_frames(self, timeout_ms: int) -> Any:
        if not self._sdk.is_plugged:
            raise self._sdk.OBError("device disconnected")
        if self._sdk.is_silent:
            threading.Event().wait(1e-3 * timeout_ms)
            return None
        number = next(self._numbers)
        rng = np.random.default_rng(number)

        def frame(values: Any) -> Any:
            return SimpleNamespace(
                get_data=lambda: values.view(np.uint8).ravel(),
                get_timestamp_us=lambda: PERIOD_US * number,
                get_index=lambda: number,
                get_depth_scale=lambda: 0.25,
            )

        depth = frame(rng.integers(1, 60_000, (48, 64), np.uint16))
        color = frame(rng.integers(0, 255, (60, 80, 3), np.uint8)) if self._sdk.has_color else None
        return SimpleNamespace(get_depth_frame=lambda: depth, get_color_frame=lambda: color)


class OakStandIn(ModuleType):
    """The module depthai, with one camera; images are small noise, tiled."""

    def __init__(self) -> None:
        super().__init__("depthai")
        self.is_plugged, self.is_silent, self.platform = True, False, "RVC2"
        self.links: list[str] = []
        self.Platform = SimpleNamespace(RVC4="RVC4")
        self.CameraBoardSocket = SimpleNamespace(CAM_A="A", CAM_B="B", CAM_C="C")
        self.node = SimpleNamespace(
            Camera="Camera", StereoDepth="StereoDepth", Sync="Sync", ImageAlign="ImageAlign"
        )
        self.Device = _OakDevices(self)
        self.Pipeline = lambda _device: _OakPipeline(self)
        self.numbers = count(1)


class _OakDevices:
    def __init__(self, library: OakStandIn) -> None:
        self._library = library

    def getAllAvailableDevices(self) -> list[Any]:
        return [SimpleNamespace(getDeviceId=lambda: "18A")] if self._library.is_plugged else []

    def __call__(self, info: Any) -> Any:
        return SimpleNamespace(
            getProductName=lambda: "OAK-D Pro",
            getDeviceName=lambda: "OAK",
            getDeviceId=info.getDeviceId,
            getPlatform=lambda: self._library.platform,
            close=lambda: None,
        )


class _Port:
    """An output that can be linked to named inputs; a node has one for any name."""

    def __init__(self, library: OakStandIn, name: str) -> None:
        self._library, self._name = library, name

    def __getattr__(self, name: str) -> Any:
        if name.startswith("set"):
            return lambda *_: None
        return _Port(self._library, f"{self._name}.{name}")

    def __getitem__(self, name: str) -> _Port:
        return _Port(self._library, f"{self._name}[{name}]")

    def build(self, socket: str) -> _Port:
        return _Port(self._library, f"{self._name} {socket}")

    def requestOutput(self, size: tuple[int, int], **_how: Any) -> _Port:
        assert size in ((640, 400), (1280, 720))
        return self

    def link(self, other: _Port) -> None:
        self._library.links.append(f"{self._name} > {other._name}")

    def createOutputQueue(self, **_how: Any) -> Any:
        return SimpleNamespace(get=self._pair)

    def _pair(self, timeout: timedelta) -> Any:
        if not self._library.is_plugged:
            raise RuntimeError("X_LINK_ERROR")
        if self._library.is_silent:
            time.sleep(timeout.total_seconds())
            return None
        number = next(self._library.numbers)
        rng = np.random.default_rng(number)
        units = np.tile(rng.integers(1, 5000, (72, 128), np.uint16), (10, 10))
        image = np.tile(rng.integers(0, 255, (72, 128, 3), np.uint8), (10, 10, 1))
        lens = [[800.0, 0.0, 640.0], [0.0, 801.0, 360.0], [0.0, 0.0, 1.0]]
        transformation = SimpleNamespace(getIntrinsicMatrix=lambda: lens)
        shared = {
            "getTransformation": lambda: transformation,
            "getSequenceNum": lambda: number,
            "getTimestampDevice": lambda: timedelta(microseconds=PERIOD_US * number),
        }
        return {
            "depth": SimpleNamespace(getFrame=lambda: units, **shared),
            "color": SimpleNamespace(getCvFrame=lambda: image, **shared),
        }


class _OakPipeline:
    def __init__(self, library: OakStandIn) -> None:
        self._library = library

    def create(self, node: str) -> _Port:
        return _Port(self._library, node)

    def start(self) -> None:
        pass

    def stop(self) -> None:
        pass


PALE = "a frame without colour"
SILENT = CameraTimeoutError("no frame came")
UNPLUGGED = CameraError("the camera was unplugged", "plug it in again")


class Scripted(Closable):
    """Gives what its script says: a frame for a number, and silence at the end."""

    name = "Scripted camera"
    identity = CameraIdentity()
    depth_intrinsics = Intrinsics(16, 12, 20.0, 20.0, 7.5, 5.5)

    def __init__(self, script: Sequence[int | str | Exception]) -> None:
        self.script = list(script)
        self.number = 0
        self.is_closed = False

    def read(self, timeout_s: float = 1.0) -> Frame:
        step = self.script.pop(0) if self.script else SILENT
        if isinstance(step, Exception):
            time.sleep(min(timeout_s, 0.05) if isinstance(step, CameraTimeoutError) else 0.0)
            raise step
        self.number = number = step if isinstance(step, int) else self.number + 1
        color, depth = np.full((12, 16, 3), number, np.uint8), np.full((12, 16), number, np.uint16)
        lens = self.depth_intrinsics
        frame = Frame(number, number * 100_000_000, 0, depth, 1e-3, lens, color, lens)
        return frame if step != PALE else replace(frame, color=None, color_intrinsics=None)

    def close(self) -> None:
        self.is_closed = True
