"""One surface from the frames of a hold: its median, without flying pixels.

The wearer may have moved by only a millimetre before a confirmation, to a cursor drawn nearly where
the hand was. φ would be wrong by as much, so frames with the hand elsewhere are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from handcal.calibration.hands import PlacedHand
from handcal.core.errors import HandError
from handcal.core.geometry import invert, rotation_vector, transform
from handcal.register.rigid import RigidSettings, motion_covariance, register_rigid
from handcal.register.surface import Surface, describe_surface, mean_point

# More frames take longer than the time between two frames, and lower the noise little.
_MOST_FRAMES = 7
# Another frame sees the surface at a point if it has one within this many point spacings.
_REACH = 1.5
# The surface is where at least this share of the frames sees it.
_SEEN = 0.5
# A hand is where it was unless noise explains the movement found with less than 0.1 %: the quantile
# of χ² with six degrees of freedom.
_MOVED = 22.5
_SETTINGS = RigidSettings(max_points=700, tolerance_m=5e-5)


def merge_hold(hands: Sequence[PlacedHand], reference: PlacedHand) -> PlacedHand:
    """Return the median surface of the frames with the hand in one place, and the movement of all.

    Each point of the reference stays on its ray, at the median of the depths that the frames
    measure there, unless fewer than half of them see anything: then it is a flying pixel.

    Parameters
    ----------
    hands : sequence of PlacedHand
    reference : PlacedHand
        One of them; time, pose, contour and mask are its own.
    """
    middles = np.array([hand.middle_W_m for hand in hands])
    movement_m = float(np.linalg.norm(np.ptp(middles, axis=0)))
    some = [hand for hand in hands if hand is not reference]
    some = some[:: max(1, -(-len(some) // (_MOST_FRAMES - 1)))]
    some = _in_one_place(some, reference)
    if not some:
        return replace(reference, movement_m=movement_m)
    T_D_W = invert(reference.T_W_D)
    points_m = transform(T_D_W, reference.points_W_m)
    rays = points_m[:, :2] / points_m[:, 2:]
    apart, _ = cKDTree(rays).query(rays, k=2)
    reach = _REACH * float(np.median(np.asarray(apart)[:, 1]))
    depths_m = np.full((1 + len(some), len(points_m)), np.nan)
    is_cut = np.zeros_like(depths_m, dtype=np.bool_)
    depths_m[0], is_cut[0] = points_m[:, 2], reference.cloud.is_cut
    for row, hand in enumerate(some, start=1):
        seen_m = transform(T_D_W, hand.points_W_m)
        found = cKDTree(seen_m[:, :2] / seen_m[:, 2:]).query(rays, distance_upper_bound=reach)
        is_seen, index = np.isfinite(found[0]), np.asarray(found[1])
        depths_m[row, is_seen] = seen_m[index[is_seen], 2]
        is_cut[row, is_seen] = hand.cloud.is_cut[index[is_seen]]
    measured = np.isfinite(depths_m)
    kept = measured.mean(axis=0) >= _SEEN
    median_m = np.nanmedian(depths_m[:, kept], axis=0)
    merged_m = points_m[kept] * (median_m / points_m[kept, 2])[:, None]
    colors = reference.cloud.colors
    cloud = replace(
        reference.cloud,
        points_m=merged_m.astype(np.float32),
        is_cut=(is_cut.sum(axis=0) >= _SEEN * measured.sum(axis=0))[kept],
        colors=None if colors is None else colors[kept],
    )
    return replace(
        reference,
        cloud=cloud,
        points_W_m=transform(reference.T_W_D, merged_m),
        frames=1 + len(some),
        movement_m=movement_m,
    )


def _in_one_place(hands: Sequence[PlacedHand], reference: PlacedHand) -> list[PlacedHand]:
    """Return the hands that are where the reference is, except for noise.

    None if almost all points of one lie at cut edges.
    """
    try:
        place, *seen = [
            describe_surface(hand.points_W_m, hand.cloud.is_cut, _SETTINGS.max_points)
            for hand in (reference, *hands)
        ]
    except HandError:
        return []
    return [hand for hand, surface in zip(hands, seen, strict=True) if _is_at(surface, place)]


def _is_at(surface: Surface, place: Surface) -> bool:
    """Return True if noise explains the movement from one surface to the other."""
    fit = register_rigid(surface, place, _SETTINGS, np.eye(4))
    T = fit.T_target_source
    middle_m = mean_point(surface.points_m)
    moved_m = transform(T, middle_m[None])[0] - middle_m
    moved = np.concatenate([rotation_vector(T[:3, :3]), moved_m])
    noise = motion_covariance(fit.rows, surface, T)
    return float(moved @ np.linalg.solve(noise, moved)) < _MOVED
