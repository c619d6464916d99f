"""The plan of a session: decides the next step, and takes it when the hand is still.

The paper's plan is one alignment with both eyes open. In the recommended plan the hand is raised
once: the cursors are that hand, placed where an alignment is most informative
(`handcal.register.placement`), for the left eye, the right eye and both in turn; then each eye is
verified. Both plans end when every eye has its verdict, or when nothing more can be gained.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from handcal.errors import HandError
from handcal.register.placement import PlacementSettings, Planned, next_alignment, next_verification
from handcal.register.verdict import planned_eyes
from handcal.station.procedure import Calibration
from handcal.station.states import Observation, ProcedureError, State
from handcal.types import EYES, Eye, EyePlan, PlanName


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """The plan that a session follows."""

    name: PlanName = "paper"
    usable_eyes: tuple[Eye, ...] = EYES
    """Only one for a wearer who sees with one eye."""
    is_automatic: bool = False
    """True if each step runs automatically once the hand is still."""
    verify: bool = True
    """True if each eye is verified after the alignments."""
    placement: PlacementSettings = field(default_factory=PlacementSettings)


class StepName(StrEnum):
    """The next thing that a plan needs."""

    RAISE = "raise"
    """The hand must be raised and held still."""
    CURSOR = "cursor"
    ALIGN = "align"
    """The wearer aligns the hand with the cursor."""
    SOLVE = "solve"
    APPLY = "apply"
    WAIT = "wait"
    """The headset has not acknowledged its projections yet."""
    VERIFY = "verify"
    NUDGE = "nudge"
    """The wearer moves the drawing."""
    DONE = "done"


_BY_STATE = {
    State.ALIGN: StepName.ALIGN,
    State.ALIGNED: StepName.SOLVE,
    State.SOLVED: StepName.APPLY,
    State.APPLYING: StepName.WAIT,
    State.VERIFY: StepName.NUDGE,
}
_JUDGED = ("accept", "keep")
_IN_TURN: Mapping[EyePlan, tuple[tuple[Eye, ...], ...]] = {
    "both": (EYES,), "each": (("left",), ("right",)), "left": (("left",),), "right": (("right",),),
}  # fmt: skip


def paper_alignments(eyes: EyePlan, count: int) -> tuple[tuple[Eye, ...], ...]:
    """Return the eyes open in each alignment of the paper's plan, `count` times over."""
    return _IN_TURN[eyes] * count


def usable_eyes(eyes: EyePlan) -> tuple[Eye, ...]:
    """Return the eyes that are calibrated in any order."""
    return tuple(eye for eye in EYES if any(eye in open_eyes for open_eyes in _IN_TURN[eyes]))


_FAULTY = ("contradicted", "implausible")


@dataclass(frozen=True, slots=True)
class NextStep:
    """The next step of a plan."""

    name: StepName
    eyes: tuple[Eye, ...]
    """The eyes that it is for."""
    text: str
    """One line for the technician."""
    planned: Planned | None = None
    """The alignment, for `cursor`."""


