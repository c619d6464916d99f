"""Break the program in known ways, in a copy, and see that something notices each.

``python -m tests.mutants [WORD ...]``, from the repository's root; a word selects by name. Half an
hour for all. What is named here runs in ``.ci/run``, without root.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from tests.helpers import ROOT

_LEFT_OUT = shutil.ignore_patterns(".venv", ".git", "results", "__pycache__", ".*_cache", "build")
_PATIENCE_S = 600.0


@dataclass(frozen=True, slots=True)
class Mutant:
    """A fault: a text in a file that is replaced by another, and what notices it."""

    name: str
    file: str
    before: str
    after: str
    noticed_by: str
    """Tests, or ``campaign`` and its name."""


def _log_the_wearer(before: str) -> str:
    warn = "import logging; logging.getLogger(__name__).warning('session of %s', wearer)"
    return f"{before}        {warn}\n"


_CLEAN = "        wearer = clean_wearer(wearer)\n"
_START = "        self._start()\n"
_SEND = "__import__('socket').socket(2, 2).sendto(b'x', ('192.0.2.1', 9))"
_COMPARE = "return hmac.compare_digest(datagram[-MAC_BYTES:], _mac(key, datagram[:-MAC_BYTES]))"
_SHORT = (
    "return hmac.compare_digest(datagram[-MAC_BYTES:][:4], _mac(key, datagram[:-MAC_BYTES])[:4])"
)
_CHECKSUM = '    if sha256(data) != checksum:\n        raise ValueError("its checksum'
MUTANTS = (
    Mutant(
        "fsync of written files skipped",
        "handcal/io/files.py",
        "                os.fsync(file.fileno())",
        "                pass",
        "tests/io/test_files.py",
    ),
    Mutant(
        "folder never synced",
        "handcal/io/files.py",
        "        os.fsync(folder)",
        "        pass",
        "tests/io/test_files.py",
    ),
    Mutant(
        "journal never synced",
        "handcal/session/journal.py",
        "os.fsync(file.fileno())",
        "pass",
        "tests/session/test_journal.py",
    ),
    Mutant("any MAC accepted", "handcal/link/wire.py", _COMPARE, "return True", "tests/link"),
    Mutant("four bytes of a MAC", "handcal/link/wire.py", _COMPARE, _SHORT, "tests/link"),
    Mutant(
        "replays accepted",
        "handcal/link/wire.py",
        "elif -ahead >= REPLAY_WINDOW or self._seen >> -ahead & 1:",
        "elif False:",
        "tests/link/test_wire.py",
    ),
    Mutant(
        "any cookie accepted",
        "handcal/link/handshake.py",
        "return bool(cookie) and any(",
        "return bool(cookie) or any(",
        "tests/link/test_handshake.py",
    ),
    Mutant(
        "old hellos accepted",
        "handcal/link/handshake.py",
        "if greeting.time_ns <= heard.admitted_ns:",
        "if False:",
        "tests/link/test_handshake.py",
    ),
    Mutant(
        "attempts without end",
        "handcal/link/exchange.py",
        "if any(self.counts[who] >= most",
        "if False and any(self.counts[who] >= most",
        "tests/link/test_exchange.py",
    ),
    Mutant(
        "public values unchecked",
        "handcal/link/exchange.py",
        "or not 1 < number < PRIME - 1",
        "",
        "tests/link/test_exchange.py",
    ),
    Mutant(
        "checksums of the journal ignored",
        "handcal/session/journal.py",
        "    if not is_sound:\n",
        "    if False:\n",
        "tests/session/test_damage.py",
    ),
    Mutant(
        "checksums of alignments ignored",
        "handcal/session/record.py",
        _CHECKSUM,
        _CHECKSUM.replace("sha256(data) != checksum", "False"),
        "tests/session/test_damage.py",
    ),
    Mutant(
        "a lock that locks nothing",
        "handcal/io/lock.py",
        "fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)",
        "pass",
        "tests/io/test_lock.py",
    ),
    Mutant(
        "formulas in CSV",
        "handcal/report/cells.py",
        "if isinstance(value, str) and value.startswith(_FORMULA_STARTS):",
        "if False:",
        "tests/report/test_document.py",
    ),
    Mutant(
        "mirrored poses accepted",
        "handcal/core/geometry.py",
        " and _dot(_cross(x, y), z) > 0.0",
        "",
        "tests/core/test_geometry.py",
    ),
    Mutant(
        "the wearer's name in the log",
        "handcal/session/session.py",
        _CLEAN,
        _log_the_wearer(_CLEAN),
        "tests/session/test_session.py",
    ),
    Mutant(
        "a datagram to a stranger",
        "handcal/link/server.py",
        _START,
        f"{_START}        {_SEND}\n",
        "campaign privacy",
    ),
    Mutant(
        "a megabyte kept of each frame",
        "handcal/station/station.py",
        "    def step(self) -> Snapshot:\n",
        "    _kept: list[bytes] = []\n\n    def step(self) -> Snapshot:\n"
        "        self._kept.append(bytes(bytearray(b'x') * (1 << 20)))\n",
        "campaign soak",
    ),
    Mutant(
        "keys that others can read",
        "handcal/link/pairing.py",
        "mode=0o600",
        "mode=0o666",
        "tests/link/test_pairing.py",
    ),
    Mutant(
        "tracebacks of a rig file",
        "handcal/rig/rig_file.py",
        "    except ValueError as error:\n        raise FileError(",
        "    except FileNotFoundError as error:\n        raise FileError(",
        "tests/rig/test_rig_file.py",
    ),
)


def main() -> None:
    words = sys.argv[1:]
    chosen = [one for one in MUTANTS if not words or any(word in one.name for word in words)]
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "handcal"
        shutil.copytree(ROOT, copy, ignore=_LEFT_OUT)
        missed = [one.name for one in chosen if not _is_noticed(one, copy)]
    print(f"{len(chosen) - len(missed)} of {len(chosen)} noticed")  # noqa: T201
    sys.exit(bool(missed))


def _is_noticed(mutant: Mutant, copy: Path) -> bool:
    """Run what should notice a mutant, and print whether it did."""
    file = copy / mutant.file
    sound = file.read_text()
    if mutant.before not in sound:
        print(f"{mutant.name}: {mutant.file} does not hold the text to replace")  # noqa: T201
        return False
    kind, *name = mutant.noticed_by.split()
    words = ["-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", mutant.noticed_by]
    if kind == "campaign":
        words = ["-m", "tests.campaigns", "--short", *name]
    environment = os.environ | {"PYTHONPATH": str(copy), "QT_QPA_PLATFORM": "offscreen"}
    began_s = time.monotonic()
    file.write_text(sound.replace(mutant.before, mutant.after))
    try:
        run = subprocess.run(
            [sys.executable, *words],
            cwd=copy,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=_PATIENCE_S,
            check=False,
        )
    finally:
        file.write_text(sound)
    noticed = run.returncode == 1
    word = "noticed" if noticed else f"MISSED (exit code {run.returncode})"
    print(f"{mutant.name}: {word} by {mutant.noticed_by}, {time.monotonic() - began_s:.0f} s")  # noqa: T201
    sys.stdout.flush()
    return noticed


if __name__ == "__main__":
    main()
