"""Draws the method, the tutorial's arrangements and the mount of the depth camera (SVG; STL).

    python docs/drawings.py                          # rewrites docs/pictures/*.svg
    python docs/drawings.py --mount FOLDER --tilt-deg 15 --holes-mm 45

The mount is a foot that is strapped to the headset's brow, and an upright plate with two slots for
the screws in the depth camera's back. Measure the camera and the headset; nothing here was tried on
a device.
"""

from __future__ import annotations

import argparse
import math
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from itertools import product
from pathlib import Path
from typing import TypeAlias

Point: TypeAlias = tuple[float, float, float]
Triangle: TypeAlias = tuple[Point, Point, Point]
PICTURES = Path(__file__).parent / "pictures"
_FONT, _INK = "font-family='sans-serif'", "fill='#222'"


@dataclass(frozen=True)
class Mount:
    """Measures of the mount; the defaults are for the outer size of a D435, 90 × 25 × 25 mm."""

    width_mm: float = 90.0
    """Width of the camera."""
    height_mm: float = 25.0
    """Height of the camera."""
    holes_mm: float = 45.0
    """Distance of the screw holes in the camera's back: measure it."""
    screw_mm: float = 3.4
    """Width of the slots: the screw's diameter and some room."""
    depth_mm: float = 40.0
    """Length of the foot on the headset's brow: measure it."""
    thick_mm: float = 4.0
    tilt_deg: float = 15.0
    """Rotation of the camera downwards from the brow."""

    def __post_init__(self) -> None:
        if min(getattr(self, one.name) for one in fields(self) if one.name != "tilt_deg") <= 0:
            raise ValueError("every length must be positive")
        if not self.holes_mm + 2 * self.screw_mm < self.width_mm:
            raise ValueError("the holes must lie within the camera's width")
        if not 2.5 * self.screw_mm < self.height_mm:
            raise ValueError("the slots must be lower than the camera")
        if not 0 <= self.tilt_deg <= 45:
            raise ValueError("the tilt must lie between 0 and 45°")


def mount_triangles(mount: Mount) -> list[Triangle]:
    """Return the closed surface of the mount, seen from outside counterclockwise, in mm.

    x to the right, y to the front along the brow, z up.
    """
    half, slot, t = mount.width_mm / 2, mount.screw_mm / 2, mount.thick_mm
    hole, top = mount.holes_mm / 2, t + mount.height_mm
    low = t + mount.height_mm / 4
    x = [-half, -hole - slot, -hole + slot, hole - slot, hole + slot, half]
    y = [0.0, mount.depth_mm - t, mount.depth_mm]
    z = [0.0, t, low, top - mount.height_mm / 4, top]

    def is_filled(i: int, j: int, k: int) -> bool:
        if not (0 <= i < len(x) - 1 and 0 <= j < len(y) - 1 and 0 <= k < len(z) - 1):
            return False
        is_slot = i in (1, 3) and k == 2
        return k == 0 or (j == 1 and not is_slot)

    def place(i: int, j: int, k: int) -> Point:
        # The foot's underside is a wedge: on a level brow the camera looks down.
        down = math.tan(math.radians(mount.tilt_deg)) * y[j] if k == 0 else 0.0
        height = z[k] if k else -(math.tan(math.radians(mount.tilt_deg)) * y[-1] - down)
        return x[i], y[j], height

    cells = product(range(len(x) - 1), range(len(y) - 1), range(len(z) - 1))
    return [
        triangle
        for cell in cells
        if is_filled(*cell)
        for axis in range(3)
        for side in (0, 1)
        if not is_filled(*(n + (2 * side - 1) * (a == axis) for a, n in enumerate(cell)))
        for triangle in _face(cell, axis, side, place)
    ]


def _face(
    cell: tuple[int, ...], axis: int, side: int, place: Callable[..., Point]
) -> Iterator[Triangle]:

    u, v = (axis + 1) % 3, (axis + 2) % 3
    around = []
    for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
        corner = list(cell)
        corner[axis] += side
        corner[u] += du
        corner[v] += dv
        around.append(place(*corner))
    a, b, c, d = around if side else around[::-1]
    yield a, b, c
    yield a, c, d


def write_stl(path: Path, triangles: list[Triangle]) -> None:
    """Write a binary STL file in mm."""
    with path.open("wb") as file:
        file.write(b"handcal mount, mm".ljust(80) + struct.pack("<I", len(triangles)))
        for triangle in triangles:
            # Zero normals: programs compute them from the order of the corners.
            file.write(struct.pack("<12fH", 0, 0, 0, *(x for point in triangle for x in point), 0))


