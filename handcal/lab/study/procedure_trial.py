"""One simulated wearer led through one plan, by the functions that the live procedure calls.

The wearer sees the true hand, and what the headset draws of the measured one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Literal, TypeAlias, TypeVar

import numpy as np

from handcal.calibration.verifying import Verifying, draw_offset
from handcal.core.display import projection_matrix, view_of_eye
from handcal.core.errors import HandError
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import (
    EYES,
    Alignment,
    Eye,
    EyeDistance,
    EyeShift,
    Float64,
    PlanName,
    Verification,
)
from handcal.hand.edges import edges_of
from handcal.lab.study.seeing import See, SeenHand
from handcal.lab.study.wearers import StudyWearer
from handcal.link.nudges import VerifyRequest
from handcal.register.fuse import FuseSettings
from handcal.register.guard import GuardSettings, RotationGuard
from handcal.register.placement import PlacementSettings, next_alignment, next_verification
from handcal.register.prior import LearnedPrior, PriorSettings
from handcal.register.results import Results, SolveSettings, conclude
from handcal.register.sitting import LearnedSitting, SittingSettings
from handcal.register.solve import solve_alignment
from handcal.sim.people import (
    Sitting,
    draw_error,
    draw_movement_m,
    draw_perception,
    is_balanced,
    misplaced,
    opened,
)
from handcal.sim.placement import apply_placement_error
from handcal.sim.sensor import SensorName
from handcal.sim.silhouette import overlay_outline, view_outline
from handcal.sim.verifying import SeenDifference, presses_for, see_difference
from handcal.sim.wearer_settings import WearerSettings

EyeDistanceSource: TypeAlias = Literal["none", "ruler", "headset"]
T = TypeVar("T")

_EYE_DISTANCE_SIGMA_M = 0.001
# A pose in which the camera cannot segment the hand, or that the guard refuses, is tried again.
_TRIES = 8
_MOST_LOOKS = 6
_FARTHER = 0.45
"""Of the hand's distance, by how much a stretched arm holds it farther away."""


@dataclass(frozen=True, slots=True)
class ProcedureModel:
    """The simulated wearers and their time."""

    sensor: SensorName = "d415"
    fatten_px: float | None = None
    """Of every D415's images; None: as drawn for each wearer."""
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
    sitting: LearnedSitting | None = None
    """As learned from earlier sessions; None for the default."""


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
    seen: SeenHand
    guard: RotationGuard


