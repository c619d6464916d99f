"""A HoloLens 2 as depth camera, and a RealSense on its USB port, before stand-ins."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest

from handcal.camera.feed import CameraFeed
from handcal.camera.hololens2 import (
    DepthFormat,
    HoloLens2Camera,
    HoloLens2RealSense,
    find_depth,
    hololens2_settings,
)
from handcal.camera.live import is_live, open_hololens2
from handcal.camera.radial import is_not_wrapped, white_brightness
from handcal.camera.settings import HoloLens2Settings
from handcal.core.errors import CameraError, CameraTimeoutError
from handcal.core.geometry import rigid
from handcal.core.types import CameraIdentity, Float32, Float64, Frame, Intrinsics, UInt16
from handcal.sim.ahat import AhatSettings, ahat_rays, sense_distance
from handcal.sim.hand import make_hand
from handcal.sim.render import World, render
from handcal.sim.room import make_room
from tests.camera.hl2ss_server import (
    AHAT_REQUEST,
    FORMATS,
    GROUPS,
    LENS,
    LONG_THROW_REQUEST,
    NAME,
    Hl2ssServer,
    ahat_payload,
    as_sent,
    calibration_of,
    camera_list_of,
    color_payload,
    depth_packet_of,
    group,
    long_throw_payload,
    one_format,
    packet_of,
    realsense_settings,
)
from tests.helpers import eventually

T_H_D: Float64 = rigid([0.2, -0.1, 0.05], [0.02, -0.03, 0.01])
T_W_H: Float64 = rigid([0.3, 0.5, -0.2], [1.0, -2.0, 3.0])
T_W_C: Float64 = T_W_H @ rigid([0.3, 0.0, 0.0], [0.01, 0.02, 0.03])
HELD_UP = rigid([0.1, 0.1, 0.05], [0.0, 0.02, 0.5])
WIDE = Intrinsics(720, 720, 345.0, 345.0, 359.5, 359.5)
CALIBRATION = calibration_of(ahat_rays(), T_H_D)
FLAT = np.full((512, 512), 500, np.uint16)
PACKET = packet_of(123_456, ahat_payload(FLAT, FLAT), T_W_H)
Serve: TypeAlias = Callable[..., HoloLens2Settings]


@pytest.fixture
def serve() -> Iterator[Serve]:
    """Return a function that serves a calibration and a packet, again and again."""
    with ExitStack() as stack:

        def serve(
            packet: bytes | Callable[[], bytes | None] = PACKET,
            calibration: bytes = CALIBRATION,
            **how: object,
        ) -> HoloLens2Settings:
            next_packet = packet if callable(packet) else lambda: packet
            server = stack.enter_context(Hl2ssServer(calibration, next_packet))
            serve.server = server  # type: ignore[attr-defined]
            return HoloLens2Settings("127.0.0.1", port=server.port, **how)  # type: ignore[arg-type]

        yield serve


def view(settings: HoloLens2Settings) -> Frame:
    with HoloLens2Camera(settings) as camera:
        return camera.read(5.0)


def sensed(depth_m: Float32, reflectance: float | Float32, **how: float) -> tuple[UInt16, UInt16]:
    shares = np.broadcast_to(np.float32(reflectance), depth_m.shape)
    rng = np.random.default_rng(0)
    return sense_distance(depth_m, shares, WIDE, rng, AhatSettings(**how))


@pytest.fixture(scope="module")
def held_up() -> tuple[World, UInt16, UInt16]:
    """Return a world with a hand before a white wall 1.7 m away, and its measurement."""
    world = World(make_hand(1), make_room(1))
    depth_m, _ = render(world, np.eye(4), HELD_UP, WIDE)
    reflectance = np.where(depth_m < 0.75, 0.55, 0.8).astype(np.float32)
    return world, *sensed(depth_m, reflectance)


def test_depth_is_that_of_a_pinhole_camera(
    serve: Serve, held_up: tuple[World, UInt16, UInt16]
) -> None:
    world, distance, brightness = held_up
    frame = view(serve(packet_of(5, ahat_payload(distance, brightness), T_W_H)))
    camera = frame.depth_intrinsics
    assert (camera.width, camera.height, camera.distortion) == (512, 512, ())
    assert (camera.fx, camera.fy) == pytest.approx((252.0, 252.0), rel=1e-3)
    assert (camera.cx, camera.cy) == pytest.approx((257.0, 257.0), abs=0.05)
    truth_m, _ = render(world, np.eye(4), HELD_UP, camera)
    is_hand = truth_m < 0.75
    error_m = frame.depth_scale_m * frame.depth - truth_m
    seen = is_hand & (frame.depth > 0)
    assert seen.sum() > 0.97 * is_hand.sum()
    assert abs(np.median(error_m[seen])) < 0.0005
    assert np.median(np.abs(error_m[seen])) < 0.002
    # The wall shows 0.6 m, like something near, but is too dark for it.
    assert np.count_nonzero(frame.depth[~is_hand]) < 0.03 * is_hand.sum()
    assert frame.color is not None
    assert frame.color[seen].mean() > 3.0 * frame.color[~is_hand].mean()


def test_a_small_hand_tells_a_large_far_wall_apart() -> None:
    """Most of what seems near is the wall: not it, but the brightest is taken for skin."""
    distance_m = np.full((512, 512), 1.6 - 1.055, np.float32)
    brightness = np.full((512, 512), 400.0 * 0.8 / 1.6**2, np.float32)
    distance_m[200:250, 200:250] = 0.5
    brightness[200:250, 200:250] = 400.0 * 0.55 / 0.5**2
    brightness[:5, :5] = 10_000.0  # a mirror
    white = white_brightness(distance_m, brightness)
    assert white == pytest.approx(440.0)
    is_near = is_not_wrapped(distance_m, brightness, 1.055, white)
    assert is_near[200:250, 200:250].all()
    assert np.count_nonzero(is_near) == 50 * 50 + 25
    assert white_brightness(np.zeros_like(distance_m), brightness) == 0.0


def test_a_plane_is_flat_up_to_the_sides(serve: Serve) -> None:
    plane = sensed(np.full((720, 720), 0.45, np.float32), 0.5, noise=0.0, blur_px=0.1)
    frame = view(serve(packet_of(5, ahat_payload(*plane), T_W_H)))
    z_m = frame.depth_scale_m * frame.depth[frame.depth > 0]
    assert z_m.size > 0.9 * frame.depth.size
    np.testing.assert_allclose(z_m, 0.45, atol=0.0008)  # distances are in whole millimetres


def test_a_frame_tells_its_pose_and_its_time(serve: Serve) -> None:
    settings = serve()
    with HoloLens2Camera(settings) as camera:
        frame = camera.read(5.0)
        np.testing.assert_allclose(camera.T_H_D, T_H_D, atol=1e-6)
    assert frame.T_W_D is not None
    np.testing.assert_allclose(frame.T_W_D, T_W_H @ T_H_D, atol=1e-6)
    assert frame.t_camera_ns == 12_345_600
    assert serve.server.requests == [b"\x02", AHAT_REQUEST]  # type: ignore[attr-defined]


def test_long_throw_comes_as_png(serve: Serve) -> None:
    rays = np.dstack(np.meshgrid((np.arange(320) - 160) / 200, (np.arange(288) - 144) / 200))
    distance = np.full((288, 320), 2000, np.uint16)
    packet = packet_of(9, long_throw_payload(distance, distance // 20), T_W_H)
    calibration = calibration_of(rays.astype(np.float32), T_H_D, alias=None)
    frame = view(serve(packet, calibration, stream="longthrow"))
    assert frame.depth_scale_m * frame.depth[144, 160] == pytest.approx(2.0)
    # Distances are from the centre, so z is smaller at the side.
    assert frame.depth_scale_m * frame.depth[144, 0] == pytest.approx(
        2.0 / np.hypot(1.0, 0.8), abs=1e-4
    )
    assert serve.server.requests[1] == LONG_THROW_REQUEST  # type: ignore[attr-defined]


def pictures(ticks: int, fx: float = 500.0, T_W_C: Float64 | None = T_W_C) -> bytes:
    """Return a picture, red above and blue below."""
    image = np.zeros((360, 640, 3), np.uint8)
    image[:180, :, 0] = image[180:, :, 2] = 200
    return packet_of(ticks, color_payload(image, fx, 501.0, 320.0, 180.0), T_W_C)


def test_the_front_camera_is_the_colour(serve: Serve) -> None:
    color = serve(pictures(123_456 + 400_000))  # 40 ms later, the head has moved
    front = serve.server  # type: ignore[attr-defined]
    settings = replace(serve(), has_color=True, color_port=color.port)
    with HoloLens2Camera(settings) as camera:
        frames: list[Frame] = []

        def has_color() -> bool:
            frames.append(camera.read(5.0))
            return frames[-1].color is not None

        eventually(has_color)
    frame = frames[-1]
    assert frame.color is not None
    assert frame.color_intrinsics == Intrinsics(640, 360, 500.0, 501.0, 320.0, 180.0)
    np.testing.assert_allclose(frame.color[90, 320], [200, 0, 0], atol=12)
    np.testing.assert_allclose(frame.color[270, 320], [0, 0, 200], atol=12)
    np.testing.assert_allclose(frame.T_C_D, np.linalg.inv(T_W_C) @ T_W_H @ T_H_D, atol=1e-6)
    eventually(lambda: len(front.requests) == 3)
    assert [request[0] for request in front.requests] == [7, 1, 11]
    assert [len(request) for request in front.requests] == [28, 14, 1]


@pytest.mark.parametrize(
    ("picture", "message"),
    [
        (pictures(123_456, fx=np.nan), "no camera of the requested size"),
        (pictures(123_456, T_W_C=2.0 * T_W_C), "no pose"),
        (pictures(123_456, T_W_C=None), "does not know where it is"),
        (PACKET, "a payload of"),
    ],
    ids=["lens", "pose", "lost", "size"],
)
def test_a_foreign_picture_is_one_clear_error(serve: Serve, picture: bytes, message: str) -> None:
    color = serve(picture)
    settings = replace(serve(), has_color=True, color_port=color.port)

    def fails() -> bool:
        try:
            camera.read(5.0)
        except CameraError as error:
            return message in str(error)
        return False

    with HoloLens2Camera(settings) as camera:
        eventually(fails)


def test_a_lost_headset_gives_no_frame_until_it_knows_its_place(serve: Serve) -> None:
    lost = packet_of(5, ahat_payload(FLAT, FLAT), None)
    is_lost = True
    with HoloLens2Camera(serve(lambda: lost if is_lost else PACKET)) as camera:
        with pytest.raises(CameraTimeoutError, match="does not know where it is"):
            camera.read(5.0)
        is_lost = False

        def is_back() -> bool:
            with suppress(CameraTimeoutError):
                return camera.read(5.0).T_W_D is not None
            return False

        eventually(is_back)


@pytest.mark.parametrize(
    ("packet", "message"),
    [
        (b"HTTP/1.1 400 Bad Request\r\n" * 4, "AHAT stream"),
        (struct.pack("<QI", 5, 2**32 - 1), "a payload of 4294967295 bytes"),
        (packet_of(5, b"\x00" * 1_048_592, T_W_H), "encoded images"),
        (packet_of(2**63, PACKET[12:-64], T_W_H), "a time beyond"),
        (packet_of(5, PACKET[12:-64], 2.0 * T_W_H), "no pose"),
        (packet_of(5, PACKET[12:-64], np.nan * T_W_H), "no pose"),
    ],
    ids=["text", "size", "encoded", "time", "pose", "nan"],
)
def test_a_foreign_stream_is_one_clear_error(serve: Serve, packet: bytes, message: str) -> None:
    with HoloLens2Camera(serve(packet)) as camera, pytest.raises(CameraError, match=message):
        camera.read(5.0)


@pytest.mark.parametrize(
    "payload",
    [
        long_throw_payload(FLAT, FLAT),  # of another size
        b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x01\x40\x00\x00\x01\x20" + 64 * b"\xff",
        64 * b"\x00",
    ],
    ids=["size", "damaged", "none"],
)
def test_a_damaged_png_is_one_clear_error(serve: Serve, payload: bytes) -> None:
    rays = np.dstack(np.meshgrid((np.arange(320) - 160) / 200, (np.arange(288) - 144) / 200))
    calibration = calibration_of(rays.astype(np.float32), T_H_D, alias=None)
    settings = serve(packet_of(5, payload, T_W_H), calibration, stream="longthrow")
    with pytest.raises(CameraError, match="no PNG of"):
        view(settings)


@pytest.mark.parametrize(
    "calibration",
    [
        calibration_of(np.zeros_like(ahat_rays()), T_H_D),
        calibration_of(-ahat_rays(), T_H_D),
        calibration_of(np.full_like(ahat_rays(), np.nan), T_H_D),
        calibration_of(ahat_rays(), np.nan * T_H_D),
        calibration_of(ahat_rays(), 2.0 * T_H_D),
        calibration_of(ahat_rays(), T_H_D, units_per_m=0.0),
        calibration_of(ahat_rays(), T_H_D, alias=np.inf),
        CALIBRATION[:1000],
        b"",
    ],
    ids=["zero", "backward", "nan", "nan pose", "scaled", "units", "alias", "cut off", "empty"],
)
def test_a_damaged_calibration_is_one_clear_error(serve: Serve, calibration: bytes) -> None:
    with pytest.raises(CameraError, match=r"damaged|no calibration|ended the stream"):
        HoloLens2Camera(serve(calibration=calibration))


def test_nobody_there_is_one_clear_error(serve: Serve) -> None:
    with Hl2ssServer(b"", lambda: None) as server:
        port = server.port
    with pytest.raises(CameraError, match=r"no hl2ss answers at 127\.0\.0\.1"):
        HoloLens2Camera(HoloLens2Settings("127.0.0.1", port=port))
    with pytest.raises(CameraError, match="no hl2ss answers"):  # the front camera
        HoloLens2Camera(replace(serve(), has_color=True, color_port=port))
    with pytest.raises(CameraError, match="say which HoloLens 2"):
        HoloLens2Camera(HoloLens2Settings())


def test_a_stream_that_ends_is_opened_again(serve: Serve, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("handcal.camera.feed._REOPEN_S", 0.01)
    left = [PACKET, None, PACKET, PACKET[:5000], None]
    settings = serve(lambda: left.pop(0) if left else PACKET)
    with CameraFeed(lambda: HoloLens2Camera(settings)) as feed:
        eventually(feed.read)
        eventually(lambda: feed.read() is None and "ended the stream" in feed.status.problem)
        eventually(lambda: feed.read() and not left)
        assert not feed.status.problem


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("hololens2:192.168.1.7", HoloLens2Settings("192.168.1.7")),
        ("hololens2:hl,color", HoloLens2Settings("hl", has_color=True)),
        ("hololens2:hl.local,longthrow", HoloLens2Settings("hl.local", "longthrow")),
        ("realsense", None),
        ("hololens2", None),
    ],
)
def test_a_source_names_the_headset(source: str, expected: HoloLens2Settings | None) -> None:
    assert hololens2_settings(source) == expected


START = b"\x07" + 7 * b"\0" + struct.pack("<3f2I", 1.0, 0.0, 0.0, 0, 0)
# Option 2**64 - 5 is the image format, 2**64 - 4 the mask for widths.
REQUEST = b"\0\x02\0\x02" + struct.pack("<4Q", 2**64 - 5, 2, 2**64 - 4, 0)


@pytest.fixture
def serve_depth(tmp_path: Path) -> Iterator[Serve]:
    """Return a function that serves a packet, again and again, and a list of cameras."""
    with ExitStack() as stack:

        def serve(packet: bytes, groups: object = GROUPS) -> HoloLens2Settings:
            server = stack.enter_context(Hl2ssServer(camera_list_of(groups), lambda: packet))
            serve.server = server  # type: ignore[attr-defined]
            return realsense_settings(server, tmp_path)

        yield serve


@pytest.mark.parametrize("padding", [0, 16])
def test_depth_comes_as_measured_with_the_lens_of_the_rig(serve_depth: Serve, padding: int) -> None:
    depth = np.arange(32 * 48, dtype=np.uint16).reshape(32, 48)
    settings = serve_depth(
        depth_packet_of(7, np.pad(depth, ((0, 0), (0, padding)), constant_values=9))
    )
    with open_hololens2(settings) as camera:
        frame = camera.read(5.0)
    np.testing.assert_array_equal(frame.depth, depth)
    assert (frame.depth_intrinsics, frame.depth_scale_m) == (LENS, 0.001)
    assert (frame.t_camera_ns, frame.color, frame.T_W_D) == (700, None, None)
    assert camera.identity == CameraIdentity("Intel RealSense D415")
    assert camera.name == f"{NAME} on the HoloLens 2 at 127.0.0.1"
    server = serve_depth.server  # type: ignore[attr-defined]
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
def test_what_is_no_depth_image_is_refused(serve_depth: Serve, packet: bytes, problem: str) -> None:
    with (
        HoloLens2RealSense(serve_depth(packet)) as camera,
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


def test_a_huge_list_is_not_received(serve_depth: Serve) -> None:
    settings = serve_depth(b"")
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
