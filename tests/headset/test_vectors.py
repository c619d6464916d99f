"""The headset's link in C# sends and reads what docs/protocol_vectors.json holds."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
import pytest

from handcal.link import handcal_pb2 as pb
from handcal.link import messages, wire
from tests.headset.conftest import Ask
from tests.link import vectors

pytestmark = pytest.mark.process
PUBLISHED = vectors.build()


@pytest.fixture(scope="module")
def told(ask: Ask) -> dict[str, list[str]]:
    """Return what the program prints, by name."""
    lines = [
        PUBLISHED["pairing_key"],
        PUBLISHED["device_id"],
        PUBLISHED["session"],
        PUBLISHED["headset_nonce"],
        PUBLISHED["pc_nonce"],
        vectors.COOKIE.hex(),
        *(one["datagram"] for one in PUBLISHED["to_headset"]),
        "",
        PUBLISHED["removed"],
    ]
    found = defaultdict(list)
    for line in ask("vectors", text="\n".join(lines) + "\n").splitlines():
        name, value = line.split("=", 1)
        found[name].append(value)
    return found


def test_the_keys(told: dict[str, list[str]]) -> None:
    for kind, keys in PUBLISHED["keys"].items():
        assert told[kind] == [f"{keys['to_pc']} {keys['to_headset']}"]


def test_what_it_sends_is_equal_byte_for_byte(told: dict[str, list[str]]) -> None:
    hellos = [one["datagram"] for one in PUBLISHED["handshake"] if one["message"] == "hello"]
    assert told["hello"] == hellos
    assert told["to_pc"] == [one["datagram"] for one in PUBLISHED["to_pc"]]


def test_the_digests(told: dict[str, list[str]]) -> None:
    for name, digest in PUBLISHED["digest"].items():
        assert told[name] == [digest]


def test_the_mac_is_checked(told: dict[str, list[str]]) -> None:
    assert told["authentic"] == ["True False"] * (len(PUBLISHED["to_headset"]) + 1)


def test_what_it_reads(told: dict[str, list[str]]) -> None:
    sent = {one["message"]: one["datagram"] for one in PUBLISHED["to_headset"]}
    points = messages.read_points(_body(sent["cursor"]).cursor.points)
    assert told["wearer"] == ["P 7|rig A"]
    assert told["prompt"] == ["Close your left eye.|Right"]
    eyes, *cursor = told["cursor"][0].split(" ")
    assert eyes == "Right"
    np.testing.assert_allclose(np.array(cursor, float), points.ravel(), atol=1e-7)
    eyes, red, outline, *live = told["live"][0].split(" ")
    assert (eyes, red, outline) == ("Left", "True", "True")
    np.testing.assert_allclose(np.array(live, float), points.ravel(), atol=1e-7)
    *left, width, height = _numbers(told["left"])
    np.testing.assert_array_equal(left, (vectors.P + 0.25).ravel())
    assert (width, height) == (1268, 720)
    eye, *corners = told["target"][0].split(" ")
    assert eye == "Right"
    np.testing.assert_array_equal(np.array(corners, float), np.arange(12) / 10)
    eyes, *corners = told["shape"][0].split(" ")
    assert eyes == "Left"
    np.testing.assert_array_equal(np.array(corners, float), np.arange(24) / 10)
    assert told["verify"] == ["Right 3 1 0.002"]


def _body(datagram: str) -> Any:
    packet = wire.read(bytes.fromhex(datagram))
    assert isinstance(packet, wire.Packet)
    return pb.Envelope.FromString(packet.payload)


def _numbers(lines: list[str]) -> list[float]:
    return [float(number) for number in lines[0].split(" ")]
