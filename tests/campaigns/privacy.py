"""A whole calibration watched: no datagram leaves the machine, no name of a wearer its session.

strace follows every process. The folders of the user are fresh, so that any file shows.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.campaigns.campaign import Tally, campaign
from tests.helpers import FOLDERS, SILENCERS, write_small_rig

WEARER = "Zdenka Quorvath"
WINDOWS_WEARER = "Demonstration"
"""The name that the window's demonstration calibrates; the command line is given one."""
CALLS = "connect,sendto,sendmsg,sendmmsg"
_ADDRESS = re.compile(
    r'sin_addr=inet_addr\("([^"]+)"\)|inet_pton\(AF_INET6, "([^"]+)"|sa_family=(AF_[A-Z0-9]+)'
)
_LOCAL = ("127.", "::1", "AF_UNIX", "AF_NETLINK", "AF_INET", "AF_UNSPEC")


def watch(tally: Tally, is_short: bool) -> None:
    if shutil.which("strace") is None:
        tally.note = "not run: it needs strace"
        return
    window = ["handcal_gui", "--autopilot", "--output", "output"]
    command = [
        *("handcal", "run", "--headset", "virtual", "--camera", "simulator", "--rig", "rig.yaml"),
        *("--wearer", WEARER, "--output", "output", "--json", "output/result.json"),
    ]
    programs = [] if is_short else [("window", window, WINDOWS_WEARER)]
    for name, words, wearer in [*programs, ("command", command, WEARER)]:
        with tempfile.TemporaryDirectory() as folder:
            _watch_one(name, words, wearer, Path(folder), tally)


def _watch_one(name: str, words: list[str], wearer: str, folder: Path, tally: Tally) -> None:
    tally.tried += 1
    environment = {key: value for key, value in os.environ.items() if key not in SILENCERS}
    for variable, place in FOLDERS.items():
        (folder / place).mkdir()
        environment[variable] = str(folder / place)
    environment |= {"QT_QPA_PLATFORM": "offscreen", "PYTHONPATH": str(Path().absolute())}
    (folder / "output").mkdir()
    write_small_rig(folder / "rig.yaml")
    trace = folder / "trace"
    command = [
        *("strace", "--seccomp-bpf", "-f", "-qq", "-e", f"trace={CALLS}", "-o", str(trace)),
        *(sys.executable, "-m", *words),
    ]
    run = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    if run.returncode != 0:
        tally.fail(f"{name}: {run.stderr[-300:]}")
    if wearer in run.stderr:
        tally.fail(f"{name}: it printed the wearer's name")
    with trace.open(errors="replace") as lines:
        for line in lines:
            tally.seen["calls of the network"] += 1
            for found in _ADDRESS.finditer(line):
                address = next(filter(None, found.groups()))
                if not address.startswith(_LOCAL):
                    tally.fail(f"{name}: {line[:200]}")
    trace.unlink()
    journals = list(folder.rglob("journal.jsonl"))
    if not any(wearer in path.read_text() for path in journals):
        tally.fail(f"{name}: no session has the wearer's name, so that nothing was looked for")
    for path in folder.rglob("*"):
        place = str(path.relative_to(folder))
        if wearer in place:
            tally.fail(f"{name}: the wearer's name is in a path: {place}")
        if not path.is_file() or place == "rig.yaml":
            continue
        tally.seen["files"] += 1
        in_output = place.startswith("output/")
        if not in_output and not place.startswith("config/handcal/"):
            tally.fail(f"{name}: wrote {place}")
        # Only sessions and their exports may hold the name.
        may_name = in_output and any(
            (up / "journal.jsonl").exists() or up.name.endswith("-export") for up in path.parents
        )
        if wearer.split()[-1].encode() in path.read_bytes() and not may_name:
            tally.fail(f"{name}: the wearer's name is in {place}")


if __name__ == "__main__":
    campaign("privacy: sockets and files of a calibration", watch)
