"""A procedural hand: bones of published proportions, skin from a smooth union, a closed mesh.

The hand's own frame has its origin at the palm's centre, the fingers along −y, the forearm along
+y and the palm facing −z, so that a camera looking along +z sees the palm upright. A right hand's
thumb is at +x, a left hand's at −x.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from skimage.measure import marching_cubes

from handcal.types import Float32, Float64, UInt8, _freeze

Side: TypeAlias = Literal["left", "right"]

# Mean lengths in mm of metacarpal, proximal, middle and distal phalanx (Buryanov & Kotiuk 2010,
# "Proportions of hand segments"), the last with some 4 mm of soft tissue at the tip.
_BONES_MM = {
    "thumb": (46, 32, 25),
    "index": (68, 40, 22, 20),
    "middle": (65, 45, 26, 21),
    "ring": (58, 41, 26, 21),
    "little": (54, 33, 18, 20),
}
# From the palm's centre: the joint where each finger leaves the palm, mm.
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
_WRIST_MM = 50.0
_REFERENCE_LENGTH_MM = 187.0
# Skin from very light to very dark, RGB of the back of the hand.
_SKIN = np.array([[236, 200, 180], [205, 155, 125], [160, 108, 78], [98, 66, 50]], dtype=np.float64)


@dataclass(frozen=True, slots=True)
class HandSettings:
    """How a hand is drawn from its seed.

    Attributes
    ----------
    length_m, length_sigma_m : float
        Wrist crease to middle fingertip: both sexes of ANSUR II (Gordon et al. 2014) pooled.
    forearm_m : float
        Length of forearm below the wrist.
    grid_m : float
        Spacing of the grid on which the skin is found.
    side : {"left", "right"} or None
        None lets the seed choose.
    """

    length_m: float = 0.187
    length_sigma_m: float = 0.010
    forearm_m: float = 0.25
    grid_m: float = 0.002
    side: Side | None = None


@dataclass(frozen=True, slots=True, eq=False)
class HandModel:
    """A hand with its forearm: a closed triangle mesh in the hand's frame.

    Attributes
    ----------
    vertices_m : (V, 3) float32
    normals : (V, 3) float32
        Unit, outward.
    colors : (V, 3) uint8
        RGB of the skin.
    triangles : (T, 3) int32
    wrist_m : (3,) float64
        Centre of the wrist.
    arm_axis : (3,) float64
        Unit vector from the wrist toward the elbow.
    side : {"left", "right"}
    """

    vertices_m: Float32
    normals: Float32
    colors: UInt8
    triangles: np.ndarray[tuple[int, ...], np.dtype[np.int32]]
    wrist_m: Float64
    arm_axis: Float64
    side: Side

    def __post_init__(self) -> None:
        _freeze(self, "vertices_m", np.float32, None, 3)
        _freeze(self, "normals", np.float32, None, 3)
        _freeze(self, "colors", np.uint8, None, 3)
        _freeze(self, "triangles", np.int32, None, 3)
        _freeze(self, "wrist_m", np.float64, 3)
        _freeze(self, "arm_axis", np.float64, 3)


@dataclass(frozen=True, slots=True)
class _Capsule:
    """A tapered capsule from a to b, melting into what was there over `blend_m`."""

    a_m: Float64
    b_m: Float64
    radius_a_m: float
    radius_b_m: float
    blend_m: float


def make_hand(seed: int, settings: HandSettings | None = None) -> HandModel:
    """Make the hand of a seed: its size, spread, curl, wrist, side and skin tone follow from it.

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
    scale_m = length_m / _REFERENCE_LENGTH_MM
    wrist_m = np.array([0.0, _WRIST_MM * scale_m, 0.0])
    deviation, flexion = rng.uniform(-0.15, 0.15, 2)
    arm_axis = _direction(np.pi + deviation, flexion)
    capsules = [
        *_forearm(wrist_m, arm_axis, settings.forearm_m, scale_m),
        *_palm(scale_m),
        *_fingers(rng, scale_m),
    ]
    vertices, triangles, normals = _skin(capsules, settings.grid_m)
    side: Side = settings.side or ("left" if rng.random() < 0.5 else "right")
    colors = _skin_colors(vertices, normals, rng)
    if side == "left":
        mirror = np.array([-1.0, 1.0, 1.0])
        vertices, normals, arm_axis = vertices * mirror, normals * mirror, arm_axis * mirror
        triangles = triangles[:, ::-1]
    return HandModel(vertices, normals, colors, triangles, wrist_m, arm_axis, side)


