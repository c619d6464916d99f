"""Frames from a HoloLens 2: of its own depth camera, or of a RealSense on its USB port.

The headset's own camera carries its pose. The RealSense's depth comes unencoded; written from
hl2ss's own sources (https://github.com/jdibenes/hl2ss), server and client, which call the streams
Extended Video and Extended Depth. On the port of the first the client sends u8 = 2, and is sent a
u32 and that many bytes of UTF-16: the list of cameras, in JSON. On the port of the second it
selects a group, a source and a profile of that list, as the front colour camera is started with
options of mixed reality capture (`handcal.camera.hl2ss`): opacity, width and height, three f32, are
the three numbers. The request is mode u8 = 0 (without pose), divisor u8, depth profile u8 = 0 (as
it is), number of options u8, and each option as two u64: the number of the image format in the
list, and the mask by which widths are rounded up, 0.

A packet is as in `handcal.camera.hl2ss`, without a pose. Its payload is the driver's buffer of u16
by rows, and width u16 and height u16. The rows may be longer than the image is wide.
"""

from __future__ import annotations

import json
import re
import struct
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from handcal.camera.hl2ss import (
    CALIBRATION_REQUEST,
    COLOR,
    STREAMS,
    Hl2ssConnection,
    NewestPackets,
    Stream,
    foreign,
    parse_calibration,
    parse_color,
    parse_packet,
    start_color,
    stop_color,
    time_of,
)
from handcal.camera.radial import DEPTH_SCALE_M, PinholeView, is_not_wrapped, white_brightness
from handcal.camera.settings import HoloLens2Settings
from handcal.core.errors import CameraError, CameraTimeoutError, FileError
from handcal.core.geometry import invert
from handcal.core.types import CameraIdentity, Float32, Float64, Frame, Intrinsics, UInt8, UInt16
from handcal.io.closable import Closable
from handcal.rig.rig_file import read_rig

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


_VIDEO_PORT, _DEPTH_PORT = 3819, 3821
_LIST_REQUEST = struct.pack("<B", 2)
_STOP = struct.pack("<B", 11)
_MEDIA_INDEX, _STRIDE_MASK = 2**64 - 5, 2**64 - 4
_MAX_LIST_BYTES = 4 * 2**20
_MOST_LISTED, _MOST_NAMED, _LONGEST_NAME = 10_000, 8, 100
_LIST_S = 4.0
_RATE_HZ = 15
_MOST_PADDING_PX = 256
_MM_M = 1e-3
"""Unit of depth of a D400 as it is delivered, except the D405; hl2ss does not report it."""
_OTHER_UNIT = "405"
_WINDOWS_NAME = re.compile(r"RealSense\(TM\) Depth Camera (\d+\w?) Depth$", re.ASCII)


class DepthFormat(NamedTuple):
    """Place of a depth image format in hl2ss's list of cameras."""

    camera: str
    """Name of the camera."""
    group: int
    media: int
    divisor: int
    """One of this many images is sent, so that 15 per second arrive."""


class HoloLens2RealSense(Closable):
    """Depth of a RealSense on the headset's own port, streamed by hl2ss; implements `Camera`.

    hl2ss reports neither lens nor unit of depth: the lens and the size of the images are those of a
    rig file, the unit is the millimetre of a D400 as delivered. There is no colour, as a rig file
    does not hold its lens. Frames carry no pose: it follows from the app's and the rig's, as
    for a RealSense on the computer. Written from hl2ss's sources and tested on a server of its
    format; not yet run on a device.

    Parameters
    ----------
    settings : HoloLens2Settings
        With `realsense_rig`.

    Raises
    ------
    CameraError
        If no hl2ss answers, there is no RealSense with depth images of the rig's size, or the rig
        file cannot be read.
    """

    def __init__(self, settings: HoloLens2Settings) -> None:
        if not settings.realsense_rig:
            raise CameraError("name the rig file with its lens: hololens2:ADDRESS,realsense=RIG")
        try:
            self.depth_intrinsics = read_rig(settings.realsense_rig).depth_intrinsics
        except FileError as error:
            raise CameraError(*error.args) from error
        host, port = settings.host, settings.port or _DEPTH_PORT
        with Hl2ssConnection(host, settings.color_port or _VIDEO_PORT, _LIST_REQUEST) as connection:
            (size,) = struct.unpack("<I", connection.receive(4, _LIST_S))
            if size > _MAX_LIST_BYTES:
                raise CameraError(f"hl2ss at {host} sent a list of cameras of {size:,} bytes")
            found = find_depth(connection.receive(size, _LIST_S), self.depth_intrinsics)
        self.identity = _identity_of(found.camera)
        self.name = f"{found.camera} on the HoloLens 2 at {host}"
        self._where = host, port
        self._stream = _stream(self.depth_intrinsics)
        Hl2ssConnection(host, port, _start(found.group)).close()
        self._newest = NewestPackets(Hl2ssConnection(host, port, _request(found)), self._stream)

    def read(self, timeout_s: float = 1.0) -> Frame:
        """Return the newest frame since the last one; see `Camera.read`."""
        index, t_host_ns, data = self._newest.take(self.name, timeout_s)
        return Frame(
            index=index,
            t_camera_ns=time_of(self._stream, data),
            t_host_ns=t_host_ns,
            depth=_depth_of(self._stream, data),
            depth_scale_m=_MM_M,
            depth_intrinsics=self.depth_intrinsics,
        )

    def close(self) -> None:
        """End the stream; safe to call twice."""
        self._newest.close()
        with suppress(CameraError):  # the headset has gone
            Hl2ssConnection(*self._where, _STOP).close()


