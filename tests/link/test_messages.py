from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import handcal.link
from handcal.core.geometry import rigid
from handcal.core.types import EYES, Float64, HeadsetIdentity, HeadsetView, Projection
from handcal.link import handcal_pb2 as pb
from handcal.link import handshake, messages
from handcal.link.fields import MalformedError
from handcal.link.reliable import Receipt
from handcal.link.shapes import Shape, Target
from handcal.link.wire import MAX_PAYLOAD_BYTES

CLOUDS = arrays(np.float64, st.tuples(st.integers(0, 700), st.just(3)), elements=st.floats(-3, 3))


def sent(envelope: pb.Envelope) -> pb.Envelope:
    return messages.parse(envelope.SerializeToString())


@given(CLOUDS)
def test_a_cursor_is_true_to_half_a_quantum(points: Float64) -> None:
    cursor = sent(messages.cursor(points, 7, ["left"])).cursor
    assert (cursor.cursor_id, list(cursor.eyes)) == (7, [pb.EYE_LEFT])
    np.testing.assert_allclose(
        messages.read_points(cursor.points), points, atol=messages.QUANTUM_M / 2 + 1e-12
    )


@given(CLOUDS)
def test_live_chunks_hold_every_point_once_and_fit_a_datagram(points: Float64) -> None:
    envelopes = messages.live_hand(points, is_over_limit=True, frame=3)
    assert all(envelope.ByteSize() <= MAX_PAYLOAD_BYTES for envelope in envelopes)
    chunks = [sent(envelope).live_hand for envelope in envelopes]
    assert {(c.frame, c.chunk_count, c.red) for c in chunks} == {(3, len(chunks), True)}
    read = np.full(points.shape, np.nan)
    for chunk in chunks:
        read[chunk.chunk :: chunk.chunk_count] = messages.read_points(chunk.points)
    np.testing.assert_allclose(read, points, atol=messages.QUANTUM_M / 2 + 1e-12)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((5, 2)), "finite metres"),
        (np.array([[0.0, 0.0, np.nan]]), "finite metres"),
        (np.zeros((messages.MAX_POINTS + 1, 3)), "exceed"),
        (np.array([[0.0, 0.0, 0.0], [7.0, 0.0, 0.0]]), "spread"),
    ],
)
def test_clouds_that_do_not_fit_are_refused(points: Float64, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        messages.cursor(points, 1)


def test_projection_prompt_poses_and_confirmation_survive_exactly() -> None:
    P = np.random.default_rng(0).normal(size=(3, 4))
    projection = messages.read_projection(
        sent(messages.projection(Projection("right", P, 1268, 720))).projection
    )
    assert (projection.eye, projection.width_px, projection.height_px) == ("right", 1268, 720)
    np.testing.assert_array_equal(projection.P, P)

    prompt = sent(messages.prompt("Close the right eye", ["left"])).prompt
    assert messages.read_prompt(prompt) == ("Close the right eye", ("left",))

    T = {"left": rigid([0.1, -0.2, 0.3], [-1, 0.0, 1.0])}
    ((t_ns, T_W_H),) = messages.read_poses(sent(messages.poses([(-5, T["left"])])).poses)
    assert t_ns == -5
    np.testing.assert_array_equal(T_W_H, T["left"])
    confirm = messages.read_confirm(sent(messages.confirm(9, 4, bytes(16))).confirm)
    assert (confirm.t_headset_ns, confirm.cursor_id, confirm.drawn) == (9, 4, bytes(16))


@given(
    st.lists(st.builds(Receipt, st.integers(1, 6), st.integers(0, 99), st.integers(0, 2**256 - 1)))
)
def test_receipts_survive(receipts: list[Receipt]) -> None:
    assert list(messages.read_ack(sent(messages.ack(receipts)).ack)) == receipts


def test_what_cannot_be_sent_is_refused() -> None:
    for name in ("x" * 41, "two\nlines"):
        with pytest.raises(ValueError, match="40 characters in one line"):
            messages.device(HeadsetIdentity("0" * 16, name), messages.Owner())
    with pytest.raises(ValueError, match="200 characters"):
        messages.projection(Projection("left", np.eye(3, 4), 9, 8, wearer="x" * 201))
    with pytest.raises(ValueError, match="500 characters"):
        messages.prompt("x" * 501, EYES)
    with pytest.raises(ValueError, match="finite"):
        messages.projection(Projection("left", np.full((3, 4), np.inf), 1268, 720))
    with pytest.raises(ValueError, match="finite"):
        messages.target(Target("left", np.full((4, 3), np.nan)))


def rotated(scale: float) -> list[float]:
    numbers: list[float] = (scale * rigid([0.1, 0.2, 0.3]))[:3].ravel().tolist()
    return numbers


def read_device(message: pb.Device) -> object:
    return messages.read_device(message, "0" * 16)


@pytest.mark.parametrize(
    ("read", "message"),
    [
        (messages.read_points, pb.Points(origin_m=[0, 0], offsets=bytes(6))),
        (messages.read_points, pb.Points(origin_m=[0, 0, 0], offsets=bytes(7))),
        (messages.read_points, pb.Points(origin_m=[0, 0, np.nan], offsets=bytes(6))),
        (
            messages.read_projection,
            pb.Projection(width_px=1, height_px=1, T_V_H=rotated(1.0), P=[0.0] * 12),
        ),
        (messages.read_projection, pb.Projection(eye=pb.EYE_LEFT, P=[0.0] * 11)),
        (messages.read_prompt, pb.Prompt(text="x" * 501)),
        (messages.read_prompt, pb.Prompt(eyes=[pb.EYE_LEFT] * 3)),
        (messages.read_target, pb.Target(eye=pb.EYE_LEFT, corners_V_m=[0.0] * 9)),
        (messages.read_target, pb.Target(corners_V_m=[0.0] * 12)),
        (lambda m: list(messages.read_poses(m)), pb.Poses(poses=[pb.Pose(T_W_H=rotated(1.01))])),
        (lambda m: list(messages.read_poses(m)), pb.Poses(poses=[pb.Pose(T_W_H=rotated(-1.0))])),
        (messages.read_confirm, pb.Confirm(drawn=bytes(15))),
        (messages.read_shape, pb.Shape(corners_W_m=[0.0] * 15)),
        (messages.read_shape, pb.Shape(corners_W_m=[np.inf] * 12)),
        (read_device, pb.Device(name="x" * 41)),
        (read_device, pb.Device(name="two\nlines")),
        (read_device, pb.Device(eye_distance_m=np.nan)),
        (read_device, pb.Device(views=[pb.View()] * 3)),
        (read_device, pb.Device(views=[pb.View(eye=pb.EYE_LEFT, T_V_H=rotated(1.0))])),
        (handshake.read_hello, pb.Envelope(hello=pb.Hello(nonce=bytes(15)))),
        (handshake.read_hello, pb.Envelope(hello=pb.Hello(nonce=bytes(16), cookie=bytes(33)))),
        (handshake.read_hello, pb.Envelope(bye=pb.Bye())),
        (handshake.read_welcome, pb.Welcome(nonce=bytes(16), session=1)),
    ],
)
def test_nonsense_is_malformed(read: Callable[[Any], object], message: object) -> None:
    with pytest.raises(MalformedError):
        read(message)


def test_a_projection_brings_its_view_its_offline_form_and_its_owner() -> None:
    rng = np.random.default_rng(0)
    P, P_offline = rng.normal(size=(2, 3, 4))
    T_V_H = rigid([0.1, 0.0, 0.2], [0.03, 0.0, 0.0])
    made = Projection("left", P, 1268, 720, T_V_H, P_offline, "P 7 ö", "rig A")
    read = messages.read_projection(sent(messages.projection(made)).projection)
    assert read.P_offline is not None
    for a, b in ((read.P, P), (read.P_offline, P_offline), (read.T_V_H, T_V_H)):
        np.testing.assert_array_equal(a, b)
    assert (read.wearer, read.rig) == ("P 7 ö", "rig A")


def test_a_headset_introduces_itself() -> None:
    view = HeadsetView(rigid([0.0, 0.1, 0.0]), np.array([-0.3, 0.3, -0.2, 0.2]), 1268, 720)
    made = HeadsetIdentity(
        "00000000000000ff", "Lab 2", "OpenXR", "app 1", 2, {"right": view}, 0.063
    )
    owner = messages.Owner("P 7", "rig A")
    read, shown = messages.read_device(sent(messages.device(made, owner)).device, made.device_id)
    assert shown == owner
    assert (read.name, read.runtime, read.app, read.protocol) == ("Lab 2", "OpenXR", "app 1", 2)
    assert read.eye_distance_m == 0.063
    np.testing.assert_array_equal(read.views["right"].T_V_H, view.T_V_H)
    np.testing.assert_array_equal(read.views["right"].tangents, view.tangents)
    unknown = messages.device(HeadsetIdentity(made.device_id), messages.Owner())
    assert messages.read_device(unknown.device, made.device_id)[0].eye_distance_m is None


@pytest.mark.parametrize("count", [4, 8])
def test_shapes_survive_exactly(count: int) -> None:
    corners = np.random.default_rng(0).normal(size=(count, 3))
    read = messages.read_shape(sent(messages.shape(Shape(corners, ("left",)))).shape)
    assert read is not None
    assert read.eyes == ("left",)
    np.testing.assert_array_equal(read.corners_W_m, corners)
    assert messages.read_shape(sent(messages.shape(None)).shape) is None


@given(st.binary(max_size=300))
def test_any_bytes_are_an_envelope_or_malformed(data: bytes) -> None:
    try:
        assert isinstance(messages.parse(data), pb.Envelope)
    except MalformedError:
        return


FOLDER = Path(handcal.link.__file__).parent


def test_the_generated_code_is_that_of_the_schema(tmp_path: Path) -> None:
    protoc = pytest.importorskip("grpc_tools.protoc")
    arguments = [f"-I{FOLDER}", f"--python_out={tmp_path}", f"--pyi_out={tmp_path}"]
    assert protoc.main(["protoc", *arguments, str(FOLDER / "handcal.proto")]) == 0
    for name in ("handcal_pb2.py", "handcal_pb2.pyi"):
        assert (tmp_path / name).read_text() == (FOLDER / name).read_text(), f"regenerate {name}"
