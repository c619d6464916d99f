"""A RealSense on the USB port of a HoloLens 2, before a stand-in for its server."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest

from handcal.camera.hololens2 import DepthFormat, HoloLens2RealSense, find_depth, hololens2_settings
from handcal.camera.live import is_live, open_hololens2
from handcal.camera.settings import HoloLens2Settings
from handcal.core.errors import CameraError
from handcal.core.types import CameraIdentity
from tests.camera.hl2ss_server import (
    FORMATS,
    GROUPS,
    LENS,
    NAME,
    Hl2ssServer,
    as_sent,
    camera_list_of,
    depth_packet_of,
    group,
    one_format,
    realsense_settings,
)
from tests.helpers import eventually

START = b"\x07" + 7 * b"\0" + struct.pack("<3f2I", 1.0, 0.0, 0.0, 0, 0)
# Option 2**64 - 5 is the image format, 2**64 - 4 the mask for widths.
REQUEST = b"\0\x02\0\x02" + struct.pack("<4Q", 2**64 - 5, 2, 2**64 - 4, 0)
Serve: TypeAlias = Callable[..., HoloLens2Settings]


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Serve]:
    """Return a function that serves a packet, again and again, and a list of cameras."""
    with ExitStack() as stack:

        def serve(packet: bytes, groups: object = GROUPS) -> HoloLens2Settings:
            server = stack.enter_context(Hl2ssServer(camera_list_of(groups), lambda: packet))
            serve.server = server  # type: ignore[attr-defined]
            return realsense_settings(server, tmp_path)

        yield serve


@pytest.mark.parametrize("padding", [0, 16])
def test_depth_comes_as_measured_with_the_lens_of_the_rig(serve: Serve, padding: int) -> None:
    depth = np.arange(32 * 48, dtype=np.uint16).reshape(32, 48)
    settings = serve(depth_packet_of(7, np.pad(depth, ((0, 0), (0, padding)), constant_values=9)))
    with open_hololens2(settings) as camera:
        frame = camera.read(5.0)
    np.testing.assert_array_equal(frame.depth, depth)
    assert (frame.depth_intrinsics, frame.depth_scale_m) == (LENS, 0.001)
    assert (frame.t_camera_ns, frame.color, frame.T_W_D) == (700, None, None)
    assert camera.identity == CameraIdentity("Intel RealSense D415")
    assert camera.name == f"{NAME} on the HoloLens 2 at 127.0.0.1"
    server = serve.server  # type: ignore[attr-defined]
    eventually(lambda: len(server.requests) == 4)
    assert server.requests == [b"\x02", START, REQUEST, b"\x0b"]


@pytest.mark.parametrize(
    ("packet", "problem"),
    [
        (depth_packet_of(1, np.zeros((32, 48)), (64, 32)), "an image of 64x32 pixels"),
        (depth_packet_of(1, np.zeros(32 * 48 + 1)), "an image of 48x32 pixels in"),
        (depth_packet_of(1, np.zeros((32, 24))), "a payload of 1540 bytes"),
        (struct.pack("<QI", 1, 2**31), "a payload of 2147483648 bytes"),
        (depth_packet_of(2**62, np.zeros((32, 48))), "a time beyond"),
    ],
)
def test_what_is_no_depth_image_is_refused(serve: Serve, packet: bytes, problem: str) -> None:
    with (
        HoloLens2RealSense(serve(packet)) as camera,
        pytest.raises(CameraError, match=f"not the RealSense depth stream.* {problem}"),
    ):
        camera.read(5.0)


def test_the_format_is_the_slowest_from_15_hz_on() -> None:
    assert find_depth(as_sent(GROUPS), LENS) == DepthFormat(NAME, 1, 2, 2)
    quick = {"7": group(f"{NAME} ", one_format(90.0), one_format(60.0), one_format(14.9))}
    assert find_depth(as_sent(quick), LENS) == DepthFormat(NAME, 7, 1, 4)


@pytest.mark.parametrize(
    ("groups", "problem"),
    [
        ({}, "found: none"),
        ({"0": GROUPS["0"]}, "found: QC Back Camera"),
        ({"0": group("\ud800 a\n\x1b[1mcamera" + 200 * "!")}, r"found: \? a \[1mcamera!{86}\)"),
        ({"0": group(NAME, one_format(6.0))}, "has no depth images of 48x32 at 15 Hz"),
        ({"0": group(NAME.replace("415", "405"), *FORMATS)}, "a unit that hl2ss does not report"),
        ([], "sent no list of cameras"),
        ({"0": []}, "sent no list of cameras"),
        ({"1e9": GROUPS["1"]}, "sent no list of cameras"),
        ({str(2**200): GROUPS["1"]}, "sent no list of cameras"),
        ({"0": group(NAME, {"Width": 48})}, "sent no list of cameras"),
        ({"0": group(NAME, one_format("fast"))}, "sent no list of cameras"),  # type: ignore[arg-type]
    ],
)
def test_a_missing_depth_camera_is_an_error_with_its_reason(groups: object, problem: str) -> None:
    with pytest.raises(CameraError, match=problem):
        find_depth(as_sent(groups), LENS)


def test_bytes_that_are_no_list_are_refused() -> None:
    for data in (b"", b"\0", b"\xff\xd8", ("[" * 100_000).encode("utf-16-le")):
        with pytest.raises(CameraError, match="sent no list of cameras"):
            find_depth(data, LENS)


def test_a_huge_list_is_not_received(serve: Serve) -> None:
    settings = serve(b"")
    with (
        Hl2ssServer(struct.pack("<I", 2**31), lambda: None) as server,
        pytest.raises(CameraError, match="a list of cameras of 2,147,483,648 bytes"),
    ):
        open_hololens2(replace(settings, color_port=server.port))


def test_its_name_tells_host_and_rig_file(tmp_path: Path) -> None:
    settings = hololens2_settings("hololens2:h,realsense=C:/a,b=c.yaml")
    assert settings == HoloLens2Settings("h", realsense_rig="C:/a,b=c.yaml")
    assert is_live("hololens2:h,realsense=rig.yaml")
    nameless = hololens2_settings("hololens2:h,realsense")
    assert nameless is not None
    with pytest.raises(CameraError, match="name the rig file"):
        open_hololens2(nameless)
    with pytest.raises(CameraError, match=r"absent\.yaml"):
        open_hololens2(HoloLens2Settings("h", realsense_rig=str(tmp_path / "absent.yaml")))
