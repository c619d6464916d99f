"""One simulated wearer led through one plan, by the functions that the live procedure calls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal, TypeAlias

import numpy as np

from handcal.core.display import arcmin_from_px, eye_projection, projection_matrix, view_of_eye
from handcal.core.geometry import invert, project, rigid, transform
from handcal.core.types import (
    EYES,
    Alignment,
    Bool,
    Eye,
    EyeDistance,
    EyeShift,
    Float64,
    PlanName,
    Verification,
)
from handcal.lab.study.wearers import StudyWearer
from handcal.register.fuse import FuseSettings
from handcal.register.guard import GuardSettings
from handcal.register.nudge import nudged_shift_m
from handcal.register.placement import PlacementSettings, next_alignment, next_verification
from handcal.register.prior import LearnedPrior, PriorSettings
from handcal.register.results import Results, SolveSettings, conclude
from handcal.register.solve import solve_alignment
from handcal.register.surface import describe_surface
from handcal.sim.people import (
    Sitting,
    draw_error,
    draw_movement_m,
    draw_perception,
    is_balanced,
)
from handcal.sim.placement import apply_placement_error, overlay_hand, view_through
from handcal.sim.raster import visible_points
from handcal.sim.wearer_settings import WearerSettings

EyeDistanceSource: TypeAlias = Literal["none", "ruler", "headset"]

See: TypeAlias = Callable[[np.random.Generator, StudyWearer, Float64], tuple[Float64, Bool]]
"""Returns, for the hand's pose T_H_hand (4, 4), points (N, 3) in H, and which are beside a cut."""

_OUTLINE_FROM_POINTS = 1500
_FOREARM_M = 0.04
_EYE_DISTANCE_SIGMA_M = 0.001


@dataclass(frozen=True, slots=True)
class ProcedureModel:
    """The simulated wearers and their time."""

    points: int = 1500
    """Number of points of each cloud."""
    depth_sigma_m: float = 0.001
    """Standard deviation of each point's depth."""
    hands: int = 12
    """Number of different hands."""
    perceived_arcmin: float = 1.5
    perceived_size: float = 0.00375
    """Standard deviations of a verification for wearers with the usual errors: 2′ and 0.5 % for
    those with 1.33 times these."""
    verify_s: float = 4.0
    """The wearer's time for the verification of one eye; an assumption."""
    eye_distance: EyeDistanceSource = "none"
    prior: LearnedPrior | None = None
    """As learned from earlier sessions; None for the default."""
    see: See | None = None
    """Measures the hand with a simulated camera; None: `points` of its ideal surface."""


@dataclass(frozen=True, slots=True, eq=False)
class Calibrated:
    """The result of a wearer's calibration."""

    shift_m: Mapping[Eye, Float64]
    """φ rendered with."""
    results: Results
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class _Raised:
    """The raised hand, in H."""

    T_H_hand: Float64
    points_m: Float64
    is_cut: Bool
    outline_m: Float64