def find_depth(listed: bytes, lens: Intrinsics) -> DepthFormat:
    """Find the depth images of a lens' size at the lowest rate from 15 Hz on.

    Raises
    ------
    CameraError
        If `listed` is not a list of cameras, or has no such images.
    """
    try:
        groups = json.loads(listed.decode("utf-16-le"))
        cameras = [
            (_name(group["DisplayName"]), _number(key), group["SourceInfos"]["0"])
            for key, group in groups.items()
        ]
        depth = [camera for camera in cameras if re.search("RealSense.*Depth$", camera[0])]
        formats = [
            (rate_hz, DepthFormat(name, group, media, round(rate_hz / _RATE_HZ)))
            for name, group, source in depth
            for media, rate_hz in _formats(source, lens)
        ]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise CameraError(
            "hl2ss sent no list of cameras",
            "install hl2ss of May 2025 or newer on the HoloLens",
        ) from error
    size = f"{lens.width}x{lens.height}"
    if not depth:
        names = ", ".join(name for name, _, _ in cameras[:_MOST_NAMED]) or "none"
        raise CameraError(
            f"no depth camera of a RealSense is on the HoloLens's USB port (found: {names})",
            "plug one in, with a powered hub if it fails to start",
        )
    if not formats:
        raise CameraError(
            f"{depth[0][0]} has no depth images of {size} at 15 Hz or more",
            "use a rig file made with a size that it has",
        )
    found = min(formats)[1]
    if _OTHER_UNIT in found.camera:
        raise CameraError(f"{found.camera} measures in a unit that hl2ss does not report")
    return found


def _formats(source: Any, lens: Intrinsics) -> list[tuple[int, float]]:
    """Return number and rate of a source's formats of depth of this size.

    16-bit depth has a subtype that Windows does not know. Where there are several for one size and
    rate, depth is the first.
    """
    return [
        (_number(number), float(one["FrameRate"]))
        for number, one in source["VideoProfileMediaDescription"].items()
        if (one["Width"], one["Height"]) == (lens.width, lens.height)
        and one["Subtype"] == "Unknown"
        and _RATE_HZ <= one["FrameRate"] <= 255
    ]


def _identity_of(name: str) -> CameraIdentity:
    """Return librealsense's name of the model, as far as Windows' name contains it."""
    model = _WINDOWS_NAME.search(name)
    return CameraIdentity(f"Intel RealSense D{model[1].upper()}" if model else "")


def _name(value: object) -> str:
    """Return a name of one line that can be printed anywhere."""
    plain = str(value)[:_LONGEST_NAME].encode("ascii", "replace").decode()
    return " ".join(re.sub(r"[^ -~]", " ", plain).split())


def _number(key: str) -> int:
    number = int(key)
    if not 0 <= number < _MOST_LISTED:
        raise ValueError("no number of a camera or format")
    return number


def _start(group: int) -> bytes:
    return struct.pack("<B7B3f2I", 7, *7 * (0,), group, 0.0, 0.0, 0, 0)


def _request(found: DepthFormat) -> bytes:
    options = _MEDIA_INDEX, found.media, _STRIDE_MASK, 0
    return struct.pack("<4B4Q", 0, found.divisor, 0, 2, *options)


def _stream(lens: Intrinsics) -> Stream:
    least, most = (
        2 * width * lens.height + 4 for width in (lens.width, lens.width + _MOST_PADDING_PX)
    )
    size = lens.width, lens.height
    return Stream("RealSense depth", _DEPTH_PORT, *size, False, (least, most), has_pose=False)


def _depth_of(stream: Stream, data: bytes) -> UInt16:
    """Return the image (H, W) in a packet; CameraError if it is of another size."""
    values = np.frombuffer(data, "<u2", (len(data) - 16) // 2, 12)
    size = struct.unpack_from("<2H", data, len(data) - 4)
    if size != (stream.width, stream.height) or values.size % stream.height:
        raise foreign(stream, f"an image of {size[0]}x{size[1]} pixels in {len(data)} bytes")
    return values.reshape(stream.height, -1)[:, : stream.width].astype(np.uint16)