def _direction(spread_rad: float, flexion_rad: float) -> Float64:
    """Return −y turned toward +x by the spread, then toward the palm's side, −z."""
    cos = np.cos(flexion_rad)
    return np.array([np.sin(spread_rad) * cos, -np.cos(spread_rad) * cos, -np.sin(flexion_rad)])


def _forearm(
    wrist_m: Float64, arm_axis: Float64, length_m: float, scale_m: float
) -> list[_Capsule]:
    """Two capsules side by side (radius and ulna), widening toward the elbow."""
    elbow_m = wrist_m + length_m * arm_axis
    across = np.array([1.0, 0.0, 0.0])
    return [
        _Capsule(
            wrist_m + sign * 10 * scale_m * across,
            elbow_m + sign * 14 * scale_m * across,
            18 * scale_m,
            33 * scale_m,
            15 * scale_m,
        )
        for sign in (-1, 1)
    ]


def _palm(scale_m: float) -> list[_Capsule]:
    """Metacarpals, and the ball of the little finger's side."""
    bases = {
        "index": (12, 26, 0),
        "middle": (4, 26, 0),
        "ring": (-4, 26, 0),
        "little": (-12, 28, 0),
    }
    metacarpals = [
        _capsule(bases[finger], _KNUCKLES_MM[finger], 14.5, 11, 12, scale_m) for finger in bases
    ]
    return [
        *metacarpals,
        _capsule((-20, 34, -4), (-29, -12, -4), 13, 11, 12, scale_m),
        _capsule((0, 45, 0), (0, 5, 0), 16, 12, 12, scale_m),
    ]


def _capsule(
    a_mm: tuple[float, ...],
    b_mm: tuple[float, ...],
    radius_a_mm: float,
    radius_b_mm: float,
    blend_mm: float,
    scale_m: float,
) -> _Capsule:
    return _Capsule(
        scale_m * np.array(a_mm, dtype=np.float64),
        scale_m * np.array(b_mm, dtype=np.float64),
        radius_a_mm * scale_m,
        radius_b_mm * scale_m,
        blend_mm * scale_m,
    )


def _fingers(rng: np.random.Generator, scale_m: float) -> list[_Capsule]:
    """Chains of phalanges; spread and curl are the hand's, with a little of each finger's own."""
    spread = rng.uniform(0.6, 1.5)
    curl_rad = rng.uniform(0.02, 0.22)
    thickness = rng.normal(1.0, 0.04)
    capsules = []
    for finger, lengths_mm in _BONES_MM.items():
        own_curl_rad = curl_rad * rng.uniform(0.7, 1.3)
        if finger == "thumb":
            start_mm, blend_mm = _THUMB_BASE_MM, 10.0
            spread_rad = rng.uniform(0.55, 0.85)
            flexion_rad, bends_rad = 0.35, (0.0, -0.1, own_curl_rad)
            turns_rad = (0.0, -0.15, -0.1)
        else:
            start_mm, blend_mm = _KNUCKLES_MM[finger], 4.0
            lengths_mm = lengths_mm[1:]
            spread_rad = spread * _SPREAD_RAD[finger] + rng.normal(0.0, 0.02)
            flexion_rad, bends_rad = 0.0, (own_curl_rad, 1.3 * own_curl_rad, 0.8 * own_curl_rad)
            turns_rad = (0.0, 0.0, 0.0)
        radii_m = np.array(_RADII_MM[finger]) * thickness * scale_m
        joint_m = scale_m * np.array(start_mm, dtype=np.float64)
        for number, (length_mm, bend_rad, turn_rad) in enumerate(
            zip(lengths_mm, bends_rad, turns_rad, strict=True)
        ):
            spread_rad += turn_rad
            flexion_rad += bend_rad
            is_last = number == len(lengths_mm) - 1
            length_m = length_mm * scale_m - (radii_m[-1] if is_last else 0.0)
            next_m = joint_m + length_m * _direction(spread_rad, flexion_rad)
            capsules.append(
                _Capsule(joint_m, next_m, radii_m[number], radii_m[number + 1], blend_mm * scale_m)
            )
            joint_m = next_m
    return capsules


