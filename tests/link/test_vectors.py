"""The published vectors are what the program sends, and what docs/protocol.md says.

They are decoded here from that page alone: with HMAC, struct and a few lines of protobuf.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import re
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


def hkdf(key: bytes, info: bytes, salt: bytes = b"handcal link 2", size: int = 32) -> bytes:
    root = hmac.new(salt, key, hashlib.sha256).digest()
    block = found = b""
    for number in range(1, 10):
        block = hmac.new(root, block + info + bytes([number]), hashlib.sha256).digest()
        found += block
    return found[:size]


def pi_times_2_to(bits: int) -> int:
    """Return ⌊2^bits π⌋ by Machin's formula."""

    def arctan_of_inverse(x: int) -> int:
        total, power, odd = 0, (1 << bits + 64) // x, 1
        while power:
            total += power // odd if odd % 4 == 1 else -(power // odd)
            power //= x * x
            odd += 2
        return total

    return 4 * (4 * arctan_of_inverse(5) - arctan_of_inverse(239)) >> 64


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


def test_pairing_by_digits(published: dict[str, Any]) -> None:
    """As docs/protocol.md says it, with the prime from its formula in RFC 3526."""
    vectors = published["pairing_by_digits"]
    device, nonce = (bytes.fromhex(published[name]) for name in ("device_id", "headset_nonce"))
    prime = 2**2048 - 2**1984 - 1 + 2**64 * (pi_times_2_to(1918) + 124476)

    def derive(key: bytes, info: bytes, size: int) -> bytes:
        return hkdf(key, info, b"handcal pair 2", size)

    info = b"generator" + device + nonce
    root = int.from_bytes(derive(vectors["digits"].encode(), info, 272), "big") % prime
    generator = pow(root, 2, prime)
    secrets = [int(vectors[name], 16) for name in ("headset_secret", "pc_secret")]
    values = [pow(generator, secret, prime).to_bytes(256, "big") for secret in secrets]
    for value, name in zip(values, ("pair", "paired"), strict=True):
        key = b"handcal pair to pc" if name == "pair" else b"handcal pair to headset"
        header, number, body = opened(bytes.fromhex(vectors[name]), key)
        assert header == (b"hC", 2, 0, 0, int(published["device_id"], 16), 0, 0, 1)
        assert (BODIES[number], body[1], body[2]) == (name, [nonce], [value])
    context = device + nonce + values[0] + values[1]
    shared = pow(generator, secrets[0] * secrets[1], prime).to_bytes(256, "big")
    assert derive(shared, b"key" + context, 24).hex() == vectors["pairing_key"]
    assert derive(shared, b"proof" + context, 16).hex() == vectors["proof"]
    assert body[3] == [bytes.fromhex(vectors["proof"])]
    assert len(vectors["paired"]) <= len(vectors["pair"]) + 2 * 16


def test_the_invitation(published: dict[str, Any]) -> None:
    assert re.fullmatch(r"HANDCAL://[0-9.]+:[0-9]{1,5}/[A-Z2-7]{26}", published["invitation"])


def test_every_message_is_sealed_in_its_slot(published: dict[str, Any]) -> None:
    seen = {"hello", "retry", "welcome", "refused", "pair", "paired"}
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

    _, _, removed = opened(bytes.fromhex(published["removed"]), key)

    def digest(eyes: tuple[int, ...], cursor: FIELDS | None, P_field: int = 2) -> str:
        content = b""
        for slot in (3, 4):
            if slot not in eyes:
                content += b"\0"
                continue
            body = bodies[slot]
            content += b"\1" + body[P_field][0] + body[5][0]
            content += struct.pack("<II", body[3][0], body[4][0])
        if cursor is not None:
            points = fields(cursor[2][0])
            offsets = points.get(2, [b""])[0]  # none if there are no points
            content += struct.pack("<I", cursor[1][0]) + points[1][0] + offsets
        else:
            content += bytes(4)
        return hashlib.sha256(content).hexdigest()[:32]

    assert published["digest"] == {
        "nothing": digest((), None),
        "left_eye_only": digest((3,), None),
        "both_and_cursor": digest((3, 4), bodies[1]),
        "both_and_cursor_offline": digest((3, 4), bodies[1], P_field=6),
        "both_and_cursor_removed": digest((3, 4), removed),
    }


def test_a_message_in_fragments(published: dict[str, Any]) -> None:
    key = keys_of(published, "session", "to_headset")
    message = b""
    for index, part in enumerate(published["fragments"]):
        datagram = bytes.fromhex(part)
        header = struct.unpack(">2sBBQQIHH", datagram[:28])
        session = int(published["session"], 16)
        assert header == (b"hC", 2, 1, session, 1 + index, 1, index, 2)
        assert datagram[-16:] == hmac.new(key, datagram[:-16], hashlib.sha256).digest()[:16]
        message += datagram[28:-16]
    cursor = fields(fields(message)[7][0])
    assert (cursor[1][0], len(fields(cursor[2][0])[2][0])) == (7, 6 * 240)
