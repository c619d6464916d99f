"""Conversion between messages of the schema and arrays; incoming messages are checked.

The size of incoming messages is bounded by the datagrams, but their content may be anything: every
reader raises `MalformedError` for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from google.protobuf.message import DecodeError
from numpy.typing import ArrayLike, NDArray

from handcal.core.types import EYES, Eye, Float64, HeadsetIdentity, HeadsetView, Projection
from handcal.link import handcal_pb2 as pb
from handcal.link.drawn import DIGEST_BYTES
from handcal.link.fields import (
    EYE_CODES,
    MalformedError,
    flat,
    is_text,
    read_eye,
    read_eyes,
    read_numbers,
    read_rigid,
    read_size,
    read_text,
)
from handcal.link.pairing import MAX_NAME_CHARACTERS
from handcal.link.reliable import Receipt
from handcal.link.shapes import Shape, Target
from handcal.link.wire import MAX_FRAGMENTS, Slot

QUANTUM_M = 1e-4
MAX_POINTS = 50_000
CHUNK_POINTS = 200
MAX_CHUNKS = MAX_POINTS // CHUNK_POINTS
MAX_PROMPT_CHARACTERS = 500
MAX_OWNER_CHARACTERS = 200

PROJECTION_SLOTS: Mapping[Eye, Slot] = {
    "left": Slot.PROJECTION_LEFT,
    "right": Slot.PROJECTION_RIGHT,
}
_MAX_EYE_DISTANCE_M = 0.2


def parse(payload: bytes) -> pb.Envelope:
    """Read an envelope."""
    try:
        return pb.Envelope.FromString(payload)
    except DecodeError as error:
        raise MalformedError(str(error)) from error


@dataclass(frozen=True, slots=True)
class Owner:
    """Wearer and rig of projections; empty if there are none."""

    wearer: str = ""
    rig: str = ""


def device(value: HeadsetIdentity, shown: Owner) -> pb.Envelope:
    """Make the headset's introduction, with the owner of the projections it shows.

    Raises
    ------
    ValueError
        If a text is too long, or a view is not finite.
    """
    texts = (value.name, value.runtime, value.app)
    if not all(is_text(text, MAX_NAME_CHARACTERS) for text in texts):
        raise ValueError(
            f"name, runtime and app have at most {MAX_NAME_CHARACTERS} characters in one line"
        )
    if not all(np.isfinite([*v.T_V_H.ravel(), *v.tangents]).all() for v in value.views.values()):
        raise ValueError("the views must be finite")
    return pb.Envelope(
        device=pb.Device(
            name=value.name,
            runtime=value.runtime,
            app=value.app,
            protocol=value.protocol,
            views=[
                pb.View(
                    eye=EYE_CODES[eye],
                    T_V_H=flat(view.T_V_H),
                    tangents=view.tangents.tolist(),
                    width_px=view.width_px,
                    height_px=view.height_px,
                )
                for eye, view in value.views.items()
            ],
            eye_distance_m=value.eye_distance_m or 0.0,
            shown_wearer=shown.wearer,
            shown_rig=shown.rig,
        )
    )


def read_device(message: pb.Device, device_id: str) -> tuple[HeadsetIdentity, Owner]:
    """Read a headset's introduction, and the owner of the projections that it shows."""
    if len(message.views) > len(EYES):
        raise MalformedError("more views than eyes")
    distance_m = message.eye_distance_m
    if not 0.0 <= distance_m < _MAX_EYE_DISTANCE_M:
        raise MalformedError("an eye distance that no wearer has")
    identity = HeadsetIdentity(
        device_id,
        name=read_text(message.name, MAX_NAME_CHARACTERS),
        runtime=read_text(message.runtime, MAX_NAME_CHARACTERS),
        app=read_text(message.app, MAX_NAME_CHARACTERS),
        protocol=message.protocol,
        views={
            read_eye(view.eye): HeadsetView(
                read_rigid(view.T_V_H),
                read_numbers(view.tangents, 4),
                *read_size(view.width_px, view.height_px),
            )
            for view in message.views
        },
        eye_distance_m=distance_m or None,
    )
    return identity, _owner(message.shown_wearer, message.shown_rig)


def cursor(points_W_m: ArrayLike, cursor_id: int, eyes: Sequence[Eye] = EYES) -> pb.Envelope:
    """Make the cursor of (N, 3) points of frame W, for some eyes; no points remove it.

    Raises
    ------
    ValueError
        If the points are not finite, too many, or spread over more than 6.5 m.
    """
    origin_m, offsets = _quantise(points_W_m)
    points = pb.Points(origin_m=origin_m, offsets=offsets.tobytes())
    codes = [EYE_CODES[eye] for eye in eyes]
    return pb.Envelope(cursor=pb.Cursor(cursor_id=cursor_id, points=points, eyes=codes))


def live_hand(
    points_W_m: ArrayLike,
    is_over_limit: bool,
    frame: int,
    eyes: Sequence[Eye] = EYES,
    is_outline: bool = False,
) -> list[pb.Envelope]:
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
                outline=is_outline,
                eyes=[EYE_CODES[eye] for eye in eyes],
            )
        )
        for chunk in range(count)
    ]


