"""Faults at every n-th system call of a session's life: error, full disk, short write, crash.

The calls of libc are replaced by those of faults.c, so the campaign needs Linux and a C compiler.
"""

from __future__ import annotations

import ctypes
import os
import random
import shutil
import subprocess
import sys
import tempfile
import traceback
from enum import IntEnum
from pathlib import Path

from handcal.core.errors import FileError
from handcal.session.session import Session
from tests.campaigns import life
from tests.campaigns.campaign import Tally, campaign

OPERATIONS = 14
LIVES, SHORT_EVERY = 3, 40
_COMPLAINED, _DIED = 98, 99


class Fault(IntEnum):
    """As in faults.c."""

    IO_ERROR = 1
    DISK_FULL = 2
    SHORT_WRITE = 3
    DIE_BEFORE = 4
    DIE_HALFWAY = 5
    DIE_AFTER = 6


def inject(tally: Tally, is_short: bool) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if sys.platform != "linux" or compiler is None:
        tally.note = "not run: it needs Linux and a C compiler"
        return
    if "FAULT_ROOT" not in os.environ:
        with tempfile.TemporaryDirectory(dir=_memory()) as folder:
            library = Path(folder) / "faults.so"
            source = Path(__file__).with_name("faults.c")
            command = [compiler, "-shared", "-fPIC", "-O1", "-o", str(library), str(source), "-ldl"]
            subprocess.run(command, check=True)
            root = Path(folder) / "root"
            root.mkdir()
            loaded = {"LD_PRELOAD": str(library), "FAULT_ROOT": str(root)}
            again = [sys.executable, "-m", "tests.campaigns.faults", *sys.argv[1:]]
            sys.exit(subprocess.run(again, env=os.environ | loaded, check=False).returncode)
    root = Path(os.environ["FAULT_ROOT"])
    library_loaded = ctypes.CDLL(None)
    for seed in range(1 if is_short else LIVES):
        calls = _live(library_loaded, root, seed, 10**9, Fault.IO_ERROR, tally)
        tally.seen["system calls of a life"] = calls
        for fault in Fault:
            for number in range(1, calls + 1, SHORT_EVERY if is_short else 1):
                if tally.is_done(10**6):
                    return
                tally.tried += 1
                _live(library_loaded, root, seed, number, fault, tally)


def _live(
    library: ctypes.CDLL, root: Path, seed: int, number: int, fault: Fault, tally: Tally
) -> int:
    """Live once in a process of its own, with a fault at a call; return the number of calls."""
    where = f"life {seed}, call {number}, {fault.name.lower()}"
    folder = root / "life"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    told, tell = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(told)
        library.fault_arm(number, int(fault))
        code = _COMPLAINED
        try:
            problem = _work(library, folder, random.Random(seed), tell)
            os.write(tell, f"COUNT {library.fault_count()}\n{problem}".encode())
            code = _COMPLAINED if problem else 0
        except BaseException as error:
            os.write(tell, "".join(traceback.format_exception(error)[-3:]).encode())
        os._exit(code)
    os.close(tell)
    with os.fdopen(told, "rb") as pipe:
        lines = pipe.read().decode().split("\n")
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    tally.seen["ended by the fault"] += code == _DIED
    steps = [line for line in lines if line.startswith("STEP")]
    if code not in (0, _DIED):
        tally.fail(f"{where}: {' '.join(lines[-7:])} (exit {code})")
    # In the order of the pipe: the last step was begun, all before have returned.
    elif steps and (problem := _judge(folder, random.Random(seed), len(steps), code == _DIED)):
        tally.fail(f"{where}: {problem}")
    return next((int(line.split()[1]) for line in lines if line.startswith("COUNT")), 0)


def _work(library: ctypes.CDLL, folder: Path, chance: random.Random, tell: int) -> str:
    """Live; return what is wrong at the end.

    After a FileError, the session writes what it has kept, or the operation is done again.
    """
    try:
        session = Session.create(folder, life.EXAMPLE.rig, {}, "session", "wearer")
    except FileError:
        session = Session.create(folder, life.EXAMPLE.rig, {}, "again", "wearer")
    model = life.Model()
    for _ in range(OPERATIONS):
        operation = life.draw(chance, model)
        os.write(tell, b"STEP\n")
        possible = {model, life.after(model, operation)}
        try:
            session = life.do(session, operation)
        except FileError:
            library.fault_pause(1)  # the fault has been; what looks at the folder meets none
            if problem := life.complaint(session.path, possible):
                return f"after an error in {operation[0]}: {problem}"
            done = life.after(model, operation)
            if operation[0] in life.KEPT and life.found(session.contents) != done:
                return f"after an error in {operation[0]}: it is not kept in memory"
            session = _again(session, operation)
            if problem := life.complaint(session.path, {done}):
                return f"after {operation[0]} was done again: {problem}"
        model = life.after(model, operation)
    os.write(tell, b"STEP\n")
    session.close()
    library.fault_pause(1)
    return life.complaint(session.path, {model})


def _again(session: Session, operation: life.Operation) -> Session:
    """Have an operation that failed take effect."""
    if operation[0] == "reopen":
        return Session(session.path)
    if operation[0] in life.KEPT:
        session.write_waiting()
        return session
    return life.do(session, operation)


def _judge(folder: Path, chance: random.Random, steps: int, has_died: bool) -> str:
    """Return what is wrong with the folder that a life left behind."""
    model = before = life.Model()
    for _ in range(min(steps, OPERATIONS)):
        before, model = model, life.after(model, life.draw(chance, model))
    path = folder / ("again" if (folder / "again" / "journal.jsonl").exists() else "session")
    possible = {before, model} if has_died else {model}
    if problem := life.complaint(path, possible):
        return problem
    try:
        Session(path).close()
    except FileError as error:
        return f"cannot be continued: {error}"
    return life.complaint(path, possible)


def _memory() -> str | None:
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


if __name__ == "__main__":
    campaign("faults at system calls of a session", inject)
