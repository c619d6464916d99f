"""Draws the packages and the threads of handcal (SVG) for docs/architecture.md.

    python docs/code_drawings.py    # rewrites docs/pictures/packages.svg and threads.svg

The packages are read from `.importlinter` and their docstrings, so the picture cannot differ from
what `lint-imports` checks. The threads are listed here: no program can tell what a queue is for.
"""

from __future__ import annotations

import ast
import configparser
import textwrap
from html import escape
from pathlib import Path

ROOT = Path(__file__).parent.parent
PICTURES = ROOT / "docs" / "pictures"
_WIDTH, _ROW = 860, 66
_FRAME_S_WAY = {"camera", "hand", "calibration", "register", "station", "link", "session"}
"""Packages that a frame passes between the camera and the headset."""


def layers() -> list[list[str]]:
    """Return the packages of `handcal`, from top to bottom, as `.importlinter` has them."""
    contracts = configparser.ConfigParser()
    contracts.read(ROOT / ".importlinter", "utf-8")
    rows = contracts["importlinter:contract:layers"]["layers"].split("\n")
    return [row.replace(":", "|").replace(" ", "").split("|") for row in rows if row.strip()]


def purpose(package: str) -> str:
    """Return the first sentence of a package's docstring."""
    source = (ROOT / "handcal" / package / "__init__.py").read_text("utf-8")
    text = ast.get_docstring(ast.parse(source)) or ""
    return text.partition("\n\n")[0].replace("\n", " ")


def packages_svg() -> str:
    """Return the drawing of the packages: each may import those below it."""
    parts = []
    for row, packages in enumerate(layers()):
        width = (_WIDTH - 20 - 12 * (len(packages) - 1)) / len(packages)
        for column, package in enumerate(packages):
            fill = "#d5e8d4" if package in _FRAME_S_WAY else "#eef2f6"
            x = 10 + column * (width + 12)
            parts.append(
                _box(x, 10 + row * _ROW, width, _ROW - 14, fill, package, purpose(package))
            )
    return _svg(_WIDTH, 10 + _ROW * len(layers()), parts)


THREADS = {
    "driver": (10, 130, 190, "camera's driver", "fills a queue that holds the newest frames"),
    "engine": (290, 130, 240, "engine's thread", "owns the station; one step for each frame"),
    "window": (620, 130, 230, "GUI thread", "shows the newest snapshot; never waits"),
    "link": (290, 300, 240, "link's thread", "reads and writes the UDP socket"),
    "jobs": (620, 300, 230, "thread of a job", "export, solve again, rig: with progress"),
    "bridge": (10, 300, 190, "thread of a bridge", "OpenIGTLink, Lab Streaming Layer"),
    "headset": (290, 440, 240, "headset, or virtual headset", "another device, or process"),
}
"""Each thread's or process's place and width, its name, and what it does."""
QUEUES = (
    ("driver", "engine", 0, "frames"),
    ("window", "engine", -14, "commands (queue)"),
    ("engine", "window", 14, "newest snapshot (slot)"),
    ("engine", "link", -40, "outbox"),
    ("link", "engine", 40, "poses, confirmations"),
    ("link", "headset", -40, "datagrams"),
    ("headset", "link", 40, "datagrams"),
    ("window", "jobs", -40, "start, cancel"),
    ("jobs", "window", 40, "progress"),
    ("engine", "bridge", -70, "items (bounded)"),
)
"""Source, target, how far the arrow is moved aside (px), and the content of each queue."""
_HIGH = 62


def threads_svg() -> str:
    """Return the drawing of the threads and processes, and of what passes between them."""
    parts = [
        "<defs><marker id='end' markerWidth='9' markerHeight='9' refX='8' refY='4' orient='auto'>"
        "<path d='M0,0 L9,4 L0,8 z' fill='#444'/></marker></defs>"
    ]
    for source, target, shift, label in QUEUES:
        (x0, y0, w0, *_), (x1, y1, w1, *_) = THREADS[source], THREADS[target]
        if y0 == y1:  # side by side
            ends = (x0 + w0, x1) if x0 < x1 else (x0, x1 + w1)
            y = y0 + _HIGH / 2 + shift
            parts.append(_arrow(ends[0], y, ends[1], y))
            # Between the boxes there is no room for words: they stand above or below.
            above = y0 - 12 if shift <= 0 else y0 + _HIGH + 22
            parts.append(_text(sum(ends) / 2, above, label, 13, "text-anchor='middle'"))
        else:
            down = y1 > y0
            tops = (y0 + _HIGH, y1) if down else (y0, y1 + _HIGH)
            x_from, x_to = x0 + w0 / 2 + shift, x1 + w1 / 2 + shift
            parts.append(_arrow(x_from, tops[0], x_to, tops[1]))
            side = "end" if shift < 0 else "start"
            x, y = (x_from + x_to) / 2, sum(tops) / 2 + (14 if down else -6)
            y -= 20 if x_from != x_to else 0  # clear of a slanting arrow
            parts.append(
                _text(x + (-8 if side == "end" else 8), y, label, 13, f"text-anchor='{side}'")
            )
    for x, y, width, name, does in THREADS.values():
        parts.append(_box(x, y, width, _HIGH, "#eef2f6", name, does))
    parts.append(_text(10, 40, "One program, seen by its threads: nothing slower than a frame", 15))
    parts.append(
        _text(10, 62, "runs in the GUI thread, and only the engine's thread calls the station.", 15)
    )
    return _svg(_WIDTH, 520, parts)


def _box(x: float, y: float, width: float, height: float, fill: str, name: str, does: str) -> str:
    lines = textwrap.wrap(does, max(12, int((width - 20) / 6.4)))[:2]
    frame = f"x='{x:.1f}' y='{y:.1f}' width='{width:.1f}' height='{height:.1f}' rx='4'"
    text = _text(x + 10, y + 18, name, 14, "font-weight='bold'")
    rows = "".join(_text(x + 10, y + 34 + 14 * i, line, 12) for i, line in enumerate(lines))
    return f"<rect {frame} fill='{fill}' stroke='#445'/>{text}{rows}"


def _arrow(x0: float, y0: float, x1: float, y1: float) -> str:
    ends = f"x1='{x0:.1f}' y1='{y0:.1f}' x2='{x1:.1f}' y2='{y1:.1f}'"
    return f"<line {ends} stroke='#444' stroke-width='1.5' marker-end='url(#end)'/>"


def _text(x: float, y: float, text: str, size_px: int, more: str = "") -> str:
    place = f"x='{x:.1f}' y='{y:.1f}' font-family='sans-serif' font-size='{size_px}' {more}"
    return f"<text {place} fill='#222'>{escape(text)}</text>"


def _svg(width: float, height: float, parts: list[str]) -> str:
    size = f"width='{width:.0f}' height='{height:.0f}' viewBox='0 0 {width:.0f} {height:.0f}'"
    paper = f"<rect width='{width:.0f}' height='{height:.0f}' fill='#fff'/>"
    body = "\n".join([paper, *parts])
    return f"<svg xmlns='http://www.w3.org/2000/svg' {size}>\n{body}\n</svg>\n"


def main() -> None:
    """Write both drawings."""
    (PICTURES / "packages.svg").write_text(packages_svg(), "utf-8")
    (PICTURES / "threads.svg").write_text(threads_svg(), "utf-8")


if __name__ == "__main__":
    main()