def read_points(message: pb.Points) -> Float64:
    """Read (N, 3) points of frame W, m."""
    if len(message.offsets) % 6 or len(message.offsets) > 6 * MAX_POINTS:
        raise MalformedError("points of a wrong size")
    offsets = np.frombuffer(message.offsets, dtype="<i2").reshape(-1, 3)
    points: Float64 = read_numbers(message.origin_m, 3) + QUANTUM_M * offsets
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
    return pb.Envelope(prompt=pb.Prompt(text=text, eyes=[EYE_CODES[eye] for eye in eyes]))


def read_prompt(message: pb.Prompt) -> tuple[str, tuple[Eye, ...]]:
    """Read a text and the eyes to keep open."""
    if len(message.text) > MAX_PROMPT_CHARACTERS or len(message.eyes) > len(EYES):
        raise MalformedError("a prompt that is too long")
    return message.text, read_eyes(message.eyes)


def projection(value: Projection) -> pb.Envelope:
    """Make a projection.

    Raises
    ------
    ValueError
        If it is not finite, or a text is too long.
    """
    offline = value.P if value.P_offline is None else value.P_offline
    if not np.isfinite(np.concatenate([value.P, offline, value.T_V_H])).all():
        raise ValueError("the projection must be finite")
    if not all(is_text(text, MAX_OWNER_CHARACTERS) for text in (value.wearer, value.rig)):
        raise ValueError(f"wearer and rig have at most {MAX_OWNER_CHARACTERS} characters")
    return pb.Envelope(
        projection=pb.Projection(
            eye=EYE_CODES[value.eye],
            P=value.P.ravel().tolist(),
            width_px=value.width_px,
            height_px=value.height_px,
            T_V_H=flat(value.T_V_H),
            P_offline=offline.ravel().tolist(),
            wearer=value.wearer,
            rig=value.rig,
        )
    )


def read_projection(message: pb.Projection) -> Projection:
    """Read a projection."""
    P = read_numbers(message.P, 12).reshape(3, 4)
    owner = _owner(message.wearer, message.rig)
    return Projection(
        read_eye(message.eye),
        P,
        *read_size(message.width_px, message.height_px),
        read_rigid(message.T_V_H),
        read_numbers(message.P_offline, 12).reshape(3, 4) if message.P_offline else P,
        owner.wearer,
        owner.rig,
    )


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
    return pb.Envelope(target=pb.Target(eye=EYE_CODES[value.eye], corners_V_m=corners))


def read_target(message: pb.Target) -> Target | None:
    """Read a target; None if it is removed."""
    if not message.corners_V_m:
        return None
    return Target(read_eye(message.eye), read_numbers(message.corners_V_m, 12).reshape(4, 3))


def shape(value: Shape | None) -> pb.Envelope:
    """Make a shape fixed in the world; None removes it.

    Raises
    ------
    ValueError
        If it is not finite.
    """
    if value is None:
        return pb.Envelope(shape=pb.Shape())
    if not np.isfinite(value.corners_W_m).all():
        raise ValueError("the shape must be finite")
    corners = value.corners_W_m.ravel().tolist()
    eyes = [EYE_CODES[eye] for eye in value.eyes]
    return pb.Envelope(shape=pb.Shape(corners_W_m=corners, eyes=eyes))


def read_shape(message: pb.Shape) -> Shape | None:
    """Read a shape; None if it is removed."""
    count = len(message.corners_W_m)
    if not count:
        return None
    if count not in (12, 24):
        raise MalformedError("a shape with neither 4 corners nor 8")
    return Shape(read_numbers(message.corners_W_m, count).reshape(-1, 3), read_eyes(message.eyes))


def poses(recent: Iterable[tuple[int, Float64]]) -> pb.Envelope:
    """Make a message of ``(t_headset_ns, T_W_H)``."""
    return pb.Envelope(
        poses=pb.Poses(poses=[pb.Pose(t_headset_ns=t, T_W_H=flat(T)) for t, T in recent])
    )


def read_poses(message: pb.Poses) -> Iterator[tuple[int, Float64]]:
    """Read ``(t_headset_ns, T_W_H)``."""
    for pose in message.poses:
        yield pose.t_headset_ns, read_rigid(pose.T_W_H)


def confirm(t_headset_ns: int, cursor_id: int, drawn: bytes) -> pb.Envelope:
    """Make a confirmation with the digest of what is drawn at that time."""
    return pb.Envelope(
        confirm=pb.Confirm(t_headset_ns=t_headset_ns, cursor_id=cursor_id, drawn=drawn)
    )


def read_confirm(message: pb.Confirm) -> pb.Confirm:
    """Return a confirmation whose digest has the right size."""
    if len(message.drawn) != DIGEST_BYTES:
        raise MalformedError("a confirmation without a digest")
    return message


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


def _owner(wearer: str, rig: str) -> Owner:
    return Owner(read_text(wearer, MAX_OWNER_CHARACTERS), read_text(rig, MAX_OWNER_CHARACTERS))