def _skin(
    capsules: list[_Capsule], grid_m: float
) -> tuple[Float32, np.ndarray[tuple[int, ...], np.dtype[np.int32]], Float32]:
    """Return vertices, triangles and outward normals of the capsules' smooth union."""
    ends = np.array([[c.a_m, c.b_m] for c in capsules])
    reach = max(max(c.radius_a_m, c.radius_b_m) for c in capsules) + 4 * grid_m
    low = ends.min((0, 1)) - reach
    shape = np.ceil((ends.max((0, 1)) + reach - low) / grid_m).astype(int) + 1
    field = np.full(shape, 0.02, dtype=np.float32)
    for capsule in capsules:
        _add(field, capsule, low, grid_m)
    vertices, triangles, normals, _ = marching_cubes(  # type: ignore[no-untyped-call]
        field, 0.0, spacing=(grid_m,) * 3, gradient_direction="descent"
    )
    return (vertices + low).astype(np.float32), triangles, -normals


def _add(field: Float32, capsule: _Capsule, low_m: Float64, grid_m: float) -> None:
    """Melt a capsule into the distance field by the polynomial smooth minimum (Quilez 2013)."""
    margin = max(capsule.radius_a_m, capsule.radius_b_m) + capsule.blend_m + 2 * grid_m
    ends = np.stack([capsule.a_m, capsule.b_m])
    first = np.floor((ends.min(0) - margin - low_m) / grid_m).astype(int).clip(0)
    last = np.ceil((ends.max(0) + margin - low_m) / grid_m).astype(int) + 1
    block = field[tuple(slice(*ends) for ends in zip(first, last, strict=True))]
    axes = [
        (low_m[i] + grid_m * np.arange(first[i], first[i] + block.shape[i])).astype(np.float32)
        for i in range(3)
    ]
    x, y, z = np.meshgrid(*axes, indexing="ij", sparse=True)
    bone = capsule.b_m - capsule.a_m
    ax, ay, az = capsule.a_m
    along = ((x - ax) * bone[0] + (y - ay) * bone[1] + (z - az) * bone[2]) / (bone @ bone)
    along = along.clip(0.0, 1.0)
    distance = np.sqrt(
        (x - ax - along * bone[0]) ** 2
        + (y - ay - along * bone[1]) ** 2
        + (z - az - along * bone[2]) ** 2
    ) - (capsule.radius_a_m + along * (capsule.radius_b_m - capsule.radius_a_m))
    overlap = (capsule.blend_m - np.abs(block - distance)).clip(0.0)
    block[:] = np.minimum(block, distance) - overlap**2 / (4.0 * capsule.blend_m)


def _skin_colors(vertices: Float32, normals: Float32, rng: np.random.Generator) -> UInt8:
    """Tone by seed, a lighter and redder palm, and soft blotches."""
    tone = rng.uniform(0.0, len(_SKIN) - 1.0)
    skin = np.array([np.interp(tone, range(len(_SKIN)), channel) for channel in _SKIN.T])
    palm_skin = 0.75 * skin + 0.25 * np.array([240.0, 190.0, 170.0])
    palm = np.clip(0.5 - 1.5 * normals[:, 2:], 0.0, 1.0)
    waves = vertices @ rng.normal(0.0, 70.0, (3, 4)) + rng.uniform(0.0, 6.3, 4)
    blotch = 1.0 + 0.025 * np.sin(waves).sum(1, keepdims=True)
    rgb: Float64 = (palm * palm_skin + (1.0 - palm) * skin) * blotch
    return np.clip(rgb, 0, 255).astype(np.uint8)
