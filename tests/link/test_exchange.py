"""Pairing by digits: the mathematics, the PC's limits, and both ends over real sockets."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handcal.core.errors import LinkError
from handcal.core.types import HeadsetIdentity
from handcal.link import exchange, handshake, messages, wire
from handcal.link import handcal_pb2 as pb
from handcal.link.client import HeadsetClient
from handcal.link.exchange import (
    MAX_ATTEMPTS,
    PRIME,
    VALUE_BYTES,
    Exchange,
    pair_by_code,
    pair_by_digits,
)
from handcal.link.fields import MalformedError
from handcal.link.handshake import Cookies
from handcal.link.invitation import Invitation
from handcal.link.pairing import OFFER_S, Pairings, new_device_id
from handcal.link.server import HeadsetServer
from handcal.link.transport import Address
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


ADDRESS = ("192.168.1.7", 5000)
INVITATION = Invitation("192.168.1.20", 47800, "ABCDEFGHIJKLMNOPQRSTUVWXYZ", DIGITS)


def new_exchange(pairings: Pairings | None = None) -> Exchange:
    return Exchange(pairings or Pairings(()), INVITATION, Cookies(), 0.0)


def request(
    nonce: bytes = NONCE,
    value: bytes | None = None,
    name: str = "",
    cookie: bytes = b"",
    *,
    by_code: bool = False,
) -> bytes:
    code = INVITATION.code if by_code else DIGITS
    value = value if value is not None else exchange.public_value(code, 7, nonce, 9)
    pair = exchange.pair(nonce, value, name, cookie, by_code=by_code)
    return handshake.seal(exchange.PUBLIC_KEYS.to_pc, 7, pair)


def hear(
    pc: Exchange, datagram: bytes, now_s: float = 0.0, address: Address = ADDRESS
) -> bytes | Rejection:
    packet = wire.read(datagram)
    assert isinstance(packet, Packet)
    return pc.hear(packet, datagram, address, now_s)


def attempt(
    pc: Exchange, number: int, address: Address = ADDRESS, *, by_code: bool = False
) -> bytes:
    """Ask with a nonce, with the cookie that the first answer brings; return the second answer."""
    nonce = number.to_bytes(16, "big")
    retry = opened(hear(pc, request(nonce, by_code=by_code), 0.0, address)).retry
    asked = request(nonce, cookie=retry.cookie, by_code=by_code)
    answer = hear(pc, asked, 0.0, address)
    assert answer == hear(pc, asked, 0.0, address)  # if it is lost
    assert isinstance(answer, bytes)
    return answer


def opened(answer: bytes | Rejection) -> pb.Envelope:
    assert isinstance(answer, bytes)
    packet = wire.read(answer)
    assert isinstance(packet, Packet)
    return messages.parse(packet.payload)


def body(answer: bytes | Rejection) -> str:
    return str(opened(answer).WhichOneof("body"))


def test_the_pc_answers_few_attempts_of_each_address_and_each_only_once() -> None:
    pairings = Pairings(())
    pc = new_exchange(pairings)
    for number in range(MAX_ATTEMPTS):
        answer = attempt(pc, number)
        assert body(answer) == "paired"
        assert len(answer) <= 1.1 * len(request())
    assert body(attempt(pc, 98)) == "refused"
    assert body(attempt(pc, 99, by_code=True)) == "paired"  # who tries digits ends no QR code
    assert len(pairings.offered(0.0, f"{7:016x}")) == MAX_ATTEMPTS + 1
    assert pairings.offered(0.0, f"{8:016x}") == ()
    assert pc.tried == (MAX_ATTEMPTS, "192.168.1.7")
    assert body(attempt(pc, 97, ("192.168.1.8", 5000))) == "paired"


def test_an_attempt_counts_once_its_address_is_proved() -> None:
    pc = new_exchange()
    for number in range(1_000):
        assert body(hear(pc, request(number.to_bytes(16, "big")))) == "retry"
        assert body(hear(pc, request(number.to_bytes(16, "big"), cookie=bytes(16)))) == "retry"
    assert pc.tried == (0, "")
    retry = hear(pc, request())
    assert isinstance(retry, bytes)
    assert len(retry) < len(request())
    stolen = request(cookie=opened(retry).retry.cookie)
    assert body(hear(pc, stolen, 0.0, ("192.168.1.8", 5000))) == "retry"


def test_one_host_cannot_use_up_the_attempts_of_all() -> None:
    pc = new_exchange()
    ends = [body(attempt(pc, number, ("fd00::7", number))) for number in range(50)]
    ends += [body(attempt(pc, 100 + n, (f"fd00::{n:x}", 1))) for n in range(16)]  # one network
    assert ends.count("paired") == 20
    assert body(attempt(pc, 200, ("192.168.1.8", 1))) == "paired"
    assert not pc.is_used_up
    for host in range(100):
        attempt(pc, 300 + host, (f"10.0.0.{host}", 1))
    assert pc.is_used_up
    assert pc.tried[0] == 100


def test_the_pc_answers_for_a_while() -> None:
    pc = new_exchange()
    assert hear(pc, request(), OFFER_S + 1.0) is Rejection.UNPAIRED
    hello = handshake.seal(b"another key", 7, handshake.hello(NONCE, 1, b"", ""))
    assert hear(pc, hello) is Rejection.UNPAIRED


def test_nonsense_costs_no_attempt() -> None:
    pairings = Pairings(())
    pc = new_exchange(pairings)
    wrong = [
        request(NONCE[1:]),
        request(value=bytes(VALUE_BYTES)),
        request(value=b""),
        request(name="two\nlines"),
        request(cookie=bytes(33)),
        handshake.seal(exchange.PUBLIC_KEYS.to_pc, 7, pb.Envelope(bye=pb.Bye())),
    ]
    for datagram in wrong * 3:
        with pytest.raises(MalformedError):
            hear(pc, datagram)
    assert not pairings.offered(0.0)
    assert body(attempt(pc, 1)) == "paired"


@settings(max_examples=30)
@given(st.binary(max_size=600))
def test_any_payload_is_refused(payload: bytes) -> None:
    pc = new_exchange()
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
    old, invitation = server.invite(), server.invite()
    host, port = server.address
    with pytest.raises(LinkError, match="code is wrong"):
        pair_by_code(replace(old, host=host, port=port), new_device_id())
    invitation = replace(invitation, host=host, port=port)
    device_id = new_device_id()
    key = pair_by_code(invitation, device_id)
    assert key != invitation.code
    connects(server, device_id, key)
    # A photograph of the code is worth nothing now.
    with pytest.raises(LinkError, match="answered"):
        pair_by_code(invitation, new_device_id(), timeout_s=0.3)
    stranger = HeadsetIdentity(new_device_id(), "photographer")
    photographed = invitation.code.encode()
    with HeadsetClient(server.address, photographed, stranger) as client, pytest.raises(LinkError):
        client.wait_connected(0.5)


def test_guessing_ends_the_code(server: HeadsetServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exchange, "_PER_CODE", 3)
    invitation = server.invite()
    for _ in range(3):
        with pytest.raises(LinkError, match="code is wrong"):
            pair_by_digits(server.address, new_device_id(), "00000000")
    with pytest.raises(LinkError, match="no more codes"):
        pair_by_digits(server.address, new_device_id(), invitation.digits)
    assert str(server.pairing_attempts) == (
        "3 attempts with other digits, the last from 127.0.0.1; no more are answered: show a new "
        "code"
    )


def test_a_revoked_device_is_cut_off(server: HeadsetServer) -> None:
    invitation = server.invite()
    device_id = new_device_id()
    identity = HeadsetIdentity(device_id, "Lab 9")
    key = pair_by_digits(server.address, device_id, invitation.digits)
    with HeadsetClient(server.address, key.encode(), identity) as client:
        server.wait_connected(3.0)
        server.pairings.revoke(device_id)
        eventually(lambda: client.dismissed)
        eventually(lambda: not server.connected)
