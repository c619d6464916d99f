import time

import pytest

from handcal.link.impair import ImpairedTransport, Impairment
from handcal.link.transport import Address

PEER: Address = ("127.0.0.1", 9)


class Loop:
    """A perfect network that returns what was sent to it."""

    address = PEER

    def __init__(self) -> None:
        self.waiting: list[tuple[bytes, Address]] = []

    def send(self, datagram: bytes, address: Address) -> None:
        self.waiting.append((datagram, address))

    def receive(self, timeout_s: float) -> list[tuple[bytes, Address]]:
        arrived, self.waiting = self.waiting, []
        return arrived

    def close(self) -> None:
        self.waiting.clear()


def outward(impairment: Impairment) -> list[int]:
    """Send the first 1,000 numbers and return which left, in order."""
    loop = Loop()
    transport = ImpairedTransport(loop, impairment)
    for i in range(1000):
        transport.send(i.to_bytes(2, "big"), PEER)
    return [int.from_bytes(datagram, "big") for datagram, _ in loop.waiting]


def test_nothing_changes_unless_asked() -> None:
    assert outward(Impairment()) == list(range(1000))


def test_loss_and_duplication_happen_as_often_as_asked() -> None:
    assert 250 < 1000 - len(outward(Impairment(loss=0.3))) < 350
    assert 150 < len(outward(Impairment(duplicate=0.2))) - 1000 < 250


def test_the_same_seed_loses_the_same() -> None:
    assert outward(Impairment(loss=0.3, seed=4)) == outward(Impairment(loss=0.3, seed=4))
    assert outward(Impairment(loss=0.3, seed=4)) != outward(Impairment(loss=0.3, seed=5))


def test_both_directions_are_impaired() -> None:
    loop = Loop()
    transport = ImpairedTransport(loop, Impairment(loss=0.5))
    loop.waiting = [(b"x", PEER)] * 1000
    assert 400 < len(transport.receive(0.0)) < 600


def test_a_delay_holds_back() -> None:
    loop = Loop()
    transport = ImpairedTransport(loop, Impairment(delay_s=0.02))
    transport.send(b"x", PEER)
    assert loop.waiting == []
    time.sleep(0.025)
    transport.receive(0.0)  # lets it go, and takes it back into the other lane
    time.sleep(0.025)
    assert transport.receive(0.0) == [(b"x", PEER)]


def test_reordering_changes_the_order_only() -> None:
    loop = Loop()
    transport = ImpairedTransport(loop, Impairment(reorder=0.2, reorder_delay_s=0.02))
    loop.waiting = [(bytes([i]), PEER) for i in range(100)]
    first = transport.receive(0.0)
    time.sleep(0.025)
    arrived = [datagram[0] for datagram, _ in first + transport.receive(0.0)]
    assert arrived != sorted(arrived)
    assert sorted(arrived) == list(range(100))


@pytest.mark.parametrize("wrong", [{"loss": 1.1}, {"duplicate": -0.1}, {"delay_s": -1.0}])
def test_impossible_values_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must lie|negative"):
        Impairment(**wrong)  # type: ignore[arg-type]