class Plan:
    """Follows a plan with one calibration.

    Parameters
    ----------
    calibration : Calibration
    settings : PlanSettings
    verifies_first : bool
        True if the headset draws with a stored φ, which is verified before anything else.
    skipped : collection of eye
        Eyes that are not verified: those skipped before the session was resumed.

    Attributes
    ----------
    skipped : set of eye
    """

    def __init__(
        self,
        calibration: Calibration,
        settings: PlanSettings,
        verifies_first: bool = False,
        skipped: Collection[Eye] = (),
    ) -> None:
        self.settings = settings
        self._calibration = calibration
        self._verifies_first = verifies_first
        self._decided: tuple[object, Planned | None] | None = None
        self._is_over = False
        self.skipped = set(skipped)

    def next_step(self, is_steady: bool) -> NextStep:
        """Return the next step; nothing changes. `is_steady`: the hand is in view and still."""
        calibration = self._calibration
        if (name := _BY_STATE.get(calibration.state)) is not None:
            return NextStep(name, calibration.eyes, _TEXTS[name])
        if calibration.results is None and (calibration.alignments or calibration.verifications):
            # One was deleted or restored, or the eye distance has changed.
            return NextStep(StepName.SOLVE, calibration.eyes, _TEXTS[StepName.SOLVE])
        unverified = self._unverified()
        if self._verifies_first and not calibration.alignments and unverified:
            return self._with_hand(StepName.VERIFY, unverified[:1], is_steady)
        if (why := self._reason_to_end(unverified)) is not None:
            return NextStep(StepName.DONE, (), why)
        if not (is_steady or calibration.raised) or not calibration.is_applied:
            done = [one.eyes for one in calibration.alignments.values()]
            eyes = planned_eyes(self.settings.name, done, self.settings.usable_eyes)
            name = StepName.WAIT if calibration.raised or is_steady else StepName.RAISE
            return NextStep(name, eyes, _TEXTS[name])
        planned = self._planned()
        if planned is not None:
            return NextStep(StepName.CURSOR, planned.eyes, planned.reason, planned)
        if (eye := self._next_verification()) is not None:
            return self._with_hand(StepName.VERIFY, (eye,), is_steady)
        return NextStep(StepName.DONE, (), self._takes())

    def advance(self, observation: Observation) -> NextStep:
        """Take the next step if nobody has to act; return it. The next frame may have another.

        Raises
        ------
        LinkError
            If the link is closed.
        FileError
            If the session cannot be written; the step is done anyway.
        """
        calibration = self._calibration
        step = self.next_step(observation.is_steady)
        try:
            match step.name:
                case StepName.CURSOR:
                    assert step.planned is not None
                    self._make_cursor(step.planned)
                case StepName.SOLVE:
                    calibration.solve()
                case StepName.APPLY:
                    calibration.apply(keeps_hand=self.settings.name == "recommended")
                case StepName.VERIFY:
                    calibration.verify(step.eyes[0])
                case StepName.DONE if not self._is_over:
                    calibration.release_hand()
        except (ProcedureError, HandError) as error:
            return NextStep(StepName.WAIT, step.eyes, str(error))
        self._is_over = step.name is StepName.DONE
        return step

    def skip(self) -> None:
        """End the verification without a result; the plan does not verify this eye again.

        Raises
        ------
        ProcedureError
            Unless an eye is being verified.
        FileError
            If the session cannot be written; the verification ends anyway.
        """
        self.skipped |= {*self._calibration.eyes} if self._calibration.verifying else set()
        self._calibration.skip_verification()

    def _make_cursor(self, planned: Planned) -> None:
        is_moved = self.settings.name == "recommended"
        self._calibration.make_cursor(planned.eyes, planned.displacement_W_m if is_moved else None)

    def _planned(self) -> Planned | None:
        """Return the next alignment, decided once for each result and hand."""
        calibration = self._calibration
        hand = calibration.raised or calibration.steady_hand
        newest = calibration.newest_hand or hand
        assert hand is not None
        assert newest is not None
        key = (calibration.results, tuple(calibration.alignments), calibration.raised, hand)
        if self._decided is None or not all(
            one is other or one == other
            for one, other in zip(self._decided[0], key, strict=True)  # type: ignore[call-overload]
        ):
            self._decided = (
                key,
                next_alignment(
                    hand.points_W_m,
                    hand.cloud.is_cut,
                    calibration.T_W_H(newest),
                    calibration.rig,
                    calibration.results,
                    [one.eyes for one in calibration.alignments.values()],
                    calibration.applied_shift_m,
                    plan=self.settings.name,
                    usable_eyes=self.settings.usable_eyes,
                    settings=self.settings.placement,
                    solve=calibration.solve_settings,
                ),
            )
        return self._decided[1]

    def _unverified(self) -> tuple[Eye, ...]:
        done = {*self._calibration.verifications, *self.skipped}
        return tuple(eye for eye in self.settings.usable_eyes if eye not in done)

    def _reason_to_end(self, unverified: tuple[Eye, ...]) -> str | None:
        """Return why the plan ends now, or None."""
        results = self._calibration.results
        if results is None:
            return None
        found = {eye: one.name for eye, one in results.verdicts.items()}
        if faulty := [eye for eye in found if found[eye] in _FAULTY]:
            return results.verdicts[faulty[0]].reason
        is_judged = all(found.get(eye) in _JUDGED for eye in self.settings.usable_eyes)
        is_verified = not (unverified and self.settings.verify)
        # A stored calibration that its verification does not refuse is kept.
        is_kept = not self._calibration.alignments or self._next_verification() is None
        if is_judged and is_verified and is_kept:
            return "every eye has its verdict"
        return None

    def _next_verification(self) -> Eye | None:
        """Return the eye to verify next, if no alignment comes first."""
        if not self.settings.verify:
            return None
        return next_verification(
            self._calibration.results,
            self._calibration.verifications,
            usable_eyes=tuple(e for e in self.settings.usable_eyes if e not in self.skipped),
            settings=self.settings.placement,
        )

    def _takes(self) -> str:
        """Return what it would take to be accepted."""
        results = self._calibration.results
        reasons = [] if results is None else [one.reason for one in results.verdicts.values()]
        return "; ".join(dict.fromkeys(reasons)) or "nothing more is planned"

    def _with_hand(self, name: StepName, eyes: tuple[Eye, ...], is_steady: bool) -> NextStep:
        """Return a step that needs a still hand and acknowledged projections."""
        if not is_steady:
            name = StepName.RAISE
        elif not self._calibration.is_applied:
            name = StepName.WAIT
        return NextStep(name, eyes, _TEXTS[name])


_TEXTS = {
    StepName.RAISE: "the wearer raises the hand and holds it still",
    StepName.ALIGN: "the wearer aligns the hand with the cursor and confirms",
    StepName.SOLVE: "the alignments are solved",
    StepName.APPLY: "the projections are sent",
    StepName.WAIT: "the headset has not acknowledged its projections yet",
    StepName.VERIFY: "the wearer verifies an eye",
    StepName.NUDGE: "the wearer moves the outline until it covers the hand, and confirms",
}
