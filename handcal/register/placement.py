"""The next alignment of a plan: the eyes to keep open, and the place of the cursor.

The wearer raises the hand once. Every cursor is that hand, moved: to where, by the posterior's
covariance, an alignment lowers the expected error of both eyes most. The same slip of the wearer
moves φ less the nearer the hand is, so this is as near as the camera can measure, and where the
displays show enough of the hand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from handcal.display import eye_projection, view_of_eye
from handcal.geometry import image_points, invert, project, transform
from handcal.register.benefit import expected_arcmin
from handcal.register.fuse import Observation, eye_slice, seen_by
from handcal.register.prior import EyePrior, eye_prior, posterior
from handcal.register.results import Results, SolveSettings
from handcal.register.surface import describe_surface
from handcal.register.verdict import planned_eyes
from handcal.types import EYES, Bool, Eye, Float64, PlanName, Rig

_OUTLINE_FROM_POINTS = 1500
# Of a registration, where none was made yet: small beside the wearer's own error.
_REGISTRATION_SIGMA_M = 3e-4


@dataclass(frozen=True, slots=True)
class PlacementSettings:
    """Places of cursors, and the number of alignments."""

    nearest_m: float = 0.45
    """Least distance of the hand from the camera, along its axis: a D415 measures nothing nearer
    at 1280x720 unless a disparity shift is set."""
    farthest_m: float = 0.75
    """Largest such distance."""
    aside_m: tuple[float, ...] = (-0.03, 0.0, 0.03)
    """Places to choose from, to the right of the middle of the displays that are used."""
    depths_m: tuple[float, ...] = (0.0, 0.04, 0.08)
    """Places to choose from, beyond the nearest."""
    shown_share: float = 0.6
    """Least share of the hand's outline within each display that is used."""
    fewest: int = 3
    """Alignments of the recommended plan before the eyes are verified."""
    most: int = 10
    """Alignments after which no other is planned."""


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """The next alignment."""

    eyes: tuple[Eye, ...]
    """Eyes to keep open."""
    displacement_W_m: Float64
    """(3,); from the raised hand to its cursor."""
    reason: str
    """One line."""


def next_alignment(
    raised_W_m: Float64,
    raised_is_cut: Bool,
    T_W_H: Float64,
    rig: Rig,
    results: Results | None,
    done: Sequence[tuple[Eye, ...]],
    drawn_shift_m: Mapping[Eye, Float64],
    *,
    plan: PlanName = "recommended",
    usable_eyes: tuple[Eye, ...] = EYES,
    settings: PlacementSettings = PlacementSettings(),
    solve: SolveSettings,
) -> Planned | None:
    """Return a plan's next alignment, or None if none is needed now or the most were made.

    Of ``paper``: both eyes, the cursor where the hand is. Of ``recommended``: left, right and both
    in turn, each cursor where it tells most. None is needed once every eye is accepted, or is
    expected to be after its verification.

    Parameters
    ----------
    raised_W_m : (N, 3) float64
        The raised hand.
    raised_is_cut : (N,) bool
        True beside a cut edge.
    T_W_H : (4, 4) float64
        The headset's pose.
    rig : Rig
    results : Results or None
        Of the alignments so far, solved with the same plan; None before the first.
    done : sequence of tuple of eye
        The open eyes of each alignment so far.
    drawn_shift_m : mapping of eye to (3,) float64
        φ that the cursor will be drawn with.
    plan : {"recommended", "paper"}
    usable_eyes : tuple of eye
        One eye for a wearer who sees with one.
    settings : PlacementSettings
    solve : SolveSettings
        Its prior and precision of a wearer count before the first alignment.

    Raises
    ------
    HandError
        If nearly all points of the hand lie at cut edges.
    """
    fewest = settings.fewest if plan == "recommended" else 1
    is_enough = results is not None and _is_enough(results, usable_eyes)
    if len(done) >= settings.most or (len(done) >= fewest and is_enough):
        return None
    eyes = planned_eyes(plan, done, usable_eyes)
    if plan == "paper":
        return Planned(eyes, np.zeros(3), "the cursor is where the hand is")
    raised_m = transform(invert(T_W_H), raised_W_m)
    surface = describe_surface(raised_m, raised_is_cut, _OUTLINE_FROM_POINTS)
    outline_m = surface.points_m[surface.outline]
    places = _places(raised_m, outline_m, rig, eyes, drawn_shift_m, settings)
    if not places:
        return Planned(eyes, np.zeros(3), "no other place is on the displays and in camera range")
    errors = [
        _expected_arcmin(
            raised_m + place, outline_m + place, rig, eyes, drawn_shift_m, results, solve
        )
        for place in places
    ]
    best = int(np.argmin(errors))
    which = "both eyes" if len(eyes) > 1 else f"the {eyes[0]} eye"
    return Planned(
        eyes,
        T_W_H[:3, :3] @ places[best],
        f"{errors[best]:.1f}′ expected after an alignment with {which} here",
    )


