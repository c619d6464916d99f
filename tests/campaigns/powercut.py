"""Power cuts on ext4, xfs and btrfs: the disk is copied at once when an operation has returned.

Needs root, loop devices and the file systems' mkfs; what is missing is named and not run.
"""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import tempfile
from pathlib import Path

from handcal.io.files import make_folder, write_atomic
from handcal.session.session import Session
from tests.campaigns import life
from tests.campaigns.campaign import Tally, campaign

CUTS, SHORT_CUTS = 40, 1
SYSTEMS = "ext4", "xfs", "btrfs"
_MB = {"ext4": 128, "xfs": 320, "btrfs": 256}


def cut(tally: Tally, is_short: bool) -> None:
    left_out = []
    for system in SYSTEMS[:1] if is_short else SYSTEMS:
        with tempfile.TemporaryDirectory() as folder:
            disk = Path(folder) / "disk"
            if not _make(disk, system):
                left_out.append(system)
                continue
            mounted = make_folder(Path(folder) / "mounted")
            if not _mount(disk, mounted):
                left_out.append(system)
                continue
            try:
                for number in range(SHORT_CUTS if is_short else CUTS):
                    _cut_once(system, disk, mounted, number, tally)
            finally:
                _call("umount", mounted)
    if left_out:
        tally.note = f"not run here (root, a loop device or mkfs is missing): {', '.join(left_out)}"


def _cut_once(system: str, disk: Path, mounted: Path, number: int, tally: Tally) -> None:
    tally.tried += 1
    tally.seen[f"on {system}"] += 1
    chance = random.Random(number)
    session = Session.create(mounted / f"p{number}", life.EXAMPLE.rig, {}, "session")
    model = life.Model()
    for _ in range(chance.randint(1, 6)):
        operation = life.draw(chance, model)
        session = life.do(session, operation)
        model = life.after(model, operation)
    other = make_folder(mounted / f"x{number}" / "deep") / "other.json"
    write_atomic(other, b"content")  # an export, a rig, a key: whatever is said to be saved
    copy = disk.with_name("copy")
    _call("cp", "--sparse=always", disk, copy)
    session.close()
    if system == "btrfs":  # two disks of one identity cannot be mounted at once
        _call("umount", mounted)
    after = make_folder(disk.with_name("after"))
    if not _mount(copy, after, "nouuid" if system == "xfs" else ""):
        tally.fail(f"{system}, cut {number}: the disk cannot be mounted")
    else:
        path = after / f"p{number}" / "session"
        if problem := life.complaint(path, {model}):
            tally.fail(f"{system}, cut {number}: {problem}")
        found = after / other.relative_to(mounted)
        if not found.exists() or found.read_bytes() != b"content":
            tally.fail(f"{system}, cut {number}: another file that was saved is lost")
        _call("umount", after)
    if system == "btrfs":
        _call("btrfs", "device", "scan", "--forget")
        if not _mount(disk, mounted):
            raise RuntimeError("the disk cannot be mounted again")
    if chance.random() < 0.3:
        os.sync()


def _make(disk: Path, system: str) -> bool:
    if os.geteuid() != 0 or shutil.which(f"mkfs.{system}") is None:
        return False
    with disk.open("wb") as file:
        file.truncate(_MB[system] * 2**20)
    return _call(f"mkfs.{system}", "-q", disk)


def _mount(disk: Path, folder: Path, *options: str) -> bool:
    return _call("mount", "-o", ",".join(["loop", *filter(None, options)]), disk, folder)


def _call(*words: str | Path) -> bool:
    return subprocess.run(words, capture_output=True, check=False).returncode == 0


if __name__ == "__main__":
    campaign("power cuts", cut)
