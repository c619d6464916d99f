"""Frames from a HoloLens 2's own depth camera, which carry its pose."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from handcal.camera.hl2ss import (
    CALIBRATION_REQUEST,
    STREAMS,
    Hl2ssConnection,
    parse_calibration,
    parse_packet,
    time_of,
)
from handcal.camera.hl2ss_color import COLOR, parse_color, start_color, stop_color
from handcal.camera.hl2ss_newest import NewestPackets
from handcal.camera.radial import DEPTH_SCALE_M, PinholeView, is_not_wrapped, white_brightness
from handcal.camera.settings import HoloLens2Settings
from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.geometry import invert
from handcal.core.types import CameraIdentity, Float32, Float64, Frame, UInt8
from handcal.io.closable import Closable

PREFIX = "hololens2:"
_LONG_THROW, _WITH_COLOR, _REALSENSE = ",longthrow", ",color", ",realsense"
_CALIBRATION_S = 4.0
_FADING = 0.99
"""Of what is known of white, from one image to the next: a mirror must not count for long."""
_APART_NS = 50_000_000
_SHOWN_M = 0.3
"""Distance at which a white surface is white in the grey image."""


def hololens2_settings(source: str) -> HoloLens2Settings | None:
    """Return the settings that a source's name stands for; None if it is another camera's.

    The name is ``hololens2:HOST``; ``hololens2:HOST,color`` with the front colour camera;
    ``hololens2:HOST,longthrow`` for the other depth camera; or ``hololens2:HOST,realsense=RIG`` for
    a RealSense on the headset's USB port, whose lens is in the rig file RIG.
    """
    if not source.startswith(PREFIX):
        return None
    host, has_realsense, rig = source.removeprefix(PREFIX).partition(_REALSENSE)
    if has_realsense:
        return HoloLens2Settings(host, realsense_rig=rig.removeprefix("="))
    if host.endswith(_LONG_THROW):
        return HoloLens2Settings(host.removesuffix(_LONG_THROW), "longthrow")
    return HoloLens2Settings(host.removesuffix(_WITH_COLOR), has_color=host.endswith(_WITH_COLOR))


def identity_of(settings: HoloLens2Settings) -> CameraIdentity:
    """Return the camera's identity, without serial number; empty for a RealSense not yet open."""
    if settings.realsense_rig is not None:
        return CameraIdentity()
    return CameraIdentity(f"HoloLens 2 {STREAMS[settings.stream].name}")


class HoloLens2Camera(Closable):
    """Depth of a HoloLens 2, streamed by hl2ss; implements `Camera`.

    The view is resampled to a pinhole camera's. `Frame.color` is the brightness of the camera's own
    light in grey, aligned with depth; or, with `has_color`, the picture of the front camera nearest
    in time, with `Frame.T_C_D` between both exposures. Written from hl2ss's sources and tested on a
    server of its format; not yet run on a device.

    Parameters
    ----------
    settings : HoloLens2Settings

    Attributes
    ----------
    T_H_D : (4, 4) float64
        From the depth camera to the headset's rig node, by the factory's calibration.

    Raises
    ------
    CameraError
        If no hl2ss answers at the address, or not as it should.
    """

    def __init__(self, settings: HoloLens2Settings) -> None:
        if not settings.host:
            raise CameraError(f"say which HoloLens 2: {PREFIX}ADDRESS, as its settings show it")
        self._stream = STREAMS[settings.stream]
        self.identity = identity_of(settings)
        self.name = f"{self.identity.model} at {settings.host}"
        port = settings.port or self._stream.port
        with Hl2ssConnection(settings.host, port, CALIBRATION_REQUEST) as connection:
            data = connection.receive(self._stream.calibration_bytes, _CALIBRATION_S)
        self._calibration = parse_calibration(self._stream, data)
        self.T_H_D: Float64 = self._calibration.T_H_D
        self._view = PinholeView(self._calibration.rays)
        self.depth_intrinsics = self._view.intrinsics
        self._white = 0.0
        self._keeps_wrapped = settings.keeps_wrapped
        request = self._stream.request(settings.divisor)
        self._color: tuple[NewestPackets, tuple[str, int]] | None = None
        self._newest = NewestPackets(Hl2ssConnection(settings.host, port, request), self._stream)
        if settings.has_color:
            where = settings.host, settings.color_port or COLOR.port
            try:
                self._color = NewestPackets(start_color(*where), COLOR), where
            except CameraError:
                self._newest.close()
                raise

    def read(self, timeout_s: float = 1.0) -> Frame:
        """Return the newest frame since the last one; see `Camera.read`."""
        index, t_host_ns, data = self._newest.take(self.name, timeout_s)
        packet = parse_packet(self._stream, data)
        if packet.T_W_H is None:
            raise CameraTimeoutError(
                f"{self.name} does not know where it is",
                "look around in a lit room",
            )
        distance_m: Float32 = packet.distance.astype(np.float32)
        distance_m /= np.float32(self._calibration.units_per_m)
        brightness = packet.brightness.astype(np.float32)
        self._white = max(_FADING * self._white, white_brightness(distance_m, brightness))
        distance_m = self._without_wrapped(distance_m, brightness)
        frame = Frame(
            index=index,
            t_camera_ns=packet.t_ns,
            t_host_ns=t_host_ns,
            depth=self._view.depth(distance_m),
            depth_scale_m=DEPTH_SCALE_M,
            depth_intrinsics=self.depth_intrinsics,
            T_W_D=packet.T_W_H @ self.T_H_D,
        )
        if self._color is not None:
            return _with_picture(frame, self._color[0].recent(), self.name)
        return replace(frame, color=self._grey(brightness), color_intrinsics=self.depth_intrinsics)

    def close(self) -> None:
        """End the streams; safe to call twice."""
        self._newest.close()
        if self._color is not None:
            (pictures, where), self._color = self._color, None
            pictures.close()
            with suppress(CameraError):  # the headset has gone
                stop_color(*where)

    def _without_wrapped(self, distance_m: Float32, brightness: Float32) -> Float32:
        alias_m = self._calibration.alias_m
        if alias_m is None or self._keeps_wrapped:
            return distance_m
        is_near = is_not_wrapped(distance_m, brightness, alias_m, self._white)
        return np.where(is_near, distance_m, np.float32(0.0))

    def _grey(self, brightness: Float32) -> UInt8:
        seen = self._view.image(brightness)
        share = seen * np.float32(_SHOWN_M**2 / max(self._white, 1.0))
        grey = 255.0 * np.sqrt(np.clip(share, 0.0, 1.0))
        return np.repeat(grey.astype(np.uint8)[..., None], 3, axis=2)


def _with_picture(frame: Frame, packets: list[bytes], name: str) -> Frame:
    """Return a frame with the picture nearest in time, if one is near."""

    def apart_ns(data: bytes) -> int:
        return abs(time_of(COLOR, data) - frame.t_camera_ns)

    nearest = min(packets, key=apart_ns, default=None)
    if nearest is None or apart_ns(nearest) > _APART_NS:
        return frame
    picture = parse_color(nearest)
    assert frame.T_W_D is not None
    if picture is None:
        raise CameraTimeoutError(f"{name} does not know where it is", "look around in a lit room")
    return replace(
        frame,
        color=picture.image,
        color_intrinsics=picture.intrinsics,
        T_C_D=invert(picture.T_W_C) @ frame.T_W_D,
    )
