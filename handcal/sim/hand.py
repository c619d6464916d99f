"""A procedural hand: bones of published proportions, a smooth union as skin, a closed mesh.

The hand's own frame has its origin at the palm's centre, the fingers along −y, the forearm along
+y and the palm facing −z, so that a camera looking along +z sees the palm upright. A right hand's
thumb is at +x, a left hand's at −x. Its skin is the zero surface of a field sampled on a grid, by
marching cubes (Lorensen & Cline 1987).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np

from handcal.core.frozen import freeze
from handcal.core.types import Float32, Float64, UInt8

Indices: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.int64]]

# The triangles of the 256 cases, three edges of the cube each, as in the classic tables of
# scikit-image (BSD-3-Clause, see THIRD-PARTY.md), which follow Bourke (1994). Bit n of a case is
# set if corner n is outside; a dash is a case without triangles.
_CASES = """
- 083 019 183981 12a 08312a 92a029 2832a8a98 3b2 0b28b0 19023b 1b219b98b 3a1ba3 0a108a8ba
3903b9ba9 98aa8b 478 430734 019847 419471731 12a847 34730412a 92a902847 2a9297273794 8473b2
b47b24204 90184723b 47b94b9b2921 3a13ba784 1ba14b1047b4 47890b9bab03 47b4b99ba 954 954083 054150
854835315 12a954 30812a495 52a542402 2a5325354348 95423b 0b208b495 05401523b 21525828b485
a3ba13954 4950818a18ba 54050b5bab03 54858aa8b 978579 930953573 078017157 153357 978957a12
a12950530573 802825857a52 2a5253357 7957893b2 95797292027b 23b018178157 b21b17715 958857a13a3b
5705097b010aba0 ba0b03a50807570 ba57b5 a65 0835a6 9015a6 1831985a6 165261 165126308 965906026
598582526328 23ba65 b08b20a65 01923b5a6 5a61929b298b 63b653513 08b0b50515b6 3b6036065059
65969bb98 5a6478 43047365a 1905a6847 a65197173794 612651478 125526304347 847905065026
739794329596269 3b2784a65 5a647242027b 01947823b5a6 9219b294b7b45a6 8473b53515b6 51b5b610b7b404b
059065036b63847 65969b4797b9 a4964a 4a649a083 a01a60640 83181686461a 149124264 308129249264
024426 832824426 a49a64b23 08228b49a4a6 3b201606461a 64161a48121b8b1 964936913b63
8b1810b61914641 3b6360064 648b68 7a678a89a 0730a709a67a a671a7178180 a67a71173 126168189867
269291679093739 780706602 732672 23ba68a89867 20727b09767a9a7 1801781a767a23b b21b17a61671
896867916b63136 091b67 7807063b0b60 7b6 76b 308b76 019b76 819831b76 a126b7 12a3086b7 2902a96b7
6b72a3a83a98 723627 708760620 276237019 162186198876 a76a17137 a7617a187108 03707a0a96a7
76a7a88a9 684b86 36b306046 86b846901 946963931b36 6846b82a1 12a30b06b046 4b846b0292a9
a93a32943b36463 823842462 042462 190234246438 194142246 8138618466a1 a10a06604 4634386a3039a93
a946a4 49576b 083495b76 50154076b b76834354315 954a1276b 6b712a083495 76b54a42a402
348354325a52b76 723762549 954086062687 362376150540 628687218485158 954a16176137 16a176107870954
40a4a503a6a737a 76a7a854a48a 6956b9b89 36b063056095 0b805b01556b 6b3635531 12a95b9b8b56
0b306b09656912a b85b56805a52025 6b36352a3a53 589528562382 956960062 158180568382628 156216
13616a386569896 a10a06950560 03856a a56 b5a75b b5ab75830 5b75ab190 a75ab7981831 b12b71751
08312717572b 9759279022b7 75272b592328982 25a235375 820852875a25 9015a35373a2 982921872a25752
135375 087071175 903935537 987597 5845a8ab8 5045b05abb30 01984a8aba45 ab4a45b34941314
2512852b8458 04b0b345b2b151b 0250592b5458b85 9452b3 25a352345384 5a2524420 3a235a385458019
5a2524192942 845853351 045105 845853905035 945 4b749b9ab 0834979b79ab 1ab1b414074b
3143481a474bab4 4b79b492b912 9749b791b2b1083 b74b42240 b74b42834324 29a279237749 9a7974a27870207
37a3a274a1a040a 1a2874 491417713 491417081871 403743 487 9a8ab8 30939bb9a 01a0a88ab 31ab3a
12b1b99b8 30939b1292b9 02b80b 32b 23828aa89 9a2092 23828a0181a8 1a2 138918 091 038 -
""".split()  # noqa: SIM905
_TRIANGLES = np.array([[int(e, 16) for e in case.strip("-").ljust(15, "f")] for case in _CASES])
_NO_EDGE = 15
_CORNERS = np.array(
    [(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0), (1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0)]
)
# Of each edge the end with the lower index in the grid, and the grid's axis along it.
_LOW_ENDS = _CORNERS[[0, 1, 3, 0, 4, 5, 7, 4, 0, 1, 2, 3]]
_AXES = np.array([2, 1, 2, 1, 2, 1, 2, 1, 0, 0, 0, 0])


def isosurface(
    field: Float32,
) -> tuple[Float32, np.ndarray[tuple[int, ...], np.dtype[np.int32]], Float64]:
    """Return the surface where a field is zero, which is negative inside and positive outside.

    Parameters
    ----------
    field : (X, Y, Z) float32
        Where the surface meets no border of the grid it is closed.

    Returns
    -------
    vertices : (V, 3) float32
        In steps of the grid from its first point; each lies on one of its edges.
    triangles : (T, 3) int32
        Counterclockwise seen from outside.
    normals : (V, 3) float64
        Unit vectors out of the surface.
    """
    outside = field > 0.0
    cases = np.zeros([size - 1 for size in field.shape], np.uint8)
    for corner, offset in enumerate(_CORNERS):
        block = tuple(
            slice(first, first + size) for first, size in zip(offset, cases.shape, strict=True)
        )
        cases |= outside[block].astype(np.uint8) << corner
    cells = np.argwhere((cases > 0) & (cases < 255))
    edges = _TRIANGLES[cases[tuple(cells.T)]]
    cell, slot = np.nonzero(edges != _NO_EDGE)
    edge = edges[cell, slot]
    low_ends = np.ravel_multi_index((cells[cell] + _LOW_ENDS[edge]).T, field.shape)
    crossed, first, corners = np.unique(
        3 * low_ends + _AXES[edge], return_index=True, return_inverse=True
    )
    order = np.argsort(first)  # as the cells come, so that a triangle's vertices lie together
    crossed, corners = crossed[order], np.argsort(order)[corners]
    low = np.stack(np.unravel_index(crossed // 3, field.shape), axis=1)
    step = np.eye(3, dtype=np.int64)[crossed % 3]
    at_low, at_high = (field[tuple(ends.T)].astype(np.float64) for ends in (low, low + step))
    along = (at_low / (at_low - at_high))[:, None]
    # The field's gradient between the edge's ends, in every cell that has a triangle there.
    low_at, step_at, along_at = low[corners], step[corners], along[corners]
    gradients = (1.0 - along_at) * _gradient(field, cells[cell], low_at)
    gradients += along_at * _gradient(field, cells[cell], low_at + step_at)
    sums = [np.bincount(corners, gradients[:, axis], len(low)) for axis in range(3)]
    normals: Float64 = np.stack(sums, axis=1).astype(np.float64)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    vertices = (low + along * step).astype(np.float32)
    return vertices, corners.reshape(-1, 3)[:, ::-1].astype(np.int32), normals


def _gradient(field: Float32, cells: Indices, at: Indices) -> Float64:
    """Return the field's differences along the cells' edges at one corner of each, (N, 3)."""
    differences = []
    for axis, step in enumerate(np.eye(3, dtype=np.int64)):
        low = at.copy()
        low[:, axis] = cells[:, axis]
        differences.append(field[tuple((low + step).T)] - field[tuple(low.T)])
    return np.stack(differences, axis=1).astype(np.float64)


Side: TypeAlias = Literal["left", "right"]

# Mean lengths in mm of the phalanges, the last with some 4 mm of soft tissue at the tip; the
# thumb's begin with the metacarpal (Buryanov & Kotiuk 2010, "Proportions of hand segments").
_PHALANGES_MM = {
    "thumb": (46, 32, 25),
    "index": (40, 22, 20),
    "middle": (45, 26, 21),
    "ring": (41, 26, 21),
    "little": (33, 18, 20),
}
# Position of each finger's first joint relative to the palm's centre, mm.
_KNUCKLES_MM = {
    "index": (25, -42, -2),
    "middle": (4, -45, 1),
    "ring": (-16, -39, 0),
    "little": (-34, -30, -3),
}
# Radii in mm at the knuckle, at the joints and at the tip.
_RADII_MM = {
    "thumb": (14, 11, 9.5, 8),
    "index": (10.5, 9, 7.8, 6.5),
    "middle": (10.5, 9.2, 8, 6.7),
    "ring": (10, 8.6, 7.5, 6.3),
    "little": (9, 7.5, 6.6, 5.6),
}
_SPREAD_RAD = {"index": 0.14, "middle": 0.02, "ring": -0.1, "little": -0.26}
_THUMB_BASE_MM = (21, 30, -8)
_WRIST_MM = np.array([0.0, 50.0, 0.0])
_REFERENCE_LENGTH_MM = 187.0
# Skin from very light to very dark, RGB of the back of the hand.
_SKIN = np.array([[236, 200, 180], [205, 155, 125], [160, 108, 78], [98, 66, 50]], dtype=np.float64)


@dataclass(frozen=True, slots=True)
class HandSettings:
    """Distributions from which a hand is drawn."""

    length_m: float = 0.187
    length_sigma_m: float = 0.010
    """Wrist crease to middle fingertip: both sexes of ANSUR II (Gordon et al. 2014) pooled."""
    forearm_m: float = 0.25
    """Length of forearm below the wrist."""
    grid_m: float = 0.002
    """Spacing of the grid for the skin."""
    side: Side | None = None
    """None lets the seed choose."""
    thumb_out_rad: float = 0.0
    spread_more: float = 0.0
    curl_more_rad: float = 0.0
    """Change of shape of the seed's hand: rotation of the thumb away from the index finger,
    increase of the fingers' spread as a share of the mean one, and bend of each finger joint."""


