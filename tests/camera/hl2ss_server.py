"""A stand-in for hl2ss on a HoloLens 2: one of its ports, in the format of its sources."""

from __future__ import annotations

import json
import socket
import struct
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.camera.settings import HoloLens2Settings
from handcal.core.geometry import invert
from handcal.core.types import Float32, Float64, Intrinsics
from handcal.io.closable import Closable
from handcal.rig.example import example_rig
from handcal.rig.rig_file import write_rig

AHAT_REQUEST = b"\x01\x03\x00\xff\xff\x00\x00\x00\x00\x00"
LONG_THROW_REQUEST = b"\x01\x03\x00\x00\x00\x00"
_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])


def calibration_of(
    rays: Float32, T_H_D: Float64, *, units_per_m: float = 1000.0, alias: float | None = 1055.0
) -> bytes:
    """Return the calibration of a camera with these rays, placed so on the rig."""
    rig_to_camera = invert(_FLIP @ T_H_D).T  # row vectors, rig in WinRT's axes
    numbers = [rays[..., 0], rays[..., 1], rig_to_camera, [units_per_m]]
    numbers += [] if alias is None else [[alias]]
    numbers += [np.zeros(rays.size), np.zeros(4)]
    return np.concatenate([np.ravel(np.asarray(one)) for one in numbers]).astype("<f4").tobytes()


def packet_of(ticks: int, payload: bytes, T_W_H: Float64 | None) -> bytes:
    """Return a packet; without a pose it is that of a headset that is lost."""
    rig_to_world = np.zeros((4, 4)) if T_W_H is None else (_FLIP @ T_W_H @ _FLIP).T
    header = struct.pack("<QI", ticks, len(payload))
    return header + payload + rig_to_world.astype("<f4").tobytes()


def ahat_payload(distance: NDArray[np.uint16], brightness: NDArray[np.uint16]) -> bytes:
    """Return the payload of raw AHAT images."""
    images = distance.astype("<u2").tobytes() + brightness.astype("<u2").tobytes()
    return struct.pack("<II", 0, len(images)) + images + struct.pack("<Q", 7)


def long_throw_payload(distance: NDArray[np.uint16], brightness: NDArray[np.uint16]) -> bytes:
    """Return the payload of long throw: both images as the bytes of one PNG."""
    pair = np.concatenate([distance, brightness]).astype("<u2")
    picture = pair.view(np.uint8).reshape(*distance.shape, 4)
    return bytes(cv2.imencode(".png", picture)[1]) + struct.pack("<Q", 7)


def color_payload(image: NDArray[np.uint8], fx: float, fy: float, cx: float, cy: float) -> bytes:
    """Return the payload of a picture (H, W, 3) of the front camera: NV12."""
    height, width = image.shape[:2]
    planes = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2YUV_I420), np.uint8)
    u, v = planes[height:].reshape(2, height // 2, width // 2)
    rows = np.concatenate([planes[:height], np.dstack([u, v]).reshape(height // 2, width)])
    padded = np.pad(rows, ((0, 0), (0, -width % 64)))
    about = struct.pack("<4f60x2H", fx, fy, cx, cy, width, height)
    return padded.tobytes() + about


def one_format(rate_hz: float, subtype: str = "Unknown", width: int = 48) -> dict[str, Any]:
    """Return an image format in the list of cameras; "Unknown" is 16-bit depth."""
    return {"Width": width, "Height": 32, "FrameRate": rate_hz, "Subtype": subtype}


def group(name: str, *formats: dict[str, Any]) -> dict[str, Any]:
    """Return a camera in the list of cameras."""
    numbered = {str(number): one for number, one in enumerate(formats)}
    return {"DisplayName": name, "SourceInfos": {"0": {"VideoProfileMediaDescription": numbered}}}


LENS = Intrinsics(48, 32, 40.0, 40.0, 23.5, 15.5)
NAME = "Intel(R) RealSense(TM) Depth Camera 415 Depth"
FORMATS = (one_format(6.0), one_format(90.0), one_format(30.0), one_format(15.0, "MPEG"))
GROUPS = {
    "0": group("QC Back Camera", *FORMATS),
    "1": group(NAME, *FORMATS, one_format(30.0), one_format(30.0, width=64)),
    "2": group("Intel(R) RealSense(TM) Depth Camera 415 RGB", *FORMATS),
}


def as_sent(groups: object) -> bytes:
    """Return the text of a list of cameras."""
    return json.dumps(groups).encode("utf-16-le")


def camera_list_of(groups: object) -> bytes:
    """Return the answer that lists the cameras."""
    text = as_sent(groups)
    return struct.pack("<I", len(text)) + text


def depth_packet_of(
    ticks: int, depth: NDArray[Any], size_px: tuple[int, int] = (LENS.width, LENS.height)
) -> bytes:
    """Return a packet of a RealSense on the USB port."""
    payload = depth.astype("<u2").tobytes() + struct.pack("<2H", *size_px)
    return struct.pack("<QI", ticks, len(payload)) + payload


def realsense_settings(server: Hl2ssServer, folder: Path) -> HoloLens2Settings:
    """Return settings for a server whose RealSense has the lens, in a rig file in `folder`."""
    rig, port = folder / "rig.yaml", server.port
    write_rig(rig, replace(example_rig(), depth_intrinsics=LENS))
    return HoloLens2Settings("127.0.0.1", port=port, color_port=port, realsense_rig=str(rig))


class Hl2ssServer(Closable):
    """Serves one client after another: its first answer, or packets until the client leaves.

    Parameters
    ----------
    calibration : bytes
    next_packet : callable
        Returns the bytes to send next, or None to end the stream.
    """

    def __init__(self, calibration: bytes, next_packet: Callable[[], bytes | None]) -> None:
        self._calibration = calibration
        self._next_packet = next_packet
        self.requests: list[bytes] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        self._is_over.set()
        # The listener is woken by a last client: closing it does not wake it everywhere.
        socket.create_connection(("127.0.0.1", self.port)).close()
        self._thread.join()
        self._listener.close()

    def _run(self) -> None:
        while True:
            client, _ = self._listener.accept()
            with client:
                if self._is_over.is_set():
                    return
                try:
                    self._serve(client)
                except OSError:
                    continue  # the client has left

    def _serve(self, client: socket.socket) -> None:
        request = client.recv(64)
        self.requests.append(request)
        if request == b"\x02":
            client.sendall(self._calibration)
        if request[0] not in (0, 1):
            return
        while not self._is_over.wait(0.005):
            packet = self._next_packet()
            if packet is None:
                return
            client.sendall(packet)
