"""The answer to a headset that speaks version 1: a prompt to update its app.

Version 1 signed with BLAKE2b. The answer is a welcome and one prompt, together no larger than three
times the hello; nobody listens in the session that it opens.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets

from handcal.link import handcal_pb2 as pb
from handcal.link.wire import HEADER, MAC_BYTES, MAGIC, Slot

_VERSION = 1
_HELLO_BYTES = HEADER.size + 11 + MAC_BYTES
_NOTICE = "Update this app: protocol 2"


def is_hello(datagram: bytes) -> bool:
    """Return whether a datagram has the form of a hello of version 1."""
    return len(datagram) == _HELLO_BYTES and datagram.startswith(MAGIC + bytes([_VERSION]))


def answer(pairing_key: bytes, hello: bytes) -> list[bytes] | None:
    """Return the datagrams that show the prompt, or None if another key signed the hello."""
    body, mac = hello[:-MAC_BYTES], hello[-MAC_BYTES:]
    root = hashlib.blake2b(pairing_key, person=b"handcal pairing").digest()
    if not hmac.compare_digest(mac, _mac(_key(root, b"to pc"), body)):
        return None
    to_headset = _key(root, b"to headset")
    session = secrets.randbits(64) | 1
    # The hello's only field is its nonce, fixed64, tag 9; a welcome of version 1 repeats it, and
    # adds the session, tag 17.
    nonce = body[-8:]
    inner = b"\x09" + nonce + b"\x11" + session.to_bytes(8, "little")
    welcome = b"\x2a" + bytes([len(inner)]) + inner
    prompt = pb.Envelope(prompt=pb.Prompt(text=_NOTICE)).SerializeToString()
    return [
        _seal(to_headset, 0, 0, Slot.UNRELIABLE, welcome),
        _seal(to_headset, session, 1, Slot.PROMPT, prompt),
    ]


def _seal(key: bytes, session: int, sequence: int, slot: Slot, payload: bytes) -> bytes:
    message_id = int(slot is not Slot.UNRELIABLE)
    body = HEADER.pack(MAGIC, _VERSION, slot, session, sequence, message_id, 0, 1) + payload
    return body + _mac(key, body)


def _key(root: bytes, label: bytes) -> bytes:
    return hashlib.blake2b(label, key=root).digest()


def _mac(key: bytes, body: bytes) -> bytes:
    return hashlib.blake2b(body, key=key, digest_size=MAC_BYTES).digest()