def lead_through(
    rng: np.random.Generator,
    wearer: StudyWearer,
    sitting: Sitting,
    model: ProcedureModel,
    plan: PlanName,
    *,
    verify: bool,
    placement: PlacementSettings,
    usable_eyes: tuple[Eye, ...] = EYES,
) -> Calibrated:
    """Lead a wearer through a plan: raise, align, and verify each eye if `verify`."""
    usual = sitting.settings
    solve = SolveSettings(fuse=FuseSettings(prior=PriorSettings(learned=model.prior)))
    eye_distance = _eye_distance(rng, wearer, model.eye_distance)
    raised = _raise(rng, wearer, model)
    seconds = 2.0 * usual.movement_s
    shift_m: dict[Eye, Float64] = {eye: np.zeros(3) for eye in EYES}
    solved: list[tuple[Alignment, Mapping[Eye, EyeShift]]] = []
    verified: dict[Eye, Verification] = {}
    results: Results | None = None
    at_rest_m = raised.T_H_hand
    to_verify = partial(next_verification, usable_eyes=usable_eyes, settings=placement)
    while True:
        planned = next_alignment(
            raised.points_m,
            raised.is_cut,
            np.eye(4),
            wearer.rig,
            results,
            [alignment.eyes for alignment, _ in solved],
            shift_m,
            plan=plan,
            usable_eyes=usable_eyes,
            settings=placement,
            solve=solve,
        )
        if planned is not None:
            alignment, at_rest_m = _align(
                rng, wearer, sitting, model, raised, planned.displacement_W_m, planned.eyes, shift_m
            )
            solved.append((alignment, solve_alignment(alignment, wearer.rig)))
            seconds += usual.reaction_s + usual.movement_s + usual.dwell_s
        elif verify and (eye := to_verify(results, verified)) is not None:
            found = _verify(rng, wearer, sitting, model, eye, shift_m[eye], at_rest_m)
            verified[eye] = found.after(verified.get(eye))
            seconds += model.verify_s
        else:
            assert results is not None
            return Calibrated(shift_m, results, seconds)
        results = conclude(
            solved,
            wearer.rig,
            solve,
            eye_distance=eye_distance,
            verified=verified,
            plan=plan,
            usable_eyes=usable_eyes,
        )
        shift_m |= results.rendered_shift_m


def _raise(rng: np.random.Generator, wearer: StudyWearer, model: ProcedureModel) -> _Raised:
    usual = WearerSettings()
    viewpoints_m = [invert(wearer.T_E_H(eye))[:3, 3] for eye in EYES]
    palm_m = np.mean(viewpoints_m, axis=0) + usual.raise_m
    palm_m += rng.uniform(-1.0, 1.0, 3) * usual.raise_spread_m
    T_H_hand = rigid(rng.normal(0.0, usual.raise_turn_rad, 3), palm_m)
    points_m, is_cut = _see(rng, wearer, model, T_H_hand)
    surface = describe_surface(points_m, is_cut, _OUTLINE_FROM_POINTS)
    return _Raised(T_H_hand, points_m, is_cut, surface.points_m[surface.outline])


def _see(
    rng: np.random.Generator, wearer: StudyWearer, model: ProcedureModel, T_H_hand: Float64
) -> tuple[Float64, Bool]:
    if model.see is not None:
        return model.see(rng, wearer, T_H_hand)
    points_D_m, is_cut = visible_points(
        wearer.hand,
        invert(wearer.rig.T_H_D) @ T_H_hand,
        model.points,
        rng,
        intrinsics=wearer.rig.depth_intrinsics,
        forearm_m=_FOREARM_M,
        depth_sigma_m=model.depth_sigma_m,
    )
    return transform(wearer.rig.T_H_D, points_D_m), is_cut


