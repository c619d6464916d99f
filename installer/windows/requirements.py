"""Writes what the Windows setup carries, from the locks of the program without and with Open3D.

    python installer/windows/requirements.py LOCK OPEN3D_LOCK FOLDER

It writes requirements.txt, requirements-open3d.txt (what Open3D needs in addition) and tools.txt
(uv). The locks hold all platforms; pip judges their markers by the computer on which it runs.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from packaging.markers import Marker

PYTHON = "3.13"
"""The Python of the setup; before 3.13, time on Windows advances in steps of 15.6 ms."""
_WINDOWS = {
    "os_name": "nt",
    "sys_platform": "win32",
    "platform_system": "Windows",
    "platform_machine": "AMD64",
    "platform_python_implementation": "CPython",
    "implementation_name": "cpython",
    "python_version": PYTHON,
    "python_full_version": f"{PYTHON}.0",
}
_PROGRAM = "handcal (pyproject.toml)"


def windows_blocks(lock: str) -> dict[str, str]:
    """Return the requirements, with hashes, that apply on Windows, by the packages' names."""
    blocks = {}
    for block in re.split(r"^(?=[^\s#])", lock, flags=re.MULTILINE):
        head = re.match(r"([\w.-]+)==\S+( ; [^\\\n]+?)?(?= \\?$)", block, re.MULTILINE)
        if head is None or (head[2] and not Marker(head[2][3:]).evaluate(_WINDOWS)):
            continue
        blocks[head[1]] = block.replace(head[2] or "", "", 1)
    return blocks


def needed(blocks: dict[str, str]) -> set[str]:
    """Return the packages that the program needs, directly or in turn."""
    users = {
        name: re.findall(r"^    #(?: via|  ) +(\S.*)$", block, re.MULTILINE)
        for name, block in blocks.items()
    }
    found = {_PROGRAM}
    while new := {name for name in blocks if found & set(users[name])} - found:
        found |= new
    return found - {_PROGRAM}


if __name__ == "__main__":
    blocks, with_open3d = (windows_blocks(Path(lock).read_text("utf-8")) for lock in sys.argv[1:3])
    folder = Path(sys.argv[3])
    program = needed(blocks)
    added = needed(with_open3d) - program
    for name, chosen in {
        "requirements.txt": [block for name, block in blocks.items() if name in program],
        "requirements-open3d.txt": [with_open3d[name] for name in sorted(added)],
        "tools.txt": [blocks["uv"]],
    }.items():
        (folder / name).write_text("".join(chosen), "utf-8")
