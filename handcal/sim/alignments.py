"""Alignments with known truth, generated from the model for tests, benchmarks and studies.

The cursor is made from the hand either as in the paper's simulation (``exact=False``, κ = 1), or
for a hand of constant size (``exact=True``). `handcal.sim.wearer` simulates a person who aligns by
looking through a display.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import Bool, Float64, Intrinsics
from handcal.register.model import predict
from handcal.sim.hand import HandModel
from handcal.sim.raster import D415, visible_points


@dataclass(frozen=True, slots=True)
class AlignmentSettings:
    """Settings of simulated alignments."""

    count: int = 5000
    """Number of points of each cloud."""
    exact: bool = True
    """True for a hand of constant size; False as in the paper."""
    shift_max_m: float = 0.010
    """Each component of φ is uniform within plus or minus this."""
    display_distance_m: float = 2.0
    """z(C0→S)."""
    resample: bool = False
    """Sample cursor and hand independently; otherwise both hold the same points in another
    order."""
    depth_sigma_m: float = 0.0
    """Standard deviation of each point's depth noise."""
    cursor_forearm_m: float = 0.04
    hand_forearm_m: float = 0.04
    """Length of forearm in each cloud."""


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedAlignment:
    """Two clouds with their true φ and pairs."""

    cursor_m: Float64
    hand_m: Float64
    """(N, 3); in W."""
    cursor_cut: Bool
    hand_cut: Bool
    """(N,)."""
    T_E_W: Float64
    """(4, 4)."""
    shift_m: Float64
    """(3,); the true φ."""
    rotation_rad: Float64
    """(3,); rotation vector of the cursor relative to the hand, in W."""
    known_cursor_m: Float64
    known_hand_m: Float64
    """(K, 3); noise-free true pairs in E0(t_b), of the part that both clouds show."""
    display_distance_m: float


def simulate_alignment(
    rng: np.random.Generator,
    hand: HandModel,
    angle_rad: float,
    settings: AlignmentSettings,
    intrinsics: Intrinsics = D415,
) -> SimulatedAlignment:
    """Return one alignment as in the paper's simulation, seen by a depth camera.

    The cursor is rotated about a random axis by `angle_rad`, around a random point of its cloud.
    """
    T_E_hand = rigid(
        rng.normal(0.0, 0.15, 3),
        [rng.normal(0.0, 0.03), rng.normal(0.0, 0.03), rng.uniform(0.42, 0.58)],
    )
    T_E_W = rigid(rng.normal(0.0, 0.5, 3), rng.normal(0.0, 0.5, 3))
    shift_m = rng.uniform(-settings.shift_max_m, settings.shift_max_m, 3)
    hand_m, hand_cut = visible_points(
        hand,
        T_E_hand,
        settings.count,
        rng,
        intrinsics=intrinsics,
        forearm_m=settings.hand_forearm_m,
    )
    if settings.resample:
        source_m, cursor_cut = visible_points(
            hand,
            T_E_hand,
            settings.count,
            rng,
            intrinsics=intrinsics,
            forearm_m=settings.cursor_forearm_m,
        )
    else:
        order = rng.permutation(len(hand_m))
        source_m, cursor_cut = hand_m[order], hand_cut[order]
    distance_m = settings.display_distance_m
    straight = predict(source_m, shift_m, distance_m, exact=settings.exact)
    axis = rng.normal(size=3)
    rotation_rad = angle_rad * axis / np.linalg.norm(axis)
    centre = straight[rng.integers(len(straight))]
    turn = rigid(translation_m=centre) @ rigid(rotation_rad) @ rigid(translation_m=-centre)
    reach_m = (transform(invert(T_E_hand), hand_m) - hand.wrist_m) @ hand.arm_axis
    common = hand_m[reach_m <= settings.cursor_forearm_m]
    T_W_E = invert(T_E_W)
    return SimulatedAlignment(
        cursor_m=transform(T_W_E, _blur(transform(turn, straight), settings.depth_sigma_m, rng)),
        hand_m=transform(T_W_E, _blur(hand_m, settings.depth_sigma_m, rng)),
        cursor_cut=cursor_cut,
        hand_cut=hand_cut,
        T_E_W=T_E_W,
        shift_m=shift_m,
        rotation_rad=T_W_E[:3, :3] @ rotation_rad,
        known_cursor_m=transform(turn, predict(common, shift_m, distance_m, exact=settings.exact)),
        known_hand_m=common,
        display_distance_m=distance_m,
    )


def _blur(points_m: Float64, sigma_m: float, rng: np.random.Generator) -> Float64:
    """Move points along their rays by noise of standard deviation `sigma_m` in z."""
    noise_m = rng.normal(0.0, sigma_m, (len(points_m), 1))
    return points_m * (1.0 + noise_m / points_m[:, 2:])