def mount_svg(mount: Mount) -> str:
    """Return the drawing of the mount: from the front and from the side, 3 px per mm."""
    s, t, high = 3.0, mount.thick_mm, mount.height_mm + mount.thick_mm
    wedge = math.tan(math.radians(mount.tilt_deg)) * mount.depth_mm
    x0, y0 = 40.0, 50.0
    parts = [_box(x0, y0, s * mount.width_mm, s * high, "")]
    slot_y = y0 + s * mount.height_mm / 4
    for sign in (-1, 1):
        middle = x0 + s * (mount.width_mm + sign * mount.holes_mm) / 2
        width = s * mount.screw_mm
        parts.append(_box(middle - width / 2, slot_y, width, s * mount.height_mm / 2, "", "#fff"))
    parts.append(_text(x0, y0 - 12, f"front: width {mount.width_mm:g} mm"))
    below = y0 + s * (high + wedge) + 24
    parts.append(_text(x0, below, f"slots {mount.holes_mm:g} mm apart, {mount.screw_mm:g} mm wide"))
    x1 = x0 + s * mount.width_mm + 70
    base, foot = y0 + s * high, s * mount.depth_mm
    side = [
        (x1, base - s * t),
        (x1 + foot - s * t, base - s * t),
        (x1 + foot - s * t, y0),
        (x1 + foot, y0),
        (x1 + foot, base),
        (x1, base + s * wedge),
    ]
    corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in side)
    parts.append(f"<polygon points='{corners}' fill='#dde6f0' stroke='#222'/>")
    parts.append(_text(x1, y0 - 12, f"side: plate {high:g} mm high, {t:g} mm thick"))
    parts.append(_text(x1, below, f"foot {mount.depth_mm:g} mm, tilt {mount.tilt_deg:g}°"))
    return _svg(x1 + max(foot, 230) + 20, below + 20, parts)


HAND = (
    "M30,130 L30,95 Q8,75 4,58 Q2,48 10,50 Q18,52 24,66 L30,70 L24,22 Q23,12 31,12 Q38,12 39,22"
    " L44,58 L43,8 Q43,-2 51,-2 Q59,-2 59,8 L60,58 L66,14 Q68,5 75,6 Q82,8 80,17 L74,62 L84,34"
    " Q88,26 94,29 Q100,32 97,40 L84,84 Q80,98 72,104 L72,130"
)
"""Outline of an open hand, 100 px wide and 130 px high."""
ALIGNMENT = (
    ("1. Raise the hand", "The depth camera measures it.", (95, 40), None),
    ("2. The outline freezes", "The cursor is drawn for C0: beside.", (95, 40), (130, 24)),
    ("3. Align and confirm", "The hand goes under the cursor.", (130, 24), (130, 24)),
    ("4. Solved: the eye's shift φ", "The outline now lies on the hand.", (95, 40), (95, 40)),
)
"""Title and caption of each picture, the place of the hand, and that of the drawn outline."""