@dataclass(frozen=True, slots=True, eq=False)
class HandModel:
    """A hand with its forearm: a closed triangle mesh in the hand's frame."""

    vertices_m: Float32
    """(V, 3)."""
    normals: Float32
    """(V, 3); unit, outward."""
    colors: UInt8
    """(V, 3); RGB of the skin."""
    triangles: np.ndarray[tuple[int, ...], np.dtype[np.int32]]
    """(T, 3)."""
    wrist_m: Float64
    """(3,); centre of the wrist."""
    arm_axis: Float64
    """(3,); unit vector from the wrist toward the elbow."""
    side: Side

    def __post_init__(self) -> None:
        freeze(self, "vertices_m", np.float32, None, 3)
        freeze(self, "normals", np.float32, None, 3)
        freeze(self, "colors", np.uint8, None, 3)
        freeze(self, "triangles", np.int32, None, 3)
        freeze(self, "wrist_m", np.float64, 3)
        freeze(self, "arm_axis", np.float64, 3)


@dataclass(frozen=True, slots=True)
class _Capsule:
    """A tapered capsule from a to b, blended with the other ones, in mm of the mean hand."""

    a: Float64
    b: Float64
    radius_a: float
    radius_b: float
    blend: float


@lru_cache(maxsize=4)  # a program that simulates several cameras or wearers often has one hand
def make_hand(seed: int, settings: HandSettings | None = None) -> HandModel:
    """Return the hand of a seed, which determines size, spread, curl, wrist, side and skin tone.

    Parameters
    ----------
    seed : int
    settings : HandSettings, optional

    Returns
    -------
    HandModel
    """
    settings = settings or HandSettings()
    rng = np.random.default_rng(seed)
    length_m = settings.length_m + settings.length_sigma_m * np.clip(rng.normal(), -2.5, 2.5)
    m_per_mm = length_m / _REFERENCE_LENGTH_MM
    arm_axis = _direction(np.pi + rng.uniform(-0.15, 0.15), rng.uniform(-0.15, 0.15))
    capsules = [
        *_forearm(arm_axis, settings.forearm_m / m_per_mm),
        *_palm(),
        *_fingers(rng, settings),
    ]
    vertices, triangles, normals = _skin(capsules, settings.grid_m / m_per_mm)
    side: Side = settings.side or ("left" if rng.random() < 0.5 else "right")
    colors = _skin_colors(vertices, normals, rng)
    if side == "left":
        mirror = np.array([-1.0, 1.0, 1.0])
        vertices, normals, arm_axis = vertices * mirror, normals * mirror, arm_axis * mirror
        triangles = triangles[:, ::-1]
    return HandModel(
        vertices * m_per_mm, normals, colors, triangles, _WRIST_MM * m_per_mm, arm_axis, side
    )


