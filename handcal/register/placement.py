"""The next alignment of a plan: the eyes to keep open, and the place of the cursor.

The wearer raises the hand once. Every cursor is that hand, moved: to where, by the posterior's
covariance, an alignment lowers the expected error of both eyes most. The same slip of the wearer
moves φ less the nearer the hand is, so this is as near as the camera can measure, and where the
displays show enough of the hand. The cursor is drawn from one view of the camera, so the hand also
stays near the camera's line of sight to it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from handcal.core.display import eye_projection, is_on_display, view_of_eye
from handcal.core.geometry import image_points, invert, project, transform
from handcal.core.types import EYES, Bool, Eye, Float64, PlanName, Rig, Verification
from handcal.register.benefit import expected_arcmin
from handcal.register.fuse import Observation, seen_by
from handcal.register.prior import eye_prior, eye_slice, posterior, with_sitting
from handcal.register.results import Results, SolveSettings
from handcal.register.sitting import sitting_prior
from handcal.register.surface import describe_surface
from handcal.register.verdict import planned_eyes

_OUTLINE_FROM_POINTS = 1500
# Places to choose from, to the right of the camera's line of sight to the raised hand.
_ASIDE_M = -0.03, 0.0, 0.03
# Places to choose from, beyond the nearest. The last tells what the wearer always sees wrongly from
# the eyes, which pays if the prior of the sitting is wide.
_BEYOND_M = 0.0, 0.04, 0.08, 0.2
# Least share of the hand's outline within each display that is used.
_SHOWN_SHARE = 0.6
# More observations do not explain what no eye explains.
_WITH_MISFIT = 2
# Error of a registration, and its growth with the angle by which the camera sees the moved hand
# from another side: its outline is then other points, on a rim of about this radius.
_REGISTRATION_SIGMA_M = 3e-4
_RIM_M = 0.010


@dataclass(frozen=True, slots=True)
class PlacementSettings:
    """Places of cursors, and the number of alignments."""

    nearest_m: float = 0.44
    """Least distance of the hand from the camera, along its axis: at 1280x720 a D415, with 1005 px,
    55 mm and 126 disparities, measures nothing nearer unless a disparity shift is set."""
    farthest_m: float = 0.75
    """Largest such distance."""
    fewest: int = 2
    """Alignments of the recommended plan before the eyes are verified."""
    most: int = 6
    """Alignments after which no other is planned."""
    verifications: int = 4
    """Largest number of verifications of one eye: the others are for an eye that the first does not
    lead to *accept*. People see two outlines coincide better than they hold a hand."""


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
    """Return a plan's next alignment, or None if none is needed now or the maximum is reached.

    Of ``paper``: both eyes, the cursor where the hand is. Of ``recommended``: left, right and both
    in turn, each cursor where it is most informative. None is needed while an eye must be verified
    (`next_verification`), nor once every eye is accepted or keeps its offline calibration.

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
        Only one for a wearer who sees with one eye.
    settings : PlacementSettings
    solve : SolveSettings
        Its prior and precision of a wearer count before the first alignment.

    Raises
    ------
    HandError
        If nearly all points of the hand lie at cut edges.
    """
    fewest = settings.fewest if plan == "recommended" else 1
    is_enough = results is not None and _is_enough(plan, results, len(done), usable_eyes, settings)
    if len(done) >= settings.most or (len(done) >= fewest and is_enough):
        return None
    eyes = planned_eyes(plan, done, usable_eyes)
    if plan == "paper":
        return Planned(eyes, np.zeros(3), "the cursor is where the hand is")
    raised_m = transform(invert(T_W_H), raised_W_m)
    surface = describe_surface(raised_m, raised_is_cut, _OUTLINE_FROM_POINTS)
    raised = _Raised(raised_m, surface.points_m[surface.outline], rig, eyes, drawn_shift_m)
    places = _places(raised, settings)
    if not places:
        return Planned(eyes, np.zeros(3), "no other place is on the displays and in camera range")
    errors = [_expected_arcmin(raised, place, results, solve) for place in places]
    best = int(np.argmin(errors))
    which = "both eyes" if len(eyes) > 1 else f"the {eyes[0]} eye"
    return Planned(
        eyes,
        T_W_H[:3, :3] @ places[best],
        f"{errors[best]:.1f}′ expected after an alignment with {which} here",
    )


def next_verification(
    results: Results | None,
    verified: Mapping[Eye, Verification],
    *,
    usable_eyes: tuple[Eye, ...] = EYES,
    settings: PlacementSettings = PlacementSettings(),
) -> Eye | None:
    """Return the eye to verify next in the recommended plan, or None if there is none.

    Each eye once, then each eye again that is not accepted. Call it when `next_alignment` plans
    nothing, and again after each verification.
    """
    if results is None:
        return None
    counts = {eye: len(one.earlier) + 1 for eye, one in verified.items()}
    wanted = _to_verify(results, counts, usable_eyes, settings)
    return min(wanted, key=lambda eye: counts.get(eye, 0), default=None)


def _to_verify(
    results: Results,
    counts: Mapping[Eye, int],
    usable_eyes: Sequence[Eye],
    settings: PlacementSettings,
) -> list[Eye]:
    """Return the eyes to verify: each once, and again while it is not accepted."""
    most = settings.verifications
    if results.evidence:
        most = min(most, _WITH_MISFIT)
    return [
        eye
        for eye in usable_eyes
        if eye in results.verdicts
        and counts.get(eye, 0) < most
        and (not counts.get(eye) or results.verdicts[eye].name in ("repeat", "keep"))
    ]


def _is_enough(
    plan: PlanName,
    results: Results,
    done: int,
    usable_eyes: Sequence[Eye],
    settings: PlacementSettings,
) -> bool:
    """Return whether no alignment is needed now: an eye must be verified, or none would help."""
    if not set(results.verdicts) >= set(usable_eyes):
        return False
    counts = {eye: len(found) for eye, found in results.fused.verified.items()}
    if plan == "paper":
        return all(one.name != "repeat" for one in results.verdicts.values())
    # Alignments that cannot lead to accept are not made.
    is_worthwhile = not results.evidence and any(
        one.is_accepted and not one.verify and one.alignments <= settings.most - done
        for one in results.advice.values()
    )
    return bool(_to_verify(results, counts, usable_eyes, settings)) or not is_worthwhile


class _Raised(NamedTuple):
    """The raised hand in H, with its outline, and what its cursor is seen with."""

    hand_m: Float64
    outline_m: Float64
    rig: Rig
    eyes: Sequence[Eye]
    drawn_shift_m: Mapping[Eye, Float64]

    @property
    def line_m(self) -> Float64:
        """(3,); the camera's line of sight to the middle of the hand."""
        line_m: Float64 = self.hand_m.mean(axis=0) - self.rig.T_H_D[:3, 3]
        return line_m