def alignment_svg() -> str:
    """Return the drawing of one alignment as the wearer sees it, in four pictures."""
    parts = []
    for i, (title, caption, hand, outline) in enumerate(ALIGNMENT):
        x, y = 10 + 300 * (i % 2), 10 + 250 * (i // 2)
        parts.append(_box(x, y, 280, 180, "", "#f4f6f8") + _hand(x, y, hand, "#e3b899", "#b98b6c"))
        if outline:
            parts.append(_hand(x, y, outline, "none", "#0072b2' stroke-width='4"))
        parts.append(_text(x, y + 202, title, "font-size='16' font-weight='bold'"))
        parts.append(_text(x, y + 223, caption, "font-size='15'"))
    return _svg(600, 502, parts)


def _hand(x: float, y: float, place: tuple[int, int], fill: str, stroke: str) -> str:
    move = f"transform='translate({x + place[0]} {y + place[1]})'"
    return f"<path d='{HAND}' {move} fill='{fill}' stroke='{stroke}' stroke-linejoin='round'/>"


def frames_svg() -> str:
    """Return the drawing of the model with its frames, from the side and not to scale."""
    C0, C1, V, H, D, W = (165, 240), (203, 282), (172, 205), (170, 110), (215, 62), (30, 400)
    pixel, s, d = (590, 148), (460, 193), (420, 185)
    parts = [
        _line((590, 70), (590, 350), "#222' stroke-width='3"),
        _line(C0, pixel, "#0072b2"),
        _line(C1, pixel, "#b5541c"),
        _line(C0, C1, "#222", is_arrow=True),
        _line(H, W, "#888", is_arrow=True),
        _line(D, H, "#888", is_arrow=True),
        _line(H, V, "#888", is_arrow=True),
        _line((165, 330), (590, 330), "#888", is_arrow=True),
    ]
    parts += [_dot(*p) for p in (C0, C1, V, H, D, W)]
    parts += [_dot(*pixel), _dot(*d, "#0072b2"), _dot(*s, "#b5541c")]
    labels = (
        (C0, -10, 20, "C0, E", "end"),
        (C1, 8, 20, "C1: the wearer's eye", "start"),
        (V, 12, 2, "V: draws", "start"),
        (H, 14, 10, "H: headset", "start"),
        (D, 12, 0, "D: depth camera", "start"),
        (W, 10, 20, "W: world (the room)", "start"),
        ((184, 261), 8, -4, "φ", "start"),
        (d, -6, -12, "d: the cursor's point", "end"),
        (s, -40, 34, "s: the hand's point", "start"),
        (pixel, -8, -18, "one pixel", "end"),
        ((590, 70), 0, -12, "S: virtual screen", "end"),
        ((377, 330), 0, 22, "z(C0→S)", "middle"),
        ((171, 160), 8, 4, "T_V_H", "start"),
        ((193, 86), -8, 0, "T_H_D", "end"),
        ((90, 276), -8, 0, "T_W_H", "end"),
    )
    for (x, y), dx, dy, label, anchor in labels:
        parts.append(_text(x + dx, y + dy, label, f"font-size='15' text-anchor='{anchor}'"))
    return _svg(620, 440, [_ARROW, *parts])


def head_svg() -> str:
    """Return the drawing of the devices on the head, from the side, as in the example rig."""
    camera, eye = (236, 66), (188, 178)
    look = math.radians(15)
    wide = math.radians(20)
    parts = [
        "<path d='M200,260 Q188,300 150,300 L60,300 L60,250 Q20,180 60,110 Q110,50 170,90"
        " Q200,120 198,170 L216,206 L200,214 z' fill='#e3b899' stroke='#b98b6c'/>",
        _box(40, 104, 180, 26, "", "#c9d3de"),
        _box(196, 112, 34, 34, ""),
        _line((226, 146), (256, 214), "#222' stroke-width='4"),
        _line((216, 110), (228, 78), "#222' stroke-width='4"),
        f"<rect x='-16' y='-12' width='32' height='24' fill='#dde6f0' stroke='#222'"
        f" transform='translate({camera[0]} {camera[1]}) rotate(15)'/>",
        _dot(*eye),
    ]
    for angle in (look - wide, look, look + wide):
        end = camera[0] + 300 * math.cos(angle), camera[1] + 300 * math.sin(angle)
        dashes = "#888' stroke-dasharray='5 4" if angle == look else "#888"
        parts.append(_line(camera, end, dashes))
    parts.append(_line(eye, (474, 178), "#0072b2"))
    parts.append(_hand(392, 108, (0, 0), "#e3b899", "#b98b6c"))
    parts.append(_line((188, 330), (440, 330), "#888", is_arrow=True))
    parts.append(_line((20, 178), (20, 66), "#888", is_arrow=True))
    labels = (
        (262, 26, "D: depth camera, 15° down", "start"),
        (40, 96, "H: headset", "start"),
        (180, 170, "eye", "end"),
        (264, 224, "display", "start"),
        (314, 352, "hand at 0.4 to 0.6 m", "middle"),
        (28, 74, "7 cm above the eye", "start"),
    )
    parts += [_text(x, y, words, f"font-size='15' text-anchor='{a}'") for x, y, words, a in labels]
    return _svg(540, 370, [_ARROW, *parts])


METHOD = {"alignment": alignment_svg, "frames": frames_svg, "head": head_svg}
"""The drawings of the method, by their names."""
_ARROW = (
    "<defs><marker id='end' markerWidth='9' markerHeight='9' refX='8' refY='4' orient='auto'>"
    "<path d='M0,0 L9,4 L0,8 z' fill='#444'/></marker></defs>"
)


def _line(
    start: tuple[float, float], end: tuple[float, float], stroke: str, *, is_arrow: bool = False
) -> str:
    ends = f"x1='{start[0]:.1f}' y1='{start[1]:.1f}' x2='{end[0]:.1f}' y2='{end[1]:.1f}'"
    head = " marker-end='url(#end)'" if is_arrow else ""
    return f"<line {ends} stroke='{stroke}'{head}/>"


def _dot(x: float, y: float, fill: str = "#222") -> str:
    return f"<circle cx='{x}' cy='{y}' r='5' fill='{fill}'/>"


ARRANGEMENTS = {
    "setup-stereo": (
        "Depth and headset camera:\none board, seen by both",
        [(20, 60, "depth\ncamera D"), (20, 116, "headset\ncamera H")],
        [(316, 88, "board")],
        "0.3 to 0.6 m",
    ),
    "setup-viewpoint": (
        "Viewpoint camera alone:\nfocus as behind the display",
        [(20, 88, "viewpoint\ncamera C")],
        [(316, 88, "board")],
        "all parts of the view, tilted",
    ),
    "setup-board": (
        "Display off: the camera unmoved,\nthe headset tracks the board",
        [(20, 60, "headset H\ntracks"), (20, 116, "viewpoint\ncamera C")],
        [(168, 106, "combiner\n(off)"), (316, 88, "board")],
        "several distances, tilted",
    ),
    "setup-display": (
        "Display: the viewpoint camera\nin the eye's place, dark room",
        [(20, 88, "viewpoint\ncamera C")],
        [(168, 88, "combiner"), (316, 88, "virtual\ngrid")],
        "focus at the virtual image",
    ),
    "setup-accept": (
        "Acceptance: after the grid,\nthe board at several distances",
        [(20, 60, "depth\ncamera D"), (20, 116, "viewpoint\ncamera C")],
        [(168, 106, "combiner\n(off)"), (316, 88, "board")],
        "0.35 to 0.65 m",
    ),
    "setup-cube": (
        "Cube in the room:\ntracked by D, drawn by the headset",
        [(20, 60, "depth\ncamera D"), (20, 116, "eye, or\ncamera C")],
        [(168, 106, "combiner"), (316, 88, "cube")],
        "0.4, 0.5, 0.6 m",
    ),
}
BOX_PX = 104, 44
"""Size of a camera or thing of an arrangement."""


def arrangement_svg(name: str) -> str:
    """Return the drawing of an arrangement, seen from the side.

    It is narrow, so that its text is as large as the window's where two stand side by side.
    """
    title, lookers, things, distance = ARRANGEMENTS[name]
    width, height = BOX_PX
    parts = [_lines(20, 32, title)]
    x_end, y_end, _ = things[-1]
    for x, y, _ in lookers:
        line = f"x1='{x + width}' y1='{y + height / 2:g}' x2='{x_end}' y2='{y_end + height / 2:g}'"
        parts.append(f"<line {line} stroke='#888' stroke-dasharray='5 4'/>")
    for x, y, label in (*lookers, *things):
        parts.append(_box(x, y, width, height, "") + _lines(x + 10, y + height / 2, label))
    parts.append(_text(x_end + width, 173, distance, "font-size='15' text-anchor='end'"))
    return _svg(440, 190, parts)


def _lines(x: float, y: float, text: str) -> str:
    """Return the large text of an arrangement, its lines centred at a height."""
    lines = text.split("\n")
    top = y + 5 - 9 * (len(lines) - 1)
    return "".join(_text(x, top + 18 * i, one, "font-size='15'") for i, one in enumerate(lines))


def _box(x: float, y: float, width: float, height: float, label: str, fill: str = "#dde6f0") -> str:
    box = f"<rect x='{x:.1f}' y='{y:.1f}' width='{width:.1f}' height='{height:.1f}'"
    box += f" fill='{fill}' stroke='#222'/>"
    return box + (_text(x + 10, y + height / 2 + 5, label) if label else "")


def _text(x: float, y: float, text: str, size: str = "font-size='13'") -> str:
    return f"<text x='{x:.1f}' y='{y:.1f}' {_FONT} {size} {_INK}>{text}</text>"


def _svg(width: float, height: float, parts: list[str]) -> str:
    size = f"width='{width:.0f}' height='{height:.0f}' viewBox='0 0 {width:.0f} {height:.0f}'"
    # In numbers: Qt, which shows them in the window, draws shares of the size wrongly.
    paper = f"<rect width='{width:.0f}' height='{height:.0f}' fill='#fff'/>"
    body = "\n".join([paper, *parts])
    return f"<svg xmlns='http://www.w3.org/2000/svg' {size}>\n{body}\n</svg>\n"


def main() -> None:
    """Write the drawings, or a mount with its own measures."""
    parser = argparse.ArgumentParser(description="Draw the mount and the arrangements.")
    parser.add_argument("--mount", type=Path, metavar="FOLDER", help="only the mount: SVG and STL")
    for one in fields(Mount):
        option = "--" + one.name.replace("_", "-")
        parser.add_argument(option, type=float, default=one.default)
    arguments = parser.parse_args()
    try:
        mount = Mount(*(getattr(arguments, one.name) for one in fields(Mount)))
    except ValueError as error:
        parser.error(str(error))
    folder = arguments.mount or PICTURES
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "mount.svg").write_text(mount_svg(mount), "utf-8")
    if arguments.mount:
        write_stl(folder / "mount.stl", mount_triangles(mount))
        return
    for name in ARRANGEMENTS:
        (folder / f"{name}.svg").write_text(arrangement_svg(name), "utf-8")
    for name, draw in METHOD.items():
        (folder / f"{name}.svg").write_text(draw(), "utf-8")


if __name__ == "__main__":
    main()
