"""Pairing by digits: the mathematics, the PC's limits, and both ends over real sockets."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.errors import LinkError
from handcal.core.types import HeadsetIdentity
from handcal.link import exchange, greetings, messages, wire
from handcal.link import handcal_pb2 as pb
from handcal.link.ask_to_pair import pair_by_digits
from handcal.link.client import HeadsetClient
from handcal.link.exchange import MAX_ATTEMPTS, PRIME, VALUE_BYTES, Exchange
from handcal.link.fields import MalformedError
from handcal.link.pairing import OFFER_S, Pairings, new_device_id
from handcal.link.server import HeadsetServer
from handcal.link.wire import Packet, Rejection
from tests.helpers import eventually

DIGITS = "01234567"
NONCE = bytes(range(16))


def two_ends(headset_digits: str, pc_digits: str) -> tuple[exchange.Agreed, exchange.Agreed]:
    secrets = exchange.new_secret(), exchange.new_secret()
    value = exchange.public_value(headset_digits, 7, NONCE, secrets[0])
    pc_value = exchange.public_value(pc_digits, 7, NONCE, secrets[1])
    return (
        exchange.agree(7, NONCE, value, pc_value, secrets[0], is_pc=False),
        exchange.agree(7, NONCE, value, pc_value, secrets[1], is_pc=True),
    )


def test_equal_digits_agree_and_others_do_not() -> None:
    headset, pc = two_ends(DIGITS, DIGITS)
    assert headset == pc
    assert len(headset.key) == 48
    assert headset.key != two_ends(DIGITS, DIGITS)[0].key
    headset, pc = two_ends(DIGITS, "01234568")
    assert headset.key != pc.key
    assert headset.proof != pc.proof


def test_the_prime_is_safe() -> None:
    """Fermat's test is enough for a number that is not chosen to deceive."""
    for number in (PRIME, PRIME // 2):
        assert pow(3, number - 1, number) == 1
    value = int.from_bytes(exchange.public_value(DIGITS, 7, NONCE, 1), "big")
    assert pow(value, PRIME // 2, PRIME) == 1  # in the subgroup of prime order


@pytest.mark.parametrize("number", [0, 1, PRIME - 1, PRIME, 2**2048 - 1])
def test_a_value_that_forces_the_secret_is_refused(number: int) -> None:
    value = exchange.public_value(DIGITS, 7, NONCE, 5)
    forced = number.to_bytes(VALUE_BYTES, "big")
    with pytest.raises(MalformedError):
        exchange.agree(7, NONCE, forced, value, 5, is_pc=True)
    with pytest.raises(MalformedError):
        exchange.agree(7, NONCE, value, forced[:-1], 5, is_pc=False)


def request(nonce: bytes = NONCE, value: bytes | None = None, name: str = "") -> bytes:
    value = value if value is not None else exchange.public_value(DIGITS, 7, nonce, 9)
    return greetings.seal(exchange.PUBLIC_KEYS.to_pc, 7, exchange.pair(nonce, value, name))


def hear(pc: Exchange, datagram: bytes, now_s: float = 0.0) -> bytes | Rejection:
    packet = wire.read(datagram)
    assert isinstance(packet, Packet)
    return pc.hear(packet, datagram, now_s)


def body(answer: bytes | Rejection) -> str:
    assert isinstance(answer, bytes)
    packet = wire.read(answer)
    assert isinstance(packet, Packet)
    return str(messages.parse(packet.payload).WhichOneof("body"))


def test_the_pc_answers_few_attempts_and_each_only_once() -> None:
    pairings = Pairings(())
    pc = Exchange(pairings, DIGITS, 0.0)
    first = hear(pc, request())
    assert hear(pc, request()) == first
    assert len(pairings.offered(0.0)) == 1
    for number in range(1, MAX_ATTEMPTS):
        assert body(hear(pc, request(bytes([number] * 16)))) == "paired"
    assert body(hear(pc, request(bytes([99] * 16)))) == "refused"
    assert hear(pc, request()) == first
    assert len(pairings.offered(0.0)) == MAX_ATTEMPTS
    assert isinstance(first, bytes)
    assert len(first) <= 1.1 * len(request())


def test_the_pc_answers_for_a_while() -> None:
    pc = Exchange(Pairings(()), DIGITS, 0.0)
    assert hear(pc, request(), OFFER_S + 1.0) is Rejection.UNPAIRED
    hello = greetings.seal(b"another key", 7, greetings.hello(NONCE, 1, b"", ""))
    assert hear(pc, hello) is Rejection.UNPAIRED


def test_nonsense_costs_no_attempt() -> None:
    pairings = Pairings(())
    pc = Exchange(pairings, DIGITS, 0.0)
    wrong = [
        request(NONCE[1:]),
        request(value=bytes(VALUE_BYTES)),
        request(value=b""),
        request(name="two\nlines"),
        greetings.seal(exchange.PUBLIC_KEYS.to_pc, 7, pb.Envelope(bye=pb.Bye())),
    ]
    for datagram in wrong * 3:
        with pytest.raises(MalformedError):
            hear(pc, datagram)
    assert not pairings.offered(0.0)
    assert body(hear(pc, request())) == "paired"


@settings(max_examples=30)
@given(st.binary(max_size=600))
def test_any_payload_is_refused(payload: bytes) -> None:
    pc = Exchange(Pairings(()), DIGITS, 0.0)
    with pytest.raises(MalformedError):
        hear(pc, wire.seal(exchange.PUBLIC_KEYS.to_pc, Packet(payload, sequence=7)))


@pytest.mark.parametrize("typed", ["0123 4567", " 01-23-45-67\n"])
def test_digits_are_read_as_typed(typed: str) -> None:
    assert exchange.read_digits(typed) == DIGITS


@pytest.mark.parametrize("typed", ["", "1234567", "123456789", "abcdefgh"])
def test_other_than_8_digits_are_refused(typed: str) -> None:
    with pytest.raises(ValueError, match="8 digits"):
        exchange.read_digits(typed)


def connects(server: HeadsetServer, device_id: str, key: str) -> None:
    with HeadsetClient(server.address, key.encode(), HeadsetIdentity(device_id, "Lab 9")):
        server.wait_connected(3.0)
        eventually(lambda: server.device is not None)
        assert server.device is not None
        assert server.device.device_id == device_id
    assert [one.key for one in server.pairings.all if one.device_id == device_id] == [key]


def test_a_device_is_paired_by_digits(server: HeadsetServer) -> None:
    invitation = server.invite()
    device_id = new_device_id()
    wrong = str((int(invitation.digits) + 1) % 10**8).zfill(8)
    with pytest.raises(LinkError, match="code is wrong"):
        pair_by_digits(server.address, device_id, wrong)
    connects(server, device_id, pair_by_digits(server.address, device_id, invitation.digits))
    with pytest.raises(LinkError, match="answered"):  # one device only
        pair_by_digits(server.address, new_device_id(), invitation.digits, timeout_s=0.3)


def test_a_device_is_paired_by_the_qr_code(server: HeadsetServer) -> None:
    before = server.invite().code
    invitation = server.invite()
    assert before != invitation.code
    connects(server, new_device_id(), invitation.code)
    assert not server.pairings.offered(0.0)


def test_guessing_ends_the_code(server: HeadsetServer) -> None:
    invitation = server.invite()
    for _ in range(MAX_ATTEMPTS):
        with pytest.raises(LinkError, match="code is wrong"):
            pair_by_digits(server.address, new_device_id(), "00000000")
    with pytest.raises(LinkError, match="no more codes"):
        pair_by_digits(server.address, new_device_id(), invitation.digits)


def test_a_revoked_device_is_cut_off(server: HeadsetServer) -> None:
    invitation = server.invite()
    device_id = new_device_id()
    identity = HeadsetIdentity(device_id, "Lab 9")
    with HeadsetClient(server.address, invitation.code.encode(), identity) as client:
        server.wait_connected(3.0)
        server.pairings.revoke(device_id)
        eventually(lambda: client.dismissed)
        eventually(lambda: not server.connected)
