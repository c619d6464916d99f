"""Frames from an Orbbec camera (Femto, Gemini), by the package pyorbbecsdk2."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from handcal.core.errors import CameraError, CameraTimeoutError, extra_advice
from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, Float64, Frame, Intrinsics, UInt8
from handcal.io.closable import Closable

_RATE_HZ = 30
_MM_M = 1e-3
_APART_US = 33_000


def _sdk() -> Any:
    try:
        import pyorbbecsdk  # imported late: an extra
    except ImportError as error:
        raise CameraError("Orbbec cameras need pyorbbecsdk2", extra_advice("orbbec")) from error
    return pyorbbecsdk


class OrbbecCamera(Closable):
    """Live depth with colour in the camera's own sizes; implements `Camera`.

    Depth is delivered as measured, not aligned to colour. Written from the SDK's documentation and
    tested with a stand-in for the SDK; not yet run on a camera.

    Parameters
    ----------
    serial : str
        Serial number; empty for the first camera.

    Raises
    ------
    CameraError
        If the SDK or the camera is missing, in use, or has a lens that OpenCV does not know.
    """

    def __init__(self, serial: str = "") -> None:
        sdk = _sdk()
        self._error: Any = sdk.OBError
        self._pipeline: Any = None
        # Otherwise it writes a log into the working folder.
        sdk.Context.set_logger_level(sdk.OBLogLevel.NONE)
        devices = sdk.Context().query_devices()
        if not devices.get_count():
            raise CameraError("no Orbbec camera is connected", "plug one into a USB 3 port")
        try:
            device = (
                devices.get_device_by_serial_number(serial)
                if serial
                else devices.get_device_by_index(0)
            )
            about = device.get_device_info()
            self.identity = CameraIdentity(
                f"Orbbec {about.get_name().removeprefix('Orbbec ')}",
                about.get_serial_number(),
                about.get_firmware_version(),
            )
            self.name = self.identity.model
            pipeline = sdk.Pipeline(device)
            depth = _profile(pipeline, sdk.OBSensorType.DEPTH_SENSOR, sdk.OBFormat.Y16, sdk)
            color = _profile(pipeline, sdk.OBSensorType.COLOR_SENSOR, sdk.OBFormat.RGB, sdk)
            models = sdk.OBCameraDistortionModel
            self.depth_intrinsics = _intrinsics(depth, models, self.name)
            self._color_intrinsics = _intrinsics(color, models, self.name)
            self._T_C_D = _transform(depth.get_extrinsic_to(color))
            config = sdk.Config()
            config.enable_stream(depth)
            config.enable_stream(color)
            pipeline.enable_frame_sync()
            pipeline.start(config)
        except self._error as error:
            which = f"the Orbbec camera {serial}".rstrip()
            raise CameraError(
                f"{which} does not start: {error}",
                "close other programs that use it, check its serial number, or plug it in again",
            ) from error
        self._pipeline = pipeline

    def read(self, timeout_s: float = 1.0) -> Frame:
        """Return the next frame with depth; see `Camera.read`."""
        if self._pipeline is None:
            raise CameraError(f"{self.name} is closed", "open it again")
        deadline_s = time.monotonic() + timeout_s
        depth = None
        while depth is None:
            left_s = deadline_s - time.monotonic()
            if left_s <= 0.0:
                raise CameraTimeoutError(f"{self.name}: no frame for {timeout_s:g} s")
            try:
                frames = self._pipeline.wait_for_frames(max(1, round(1e3 * left_s)))
            except self._error as error:
                raise CameraError(f"{self.name} failed: {error}", "plug it in again") from error
            depth = None if frames is None else frames.get_depth_frame()
        color = frames.get_color_frame()
        t_us = depth.get_timestamp_us()
        image = None
        if color is not None and abs(color.get_timestamp_us() - t_us) <= _APART_US:
            image = _image(color, self._color_intrinsics)
        camera = self.depth_intrinsics
        units = np.frombuffer(depth.get_data(), np.uint16)
        if units.size != camera.width * camera.height:
            raise CameraError(f"{self.name}: a depth image is not of its profile's size")
        return Frame(
            index=depth.get_index(),
            t_camera_ns=1000 * t_us,
            t_host_ns=time.monotonic_ns(),
            depth=units.reshape(camera.height, camera.width).copy(),
            depth_scale_m=_MM_M * depth.get_depth_scale(),
            depth_intrinsics=camera,
            color=image,
            color_intrinsics=None if image is None else self._color_intrinsics,
            T_C_D=np.eye(4) if image is None else self._T_C_D,
        )

    def close(self) -> None:
        """Stop the camera; safe to call twice."""
        if self._pipeline is not None:
            self._pipeline.stop()
            self._pipeline = None


def _profile(pipeline: Any, sensor: Any, form: Any, sdk: Any) -> Any:
    """Return the default profile if it has this format, otherwise the first with it."""
    profiles = pipeline.get_stream_profile_list(sensor)
    default = profiles.get_default_video_stream_profile()
    if default.get_format() == form:
        return default
    try:
        return profiles.get_video_stream_profile(default.get_width(), 0, form, _RATE_HZ)
    except sdk.OBError:
        return profiles.get_video_stream_profile(0, 0, form, _RATE_HZ)


def _intrinsics(profile: Any, models: Any, name: str) -> Intrinsics:
    lens, bent = profile.get_intrinsic(), profile.get_distortion()
    values = [getattr(bent, key) for key in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")]
    if not any(values):
        values = []
    elif bent.model == models.BROWN_CONRADY:
        values = values[:5]
    elif bent.model != models.BROWN_CONRADY_K6:
        raise CameraError(f"{name}: its lens model {bent.model} is not known to OpenCV")
    return Intrinsics(
        profile.get_width(), profile.get_height(), lens.fx, lens.fy, lens.cx, lens.cy, tuple(values)
    )


def _transform(extrinsic: Any) -> Float64:
    R = np.asarray(extrinsic.rot, np.float64).reshape(3, 3)
    return rigid(R, _MM_M * np.asarray(extrinsic.transform, np.float64).ravel())


def _image(color: Any, camera: Intrinsics) -> UInt8 | None:
    """Return the image (H, W, 3), RGB; None if the data are not of the profile's size."""
    values = np.frombuffer(color.get_data(), np.uint8)
    if values.size != 3 * camera.width * camera.height:
        return None
    return values.reshape(camera.height, camera.width, 3).copy()
