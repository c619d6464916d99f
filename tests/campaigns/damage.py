"""Damage to every file of a session: whatever differs afterwards must be named."""

from __future__ import annotations

import random
import shutil
import tempfile
import time
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from handcal.core.errors import HandcalError
from handcal.io.resources import resource_path
from handcal.session.session import Session
from tests.campaigns.campaign import Tally, campaign

DAMAGES, SHORT_DAMAGES = 3000, 100
SLOWEST_S = 5.0
_KINDS = "cut", "bit", "bit", "zeros", "digit", "removed", "lines"
_OTHER = {"damaged", "journal_bytes", "torn_bytes", "path"}


def damage(tally: Tally, is_short: bool) -> None:
    chance = random.Random(0)
    with tempfile.TemporaryDirectory() as folder:
        session = Path(folder) / "session"
        shutil.copytree(resource_path("example_session"), session)
        paths = [path for path in sorted(session.rglob("*")) if path.is_file()]
        whole, _ = _look(session)
        while not tally.is_done(SHORT_DAMAGES if is_short else DAMAGES):
            path, kind = chance.choice(paths), chance.choice(_KINDS)
            before = path.read_bytes()
            after = _damaged(before, kind, chance)
            if after == before:
                continue
            tally.tried += 1
            path.unlink()
            if after is not None:
                path.write_bytes(after)
            where = f"{path.relative_to(session)}, {kind}"
            start_s = time.process_time()
            try:
                found, is_named = _look(session)
                differing = [name for name in whole if found[name] != whole[name]]
                tally.seen["named" if is_named else "without effect"] += 1
                if differing and not is_named:
                    tally.fail(f"{where}: silently different: {', '.join(differing)}")
            except HandcalError as error:
                tally.seen["refused"] += 1
                if path.name != "journal.jsonl":
                    tally.fail(f"{where}: unreadable as a whole: {error}")
            except Exception as error:
                tally.fail(f"{where}: {error!r}")
            if time.process_time() - start_s > SLOWEST_S:
                tally.fail(f"{where}: took over {SLOWEST_S} s")
            path.write_bytes(before)


def _damaged(data: bytes, kind: str, chance: random.Random) -> bytes | None:
    """Return damaged content; None for a removed file."""
    new = bytearray(data)
    at = chance.randrange(len(new)) if new else 0
    match kind:
        case "cut":
            return data[:at]
        case "bit" if new:
            new[at] ^= 1 << chance.randrange(8)
        case "zeros":
            end = min(len(new), (at // 512 + 1) * 512)
            new[at:end] = bytes(end - at)
        case "digit":
            digits = [place for place, one in enumerate(data) if 48 <= one <= 57]
            if digits:
                at = chance.choice(digits)
                new[at] = 48 + (new[at] - 48 + chance.randint(1, 9)) % 10
        case "removed":
            return None
        case "lines":
            lines = data.split(b"\n")
            one, other = chance.randrange(len(lines)), chance.randrange(len(lines))
            match chance.randrange(3):
                case 0:
                    del lines[one]
                case 1:
                    lines[one], lines[other] = lines[other], lines[one]
                case _:
                    lines.insert(other, lines[one])
            return b"\n".join(lines)
    return bytes(new)


def _look(path: Path) -> tuple[dict[str, Any], bool]:
    """Return the contents of a session in comparable form, and True if damage is named."""
    record = Session.open(path)
    names = (field.name for field in fields(record) if field.name not in _OTHER)
    content = {name: _plain(getattr(record, name)) for name in names}
    return content, bool(record.damaged) or record.torn_bytes > 0


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tobytes()
    if hasattr(value, "__dataclass_fields__"):
        return tuple(_plain(getattr(value, field.name)) for field in fields(value))
    if hasattr(value, "items"):
        return tuple((str(name), _plain(one)) for name, one in value.items())
    if isinstance(value, list | tuple):
        return tuple(map(_plain, value))
    return repr(value)


if __name__ == "__main__":
    campaign("damage to the files of a session", damage)
