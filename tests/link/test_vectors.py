"""The published vectors are what the program sends, and what docs/protocol.md says.

They are decoded here from that page alone: with HMAC, struct and a few lines of protobuf.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import struct
from collections import defaultdict
from typing import Any, TypeAlias

import pytest

from handcal.link import handcal_pb2 as pb
from tests.link import vectors

FIELDS: TypeAlias = dict[int, list[Any]]
BODIES = {field.number: field.name for field in pb.Envelope.DESCRIPTOR.fields}
SLOTS = {
    "cursor": (1,),
    "prompt": (2,),
    "projection": (3, 4),
    "confirm": (5,),
    "target": (6,),
    "device": (7,),
    "shape": (8,),
    "show": (9,),
    "verify": (10,),
    "nudge": (11,),
}


@pytest.fixture(scope="module")
def published() -> dict[str, Any]:
    read: dict[str, Any] = json.loads(vectors.PATH.read_text())
    return read


def hkdf(key: bytes, info: bytes) -> bytes:
    root = hmac.new(b"handcal link 2", key, hashlib.sha256).digest()
    return hmac.new(root, info + b"\x01", hashlib.sha256).digest()


def keys_of(published: dict[str, Any], kind: str, direction: str) -> bytes:
    info = f"{kind} {direction.replace('_', ' ')}".encode() + bytes.fromhex(published["device_id"])
    if kind == "session":
        parts = ("session", "headset_nonce", "pc_nonce")
        info += b"".join(bytes.fromhex(published[part]) for part in parts)
    return hkdf(published["pairing_key"].encode(), info)


def fields(data: bytes) -> FIELDS:
    """Decode one protobuf message: varint, 8 bytes, or bytes."""
    found: FIELDS = defaultdict(list)

    def varint() -> int:
        nonlocal data
        value = shift = 0
        while True:
            byte, data = data[0], data[1:]
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    while data:
        tag = varint()
        match tag & 7:
            case 0:
                found[tag >> 3].append(varint())
            case 1:
                found[tag >> 3].append(struct.unpack_from("<Q", data)[0])
                data = data[8:]
            case 2:
                size = varint()
                found[tag >> 3].append(data[:size])
                data = data[size:]
            case kind:
                raise AssertionError(f"unexpected wire type {kind}")
    return found


def opened(datagram: bytes, key: bytes) -> tuple[tuple[Any, ...], int, FIELDS]:
    """Return header, number of the body and fields of the body."""
    assert datagram[-16:] == hmac.new(key, datagram[:-16], hashlib.sha256).digest()[:16]
    header = struct.unpack(">2sBBQQIHH", datagram[:28])
    ((number, (body,)),) = fields(datagram[28:-16]).items()
    return header, number, fields(body)


def test_the_file_is_what_the_program_sends(published: dict[str, Any]) -> None:
    assert published == vectors.build(), "run python -m tests.link.vectors"


def test_keys_follow_from_the_pairing_key(published: dict[str, Any]) -> None:
    for kind, pair in published["keys"].items():
        for direction, key in pair.items():
            assert keys_of(published, kind, direction).hex() == key


def test_the_handshake(published: dict[str, Any]) -> None:
    directions = ("to_pc", "to_headset", "to_pc", "to_headset")
    steps = []
    for direction, step in zip(directions, published["handshake"], strict=True):
        key = keys_of(published, "handshake", direction)
        header, number, body = opened(bytes.fromhex(step["datagram"]), key)
        device = int(published["device_id"], 16)
        assert header == (b"hC", 2, 0, 0, device, 0, 0, 1)
        assert BODIES[number] == step["message"]
        assert body[1] == [bytes.fromhex(published["headset_nonce"])]
        steps.append(body)
    hello, retry, again, welcome = steps
    assert hello[3] == []
    assert again[3] == retry[2]
    assert again[2] > hello[2]
    assert welcome[2] == [int(published["session"], 16)]
    assert welcome[3] == [bytes.fromhex(published["pc_nonce"])]
    sizes = [len(step["datagram"]) for step in published["handshake"]]
    assert sizes[1] <= 3 * sizes[0]


def test_every_message_is_sealed_in_its_slot(published: dict[str, Any]) -> None:
    seen = {"hello", "retry", "welcome", "refused"}
    for direction in ("to_pc", "to_headset"):
        key = keys_of(published, "session", direction)
        for sequence, one in enumerate(published[direction], 1):
            header, number, _ = opened(bytes.fromhex(one["datagram"]), key)
            _, version, slot, session, found, message_id, fragment, count = header
            assert slot in SLOTS.get(one["message"], (0,))
            assert (version, session, found) == (2, int(published["session"], 16), sequence)
            assert (message_id, fragment, count) == (sequence if slot else 0, 0, 1)
            assert BODIES[number] == one["message"]
            seen.add(one["message"])
    assert seen == set(BODIES.values())


def test_the_digest(published: dict[str, Any]) -> None:
    bodies: dict[int, FIELDS] = {}
    key = keys_of(published, "session", "to_headset")
    for one in published["to_headset"]:
        header, _, body = opened(bytes.fromhex(one["datagram"]), key)
        bodies[header[2]] = body

    def digest(eyes: tuple[int, ...], has_cursor: bool, P_field: int = 2) -> str:
        content = b""
        for slot in (3, 4):
            if slot not in eyes:
                content += b"\0"
                continue
            body = bodies[slot]
            content += b"\1" + body[P_field][0] + body[5][0]
            content += struct.pack("<II", body[3][0], body[4][0])
        if has_cursor:
            cursor = bodies[1]
            points = fields(cursor[2][0])
            content += struct.pack("<I", cursor[1][0]) + points[1][0] + points[2][0]
        else:
            content += bytes(4)
        return hashlib.sha256(content).hexdigest()[:32]

    assert published["digest"] == {
        "nothing": digest((), False),
        "left_eye_only": digest((3,), False),
        "both_and_cursor": digest((3, 4), True),
        "both_and_cursor_offline": digest((3, 4), True, P_field=6),
    }