def _places(raised: _Raised, settings: PlacementSettings) -> list[Float64]:
    """Return displacements of the raised hand, in H, to places that displays and camera allow.

    The hand moves along the camera's line of sight, so that the camera sees the same side of it,
    and a little sideways.
    """
    T_H_D, line_m = raised.rig.T_H_D, raised.line_m
    depth_m = transform(invert(T_H_D), raised.hand_m)[:, 2].min()
    # Movement along the line of sight changes the depth before the camera at this rate.
    rate = float((T_H_D[:3, :3].T @ line_m)[2])
    places = []
    for aside_m, beyond_m in product(_ASIDE_M, _BEYOND_M):
        ratio = 1.0 + (settings.nearest_m + beyond_m - depth_m) / rate
        places.append((ratio - 1.0) * line_m + [aside_m, 0.0, 0.0])
    return [place for place in places if _is_visible(raised, place, settings)]


def _is_visible(raised: _Raised, place: Float64, settings: PlacementSettings) -> bool:
    """Return whether the displaced hand is in the camera's range and view, and on the displays."""
    rig, camera = raised.rig, raised.rig.depth_intrinsics
    hand_D_m = transform(invert(rig.T_H_D), raised.hand_m + place)
    low_m, high_m = hand_D_m[:, 2].min(), hand_D_m[:, 2].max()
    # The nearest place is computed to be just at the limit, so rounding must not exclude it.
    if low_m < settings.nearest_m - 1e-3 or high_m > settings.farthest_m:
        return False
    pixels = image_points(hand_D_m, camera)
    if not ((pixels >= 0.0) & (pixels <= [camera.width - 1, camera.height - 1])).all():
        return False
    for eye in raised.eyes:
        display = rig.eyes[eye]
        drawn = eye_projection(display, raised.drawn_shift_m[eye]) @ view_of_eye(display, np.eye(4))
        outline_px = project(drawn, raised.outline_m + place)
        if is_on_display(display, outline_px).mean() < _SHOWN_SHARE:
            return False
    return True


def _expected_arcmin(
    raised: _Raised, place: Float64, results: Results | None, solve: SolveSettings
) -> float:
    """Return the mean expected error of both eyes after an alignment at a displacement."""
    rig = raised.rig
    T_E_H = {eye: view_of_eye(rig.eyes[eye], np.eye(4)) for eye in EYES}
    hand_m, outline_m = raised.hand_m + place, raised.outline_m + place
    H, wearer_m2, by_sitting = seen_by(
        hand_m, outline_m, T_E_H, raised.drawn_shift_m, raised.eyes, rig, solve.fuse
    )
    rays = (line_m / np.linalg.norm(line_m) for line_m in (raised.line_m, raised.line_m + place))
    turned_rad = float(np.linalg.norm(np.subtract(*rays)))
    registration_m2 = (_REGISTRATION_SIGMA_M**2 + (_RIM_M * turned_rad) ** 2) * np.eye(3)
    if results is None:
        prior = with_sitting(eye_prior(solve.fuse.prior), sitting_prior(rig, solve.fuse.sitting))
        observed, scale = [], 1.0
    else:
        fused = results.fused
        prior, observed, scale = fused.prior, list(fused.all_observed), fused.wearer_scale
    observed.append(Observation(H, np.zeros(3), registration_m2, wearer_m2, by_sitting))
    _, covariance_m2 = posterior(prior, [one.at(scale) for one in observed])
    parts = {eye: covariance_m2[eye_slice(eye), eye_slice(eye)] for eye in EYES}
    errors = [expected_arcmin(rig.eyes[eye], np.zeros(3), part) for eye, part in parts.items()]
    return float(np.mean(errors))
