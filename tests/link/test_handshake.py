"""The PC's side of the handshake without sockets: strangers, replays, secrets that change."""

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.link import handcal_pb2 as pb
from handcal.link import handshake, messages, wire
from handcal.link.fields import MalformedError
from handcal.link.handshake import MAX_ANSWERS, PERIOD_S, Caller, Limiter, Reception
from handcal.link.pairing import MAX_DEVICES, Pairing, Pairings
from handcal.link.transport import Address
from handcal.link.wire import Packet, Rejection

KEY = "a pairing key of the tests"
DEVICE = 0x1234
HERE: Address = ("192.0.2.1", 5000)
THERE: Address = ("192.0.2.2", 5000)


class Desk:
    """A reception, and a device that calls at it."""

    def __init__(self, key: str = KEY, device: int = DEVICE, pairings: Pairings | None = None):
        self.reception = Reception(pairings or Pairings((Pairing(KEY),)))
        self.keys = wire.handshake_keys(key.encode(), device)
        self.device = device

    def hello(self, time_ns: int, cookie: bytes = b"", name: str = "Lab") -> bytes:
        made = handshake.hello(bytes(16), time_ns, cookie, name)
        return handshake.seal(self.keys.to_pc, self.device, made)

    def hear(
        self, datagram: bytes, address: Address = HERE, now_s: float = 0.0
    ) -> Caller | bytes | Rejection:
        packet = wire.read(datagram)
        if isinstance(packet, Rejection):
            return packet
        return self.reception.hear(packet, datagram, address, now_s)

    def cookie(self, time_ns: int, address: Address = HERE, now_s: float = 0.0) -> bytes:
        answer = self.hear(self.hello(time_ns), address, now_s)
        assert isinstance(answer, bytes)
        assert wire.is_authentic(self.keys.to_headset, answer)
        packet = wire.read(answer)
        assert isinstance(packet, Packet)
        return messages.parse(packet.payload).retry.cookie


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_only_a_hello_with_its_cookie_is_passed_on(desk: Desk) -> None:
    cookie = desk.cookie(1)
    caller = desk.hear(desk.hello(2, cookie))
    assert isinstance(caller, Caller)
    assert (caller.device_id, caller.name) == (f"{DEVICE:016x}", "Lab")


def test_a_cookie_serves_one_address_and_device(desk: Desk) -> None:
    cookie = desk.cookie(1)
    for address in (THERE, (HERE[0], 5001)):
        assert isinstance(desk.hear(desk.hello(2, cookie), address), bytes)
    other = Desk(device=7)
    other.reception = desk.reception
    assert isinstance(other.hear(other.hello(3, cookie)), bytes)
    for bad in (b"", cookie[:-1], cookie + b"x", bytes(16)):
        assert not isinstance(desk.hear(desk.hello(4, bad), THERE), Caller)


@given(st.floats(0.0, 1e6), st.floats(0.0, 3.0))
def test_a_cookie_lasts_one_to_two_periods(made_s: float, periods: float) -> None:
    desk = Desk()
    cookie = desk.cookie(1, now_s=made_s)
    caller = desk.hear(desk.hello(2, cookie), now_s=made_s + periods * PERIOD_S)
    if periods < 1.0 or periods > 2.0:
        assert isinstance(caller, Caller) == (periods < 1.0)


@given(st.lists(st.tuples(st.integers(0, 9), st.booleans(), st.booleans()), max_size=30))
def test_no_hello_is_heard_twice(calls: list[tuple[int, bool, bool]]) -> None:
    desk = Desk()
    cookies = {HERE: desk.cookie(0, HERE), THERE: desk.cookie(1, THERE)}
    newest = -1
    for time_ns, is_here, has_cookie in calls:
        address = HERE if is_here else THERE
        heard = desk.hear(desk.hello(time_ns, cookies[address] if has_cookie else b""), address)
        if has_cookie:
            assert isinstance(heard, Caller) == (time_ns > newest)
            newest = max(newest, time_ns)
        else:
            assert not isinstance(heard, Caller)


def test_a_replayed_hello_is_answered_at_most_once_an_address(desk: Desk) -> None:
    hello = desk.hello(5)
    answers = [desk.hear(hello, (f"10.0.{i // 250}.{i % 250}", 9)) for i in range(1000)]
    given_out = [answer for answer in answers if isinstance(answer, bytes)]
    assert len(given_out) == MAX_ANSWERS
    assert all(len(answer) <= 3 * len(hello) for answer in given_out)
    assert desk.hear(hello) is Rejection.REPLAYED
    assert isinstance(desk.hear(desk.hello(6)), bytes)  # the device itself is not kept out
    assert desk.hear(hello, THERE) is Rejection.REPLAYED