def _direction(spread_rad: float, flexion_rad: float) -> Float64:
    """Return −y rotated toward +x by the spread, then toward the palm's side, −z."""
    cos = np.cos(flexion_rad)
    return np.array([np.sin(spread_rad) * cos, -np.cos(spread_rad) * cos, -np.sin(flexion_rad)])


def _forearm(arm_axis: Float64, length: float) -> list[_Capsule]:
    """Return two parallel capsules, radius and ulna, widening toward the elbow."""
    elbow = _WRIST_MM + length * arm_axis
    across = np.array([1.0, 0.0, 0.0])
    return [
        _Capsule(_WRIST_MM + 10 * side * across, elbow + 14 * side * across, 18, 33, 15)
        for side in (-1, 1)
    ]


def _palm() -> list[_Capsule]:
    """Return the metacarpals, the ball of the little finger's side, and the carpus."""
    bases = {
        "index": (12, 26, 0),
        "middle": (4, 26, 0),
        "ring": (-4, 26, 0),
        "little": (-12, 28, 0),
    }
    lines = [(base, _KNUCKLES_MM[finger], 14.5, 11) for finger, base in bases.items()]
    lines += [((-20, 34, -4), (-29, -12, -4), 13, 11), ((0, 45, 0), (0, 5, 0), 16, 12)]
    return [
        _Capsule(np.array(a, np.float64), np.array(b, np.float64), radius_a, radius_b, 12)
        for a, b, radius_a, radius_b in lines
    ]


