"""Hostile bytes never raise, and never pass."""

import dataclasses
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.link import wire
from handcal.link.wire import Packet, Rejection, ReplayWindow, Slot

KEYS = wire.handshake_keys(b"0123456789abcdef", 7)
PACKETS = st.builds(
    Packet,
    payload=st.binary(max_size=wire.MAX_PAYLOAD_BYTES),
    session=st.integers(0, 2**64 - 1),
    sequence=st.integers(0, 2**64 - 1),
    slot=st.sampled_from([slot for slot in Slot if slot is not Slot.UNRELIABLE]),
    message_id=st.integers(0, 2**32 - 1),
    fragment=st.integers(0, 9),
    fragment_count=st.integers(10, wire.MAX_FRAGMENTS),
)


def unseal(key: bytes, datagram: bytes) -> Packet | Rejection:
    packet = wire.read(datagram)
    is_good = isinstance(packet, Rejection) or wire.is_authentic(key, datagram)
    return packet if is_good else Rejection.UNPAIRED


@given(PACKETS)
def test_a_packet_survives_the_way(packet: Packet) -> None:
    datagram = wire.seal(KEYS.to_pc, packet)
    assert len(datagram) <= wire.MAX_DATAGRAM_BYTES
    assert unseal(KEYS.to_pc, datagram) == packet


@given(st.binary(max_size=2000))
def test_random_bytes_are_rejected(data: bytes) -> None:
    assert isinstance(unseal(KEYS.to_pc, data), Rejection)


@given(st.binary(max_size=200))
def test_random_bytes_behind_a_good_start_are_rejected(data: bytes) -> None:
    assert isinstance(unseal(KEYS.to_pc, wire.MAGIC + bytes([wire.VERSION]) + data), Rejection)


@given(PACKETS, st.data())
def test_a_flipped_bit_is_rejected(packet: Packet, data: st.DataObject) -> None:
    datagram = bytearray(wire.seal(KEYS.to_pc, packet))
    bit = data.draw(st.integers(0, 8 * len(datagram) - 1))
    datagram[bit // 8] ^= 1 << bit % 8
    assert isinstance(unseal(KEYS.to_pc, bytes(datagram)), Rejection)


@given(PACKETS, st.data())
def test_a_truncated_datagram_is_rejected(packet: Packet, data: st.DataObject) -> None:
    datagram = wire.seal(KEYS.to_pc, packet)
    kept = datagram[: data.draw(st.integers(0, len(datagram) - 1))]
    assert unseal(KEYS.to_pc, kept) in (Rejection.UNPAIRED, Rejection.CORRUPT)


def test_a_datagram_thrown_back_is_rejected() -> None:
    assert unseal(KEYS.to_headset, wire.seal(KEYS.to_pc, Packet(b"pose"))) == "unpaired"


def test_another_pairing_key_or_device_is_rejected() -> None:
    datagram = wire.seal(KEYS.to_pc, Packet(b"pose"))
    for key, device in ((b"fedcba9876543210", 7), (b"0123456789abcdef", 8)):
        assert unseal(wire.handshake_keys(key, device).to_pc, datagram) == "unpaired"


def test_keys_are_derived_as_rfc_5869_says() -> None:
    """Test case 2, whose key, salt, info and result are longer than a hash."""
    key, salt, info = (bytes(range(start, start + 0x50)) for start in (0x00, 0x60, 0xB0))
    derived = wire.hkdf(key, salt, info, 82)
    assert derived.hex() == (
        "b11e398dc80327a1c8e7f78c596a49344f012eda2d4efad8a050cc4c19afa97c"
        "59045a99cac7827271cb41c65e590e09da3275600c2f09b8367793a9aca3db71"
        "cc30c58179ec3e87c14c01d5c1f3434f1d87"
    )


def test_every_session_has_keys_of_its_own() -> None:
    welcomes = [
        wire.Welcome(session, headset * 16, pc * 16)
        for session in (1, 2)
        for headset in (b"a", b"b")
        for pc in (b"c", b"d")
    ]
    keys = [
        wire.session_keys(b"0123456789abcdef", device, w) for w in welcomes for device in (7, 8)
    ]
    assert len({key for one in keys for key in (one.to_pc, one.to_headset)}) == 2 * len(keys)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"fragment_count": wire.MAX_FRAGMENTS + 1}, "oversized"),
        ({"fragment": 3, "fragment_count": 3}, "corrupt"),
        ({"fragment_count": 0}, "corrupt"),
        ({"slot": len(Slot)}, "corrupt"),
        ({"slot": Slot.UNRELIABLE, "fragment_count": 2}, "corrupt"),
    ],
)
def test_nonsense_from_a_paired_peer_is_rejected(change: dict[str, Any], reason: str) -> None:
    packet = dataclasses.replace(Packet(b"x", slot=Slot.CURSOR), **change)
    assert unseal(KEYS.to_pc, wire.seal(KEYS.to_pc, packet)) == reason


def test_limits_are_refused_when_sending() -> None:
    with pytest.raises(ValueError, match="does not fit"):
        wire.seal(KEYS.to_pc, Packet(bytes(wire.MAX_PAYLOAD_BYTES + 1)))
    with pytest.raises(ValueError, match="exceeds"):
        wire.split(bytes(wire.MAX_MESSAGE_BYTES + 1))


@given(st.binary(max_size=5000))
def test_fragments_join_to_the_message(message: bytes) -> None:
    fragments = wire.split(message)
    assert b"".join(fragments) == message
    assert all(len(fragment) <= wire.MAX_PAYLOAD_BYTES for fragment in fragments)


@given(st.lists(st.integers(1, 3000), max_size=200))
def test_the_window_accepts_each_number_once_and_none_too_old(sequences: list[int]) -> None:
    window = ReplayWindow()
    accepted: set[int] = set()
    for sequence in sequences:
        is_recent = sequence > max(accepted, default=0) - wire.REPLAY_WINDOW
        assert window.accept(sequence) == (sequence not in accepted and is_recent)
        if is_recent:
            accepted.add(sequence)
    assert window.lost == max(accepted, default=0) - len(accepted)


def test_the_window_takes_any_64_bit_number() -> None:
    window = ReplayWindow()
    assert not window.accept(0)
    assert window.accept(2**64 - 1)
    assert not window.accept(2**64 - 1)
    assert not window.accept(1)
