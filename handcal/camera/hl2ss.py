"""The wire format of hl2ss, a server on a HoloLens 2 that streams its sensors over TCP.

Written from the description in hl2ss's own sources (https://github.com/jdibenes/hl2ss, those of May
2025). All numbers are little-endian. Each stream has a port, on which the client sends one request:

==============  ==================================================================================
calibration     mode u8 = 2
AHAT            mode u8 = 1, divisor u8, depth profile u8 = 0 (as the brightness), profile u8 = 255
                (raw), level u8 = 255, bit rate u32 = 0, number of encoder options u8 = 0
long throw      mode u8 = 1, divisor u8, filter of the PNG u32 = 0
colour (PV)     mode u8 = 1, width u16, height u16, images per second u8, divisor u8, profile u8 =
                255 (raw), level u8 = 255, bit rate u32 = 0, number of options u8 = 0
==============  ==================================================================================

The calibration is an array of float32: x, then y of every pixel's ray in the plane z = 1, by rows;
the transform from rig node to camera, 16; units per metre of distance; AHAT only: the distance at
which the phase wraps, in units; then a map and a matrix that are not used here.

The other answers are endless packets: time u64 (100 ns), size of the payload u32, payload, and
the transform from rig node to world, 16 float32, all 0 if the headset does not know where it is.
Transforms are for row vectors, in WinRT's axes (x right, y up, z back) except the camera's, which
are OpenCV's. The payload of AHAT is two u32, 0 and the size of the images, distance u16 and
brightness u16 by rows, and a time u64; that of long throw is a PNG of 4 channels, whose bytes are
the same two images, and a time u64.

Colour is that of the front camera. The client first sends, on a separate connection, mode u8 = 7
(start) and the options of mixed reality capture: seven u8, opacity, width and height f32, two u32.
All are 0: plain pictures. To end, it sends mode u8 = 11. The payload is NV12 with rows of a
multiple of 64 bytes, and 80 bytes: focal lengths and principal point, four f32 in px, values of the
exposure that are not used here, width u16 and height u16. The pose is that of the camera itself.
"""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.core.conventions import opengl_transform
from handcal.core.errors import CameraError, CameraTimeoutError, FileError
from handcal.core.frozen import freeze
from handcal.core.geometry import invert, is_rigid
from handcal.core.types import Float32, Float64, Intrinsics, UInt8, UInt16
from handcal.io.closable import Closable
from handcal.io.images import PNG_START, decode_image

StreamName: TypeAlias = Literal["ahat", "longthrow"]

_HEADER = struct.Struct("<QI")
_POSE_BYTES = 64
_TICKS_BYTES = 8
_TICK_NS = 100
_INVALID = 4090  # AHAT's values from here on say why there is no distance
_CONNECT_S = 2.0
_RECEIVE_BYTES = 1 << 20
_WORLD_M = 1000.0
_RIG_M = 0.5
_UNITS_PER_M = 100.0, 100_000.0
_ALIAS_M = 0.3, 20.0
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


@dataclass(frozen=True, slots=True)
class Stream:
    """One of hl2ss's depth streams."""

    name: str
    port: int
    width: int
    height: int
    is_wrapped: bool
    """True for AHAT, whose distances begin again at its alias."""
    packet_bytes: tuple[int, int]
    """Least and largest size of a payload."""
    has_pose: bool = True
    """True if a pose follows each payload."""

    @property
    def pixels(self) -> int:
        """Number of pixels of an image."""
        return self.width * self.height

    @property
    def calibration_bytes(self) -> int:
        """Size of the calibration."""
        return 4 * (4 * self.pixels + 16 + 1 + self.is_wrapped + 4)

    def request(self, divisor: int) -> bytes:
        """Return the request for every `divisor`-th image with its pose."""
        if self.is_wrapped:
            return struct.pack("<BBBBBIB", 1, divisor, 0, 255, 255, 0, 0)
        return struct.pack("<BBI", 1, divisor, 0)


_AHAT_BYTES = 8 + 4 * 512 * 512 + _TICKS_BYTES
STREAMS: dict[StreamName, Stream] = {
    "ahat": Stream("AHAT", 3804, 512, 512, True, (_AHAT_BYTES, _AHAT_BYTES)),
    "longthrow": Stream("long throw", 3805, 320, 288, False, (64, 1 << 20)),
}
CALIBRATION_REQUEST = struct.pack("<B", 2)


