"""A procedural hand: bones of published proportions, a smooth union as skin, a closed mesh.

The hand's own frame has its origin at the palm's centre, the fingers along −y, the forearm along
+y and the palm facing −z, so that a camera looking along +z sees the palm upright. A right hand's
thumb is at +x, a left hand's at −x.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np

from handcal.core.frozen import freeze
from handcal.core.types import Float32, Float64, UInt8
from handcal.sim.isosurface import isosurface

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
