"""Writes docs/protocol_vectors.json: a whole conversation, to test clients in any language.

From the repository's root: ``python -m tests.link.vectors``.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.geometry import rigid
from handcal.core.types import Eye, HeadsetIdentity, HeadsetView, Projection
from handcal.link import exchange, handshake, messages, nudges, wire
from handcal.link import handcal_pb2 as pb
from handcal.link.drawn import drawn_digest, drawn_projections
from handcal.link.handshake import Refusal
from handcal.link.invitation import Invitation
from handcal.link.messages import Owner
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.link.reliable import Receipt
from handcal.link.shapes import Shape, Target
from handcal.link.wire import Keys, Packet, Slot, Welcome
from tests.helpers import ROOT

PATH = ROOT / "docs/protocol_vectors.json"
KEY = b"a pairing key of the vectors"
INVITATION = Invitation("192.168.1.20", 47800, "ABCDEFGHIJKLMNOPQRSTUVWXYZ")
DIGITS = "01234567"
SECRET, PC_SECRET = int("9b" * 32, 16), int("c5" * 32, 16)
DEVICE_ID = "0123456789abcdef"
DEVICE = int(DEVICE_ID, 16)
NONCE, PC_NONCE, COOKIE = bytes(range(16)), bytes(range(16, 32)), bytes(range(32, 48))
WELCOME = Welcome(0x1122334455667788, NONCE, PC_NONCE)
T_NS = 1_000_000_000_123
# The published bytes hold this matrix as SciPy rounds it.
T_V_H = rigid(Rotation.from_rotvec([0.01, 0.02, 0.03]).as_matrix(), [0.032, 0.0, 0.015])
P = np.array([[1500.0, 0.5, 634.0, -3.0], [0.0, 1490.0, 360.0, 2.0], [0.0, 0.0, 1.0, 0.001]])


def build() -> dict[str, Any]:
    """Return the vectors."""
    greeting = wire.handshake_keys(KEY, DEVICE)
    session = wire.session_keys(KEY, DEVICE, WELCOME)
    view = HeadsetView(T_V_H, np.array([-0.3, 0.31, -0.17, 0.18]), 1268, 720)
    identity = HeadsetIdentity(DEVICE_ID, "Lab 2", "runtime 1", "app 3", 2, {"left": view}, 0.063)
    points = np.array([[0.0, 0.1, 0.5], [0.01, 0.12, 0.51], [-0.02, 0.08, 0.49]])
    cursor = messages.cursor(points, 7, ["right"])
    shifts: dict[Eye, float] = {"left": 0.25, "right": -0.5}
    projections = {
        eye: Projection(eye, P + shift, 1268, 720, T_V_H, P, "P 7", "rig A")
        for eye, shift in shifts.items()
    }
    drawn = drawn_digest(drawn_projections(projections, is_offline=False), cursor.cursor)
    removed = messages.cursor(np.empty((0, 3)), 7, [])
    target = Target("right", np.arange(12.0).reshape(4, 3) / 10)
    shape = Shape(np.arange(24.0).reshape(8, 3) / 10, ("left",))
    request = VerifyRequest(3, "right", 1.0, 0.002)
    moved = NudgeSum(-4.0, 2.0, 0.004)
    to_headset = [
        (Slot.UNRELIABLE, pb.Envelope(ping=pb.Ping(t_sent_host_ns=T_NS))),
        (Slot.CURSOR, cursor),
        (Slot.UNRELIABLE, messages.live_hand(points, True, 5, ["left"], is_outline=True)[0]),
        (Slot.PROMPT, messages.prompt("Close your left eye.", ["right"])),
        (Slot.PROJECTION_LEFT, messages.projection(projections["left"])),
        (Slot.PROJECTION_RIGHT, messages.projection(projections["right"])),
        (Slot.TARGET, messages.target(target)),
        (Slot.SHAPE, messages.shape(shape)),
        (Slot.SHOW, pb.Envelope(show=pb.Show(offline=True))),
        (Slot.VERIFY, nudges.verify(request)),
    ]
    pong = pb.Pong(
        t_sent_host_ns=T_NS,
        t_received_headset_ns=T_NS + 7,
        t_sent_headset_ns=T_NS + 9,
        highest_sequence=4,
        accepted=3,
    )
    to_pc = [
        (Slot.DEVICE, messages.device(identity, Owner("P 7", "rig A"))),
        (Slot.UNRELIABLE, messages.poses([(T_NS, T_V_H)])),
        (Slot.UNRELIABLE, pb.Envelope(pong=pong)),
        (Slot.CONFIRM, messages.confirm(T_NS, 7, drawn)),
        (Slot.NUDGE, nudges.nudge(request, moved, True, T_NS, drawn)),
        (Slot.UNRELIABLE, messages.ack([Receipt(Slot.CURSOR, 2, 1)])),
        (Slot.UNRELIABLE, pb.Envelope(bye=pb.Bye())),
    ]
    busy = handshake.refused(NONCE, Refusal(is_key_taken=False, other="Lab 1"))
    offline = drawn_digest(drawn_projections(projections, is_offline=True), cursor.cursor)
    return {
        "protocol": wire.VERSION,
        "pairing_key": KEY.decode(),
        "invitation": INVITATION.text,
        "device_id": DEVICE_ID,
        "headset_nonce": NONCE.hex(),
        "pc_nonce": PC_NONCE.hex(),
        "session": f"{WELCOME.session:016x}",
        "pairing_by_digits": _pairing_by_digits(),
        "keys": {"handshake": _hex(greeting), "session": _hex(session)},
        "handshake": [
            _greeting(greeting.to_pc, handshake.hello(NONCE, T_NS, b"", "Lab 2")),
            _greeting(greeting.to_headset, handshake.retry(NONCE, COOKIE)),
            _greeting(greeting.to_pc, handshake.hello(NONCE, T_NS + 1, COOKIE, "Lab 2")),
            _greeting(greeting.to_headset, handshake.welcome(WELCOME)),
        ],
        "refused": _greeting(greeting.to_headset, busy),
        "fragments": _fragments(session.to_headset),
        "to_headset": _messages(session.to_headset, to_headset),
        "removed": wire.seal(session.to_headset, _after(to_headset, removed)).hex(),
        "to_pc": _messages(session.to_pc, to_pc),
        "digest": {
            "nothing": drawn_digest({}, None).hex(),
            "left_eye_only": drawn_digest({"left": projections["left"]}, None).hex(),
            "both_and_cursor": drawn.hex(),
            "both_and_cursor_offline": offline.hex(),
            "both_and_cursor_removed": drawn_digest(projections, removed.cursor).hex(),
        },
    }


def _pairing_by_digits() -> dict[str, str]:
    """Return an exchange with fixed secrets."""
    value = exchange.public_value(DIGITS, DEVICE, NONCE, SECRET)
    pc_value = exchange.public_value(DIGITS, DEVICE, NONCE, PC_SECRET)
    agreed = exchange.agree(DEVICE, NONCE, value, pc_value, SECRET, is_pc=False)
    keys = exchange.PUBLIC_KEYS
    first = _greeting(keys.to_pc, exchange.pair(NONCE, value, "Lab 2"))
    request = _greeting(keys.to_pc, exchange.pair(NONCE, value, "Lab 2", COOKIE))
    by_code = exchange.public_value(INVITATION.code, DEVICE, NONCE, SECRET)
    scanned = exchange.pair(NONCE, by_code, "Lab 2", COOKIE, by_code=True)
    answer = _greeting(keys.to_headset, exchange.paired(NONCE, pc_value, agreed.proof))
    return {
        "digits": DIGITS,
        "headset_secret": f"{SECRET:064x}",
        "pc_secret": f"{PC_SECRET:064x}",
        "first_pair": first["datagram"],
        "retry": _greeting(keys.to_headset, handshake.retry(NONCE, COOKIE))["datagram"],
        "pair": request["datagram"],
        "pair_by_code": _greeting(keys.to_pc, scanned)["datagram"],
        "refused": _greeting(keys.to_headset, handshake.refused_code(NONCE))["datagram"],
        "paired": answer["datagram"],
        "proof": agreed.proof.hex(),
        "pairing_key": agreed.key,
    }


def _after(sent: list[tuple[Slot, pb.Envelope]], envelope: pb.Envelope) -> Packet:
    """Return the cursor that follows the messages of a session."""
    number = len(sent) + 1
    payload = envelope.SerializeToString()
    return Packet(payload, WELCOME.session, number, Slot.CURSOR, message_id=number)


def _fragments(key: bytes) -> list[str]:
    """Return the datagrams of a message of two fragments, as the first of a session."""
    points = np.column_stack([np.linspace(-0.1, 0.1, 240), np.zeros(240), np.full(240, 0.5)])
    parts = wire.split(messages.cursor(points, 7, ["right"]).SerializeToString())
    return [
        wire.seal(
            key, Packet(part, WELCOME.session, 1 + index, Slot.CURSOR, 1, index, len(parts))
        ).hex()
        for index, part in enumerate(parts)
    ]


def _hex(keys: Keys) -> dict[str, str]:
    return {"to_pc": keys.to_pc.hex(), "to_headset": keys.to_headset.hex()}


def _greeting(key: bytes, envelope: pb.Envelope) -> dict[str, str]:
    body = str(envelope.WhichOneof("body"))
    return {"message": body, "datagram": handshake.seal(key, DEVICE, envelope).hex()}


def _messages(key: bytes, envelopes: list[tuple[Slot, pb.Envelope]]) -> list[dict[str, str]]:
    sealed = []
    for sequence, (slot, envelope) in enumerate(envelopes, 1):
        packet = Packet(
            envelope.SerializeToString(),
            WELCOME.session,
            sequence,
            slot,
            message_id=sequence if slot else 0,
        )
        body = str(envelope.WhichOneof("body"))
        sealed.append({"message": body, "datagram": wire.seal(key, packet).hex()})
    return sealed


if __name__ == "__main__":
    PATH.write_text(json.dumps(build(), indent=2) + "\n")
