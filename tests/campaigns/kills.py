"""kill -9 at random moments of a session's life; the next process goes on with what was left."""

from __future__ import annotations

import os
import random
import signal
import tempfile
import time
from pathlib import Path

from handcal.core.errors import FileError
from handcal.session.session import Session
from tests.campaigns import life
from tests.campaigns.campaign import Tally, campaign

KILLS, SHORT_KILLS = 1000, 12
KILLS_OF_A_SESSION = 12
LONGEST_S = 0.15


def kill(tally: Tally, is_short: bool) -> None:
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None
    chance = random.Random(0)
    with tempfile.TemporaryDirectory(dir=memory) as folder:
        while not tally.is_done(SHORT_KILLS if is_short else KILLS):
            path = Path(folder) / f"session-{tally.tried}"
            Session.create(path.parent, life.EXAMPLE.rig, {}, path.name).close()
            model: life.Model | None = life.Model()
            for _ in range(KILLS_OF_A_SESSION):
                if model is not None:
                    model = _kill_once(path, chance, model, tally)


def _kill_once(
    path: Path, chance: random.Random, model: life.Model, tally: Tally
) -> life.Model | None:
    """Go on with a session and kill it; return its contents, None after a failure."""
    seed, tally.tried = chance.random(), tally.tried + 1
    told, tell = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(told)
        try:
            _work(path, random.Random(seed), model, tell)
        except BaseException as error:
            os.write(tell, f"!{type(error).__name__}: {error}".encode())
        os._exit(1)
    os.close(tell)
    with os.fdopen(told, "rb") as pipe:
        begun = pipe.read(1)  # the session is open
        time.sleep(chance.uniform(0.0, LONGEST_S))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        steps = begun + pipe.read()
    if b"!" in steps:
        tally.fail(f"{path.name}: {steps[-200:].decode()}")
        return None
    before, again = model, random.Random(seed)
    for _ in range(steps.count(b"+")):
        before, model = model, life.after(model, life.draw(again, model))
    tally.seen["operations"] += steps.count(b"+")
    # The last operation may have returned or not: its model and that before it are possible.
    if problem := life.complaint(path, {before, model}):
        tally.fail(f"{path.name}: {problem}")
        return None
    record = Session.open(path)
    tally.seen["torn lines left behind"] += record.torn_bytes > 0
    tally.seen["temporary files left behind"] += len(list(path.rglob(".*")))
    return life.found(record)


def _work(path: Path, chance: random.Random, model: life.Model, tell: int) -> None:
    try:
        session = Session(path)
    except FileError as error:
        raise AssertionError(f"cannot be continued: {error}") from error
    os.write(tell, b"o")
    while True:
        operation = life.draw(chance, model)
        os.write(tell, b"+")
        session = life.do(session, operation)
        model = life.after(model, operation)


if __name__ == "__main__":
    campaign("kill -9 of a process that writes a session", kill)