@dataclass(frozen=True, slots=True, eq=False)
class HoloLensCalibration:
    """The factory's calibration of a depth camera."""

    rays: Float32
    """(H, W, 2); x and y of each pixel's ray in the plane z = 1, frame D."""
    T_H_D: Float64
    """(4, 4); from the depth camera to the rig node, both in OpenCV's axes."""
    units_per_m: float
    alias_m: float | None
    """Distance at which the phase wraps; None if it does not."""


@dataclass(frozen=True, slots=True, eq=False)
class Packet:
    """One image of distances."""

    t_ns: int
    """Time of its exposure on the headset's clock."""
    distance: UInt16
    """(H, W); from the camera's centre, in units; 0 where there is none."""
    brightness: UInt16
    """(H, W); of the camera's own light."""
    T_W_H: Float64 | None
    """(4, 4); pose of the rig node in OpenCV's axes; None if the headset does not know it."""


class Hl2ssConnection(Closable):
    """A connection to one port of hl2ss.

    Parameters
    ----------
    host : str
    port : int
    request : bytes

    Raises
    ------
    CameraError
        If nothing answers there.
    """

    def __init__(self, host: str, port: int, request: bytes) -> None:
        self._where = f"{host}, port {port}"
        self._data = bytearray()
        try:
            self._socket = socket.create_connection((host, port), _CONNECT_S)
            self._socket.sendall(request)
        except (OSError, UnicodeError) as error:
            raise CameraError(
                f"no hl2ss answers at {self._where} ({error})",
                "start it on the HoloLens, and check address and network",
            ) from error

    def receive(self, size: int, timeout_s: float) -> bytes:
        """Return the next `size` bytes; what came before a timeout is kept for the next call.

        Raises
        ------
        CameraTimeoutError
            If they have not all arrived in time.
        CameraError
            If the connection has ended.
        """
        self._fill(size, timeout_s)
        taken = bytes(self._data[:size])
        del self._data[:size]
        return taken

    def receive_packet(self, stream: Stream, timeout_s: float) -> bytes:
        """Return the next whole packet.

        Raises
        ------
        CameraTimeoutError, CameraError
            As `receive`; also if the data are not a packet of this stream.
        """
        self._fill(_HEADER.size, timeout_s)
        _, size = _HEADER.unpack_from(self._data)
        least, most = stream.packet_bytes
        if not least <= size <= most:
            raise foreign(stream, f"a payload of {size} bytes")
        return self.receive(_HEADER.size + size + _POSE_BYTES * stream.has_pose, timeout_s)

    def close(self) -> None:
        """End the connection; safe to call twice, and while another thread receives."""
        with suppress(OSError):  # it has ended already
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _fill(self, size: int, timeout_s: float) -> None:
        """Wait until at least `size` bytes have arrived; raises as `receive`."""
        deadline_s = time.monotonic() + timeout_s
        while len(self._data) < size:
            left_s = deadline_s - time.monotonic()
            try:
                self._socket.settimeout(max(1e-3, left_s))
                arrived = self._socket.recv(min(_RECEIVE_BYTES, size - len(self._data)))
            except TimeoutError as error:
                raise CameraTimeoutError(
                    f"hl2ss at {self._where} sent no image for {timeout_s:g} s"
                ) from error
            except OSError as error:
                raise CameraError(f"the connection to hl2ss at {self._where} broke") from error
            if not arrived:
                raise CameraError(
                    f"hl2ss at {self._where} ended the stream: one program at a time can read it"
                )
            self._data += arrived


def parse_calibration(stream: Stream, data: bytes) -> HoloLensCalibration:
    """Return the calibration in an answer of `stream.calibration_bytes`.

    Raises
    ------
    CameraError
        If it cannot be that of a camera.
    """
    numbers = np.frombuffer(data, "<f4").astype(np.float32)
    rays_x, rays_y, rest = np.split(numbers, [stream.pixels, 2 * stream.pixels])
    shape = stream.height, stream.width
    rays = np.dstack([rays_x.reshape(shape), rays_y.reshape(shape)])
    T_D_rig = rest[:16].astype(np.float64).reshape(4, 4).T
    units_per_m = float(rest[16])
    if not is_rigid(T_D_rig, _RIG_M) or not _UNITS_PER_M[0] <= units_per_m <= _UNITS_PER_M[1]:
        raise foreign(stream, "no calibration")
    alias_m = float(rest[17]) / units_per_m if stream.is_wrapped else None
    if alias_m is not None and not _ALIAS_M[0] <= alias_m <= _ALIAS_M[1]:
        raise foreign(stream, "no calibration")
    return HoloLensCalibration(rays, _FLIP @ invert(T_D_rig), units_per_m, alias_m)