def _fingers(rng: np.random.Generator, settings: HandSettings) -> list[_Capsule]:
    """Return all phalanges, with the hand's spread and curl and small deviations per finger."""
    spread = rng.uniform(0.6, 1.5) + settings.spread_more
    curl_rad = rng.uniform(0.02, 0.22)
    thickness = rng.normal(1.0, 0.04)
    capsules = []
    for finger, knuckle in _KNUCKLES_MM.items():
        bends = curl_rad * rng.uniform(0.7, 1.3) * np.array([1.0, 1.3, 0.8])
        bends += settings.curl_more_rad
        turns = np.array([spread * _SPREAD_RAD[finger] + rng.normal(0.0, 0.02), 0.0, 0.0])
        radii = thickness * np.array(_RADII_MM[finger])
        capsules += _chain(knuckle, _PHALANGES_MM[finger], radii, turns, bends, 4)
    bends = np.array([0.35, -0.1, curl_rad * rng.uniform(0.7, 1.3)])
    turns = np.array([rng.uniform(0.55, 0.85) + settings.thumb_out_rad, -0.15, -0.1])
    radii = thickness * np.array(_RADII_MM["thumb"])
    return capsules + _chain(_THUMB_BASE_MM, _PHALANGES_MM["thumb"], radii, turns, bends, 10)