def lead_through(
    rng: np.random.Generator,
    wearer: StudyWearer,
    see: See,
    sitting: Sitting,
    model: ProcedureModel,
    plan: PlanName,
    *,
    verify: bool,
    placement: PlacementSettings,
    usable_eyes: tuple[Eye, ...] = EYES,
    farther_too: bool = False,
) -> Calibrated:
    """Lead a wearer through a plan: raise, align, and verify each eye if `verify`.

    If `farther_too`, each eye is verified once more at the end with the arm stretched, as a lab
    does that learns what its wearers always see wrongly.
    """
    usual = sitting.settings
    solve = SolveSettings(
        fuse=FuseSettings(
            prior=PriorSettings(learned=model.prior),
            sitting=SittingSettings(learned=model.sitting),
        )
    )
    person = _Person(rng, wearer, see, sitting, model)
    eye_distance = person.eye_distance()
    raised = person.raise_hand()
    seconds = 2.0 * usual.movement_s
    shift_m: dict[Eye, Float64] = {eye: np.zeros(3) for eye in EYES}
    solved: list[tuple[Alignment, Mapping[Eye, EyeShift]]] = []
    verified: dict[Eye, Verification] = {}
    results: Results | None = None
    at_rest_m = raised.T_H_hand
    skipped: set[Eye] = set()
    again = 0
    farther = list(usable_eyes) if farther_too else []
    while True:
        planned = next_alignment(
            raised.seen.points_m,
            raised.seen.is_cut,
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
            try:
                alignment, at_rest_m = person.align(
                    raised, planned.displacement_W_m, planned.eyes, shift_m
                )
            except HandError:
                again += 1
                if again > _TRIES:
                    raise
                raised = person.raise_hand()
                seconds += 2.0 * usual.movement_s
                continue
            solved.append((alignment, solve_alignment(alignment, wearer.rig)))
            seconds += usual.reaction_s + usual.movement_s + usual.dwell_s
        elif verify and (eye := _to_verify(results, verified, usable_eyes, skipped, placement)):
            verification = person.verify(eye, shift_m[eye], at_rest_m, raised)
            seconds += model.verify_s * (2.0 if any(verification.offset_arcmin) else 1.0)
            if not verification.was_moved:
                skipped.add(eye)
                continue
            verified[eye] = verification.after(verified.get(eye))
        elif farther:
            eye = farther.pop()
            line_m = at_rest_m[:3, 3] - wearer.eye_m(eye)
            T_H_far = rigid(translation_m=_FARTHER * line_m) @ at_rest_m
            verification = person.verify(eye, shift_m[eye], T_H_far, raised)
            verified[eye] = verification.after(verified.get(eye))
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


def _to_verify(
    results: Results | None,
    verified: Mapping[Eye, Verification],
    usable_eyes: tuple[Eye, ...],
    skipped: set[Eye],
    placement: PlacementSettings,
) -> Eye | None:
    """Return the eye to verify next, as the live plan does."""
    asked = tuple(eye for eye in usable_eyes if eye not in skipped)
    return next_verification(results, verified, usable_eyes=asked, settings=placement)


@dataclass(frozen=True, slots=True, eq=False)
class _Person:
    """A simulated wearer in front of a camera, with a source of chance."""

    rng: np.random.Generator
    wearer: StudyWearer
    see: See
    sitting: Sitting
    model: ProcedureModel

    def raise_hand(self) -> _Raised:
        """Raise the hand about where wearers do."""
        usual = WearerSettings()
        viewpoints_m = [invert(self.wearer.T_E_H(eye))[:3, 3] for eye in EYES]
        middle_m = np.mean(viewpoints_m, axis=0) + usual.raise_m

        def attempt() -> _Raised:
            palm_m = middle_m + self.rng.uniform(-1.0, 1.0, 3) * usual.raise_spread_m
            T_H_hand = rigid(self.rng.normal(0.0, usual.raise_turn_rad, 3), palm_m)
            seen = self.see(self.rng, self.wearer.hand, self.wearer.rig, T_H_hand)
            return _Raised(T_H_hand, seen, RotationGuard(seen.points_m, seen.is_cut))

        return _tried_again(attempt)

    def in_view(self, T_H_hand: Float64, raised: _Raised) -> tuple[Float64, SeenHand]:
        """Return a resting hand as measured.

        It is moved toward where it was raised if it is out of view.
        """
        back_m = raised.T_H_hand[:3, 3] - T_H_hand[:3, 3]
        for share in np.linspace(0.0, 1.0, _TRIES):
            T = rigid(translation_m=share * back_m) @ T_H_hand
            with suppress(HandError):
                return T, self.see(self.rng, self.wearer.hand, self.wearer.rig, T)
        return raised.T_H_hand, raised.seen

    def align(
        self,
        raised: _Raised,
        displacement_m: Float64,
        eyes: tuple[Eye, ...],
        drawn_m: Mapping[Eye, Float64],
    ) -> tuple[Alignment, Float64]:
        """Overlay the hand on the moved cursor; return the hand's pose, too."""
        rng, wearer, rig, sitting = self.rng, self.wearer, self.wearer.rig, self.sitting
        T_H_cursor = rigid(translation_m=displacement_m) @ raised.T_H_hand
        shown_m = raised.seen.outline_m + displacement_m
        views = [
            view_outline(
                rig.eyes[eye],
                wearer.true_shift_m[eye],
                np.eye(4),
                projection_matrix(rig.eyes[eye], drawn_m[eye]) @ rig.eyes[eye].T_V_H,
                shown_m,
            )
            for eye in eyes
        ]
        eye_m = np.mean([wearer.eye_m(eye) for eye in eyes], axis=0)
        distance_m = float(np.linalg.norm(shown_m.mean(axis=0) - eye_m))
        balanced = partial(is_balanced, hand=wearer.hand, sitting=sitting)

        def attempt() -> tuple[Alignment, Float64]:
            hand = opened(rng, wearer.hand, sitting)
            error = draw_error(rng, sitting, distance_m, GuardSettings().limit_rad)
            turned = T_H_cursor @ rigid(error.rotation_rad)
            placed = overlay_outline(hand, turned, views, balanced)
            assert placed is not None, "the cursor is on the displays"
            T_H_hand = apply_placement_error(placed[0], eye_m, error)
            T_H_hand = misplaced(T_H_hand, eye_m, sitting.sees_hand)
            T_H_hand = rigid(translation_m=draw_movement_m(rng, sitting)) @ T_H_hand
            seen = self.see(rng, hand, rig, T_H_hand)
            rotation_rad = raised.guard.rotation(seen.points_m, seen.is_cut)
            shape = raised.guard.shape_change(seen.points_m, seen.is_cut)
            limits = GuardSettings()
            is_turned = np.linalg.norm(rotation_rad) > limits.limit_rad
            if is_turned or shape.rms_m > limits.shape_limit_m:
                raise HandError("turned, or of another shape")
            return (
                Alignment(
                    cursor_m=raised.seen.points_m + displacement_m,
                    hand_m=seen.points_m,
                    cursor_is_cut=raised.seen.is_cut,
                    hand_is_cut=seen.is_cut,
                    T_E_W={eye: view_of_eye(rig.eyes[eye], np.eye(4)) for eye in EYES},
                    eyes=eyes,
                    rotation_rad=rig.T_H_D[:3, :3].T @ rotation_rad,
                    t_a_ns=0,
                    t_b_ns=1,
                    drawn_shift_m=drawn_m,
                ),
                T_H_hand,
            )

        return _tried_again(attempt)

    def verify(
        self, eye: Eye, drawn_m: Float64, T_H_hand: Float64, raised: _Raised
    ) -> Verification:
        """Move the drawing of the resting hand until it seems to cover the hand.

        If it fits at once, it is moved aside, and the wearer is asked to bring it back.
        """
        wearer, sitting, model = self.wearer, self.sitting, self.model
        hand, display = wearer.hand, wearer.rig.eyes[eye]
        T_H_hand, seen = self.in_view(T_H_hand, raised)
        hand_E_m = transform(wearer.T_E_H(eye), seen.points_m).mean(axis=0)
        error = draw_perception(self.rng, sitting, model.perceived_arcmin, model.perceived_size)
        balanced = partial(is_balanced, hand=hand, sitting=sitting)
        request = VerifyRequest(1, eye)

        def look(shown_m: Float64) -> SeenDifference:
            drawn = projection_matrix(display, shown_m) @ display.T_V_H
            true_m = wearer.true_shift_m[eye]
            difference = see_difference(
                display, true_m, drawn, np.eye(4), hand, T_H_hand, seen.outline_m, balanced
            )
            assert difference is not None, "the outline is on the display"
            return difference

        verifying = Verifying(request, display, drawn_m, hand_E_m)
        while True:
            for _ in range(_MOST_LOOKS):
                presses = presses_for(look(verifying.shift_m), error, request)
                if sitting.variant == "fits-at-once" or not any(presses):
                    break
                verifying.nudge(*presses)
            if not verifying.needs_proof:
                return verifying.result(hand_E_m, edges_of(wearer.rig).sigma_px)
            verifying.set_aside(draw_offset(self.rng))

    def eye_distance(self) -> EyeDistance | None:
        """Return the distance of the eyes as the model's source measures it."""
        source = self.model.eye_distance
        if source == "none":
            return None
        apart_m = float(np.linalg.norm(self.wearer.eye_m("right") - self.wearer.eye_m("left")))
        measured_m = apart_m + float(self.rng.normal(0.0, _EYE_DISTANCE_SIGMA_M))
        kind: Literal["headset", "typed"] = "headset" if source == "headset" else "typed"
        return EyeDistance(measured_m, _EYE_DISTANCE_SIGMA_M, kind)


def _tried_again(attempt: Callable[[], T]) -> T:
    """Return what an attempt returns; it may be refused a few times, as a live one may."""
    for _ in range(_TRIES - 1):
        with suppress(HandError):
            return attempt()
    return attempt()