def parse_packet(stream: Stream, data: bytes) -> Packet:
    """Return the contents of a packet from `Hl2ssConnection.receive_packet`.

    Raises
    ------
    CameraError
        If it is not one of this stream.
    """
    _, size = _HEADER.unpack_from(data)
    payload = data[_HEADER.size : _HEADER.size + size]
    unpack = _ahat_images if stream.is_wrapped else _png_images
    distance, brightness = unpack(stream, payload)
    return Packet(time_of(stream, data), distance, brightness, pose_of(stream, data))


def time_of(stream: Stream, data: bytes) -> int:
    """Return the time of a packet on the headset's clock, ns; CameraError if it is not one."""
    ticks = int(_HEADER.unpack_from(data)[0])
    if ticks * _TICK_NS >= 2**62:
        raise foreign(stream, "a time beyond all clocks")
    return ticks * _TICK_NS


def pose_of(stream: Stream, data: bytes) -> Float64 | None:
    """Return a packet's pose (4, 4) in OpenCV's axes; None if the headset does not know it.

    Raises
    ------
    CameraError
        If it is not a pose.
    """
    T_world_rig = np.frombuffer(data[-_POSE_BYTES:], "<f4").astype(np.float64).reshape(4, 4).T
    if not T_world_rig.any():
        return None
    if not is_rigid(T_world_rig, _WORLD_M):
        raise foreign(stream, "no pose")
    return opengl_transform(T_world_rig)


def _ahat_images(stream: Stream, payload: bytes) -> tuple[UInt16, UInt16]:
    if struct.unpack_from("<II", payload) != (0, 4 * stream.pixels):
        raise foreign(stream, "encoded images")
    images = _pair(stream, np.frombuffer(payload, "<u2", 2 * stream.pixels, 8))
    return np.where(images[0] < _INVALID, images[0], 0).astype(np.uint16), images[1]


def _png_images(stream: Stream, payload: bytes) -> tuple[UInt16, UInt16]:
    size = struct.pack(">II", stream.width, stream.height)
    # The size is checked before the image is unpacked: a small file may hold a huge image.
    if not payload.startswith(PNG_START + size):
        raise foreign(stream, f"no PNG of {stream.width}x{stream.height}")
    try:
        image = decode_image(payload, "the image", cv2.IMREAD_UNCHANGED)
    except FileError as error:
        raise foreign(stream, "no PNG of 4 channels") from error
    if image.dtype != np.uint8 or image.size != 4 * stream.pixels:
        raise foreign(stream, "no PNG of 4 channels")
    return _pair(stream, np.ascontiguousarray(image).reshape(-1).view("<u2"))


def _pair(stream: Stream, values: NDArray[np.uint16]) -> tuple[UInt16, UInt16]:
    distance, brightness = values.reshape(2, stream.height, stream.width).astype(np.uint16)
    return distance, brightness


def foreign(stream: Stream, found: str) -> CameraError:
    """Return the error for data that are not those of a stream."""
    return CameraError(
        f"this is not the {stream.name} stream of a known hl2ss: {found}",
        "install hl2ss of May 2025 or newer on the HoloLens",
    )


_POLL_S = 0.2
_KEPT = 4