def _chain(
    start: tuple[int, ...],
    lengths: tuple[int, ...],
    radii: Float64,
    turns_rad: Float64,
    bends_rad: Float64,
    blend: float,
) -> list[_Capsule]:
    """Return a finger's bones, each rotated sideways and bent relative to the previous one."""
    ends = np.array(lengths, dtype=np.float64)
    ends[-1] -= radii[-1]  # the length includes the tip's cap
    capsules = []
    joint = np.array(start, dtype=np.float64)
    for number, spread_rad, flexion_rad in zip(
        range(len(ends)), np.cumsum(turns_rad), np.cumsum(bends_rad), strict=True
    ):
        following = joint + ends[number] * _direction(spread_rad, flexion_rad)
        capsules.append(_Capsule(joint, following, radii[number], radii[number + 1], blend))
        joint = following
    return capsules


def _skin(
    capsules: list[_Capsule], grid: float
) -> tuple[Float32, np.ndarray[tuple[int, ...], np.dtype[np.int32]], Float32]:
    """Return vertices, triangles and outward normals of the capsules' smooth union."""
    ends = np.array([[capsule.a, capsule.b] for capsule in capsules])
    reach = max(max(capsule.radius_a, capsule.radius_b) for capsule in capsules) + 4 * grid
    low = ends.min((0, 1)) - reach
    shape = np.ceil((ends.max((0, 1)) + reach - low) / grid).astype(int) + 1
    field = np.full(shape, 20.0, dtype=np.float32)
    for capsule in capsules:
        _add(field, capsule, low, grid)
    vertices, triangles, normals = isosurface(field)
    return (
        (vertices * np.float64(grid) + low).astype(np.float32),
        triangles,
        normals.astype(np.float32),
    )


def _add(field: Float32, capsule: _Capsule, low: Float64, grid: float) -> None:
    """Blend a capsule into the distance field by the polynomial smooth minimum (Quilez 2013)."""
    margin = max(capsule.radius_a, capsule.radius_b) + capsule.blend + 2 * grid
    near, far = np.minimum(capsule.a, capsule.b), np.maximum(capsule.a, capsule.b)
    first = np.floor((near - margin - low) / grid).astype(int).clip(0)
    last = np.ceil((far + margin - low) / grid).astype(int) + 1
    block = field[tuple(map(slice, first, last))]
    axes = [
        (low[i] - capsule.a[i] + grid * np.arange(first[i], first[i] + block.shape[i]))
        for i in range(3)
    ]
    x, y, z = np.meshgrid(*(axis.astype(np.float32) for axis in axes), indexing="ij", sparse=True)
    bone = capsule.b - capsule.a
    along = ((x * bone[0] + y * bone[1] + z * bone[2]) / (bone @ bone)).clip(0.0, 1.0)
    distance = np.sqrt(
        (x - along * bone[0]) ** 2 + (y - along * bone[1]) ** 2 + (z - along * bone[2]) ** 2
    ) - (capsule.radius_a + along * (capsule.radius_b - capsule.radius_a))
    overlap = (capsule.blend - np.abs(block - distance)).clip(0.0)
    block[:] = np.minimum(block, distance) - overlap**2 / (4.0 * capsule.blend)


def _skin_colors(vertices: Float32, normals: Float32, rng: np.random.Generator) -> UInt8:
    """Return colours: the tone by seed, a lighter and redder palm, and soft blotches."""
    tone = rng.uniform(0.0, len(_SKIN) - 1.0)
    skin = np.array([np.interp(tone, range(len(_SKIN)), channel) for channel in _SKIN.T])
    palm_skin = 0.75 * skin + 0.25 * np.array([240.0, 190.0, 170.0])
    palm = np.clip(0.5 - 1.5 * normals[:, 2:], 0.0, 1.0)
    waves = vertices @ rng.normal(0.0, 0.07, (3, 4)) + rng.uniform(0.0, 6.3, 4)
    blotch = 1.0 + 0.025 * np.sin(waves).sum(1, keepdims=True)
    rgb: Float64 = (palm * palm_skin + (1.0 - palm) * skin) * blotch
    return np.clip(rgb, 0, 255).astype(np.uint8)