def _align(
    rng: np.random.Generator,
    wearer: StudyWearer,
    sitting: Sitting,
    model: ProcedureModel,
    raised: _Raised,
    displacement_m: Float64,
    eyes: tuple[Eye, ...],
    drawn_m: Mapping[Eye, Float64],
) -> tuple[Alignment, Float64]:
    """Let the wearer overlay the hand on the moved cursor; return the hand's pose, too."""
    rig = wearer.rig
    T_H_cursor = rigid(translation_m=displacement_m) @ raised.T_H_hand
    shown_m = raised.outline_m + displacement_m
    on_hand_m = transform(invert(T_H_cursor), shown_m)
    kept = is_balanced(on_hand_m, wearer.hand, sitting)
    views = [
        view_through(
            rig.eyes[eye],
            wearer.true_shift_m[eye],
            np.eye(4),
            projection_matrix(rig.eyes[eye], drawn_m[eye]) @ rig.eyes[eye].T_V_H,
            shown_m[kept],
        )
        for eye in eyes
    ]
    eye_m = np.mean([wearer.eye_m(eye) for eye in eyes], axis=0)
    distance_m = float(np.linalg.norm(shown_m.mean(axis=0) - eye_m))
    error = draw_error(rng, sitting, distance_m, GuardSettings().limit_rad)
    placed = overlay_hand(on_hand_m[kept], T_H_cursor @ rigid(error.rotation_rad), views)
    assert placed is not None, "the cursor is on the displays"
    T_H_hand = apply_placement_error(placed[0], eye_m, error)
    T_H_hand = rigid(translation_m=draw_movement_m(rng, sitting)) @ T_H_hand
    hand_m, hand_is_cut = _see(rng, wearer, model, T_H_hand)
    return (
        Alignment(
            cursor_m=raised.points_m + displacement_m,
            hand_m=hand_m,
            cursor_is_cut=raised.is_cut,
            hand_is_cut=hand_is_cut,
            T_E_W={eye: view_of_eye(rig.eyes[eye], np.eye(4)) for eye in EYES},
            eyes=eyes,
            rotation_rad=rig.T_H_D[:3, :3].T @ T_H_cursor[:3, :3] @ error.rotation_rad,
            t_a_ns=0,
            t_b_ns=1,
            drawn_shift_m=drawn_m,
        ),
        T_H_hand,
    )


def _verify(
    rng: np.random.Generator,
    wearer: StudyWearer,
    sitting: Sitting,
    model: ProcedureModel,
    eye: Eye,
    drawn_m: Float64,
    T_H_hand: Float64,
) -> Verification:
    """Let the wearer move the drawing of the resting hand until it seems to cover the hand.

    The movement is the mean, and the growth the least-squares scale, from the measured points as
    drawn to the same points as the eye sees them.
    """
    display = wearer.rig.eyes[eye]
    points_m, _ = _see(rng, wearer, model, T_H_hand)
    kept = is_balanced(transform(invert(T_H_hand), points_m), wearer.hand, sitting)
    points_E_m = transform(wearer.T_E_H(eye), points_m)
    drawn_px = project(eye_projection(display, drawn_m), points_E_m[kept])
    seen_px = project(eye_projection(display, wearer.true_shift_m[eye]), points_E_m[kept])
    moved_px = (seen_px - drawn_px).mean(axis=0)
    centred_px = drawn_px - drawn_px.mean(axis=0)
    growth = float(np.sum(centred_px * (seen_px - seen_px.mean(axis=0))) / np.sum(centred_px**2))
    error_arcmin, error_size = draw_perception(
        rng, sitting, model.perceived_arcmin, model.perceived_size
    )
    moved_arcmin = np.sign(moved_px) * arcmin_from_px(display, np.abs(moved_px)) + error_arcmin
    size = growth - 1.0 + error_size
    hand_E_m = points_E_m[kept].mean(axis=0)
    after_m = nudged_shift_m(
        display, drawn_m, hand_E_m, float(moved_arcmin[0]), float(moved_arcmin[1]), size
    )
    return Verification(
        before_m=_three(drawn_m),
        nudge_arcmin=(float(moved_arcmin[0]), float(moved_arcmin[1])),
        after_m=_three(after_m),
        nudge_size=size,
        hand_E_m=_three(hand_E_m),
    )


def _three(values_m: Float64) -> tuple[float, float, float]:
    x, y, z = values_m.tolist()
    return x, y, z


def _eye_distance(
    rng: np.random.Generator, wearer: StudyWearer, source: EyeDistanceSource
) -> EyeDistance | None:
    if source == "none":
        return None
    apart_m = float(np.linalg.norm(wearer.eye_m("right") - wearer.eye_m("left")))
    measured_m = apart_m + float(rng.normal(0.0, _EYE_DISTANCE_SIGMA_M))
    return EyeDistance(
        measured_m, _EYE_DISTANCE_SIGMA_M, "headset" if source == "headset" else "typed"
    )