def test_the_smallest_hello_is_not_amplified(desk: Desk) -> None:
    hello = desk.hello(1, name="")
    answer = desk.hear(hello)
    assert isinstance(answer, bytes)
    assert len(answer) <= 3 * len(hello)


def test_a_clock_that_was_set_back_is_forgiven_when_no_cookie_is_left(desk: Desk) -> None:
    desk.hear(desk.hello(1001, desk.cookie(1000)))
    assert desk.hear(desk.hello(3)) is Rejection.REPLAYED
    late_s = 2 * PERIOD_S + 1
    cookie = desk.cookie(4, now_s=late_s)
    assert isinstance(desk.hear(desk.hello(5, cookie), now_s=late_s), Caller)


@pytest.mark.parametrize("later_s", [0.01, PERIOD_S, 2 * PERIOD_S])
def test_hellos_are_remembered_while_a_cookie_may_be_left(desk: Desk, later_s: float) -> None:
    """A recorded hello with its cookie could be sent again as long as the cookie is valid."""
    cookie = desk.cookie(1)
    admitted = desk.hello(2, cookie)
    assert isinstance(desk.hear(admitted), Caller)
    assert desk.hear(desk.hello(1), now_s=later_s) is Rejection.REPLAYED
    assert not isinstance(desk.hear(admitted, now_s=later_s), Caller)
    assert isinstance(desk.hear(desk.hello(3), now_s=later_s), bytes)


def test_a_key_of_another_device_is_named_and_a_strange_one_is_not() -> None:
    pairings = Pairings((Pairing(KEY, "00000000000000aa", "Owner"),))
    desk = Desk(pairings=pairings)
    caller = desk.hear(desk.hello(2, desk.cookie(1)))
    assert isinstance(caller, Caller)
    assert caller.pairing.name == "Owner"
    stranger = Desk(key="a key that nobody knows", pairings=pairings)
    assert stranger.hear(stranger.hello(1)) is Rejection.UNPAIRED


def test_strangers_cannot_have_every_key_tried_for_long() -> None:
    pairings = Pairings(
        tuple(Pairing(f"{KEY} {i}", f"{i:016x}") for i in range(1, MAX_DEVICES + 1))
    )
    desk = Desk(key=f"{KEY} 3", pairings=pairings)
    heard = [desk.hear(desk.hello(time_ns)) for time_ns in range(100)]
    assert heard.count(Rejection.UNPAIRED) >= 75
    own = Desk(key=f"{KEY} 3", device=3)
    own.reception = desk.reception
    assert isinstance(own.hear(own.hello(1)), bytes)


@pytest.mark.parametrize(
    "envelope", [pb.Envelope(), pb.Envelope(bye=pb.Bye()), handshake.hello(b"short", 1, b"", "")]
)
def test_what_is_no_hello_is_malformed(desk: Desk, envelope: pb.Envelope) -> None:
    with pytest.raises(MalformedError):
        desk.hear(handshake.seal(desk.keys.to_pc, DEVICE, envelope))


@pytest.fixture
def flooded() -> Iterator[Desk]:
    desk = Desk(pairings=Pairings((Pairing(KEY), Pairing(f"{KEY} 2", "00000000000000aa"))))
    yield desk
    assert len(desk.reception._heard) <= 64


@given(datagram=st.binary(max_size=200), device=st.integers(0, 2**64 - 1))
def test_forged_hellos_are_never_answered(datagram: bytes, device: int) -> None:
    desk = Desk()
    forged = wire.seal(bytes(32), Packet(datagram, sequence=device))
    assert desk.hear(forged) is Rejection.UNPAIRED
    assert not desk.reception._heard


def test_a_holder_of_the_key_cannot_fill_the_memory(flooded: Desk) -> None:
    for device in range(300):
        one = Desk(device=device)
        one.reception = flooded.reception
        one.cookie(1)


def test_a_limiter_allows_its_rate() -> None:
    limiter = Limiter(10.0)
    assert sum(limiter.allows(0.0) for _ in range(100)) == 10
    assert sum(limiter.allows(0.5) for _ in range(100)) == 5
    assert sum(limiter.allows(0.5 + 0.01 * i) for i in range(1, 201)) in (19, 20)
