"""Mutations of files: bytes, text, JSON values, and PNG chunks with right checksums.

The length of a chunk may be a lie, about one of any type, and up to 4 GB.
"""

from __future__ import annotations

import json
import random
import re
import struct
import zlib
from copy import deepcopy
from typing import Any

_WORDS = (
    "NaN", "Infinity", ".nan", ".inf", "1e400", "-1", "0", "-0.0", "1e308", "1e-320",
    "9223372036854775808", "9" * 400, "1" * 5000, "null", "true", "[]", "{}", '""', '"\\u0000"',
    "1.5", "[[[]]]", "2147483648", "0x10", "~", "!!python/object/apply:os.system [id]", "&a [*a]",
)  # fmt: skip
_INSERTS = (
    "[", "{", "]", "}", '"', ",", ":", "\n", "\0", "\u202e", "%YAML", "---", "[" * 20000,
    '{"a":' * 5000, "\t", "- " * 3000,
)  # fmt: skip
_NAMES = "", "x", "../../x", "a" * 5000, "\n", "eyes", "version"
_VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 1, 2**63, -(2**70), 10**30, 1e308, float("nan"), float("inf"), "", "x",
    "é" * 40, "../../x", [], {}, [1, 2, 3], [[0] * 3] * 3, [[1, 2], [3]], {"a": 1}, {"": 1}, "1",
    [None] * 4, ["a"] * 3, [[float("nan")] * 4] * 4,
)  # fmt: skip
_LIES = 1, 2**30, 2**31 - 1, 2**32 - 16
_CHUNKS = b"IDAT", b"tEXt", b"PLTE", b"fdAT", b"abCd"
_PNG = b"\x89PNG\r\n\x1a\n"


def mutated(data: bytes, kind: str, chance: random.Random) -> bytes:
    """Return a mutation of a file's content of kind binary, png, json or text."""
    luck = chance.random()
    if kind == "png" and luck < 0.6 and data.startswith(_PNG):
        return _png(data, chance)
    if kind == "json" and luck < 0.6:
        return _json(data, chance)
    if kind in ("json", "text") and luck < 0.85:
        return _text(data, chance)
    return _bytes(data, chance)


def _bytes(data: bytes, chance: random.Random) -> bytes:
    new = bytearray(data)
    for _ in range(chance.choice((1, 1, 1, 2, 5, 30))):
        at = chance.randrange(len(new)) if new else 0
        some = chance.choice((1, 4, 100))
        match chance.randrange(7) if new else 3:
            case 0:
                new[at] ^= 1 << chance.randrange(8)
            case 1:
                del new[at:]
            case 2:
                del new[at : at + some]
            case 3:
                new[at:at] = chance.randbytes(some)
            case 4:
                new[at:at] = new[chance.randrange(len(new)) :][: 10 * some]
            case 5:
                new[at : at + 4] = chance.choice(
                    (b"\xff" * 4, bytes(4), b"\x80\0\0\0", b"\0\0\0\1")
                )
            case _:
                new[at : at + 8] = struct.pack("<Q", chance.getrandbits(64))
    return bytes(new)


def _text(data: bytes, chance: random.Random) -> bytes:
    text = data.decode(errors="replace")
    for _ in range(chance.choice((1, 1, 2, 4))):
        numbers = list(re.finditer(r"-?\d+\.?\d*(?:e[-+]?\d+)?", text))
        names = list(re.finditer(r"[A-Za-z_]{2,}", text))
        lines = text.split("\n")
        line = chance.randrange(len(lines))
        match chance.randrange(7):
            case 0 | 1 | 2 if numbers:
                place = chance.choice(numbers)
                text = text[: place.start()] + chance.choice(_WORDS) + text[place.end() :]
            case 3:
                del lines[line]
                text = "\n".join(lines)
            case 4:
                lines[line:line] = [chance.choice(lines)] * chance.choice((1, 2, 500))
                text = "\n".join(lines)
            case 5 if names:
                place = chance.choice(names)
                text = text[: place.start()] + chance.choice(_NAMES) + text[place.end() :]
            case _:
                at = chance.randrange(len(text) + 1)
                text = text[:at] + chance.choice(_INSERTS) + text[at:]
    return text.encode(errors="replace")


def _json(data: bytes, chance: random.Random) -> bytes:
    try:
        value = json.loads(data)
    except ValueError:
        return _text(data, chance)
    for _ in range(chance.choice((1, 1, 1, 2, 4))):
        places = _places(value)
        if not places:
            return json.dumps(chance.choice(_VALUES)).encode()
        holder, key = chance.choice(places)
        again = deepcopy(holder[key])  # a value in two places could come to hold itself
        match chance.randrange(4):
            case 0 | 1:
                holder[key] = deepcopy(chance.choice(_VALUES))
            case 2:
                del holder[key]
            case _ if isinstance(holder, dict):
                holder[chance.choice(("x", "", "__proto__", f"{key}2"))] = again
            case _:
                holder.append(again)
    return json.dumps(value).encode()


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Return every place in a JSON value as its holder and key."""
    found: list[tuple[Any, Any]] = []
    items = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    for key, one in items:
        found += [(value, key), *_places(one)]
    return found


def _png(data: bytes, chance: random.Random) -> bytes:
    chunks, at = [], len(_PNG)
    while at + 12 <= len(data):
        size = int.from_bytes(data[at : at + 4])
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + size]))
        at += 12 + size
    place, lie = chance.randrange(min(3, len(chunks))), 0
    if chance.random() < 0.5:
        place, lie = chance.choice((1, 1, len(chunks))), chance.choice(_LIES)
        chunks.insert(place, (chance.choice(_CHUNKS), b"abc"))
    name, content = chunks[place]
    if lie:
        pass
    elif name == b"IHDR":
        header = bytearray(content)
        header[chance.randrange(13)] = chance.choice((0, 1, 2, 3, 4, 6, 8, 16, 255))
        content = bytes(header)
    elif name == b"IDAT" and chance.random() < 0.3:
        content = zlib.compress(bytes(chance.choice((0, 1000, 40 * 2**20))), 9)
    else:
        content = _bytes(content, chance)
    chunks[place] = name, content
    return _PNG + b"".join(
        struct.pack(">I", (len(content) + lie * (number == place)) % 2**32)
        + name
        + content
        + struct.pack(">I", zlib.crc32(name + content))
        for number, (name, content) in enumerate(chunks)
    )