def _is_enough(results: Results, usable_eyes: Sequence[Eye]) -> bool:
    """Return whether every eye is accepted or kept, or expected to be accepted once verified."""
    return set(results.verdicts) >= set(usable_eyes) and all(
        verdict.name != "repeat"
        or (eye in results.advice and results.advice[eye].is_accepted_once_verified)
        for eye, verdict in results.verdicts.items()
    )


def _places(
    raised_m: Float64,
    outline_m: Float64,
    rig: Rig,
    eyes: Sequence[Eye],
    drawn_shift_m: Mapping[Eye, Float64],
    settings: PlacementSettings,
) -> list[Float64]:
    """Return displacements of the raised hand, in H, to places that displays and camera allow.

    The hand stays at its height on the displays: it moves along the line of sight of the eyes'
    middle, and aside.
    """
    viewpoints_m = [invert(view_of_eye(rig.eyes[eye], np.eye(4)))[:3, 3] for eye in eyes]
    middle_m = np.mean(viewpoints_m, axis=0)
    centre_m = raised_m.mean(axis=0)
    line_m = centre_m - middle_m
    depth_m = transform(invert(rig.T_H_D), raised_m)[:, 2].min()
    # Movement along the line of sight changes the depth before the camera at this rate.
    rate = float((rig.T_H_D[:3, :3].T @ line_m)[2])
    places = []
    for aside_m, beyond_m in product(settings.aside_m, settings.depths_m):
        ratio = 1.0 + (settings.nearest_m + beyond_m - depth_m) / rate
        goal_m = middle_m + ratio * line_m
        goal_m[0] = middle_m[0] + aside_m
        place = goal_m - centre_m
        if _is_visible(raised_m + place, outline_m + place, rig, eyes, drawn_shift_m, settings):
            places.append(place)
    return places


def _is_visible(
    hand_m: Float64,
    outline_m: Float64,
    rig: Rig,
    eyes: Sequence[Eye],
    drawn_shift_m: Mapping[Eye, Float64],
    settings: PlacementSettings,
) -> bool:
    """Return whether a hand in H is in the camera's range and view, and on the displays."""
    hand_D_m = transform(invert(rig.T_H_D), hand_m)
    low_m, high_m = hand_D_m[:, 2].min(), hand_D_m[:, 2].max()
    if low_m < settings.nearest_m - 1e-3 or high_m > settings.farthest_m:
        return False
    camera = rig.depth_intrinsics
    pixels = image_points(hand_D_m, camera)
    if not ((pixels >= 0.0) & (pixels <= [camera.width - 1, camera.height - 1])).all():
        return False
    for eye in eyes:
        display = rig.eyes[eye]
        drawn = eye_projection(display, drawn_shift_m[eye]) @ view_of_eye(display, np.eye(4))
        pixels = project(drawn, outline_m)
        last_px = display.width_px - 0.5, display.height_px - 0.5
        if ((pixels >= -0.5) & (pixels <= last_px)).all(axis=1).mean() < settings.shown_share:
            return False
    return True


def _expected_arcmin(
    hand_m: Float64,
    outline_m: Float64,
    rig: Rig,
    eyes: Sequence[Eye],
    drawn_shift_m: Mapping[Eye, Float64],
    results: Results | None,
    solve: SolveSettings,
) -> float:
    """Return the error to expect on the mean of both eyes after an alignment at a place."""
    T_E_H = {eye: view_of_eye(rig.eyes[eye], np.eye(4)) for eye in EYES}
    H, wearer_m2 = seen_by(hand_m, outline_m, T_E_H, drawn_shift_m, eyes, rig, solve.fuse)
    prior: EyePrior = eye_prior(solve.fuse.prior)
    known: list[Observation] = []
    scale = 1.0
    registration_m2 = _REGISTRATION_SIGMA_M**2 * np.eye(3)
    if results is not None:
        fused = results.fused
        prior, scale = fused.prior, fused.wearer_scale
        known = [*fused.observed, *fused.verified.values()]
    known.append(Observation(H, np.zeros(3), registration_m2, wearer_m2))
    _, covariance_m2 = posterior(prior, [one.at(scale) for one in known])
    return float(
        np.mean(
            [
                expected_arcmin(
                    rig.eyes[eye], np.zeros(3), covariance_m2[eye_slice(eye), eye_slice(eye)]
                )
                for eye in EYES
            ]
        )
    )
