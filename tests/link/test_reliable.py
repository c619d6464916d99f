"""Reliable messages over a simulated bad network, without sockets or waiting."""

import dataclasses
import itertools
import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handcal.link.reliable import Delivery, Inbox, Outbox
from handcal.link.wire import MAX_PAYLOAD_BYTES, Slot

STEP_S = 0.005


def message_of(fragments: int, letter: bytes = b"x") -> bytes:
    return letter * (fragments * MAX_PAYLOAD_BYTES)


def exchange(
    outbox: Outbox,
    inbox: Inbox,
    chance: random.Random,
    loss: float,
    duration_s: float,
    start_s: float = 0.0,
) -> list[bytes]:
    """Run both halves over a network that loses, doubles and shuffles; return what came."""
    delivered: list[bytes] = []
    for step in range(round(duration_s / STEP_S)):
        now_s = start_s + step * STEP_S
        outbox.expire(now_s)
        packets = [p for p in outbox.due(now_s, 16) for _ in range(1 + (chance.random() < 0.1))]
        chance.shuffle(packets)
        for packet in packets:
            if chance.random() >= loss:
                message = inbox.receive(packet)
                delivered += [] if message is None else [message]
        for receipt in inbox.take_receipts():
            if chance.random() >= loss:
                outbox.acknowledge(receipt)
    return delivered


@given(seed=st.integers(0, 10**6), fragments=st.integers(1, 44))
def test_a_message_gets_through_30_percent_loss_exactly_once(seed: int, fragments: int) -> None:
    outbox, inbox = Outbox(), Inbox()
    sent = outbox.send(Slot.CURSOR, message_of(fragments), 0.0)
    delivered = exchange(outbox, inbox, random.Random(seed), loss=0.3, duration_s=5.0)
    assert delivered == [message_of(fragments)]
    assert sent.state is Delivery.ACKED
    assert (outbox.acked, outbox.unacked, outbox.failed) == (1, 0, 0)


def test_a_44_fragment_cursor_is_quick_at_30_percent_loss() -> None:
    arrived = 0
    for seed in range(50):
        outbox, inbox = Outbox(), Inbox()
        sent = outbox.send(Slot.CURSOR, message_of(44), 0.0)
        exchange(outbox, inbox, random.Random(seed), loss=0.3, duration_s=0.5)
        arrived += sent.state is Delivery.ACKED
    assert arrived >= 45


def test_only_missing_fragments_are_sent_again() -> None:
    outbox, inbox = Outbox(), Inbox()
    outbox.send(Slot.CURSOR, message_of(10), 0.0)
    for packet in outbox.due(0.0, 16):
        if packet.fragment not in (2, 7):
            inbox.receive(packet)
    for receipt in inbox.take_receipts():
        outbox.acknowledge(receipt)
    assert outbox.due(0.039, 16) == []
    assert [packet.fragment for packet in outbox.due(0.041, 16)] == [2, 7]
    assert outbox.resent == 2


def test_the_wait_doubles_to_its_limit() -> None:
    outbox = Outbox()
    outbox.send(Slot.PROMPT, b"hello", 0.0)
    times = [t for t in (i / 1000 for i in range(4000)) if outbox.due(t, 16)]
    waits = [round(b - a, 2) for a, b in itertools.pairwise(times)]
    assert waits == [0.04, 0.08, 0.16, 0.32, 0.64, 0.64, 0.64, 0.64, 0.64]


def test_a_burst_is_bounded() -> None:
    outbox = Outbox()
    outbox.send(Slot.CURSOR, message_of(20), 0.0)
    outbox.send(Slot.PROMPT, b"hello", 0.0)
    assert [len(outbox.due(0.001 * i, 16)) for i in range(3)] == [16, 5, 0]


def test_a_newer_message_replaces_an_older_of_its_slot_only() -> None:
    outbox = Outbox()
    older = outbox.send(Slot.PROJECTION_LEFT, b"old", 0.0)
    other = outbox.send(Slot.PROJECTION_RIGHT, b"right", 0.0)
    newer = outbox.send(Slot.PROJECTION_LEFT, b"new", 0.0)
    assert older.state is Delivery.SUPERSEDED
    assert (other.state, newer.state) == (Delivery.PENDING, Delivery.PENDING)
    assert sorted(packet.payload for packet in outbox.due(0.0, 16)) == [b"new", b"right"]


def test_a_late_older_projection_never_overwrites_a_newer_one() -> None:
    outbox, inbox = Outbox(), Inbox()
    outbox.send(Slot.PROJECTION_LEFT, b"old", 0.0)
    late = outbox.due(0.0, 16)
    outbox.send(Slot.PROJECTION_LEFT, b"new", 0.0)
    assert [inbox.receive(packet) for packet in outbox.due(0.0, 16)] == [b"new"]
    assert [inbox.receive(packet) for packet in late] == [None]


@given(st.permutations(range(6)))
def test_whatever_order_fragments_of_two_messages_come_in_the_newer_one_stays(
    order: list[int],
) -> None:
    outbox, inbox = Outbox(), Inbox()
    outbox.send(Slot.CURSOR, message_of(3, b"a"), 0.0)
    packets = outbox.due(0.0, 16)
    outbox.send(Slot.CURSOR, message_of(3, b"b"), 0.0)
    packets += outbox.due(0.0, 16)
    delivered = [inbox.receive(packets[i]) for i in order]
    assert [message for message in delivered if message][-1] == message_of(3, b"b")


def test_nothing_acknowledged_is_given_up_and_counted() -> None:
    outbox = Outbox()
    sent = outbox.send(Slot.CURSOR, b"hand", 0.0)
    assert outbox.expire(4.99) == []
    assert outbox.expire(5.0) == [sent]
    assert (sent.state, outbox.failed, outbox.unacked) == (Delivery.FAILED, 1, 0)
    assert outbox.due(6.0, 16) == []


def test_a_new_receiver_is_sent_the_newest_of_every_slot() -> None:
    outbox = Outbox()
    outbox.send(Slot.PROMPT, b"old prompt", 0.0)
    outbox.send(Slot.PROMPT, b"prompt", 0.0)
    outbox.send(Slot.CURSOR, message_of(3), 0.0)
    chance = random.Random(0)
    exchange(outbox, Inbox(), chance, loss=0.0, duration_s=0.1)
    outbox.restart(1.0)
    again = exchange(outbox, Inbox(), chance, loss=0.0, duration_s=0.1, start_s=1.0)
    assert sorted(again) == sorted([b"prompt", message_of(3)])
    assert outbox.unacked == 0


@pytest.mark.parametrize("change", [{"fragment_count": 5}, {"message_id": 0}])
def test_a_fragment_that_contradicts_the_others_is_ignored(change: dict[str, Any]) -> None:
    outbox, inbox = Outbox(), Inbox()
    outbox.send(Slot.CURSOR, message_of(2), 0.0)
    first, second = outbox.due(0.0, 16)
    inbox.receive(first)
    assert inbox.receive(dataclasses.replace(second, **change)) is None
    assert inbox.receive(second) == message_of(2)
