"""The front colour camera of a HoloLens 2 (PV), as hl2ss sends it without encoding.

The client first sends, on a separate connection, mode u8 = 7 (start) and the options of mixed
reality capture: seven u8, opacity, width and height f32, two u32. All are 0: plain pictures. To
end, it sends mode u8 = 11. The request is mode u8 = 1, width u16, height u16, images per second u8,
divisor u8, profile u8 = 255 (raw), level u8 = 255, bit rate u32 = 0, number of options u8 = 0.

The payload is NV12 with rows of a multiple of 64 bytes, and 80 bytes: focal lengths and principal
point, four f32 in px, values of the exposure that are not used here, width u16 and height u16. The
pose is that of the camera itself. See `handcal.camera.hl2ss` for the rest.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import cv2
import numpy as np

from handcal.camera.hl2ss import Hl2ssConnection, Stream, foreign, pose_of, time_of
from handcal.core.frozen import freeze
from handcal.core.types import Float64, Intrinsics, UInt8

WIDTH_PX, HEIGHT_PX = 640, 360
_SIZE = WIDTH_PX, HEIGHT_PX
_RATE_HZ = 15
_STRIDE_PX = (WIDTH_PX + 63) // 64 * 64
_ABOUT_BYTES = 80
_BYTES = _STRIDE_PX * HEIGHT_PX * 3 // 2 + _ABOUT_BYTES
_START = struct.pack("<B7B3f2I", 7, *7 * (0,), 0.0, 0.0, 0.0, 0, 0)
_STOP = struct.pack("<B", 11)

COLOR = Stream("colour", 3810, WIDTH_PX, HEIGHT_PX, False, (_BYTES, _BYTES))
COLOR_REQUEST = struct.pack("<BHHBBBBIB", 1, WIDTH_PX, HEIGHT_PX, _RATE_HZ, 1, 255, 255, 0, 0)


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
    Hl2ssConnection(host, port, _START).close()
    return Hl2ssConnection(host, port, COLOR_REQUEST)


def stop_color(host: str, port: int) -> None:
    """Switch the colour camera off; raises as `start_color`."""
    Hl2ssConnection(host, port, _STOP).close()


def parse_color(data: bytes) -> ColorPacket | None:
    """Return the contents of a packet; None if the headset did not know where it was.

    Raises
    ------
    CameraError
        If it is not one of this stream.
    """
    payload, about = data[12 : 12 + _BYTES - _ABOUT_BYTES], data[12 + _BYTES - _ABOUT_BYTES :]
    fx, fy, cx, cy = (float(value) for value in struct.unpack_from("<4f", about))
    size = struct.unpack_from("<2H", about, _ABOUT_BYTES - 4)
    is_camera = 100.0 < fx < 5000.0 and 100.0 < fy < 5000.0
    if not is_camera or not 0.0 < cx < WIDTH_PX or not 0.0 < cy < HEIGHT_PX or size != _SIZE:
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