class NewestPackets(Closable):
    """The newest packets of a stream, received by a thread of its own: older ones are dropped."""

    def __init__(self, connection: Hl2ssConnection, stream: Stream) -> None:
        self._connection = connection
        self._stream = stream
        self._packet: tuple[int, int, bytes] | None = None
        self._recent: deque[bytes] = deque(maxlen=_KEPT)
        self._error: CameraError | None = None
        self._is_closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._receive, name="hl2ss", daemon=True)
        self._thread.start()

    def take(self, name: str, timeout_s: float) -> tuple[int, int, bytes]:
        """Return number, time of arrival on the host's clock, and data of the newest packet.

        Raises
        ------
        CameraTimeoutError
            If there is no new one in time.
        CameraError
            If the stream has ended.
        """
        with self._changed:
            self._changed.wait_for(
                lambda: self._packet or self._error or self._is_closed, timeout_s
            )
            if self._is_closed:
                raise CameraError(f"{name} is closed", "open it again")
            if self._packet is not None:
                packet, self._packet = self._packet, None
                return packet
            if self._error is not None:
                raise self._error
        raise CameraTimeoutError(
            f"{name} sent no image for {timeout_s:g} s",
            "put the headset on, and keep hl2ss running",
        )

    def recent(self) -> list[bytes]:
        """Return the last few packets; CameraError if the stream has ended."""
        with self._changed:
            if self._error is not None:
                raise self._error
            return list(self._recent)

    def close(self) -> None:
        """End the stream; safe to call twice."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()
        self._connection.close()
        self._thread.join()

    def _receive(self) -> None:
        number = 0
        while not self._is_closed:
            try:
                data = self._connection.receive_packet(self._stream, _POLL_S)
            except CameraTimeoutError:
                continue
            except CameraError as error:
                with self._changed:
                    self._error = error
                    self._changed.notify_all()
                return
            number += 1
            with self._changed:
                self._packet = number, time.monotonic_ns(), data
                self._recent.append(data)
                self._changed.notify_all()


WIDTH_PX, HEIGHT_PX = 640, 360
_COLOR_SIZE = WIDTH_PX, HEIGHT_PX
_COLOR_HZ = 15
_STRIDE_PX = (WIDTH_PX + 63) // 64 * 64
_ABOUT_BYTES = 80
_COLOR_BYTES = _STRIDE_PX * HEIGHT_PX * 3 // 2 + _ABOUT_BYTES
_START_COLOR = struct.pack("<B7B3f2I", 7, *7 * (0,), 0.0, 0.0, 0.0, 0, 0)
_STOP_COLOR = struct.pack("<B", 11)

COLOR = Stream("colour", 3810, WIDTH_PX, HEIGHT_PX, False, (_COLOR_BYTES, _COLOR_BYTES))
COLOR_REQUEST = struct.pack("<BHHBBBBIB", 1, WIDTH_PX, HEIGHT_PX, _COLOR_HZ, 1, 255, 255, 0, 0)


@dataclass(frozen=True, slots=True, eq=False)
class ColorPacket:
    """One colour image."""

    t_ns: int
    """Time of its exposure on the headset's clock."""
    image: UInt8
    """(H, W, 3); RGB."""
    intrinsics: Intrinsics
    """Focus moves them; distortion is ignored."""
    T_W_C: Float64
    """(4, 4); the colour camera's pose."""

    def __post_init__(self) -> None:
        freeze(self, "image", np.uint8, HEIGHT_PX, WIDTH_PX, 3)
        freeze(self, "T_W_C", np.float64, 4, 4)


def start_color(host: str, port: int) -> Hl2ssConnection:
    """Switch the colour camera on, and return the connection on which its images come.

    Raises
    ------
    CameraError
        If nothing answers there.
    """
    Hl2ssConnection(host, port, _START_COLOR).close()
    return Hl2ssConnection(host, port, COLOR_REQUEST)


def stop_color(host: str, port: int) -> None:
    """Switch the colour camera off; raises as `start_color`."""
    Hl2ssConnection(host, port, _STOP_COLOR).close()


def parse_color(data: bytes) -> ColorPacket | None:
    """Return the contents of a packet; None if the headset did not know where it was.

    Raises
    ------
    CameraError
        If it is not one of this stream.
    """
    payload, about = (
        data[12 : 12 + _COLOR_BYTES - _ABOUT_BYTES],
        data[12 + _COLOR_BYTES - _ABOUT_BYTES :],
    )
    fx, fy, cx, cy = (float(value) for value in struct.unpack_from("<4f", about))
    size = struct.unpack_from("<2H", about, _ABOUT_BYTES - 4)
    is_camera = 100.0 < fx < 5000.0 and 100.0 < fy < 5000.0
    if not is_camera or not 0.0 < cx < WIDTH_PX or not 0.0 < cy < HEIGHT_PX or size != _COLOR_SIZE:
        raise foreign(COLOR, "no camera of the requested size")
    T_W_C = pose_of(COLOR, data)
    if T_W_C is None:
        return None
    rows = np.frombuffer(payload, np.uint8).reshape(HEIGHT_PX * 3 // 2, _STRIDE_PX)
    nv12 = np.ascontiguousarray(rows[:, :WIDTH_PX])
    image = np.asarray(cv2.cvtColor(nv12, cv2.COLOR_YUV2RGB_NV12), np.uint8)
    return ColorPacket(
        time_of(COLOR, data), image, Intrinsics(WIDTH_PX, HEIGHT_PX, fx, fy, cx, cy), T_W_C
    )
