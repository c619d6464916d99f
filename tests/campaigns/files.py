"""Mutated files of every kind through the commands: no traceback, no hang, little memory.

The commands run in forked processes of this one, a batch in each.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TypeAlias

import cv2
import numpy as np

from handcal.camera.images import write_frame
from handcal.camera.recordings import record_frames
from handcal.cli.main import main
from handcal.core.errors import HandcalError
from handcal.core.geometry import rigid
from handcal.core.types import Intrinsics
from handcal.export.clouds import read_cloud
from handcal.io.resources import resource_path
from handcal.rig.formats import write_intrinsics
from handcal.sim.camera import SyntheticCamera
from handcal.sim.hand import make_hand
from handcal.sim.raster import D415
from handcal.sim.render import World
from handcal.sim.room import make_room
from handcal.sim.scene import SceneState
from tests.campaigns.campaign import Tally, campaign
from tests.campaigns.mutate import mutated

FILES, SHORT_FILES, BATCH = 20_000, 80, 100
SLOWEST_S, MOST_MB, ENDED_S = 5.0, 500, 20
IMPORTED = (
    *(f"handcal.cli.{name}" for name in ("evaluate", "recordings", "rig", "rig_files", "sessions")),
    "handcal.camera.playback", "handcal.cli.cameras",
    "handcal.cli.simulate", "handcal.export.export", "handcal.hand.shipped",
    "handcal.calibration.solve_again",
)  # fmt: skip
Words: TypeAlias = "list[str] | Callable[[], object]"
Case: TypeAlias = Callable[[Path, random.Random], Words]


class HangError(BaseException):
    """A command that did not end."""


def mutate_files(tally: Tally, is_short: bool) -> None:
    with tempfile.TemporaryDirectory() as folder:
        seeds = Path(folder) / "seeds"
        _make_seeds(seeds)
        cases = dict(_cases(seeds))
        for name in IMPORTED:  # once, before the forks
            import_module(name)
        number = 0
        while not tally.is_done(SHORT_FILES if is_short else FILES):
            number += 1
            work = Path(folder) / "work"
            shutil.rmtree(work, ignore_errors=True)
            work.mkdir()
            most_mb = _batch(cases, work, number, SHORT_FILES if is_short else BATCH, tally)
            tally.seen["MB at most"] = max(tally.seen["MB at most"], most_mb)
        tally.note = f"{len(cases)} kinds of input"


def _make_seeds(seeds: Path) -> None:
    """Write a sound file of every kind."""
    seeds.mkdir()
    rig = resource_path("example_rig.yaml")
    shutil.copy(rig, seeds / "rig.yaml")
    quarter = Intrinsics(
        D415.width // 4, D415.height // 4, D415.fx / 4, D415.fy / 4, D415.cx / 4, D415.cy / 4
    )
    still = SceneState(0, np.eye(4), rigid([0.1, 0.1, 0.05], [0.0, 0.02, 0.5]))
    world = World(make_hand(1), make_room(1))
    camera = SyntheticCamera(world, lambda: still, depth_intrinsics=quarter, seed=1)
    frames = [camera.read() for _ in range(3)]
    write_frame(seeds, frames[0])
    assert frames[0].color is not None
    cv2.imwrite(str(seeds / "color.jpg"), frames[0].color[..., ::-1])
    record_frames(seeds / "folder", iter(frames))
    with contextlib.suppress(HandcalError):  # no RealSense SDK
        later = [replace(one, index=place + 1) for place, one in enumerate(frames)]
        record_frames(seeds / "film.db3", iter(later))
    write_intrinsics(seeds / "opencv.yml", quarter, "opencv")
    write_intrinsics(seeds / "ros.yaml", quarter, "ros")
    write_intrinsics(seeds / "camera.json", quarter, "json")
    (seeds / "pairing.key").write_text('{"devices": [{"key": "' + "k" * 32 + '"}]}')
    header = "ply\nformat ascii 1.0\nelement vertex 40\n" + "".join(
        f"property float {axis}\n" for axis in "xyz"
    )
    points = "".join(f"0.0{n} 0.1 0.4\n" for n in range(40))
    (seeds / "cloud.ply").write_text(f"{header}end_header\n{points}")
    (seeds / "cloud.xyz").write_text(points)
    boxes = {"color.jpg": [[10.0, 10.0, 100.0, 100.0]]}
    (seeds / "boxes.json").write_text(json.dumps(boxes))
    with contextlib.suppress(ImportError):
        from handcal_gui.app.preferences import Preferences, PreferencesFile

        PreferencesFile(seeds / "preferences.json").save(Preferences())


def _cases(seeds: Path) -> Iterable[tuple[str, Case]]:
    """Give a case for every kind of input: from a folder and chance, the words of a command."""

    def one(name: str, kind: str, words: Callable[[str], Words]) -> Case:
        data = (seeds / name).read_bytes()

        def make(work: Path, chance: random.Random) -> Words:
            path = work / Path(name).name
            path.write_bytes(mutated(data, kind, chance))
            path.chmod(0o600)  # as keys must be
            return words(str(path))

        return make

    def pair(**changed: str) -> list[str]:
        files = {"color": "color.png", "depth": "depth.png", "intrinsics": "intrinsics.json"}
        paths = {name: changed.get(name, str(seeds / file)) for name, file in files.items()}
        words = [word for name, path in paths.items() for word in (f"--{name}", path)]
        return ["segment", *words, "--roi", "depth", "--output", "out"]

    def folder(work: Path, chance: random.Random) -> Words:
        copy = _copied(seeds / "folder", work / "folder")
        path = chance.choice(sorted(copy.iterdir()))
        kind = {".json": "json", ".csv": "text"}.get(path.suffix, "png")
        path.write_bytes(mutated(path.read_bytes(), kind, chance))
        return ["replay", str(copy), "--roi", "depth"]

    def session(words: Callable[[str], list[str]]) -> Case:
        def make(work: Path, chance: random.Random) -> Words:
            copy = _copied(resource_path("example_session"), work / "session")
            _mutate_session(copy, chance)
            return words(str(copy))

        return make

    def preferences(path: str) -> Callable[[], object]:
        from handcal_gui.app.preferences import PreferencesFile

        return lambda: PreferencesFile(Path(path)).load()

    headset = ["headset", "--port", "9", "--duration-s", "0", "--key-file"]
    yield "rig file", one("rig.yaml", "text", lambda path: ["rig", "check", path])
    for name, kind in (("opencv.yml", "text"), ("ros.yaml", "text"), ("camera.json", "json")):
        yield (
            f"intrinsics, {name}",
            one(name, kind, lambda p: ["rig", "convert", p, "new.json", "--format", "json"]),
        )
    yield "frame, intrinsics", one("intrinsics.json", "json", lambda p: pair(intrinsics=p))
    yield "frame, depth", one("depth.png", "png", lambda p: pair(depth=p))
    yield "frame, colour", one("color.png", "png", lambda p: pair(color=p))
    yield "frame, colour as JPEG", one("color.jpg", "binary", lambda p: pair(color=p))
    yield "recording, folder", folder
    if (seeds / "film.db3").exists():
        yield (
            "recording, db3",
            one("film.db3", "binary", lambda p: ["replay", p, "--roi", "depth"]),
        )
    yield "pairing key", one("pairing.key", "json", lambda path: [*headset, path])
    yield "session, solved", session(lambda path: ["solve", path])
    yield "session, checked", session(lambda path: ["session", "check", path])
    yield (
        "session, exported",
        session(lambda p: ["export", p, "--output", "out", "--format", "csv", "--format", "json"]),
    )
    for suffix in ("ply", "xyz"):
        yield f"cloud, {suffix}", one(f"cloud.{suffix}", "text", lambda p: lambda: read_cloud(p))
    yield (
        "detector's boxes",
        one(
            "boxes.json",
            "json",
            lambda p: ["evaluate", "detector", "--images", str(seeds), "--annotations", p],
        ),
    )
    if (seeds / "preferences.json").exists():
        yield "preferences", one("preferences.json", "json", preferences)


def _copied(source: Path, copy: Path) -> Path:
    shutil.rmtree(copy, ignore_errors=True)
    return Path(shutil.copytree(source, copy))


def _mutate_session(path: Path, chance: random.Random) -> None:
    """Mutate one file of a session; a hostile one has the right checksums."""
    whole = sorted(one for one in path.rglob("*") if one.is_file())
    target = chance.choice([*whole, *[path / "journal.jsonl"] * 4])
    before = target.read_bytes()
    journal = path / "journal.jsonl"
    if target == journal:
        lines = before.split(b"\n")
        place = chance.randrange(len(lines) - 1)
        body = mutated(lines[place][:-47] + b"}", "json", chance).replace(b"\n", b" ")
        lines[place] = _with_checksum(body)
        journal.write_bytes(b"\n".join(lines))
        return
    kinds = {".json": "json", ".npz": "binary"}
    after = mutated(before, kinds.get(target.suffix, "text"), chance)
    target.write_bytes(after)
    old, new = (hashlib.sha256(data).hexdigest().encode() for data in (before, after))
    lines = journal.read_bytes().split(b"\n")
    journal.write_bytes(
        b"\n".join(
            _with_checksum(line[:-47].replace(old, new) + b"}") if old in line else line
            for line in lines
        )
    )


def _with_checksum(content: bytes) -> bytes:
    digest = hashlib.sha256(content).hexdigest()[:32]
    return content[:-1] + b', "sha256": "' + digest.encode() + b'"}'


def _batch(cases: dict[str, Case], work: Path, number: int, size: int, tally: Tally) -> int:
    """Run mutations in a forked process; return the most memory of one, MB."""
    told, tell = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(told)
        try:
            _work(cases, work, random.Random(number), size, tell)
        except BaseException as error:
            os.write(
                tell, (json.dumps(["the campaign itself", repr(error), 0.0, 0]) + "\n").encode()
            )
        os._exit(0)
    os.close(tell)
    most_mb, begun = 0, ""
    with os.fdopen(told, "rb") as pipe:
        for line in pipe:
            name, problem, seconds, mb = json.loads(line)
            if problem is None:
                begun = name
                tally.tried += 1
                continue
            begun, most_mb = "", max(most_mb, mb)
            if problem not in ("read", "refused"):
                tally.fail(f"{name} (batch {number}): {problem}")
            elif seconds > SLOWEST_S or mb > MOST_MB:
                tally.fail(f"{name} (batch {number}): {seconds:.1f} s of processor, {mb} MB")
            else:
                tally.seen[problem] += 1
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code or begun:
        tally.fail(f"{begun} (batch {number}): the process ended with {code}")
    return most_mb


def _work(cases: dict[str, Case], work: Path, chance: random.Random, size: int, tell: int) -> None:
    """Run mutations; tell each before and after."""
    os.chdir(work)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)  # what native code prints
    for _ in range(size):
        name = chance.choice(sorted(cases))
        os.write(tell, (json.dumps([name, None, 0.0, 0]) + "\n").encode())
        result = _try(cases[name](work, chance))
        os.write(tell, (json.dumps([name, *result]) + "\n").encode())


def _try(words: Words) -> tuple[str, float, int]:
    """Run a command; return what came of it, its processor time and the most memory, MB."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")  # the greatest memory so far is forgotten
    start_s = time.process_time()
    signal.signal(signal.SIGALRM, _hang)
    signal.alarm(ENDED_S)
    try:
        problem = _run(words)
    except HangError:
        problem = f"no end within {ENDED_S} s"
    except BaseException as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        problem = f"{error!r:.150} at {Path(where.filename).name}:{where.lineno}"
    signal.alarm(0)
    status = Path("/proc/self/status").read_text().split("VmHWM:")[1]
    return problem, time.process_time() - start_s, int(status.split()[0]) // 1024


def _run(words: Words) -> str:
    """Run a command as the shell would; return what came of it."""
    if callable(words):
        try:
            words()
        except HandcalError:
            return "refused"
        return "read"
    out, told = io.StringIO(), io.StringIO()
    sys.argv = ["handcal", *words]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(told):
        try:
            main()
            code: object = 0
        except SystemExit as error:
            code = error.code or 0
    lines = told.getvalue().splitlines()
    if code in (1, 2) and not lines and words[:2] == ["session", "check"]:
        return "read"  # the damage is its output
    if code == 0:
        return "read" if not lines else f"several lines: {told.getvalue()[:200]}"
    if len(lines) != 1 or not lines[0].startswith("handcal: "):
        return f"not one line, code {code}: {told.getvalue()[-200:]}"
    return "refused"


def _hang(*_: object) -> None:
    raise HangError


if __name__ == "__main__":
    campaign("mutated files through the commands", mutate_files)
