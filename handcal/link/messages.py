"""Conversion between messages of the schema and arrays; incoming messages are checked.

The size of incoming messages is bounded by the datagrams, but their content may be nonsense: every
reader raises `MalformedError` for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from google.protobuf.message import DecodeError
from numpy.typing import ArrayLike, NDArray

from handcal.geometry import is_rigid
from handcal.link import handcal_pb2 as pb
from handcal.link.reliable import Receipt
from handcal.link.wire import MAX_FRAGMENTS, Slot
from handcal.types import EYES, Eye, Float64, Projection, Target

QUANTUM_M = 1e-4
MAX_POINTS = 50_000
CHUNK_POINTS = 200
MAX_CHUNKS = MAX_POINTS // CHUNK_POINTS
MAX_PROMPT_CHARACTERS = 500

PROJECTION_SLOTS: Mapping[Eye, Slot] = {
    "left": Slot.PROJECTION_LEFT,
    "right": Slot.PROJECTION_RIGHT,
}
_EYE_CODES: Mapping[Eye, pb.Eye] = {"left": pb.EYE_LEFT, "right": pb.EYE_RIGHT}
_EYES: Mapping[int, Eye] = {code: eye for eye, code in _EYE_CODES.items()}
_REACH_M = 1e3


class MalformedError(Exception):
    """A message that no correct peer sends."""


def parse(payload: bytes) -> pb.Envelope:
    """Read an envelope."""
    try:
        return pb.Envelope.FromString(payload)
    except DecodeError as error:
        raise MalformedError(str(error)) from error


def cursor(points_W_m: ArrayLike, cursor_id: int) -> pb.Envelope:
    """Make the cursor of (N, 3) points of frame W; no points remove it.

    Raises
    ------
    ValueError
        If the points are not finite, too many, or spread over more than 6.5 m.
    """
    origin_m, offsets = _quantise(points_W_m)
    points = pb.Points(origin_m=origin_m, offsets=offsets.tobytes())
    return pb.Envelope(cursor=pb.Cursor(cursor_id=cursor_id, points=points))


def live_hand(points_W_m: ArrayLike, is_over_limit: bool, frame: int) -> list[pb.Envelope]:
    """Make the chunks of a live hand, interleaved so that a lost chunk leaves no hole.

    Raises
    ------
    ValueError
        As `cursor`.
    """
    origin_m, offsets = _quantise(points_W_m)
    count = max(1, math.ceil(len(offsets) / CHUNK_POINTS))
    return [
        pb.Envelope(
            live_hand=pb.LiveHand(
                frame=frame,
                chunk=chunk,
                chunk_count=count,
                red=is_over_limit,
                points=pb.Points(origin_m=origin_m, offsets=offsets[chunk::count].tobytes()),
            )
        )
        for chunk in range(count)
    ]


def read_points(message: pb.Points) -> Float64:
    """Read (N, 3) points of frame W, m."""
    if len(message.offsets) % 6 or len(message.offsets) > 6 * MAX_POINTS:
        raise MalformedError("points of a wrong size")
    offsets = np.frombuffer(message.offsets, dtype="<i2").reshape(-1, 3)
    points: Float64 = _numbers(message.origin_m, 3) + QUANTUM_M * offsets
    return points


def _quantise(points_m: ArrayLike) -> tuple[list[float], NDArray[np.int16]]:
    """Return the centre of the points' bounding box, and each point's offset from it in quanta."""
    points = np.asarray(points_m, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise ValueError("points must be an (N, 3) array of finite metres")
    if len(points) > MAX_POINTS:
        raise ValueError(f"{len(points):,} points exceed the {MAX_POINTS:,} that the link carries")
    if not len(points):
        return [0.0, 0.0, 0.0], np.empty((0, 3), "<i2")
    low, high = points.min(axis=0), points.max(axis=0)
    if (high - low).max() > 2 * np.iinfo(np.int16).max * QUANTUM_M:
        raise ValueError("the points spread over more than the 6.5 m that the link carries")
    origin = (low + high) / 2
    return origin.tolist(), np.rint((points - origin) / QUANTUM_M).astype("<i2")


def prompt(text: str, eyes: Sequence[Eye]) -> pb.Envelope:
    """Make a prompt.

    Raises
    ------
    ValueError
        If the text is too long.
    """
    if len(text) > MAX_PROMPT_CHARACTERS:
        raise ValueError(f"a prompt may have at most {MAX_PROMPT_CHARACTERS} characters")
    return pb.Envelope(prompt=pb.Prompt(text=text, eyes=[_EYE_CODES[eye] for eye in eyes]))


def read_prompt(message: pb.Prompt) -> tuple[str, tuple[Eye, ...]]:
    """Read a text and the eyes to keep open."""
    if len(message.text) > MAX_PROMPT_CHARACTERS or len(message.eyes) > len(EYES):
        raise MalformedError("a prompt that is too long")
    return message.text, tuple(_eye(code) for code in message.eyes)


def projection(value: Projection) -> pb.Envelope:
    """Make a projection.

    Raises
    ------
    ValueError
        If it is not finite.
    """
    if not np.isfinite(value.P).all():
        raise ValueError("the projection must be finite")
    return pb.Envelope(
        projection=pb.Projection(
            eye=_EYE_CODES[value.eye],
            P=value.P.ravel().tolist(),
            width_px=value.width_px,
            height_px=value.height_px,
        )
    )


def read_projection(message: pb.Projection) -> Projection:
    """Read a projection."""
    P = _numbers(message.P, 12).reshape(3, 4)
    return Projection(_eye(message.eye), P, message.width_px, message.height_px)


def target(value: Target | None) -> pb.Envelope:
    """Make the user test's target; None removes it.

    Raises
    ------
    ValueError
        If it is not finite.
    """
    if value is None:
        return pb.Envelope(target=pb.Target())
    if not np.isfinite(value.corners_V_m).all():
        raise ValueError("the target must be finite")
    corners = value.corners_V_m.ravel().tolist()
    return pb.Envelope(target=pb.Target(eye=_EYE_CODES[value.eye], corners_V_m=corners))


def read_target(message: pb.Target) -> Target | None:
    """Read a target; None if it is removed."""
    if not message.corners_V_m:
        return None
    return Target(_eye(message.eye), _numbers(message.corners_V_m, 12).reshape(4, 3))


def poses(recent: Iterable[tuple[int, Float64]]) -> pb.Envelope:
    """Make a message of ``(t_headset_ns, T_W_H)``."""
    return pb.Envelope(
        poses=pb.Poses(poses=[pb.Pose(t_headset_ns=t, T_W_H=_flat(T)) for t, T in recent])
    )


def read_poses(message: pb.Poses) -> Iterator[tuple[int, Float64]]:
    """Read ``(t_headset_ns, T_W_H)``."""
    for pose in message.poses:
        yield pose.t_headset_ns, _rigid(pose.T_W_H)


def confirm(T_E_W: Mapping[Eye, Float64], t_headset_ns: int, cursor_id: int) -> pb.Envelope:
    """Make a confirmation with E0(t_b) of both eyes."""
    return pb.Envelope(
        confirm=pb.Confirm(
            t_headset_ns=t_headset_ns,
            cursor_id=cursor_id,
            T_E_W_left=_flat(T_E_W["left"]),
            T_E_W_right=_flat(T_E_W["right"]),
        )
    )


def read_confirm(message: pb.Confirm) -> dict[Eye, Float64]:
    """Read ``T_E_W`` of both eyes."""
    return {"left": _rigid(message.T_E_W_left), "right": _rigid(message.T_E_W_right)}


def ack(receipts: Iterable[Receipt] = ()) -> pb.Envelope:
    """Make an acknowledgement; an empty one keeps the session alive."""
    return pb.Envelope(
        ack=pb.Ack(
            received=[
                pb.Ack.Received(
                    slot=receipt.slot,
                    message_id=receipt.message_id,
                    fragments=receipt.fragments.to_bytes(MAX_FRAGMENTS // 8, "little").rstrip(
                        b"\0"
                    ),
                )
                for receipt in receipts
            ]
        )
    )


def read_ack(message: pb.Ack) -> Iterator[Receipt]:
    """Read receipts."""
    for received in message.received:
        fragments = int.from_bytes(received.fragments, "little")
        yield Receipt(received.slot, received.message_id, fragments)


def _flat(T: Float64) -> list[float]:
    numbers: list[float] = np.asarray(T, dtype=np.float64)[:3].ravel().tolist()
    return numbers


def _numbers(values: Sequence[float], count: int) -> Float64:
    numbers = np.array(values, dtype=np.float64)
    if len(numbers) != count or not np.isfinite(numbers).all():
        raise MalformedError(f"expected {count} finite numbers")
    return numbers


def _rigid(values: Sequence[float]) -> Float64:
    T = np.vstack([_numbers(values, 12).reshape(3, 4), [0.0, 0.0, 0.0, 1.0]])
    if not is_rigid(T, _REACH_M):
        raise MalformedError("a pose that is not a rotation and a translation")
    T.flags.writeable = False
    return T


def _eye(code: int) -> Eye:
    eye = _EYES.get(code)
    if eye is None:
        raise MalformedError(f"unknown eye {code}")
    return eye
