"""The plan of a session: decides the next step, and takes it.

The paper's plan aligns both eyes at once, or one after the other, each cursor where the hand is. In
the recommended plan the hand is raised once: the cursors are that hand, placed where an alignment
is most informative (`handcal.register.placement`), for the left eye, the right eye and both in
turn. In both, each eye is then verified. A plan ends when every eye has its verdict, or when
nothing more can be gained; a person may ask for more (`Plan.request`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from enum import StrEnum

from handcal.calibration.procedure import Calibration
from handcal.calibration.states import Observation, ProcedureError, State
from handcal.core.errors import FileError, HandError
from handcal.core.types import EYES, Eye, EyePlan, PlanName, Verdict, VerdictName
from handcal.register.placement import PlacementSettings, Planned, next_alignment, next_verification
from handcal.register.verdict import Advice, planned_eyes


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """The plan that a session follows."""

    name: PlanName = "paper"
    usable_eyes: tuple[Eye, ...] = EYES
    """Only one for a wearer who sees with one eye."""
    is_automatic: bool = False
    """True if each step runs automatically once the hand is still."""
    verify: bool = True
    """True if each eye is verified after the alignments, and aligned again if it is not accepted
    but soon would be."""
    placement: PlacementSettings = field(default_factory=PlacementSettings)
    in_turn: bool = False
    """True if the paper's plan aligns one eye after the other."""
    alignments: int = 1
    """Number of alignments of the paper's plan; of each eye, if they are in turn."""

    @property
    def eyes(self) -> EyePlan:
        """The usable eyes and their order in one word."""
        if len(self.usable_eyes) == 1:
            return self.usable_eyes[0]
        return "each" if self.in_turn else "both"


def with_eyes(settings: PlanSettings, eyes: EyePlan) -> PlanSettings:
    """Return settings for these eyes, in this order."""
    usable: tuple[Eye, ...] = (eyes,) if eyes == "left" or eyes == "right" else EYES
    return replace(settings, usable_eyes=usable, in_turn=eyes == "each")


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
_PAUSE_NS: Mapping[PlanName, int] = {"paper": 1_200_000_000, "recommended": 0}
"""Time for which a step must have been next before it begins automatically. In the paper's plan the
wearer lowers the hand and raises it again in between, and should see what comes."""
_FEW = 2
"""Most further alignments of the paper's plan that are begun without asking."""


@dataclass(frozen=True, slots=True)
class NextStep:
    """The next step of a plan."""

    name: StepName
    eyes: tuple[Eye, ...]
    """The eyes that it is for."""
    text: str
    """One line for the technician."""
    planned: Planned | None = None
    """The place of the cursor, if the plan chooses it."""
    awaited: StepName | None = None
    """The step that follows once the hand is raised, or the projections are acknowledged."""
    is_requested: bool = False
    """True if a person has asked for it."""


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
    settings : PlanSettings
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
        self._requested: tuple[Eye, ...] = ()
        self._waiting: tuple[object, int] = None, 0
        self.skipped = set(skipped)

    def next_step(self, is_steady: bool) -> NextStep:
        """Return the next step; nothing changes. `is_steady`: the hand is in view and still."""
        calibration = self._calibration
        if (name := _BY_STATE.get(calibration.state)) is not None:
            return NextStep(name, calibration.eyes, _TEXTS[name])
        if calibration.results is None and (calibration.alignments or calibration.verifications):
            # One was deleted or restored, or the eye distance has changed.
            return NextStep(StepName.SOLVE, calibration.eyes, _TEXTS[StepName.SOLVE])
        if self._requested:
            step = self._with_hand(StepName.CURSOR, self._requested, is_steady)
            return replace(step, is_requested=True)
        unverified = self._unverified()
        if self._verifies_first and not calibration.alignments:
            if unverified:
                return self._with_hand(StepName.VERIFY, unverified[:1], is_steady)
            if why := self._end(unverified):
                return NextStep(StepName.DONE, (), why)
        if self.settings.name == "paper":
            return self._next_of_paper(unverified, is_steady)
        return self._next_of_recommended(unverified, is_steady)

    def follow(self, observation: Observation) -> NextStep:
        """Take the next step if it is automatic and its time has come; return it."""
        step = self.next_step(observation.is_steady)
        if not self.settings.is_automatic or self._is_early(step, observation):
            return step
        return self.advance(observation)

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
                    place_m = None if step.planned is None else step.planned.displacement_W_m
                    calibration.make_cursor(step.eyes, place_m)
                case StepName.SOLVE:
                    if calibration.state is State.ALIGNED:
                        self._requested = ()
                    calibration.solve()
                case StepName.APPLY:
                    calibration.apply(keeps_hand=self.settings.name == "recommended")
                case StepName.VERIFY:
                    calibration.verify(step.eyes[0])
                case StepName.DONE if not self._is_over:
                    calibration.release_hand()
        except (ProcedureError, HandError) as error:
            return NextStep(StepName.WAIT, step.eyes, str(error), is_requested=step.is_requested)
        self._is_over = step.name is StepName.DONE
        return step

    def request(self, eyes: tuple[Eye, ...] = ()) -> None:
        """Make one more alignment next; the plan chooses the eyes unless they are given."""
        self._requested = eyes or self._advised_eyes() or self._turn()

    def withdraw(self) -> None:
        """Withdraw a request that has not become a cursor yet."""
        self._requested = ()

    def choose(self, eyes: EyePlan) -> None:
        """Change the eyes of the paper's plan, and their order.

        What the session cannot write is kept in memory; `Session.write_waiting` says so.

        Raises
        ------
        ProcedureError
            While a cursor is shown or projections are being applied.
        """
        chosen = with_eyes(self.settings, eyes)
        with suppress(FileError):
            self._calibration.choose_eyes(eyes, chosen.usable_eyes)
        self.settings, self._requested = chosen, ()

    def skip(self) -> None:
        """Verify an eye no further: the one being verified, or the one that would be next.

        Raises
        ------
        ProcedureError
            If no eye is.
        FileError
            If the session cannot be written; the verification ends anyway.
        """
        calibration = self._calibration
        if calibration.verifying is not None:
            self.skipped.add(calibration.verifying.eye)
            calibration.skip_verification()
            return
        eye = next(iter(self._unverified()), None) or self._next_verification()
        # While a verification that has just ended is applied, the other eye's is not meant.
        if eye is None or calibration.state not in (State.SHOW_HAND, State.APPLIED):
            raise ProcedureError("there is no verification to skip")
        self.skipped.add(eye)
        calibration.record_skipped(eye)

    def _next_of_paper(self, unverified: tuple[Eye, ...], is_steady: bool) -> NextStep:
        if why := self._fault("contradicted"):
            return NextStep(StepName.DONE, (), why)
        if self._made(turn := self._turn()) < self.settings.alignments:
            return self._with_hand(StepName.CURSOR, turn, is_steady)
        if why := self._fault("implausible"):
            return NextStep(StepName.DONE, (), why)
        if not self.settings.verify:
            return NextStep(StepName.DONE, (), "every alignment is made")
        if unverified:
            return self._with_hand(StepName.VERIFY, unverified[:1], is_steady)
        advice = self._worst_advice()
        is_worthwhile = advice is not None and advice.is_accepted and advice.alignments <= _FEW
        if is_worthwhile and len(self._calibration.alignments) < self.settings.placement.most:
            return self._with_hand(StepName.CURSOR, self._advised_eyes(), is_steady)
        return NextStep(StepName.DONE, (), self._takes())

    def _next_of_recommended(self, unverified: tuple[Eye, ...], is_steady: bool) -> NextStep:
        calibration = self._calibration
        if why := self._fault("contradicted", "implausible") or self._end(unverified):
            return NextStep(StepName.DONE, (), why)
        if not (is_steady or calibration.raised) or not calibration.is_applied:
            name = StepName.WAIT if calibration.raised or is_steady else StepName.RAISE
            return NextStep(name, self._turn(), _TEXTS[name])
        planned = self._planned()
        if planned is not None:
            return NextStep(StepName.CURSOR, planned.eyes, planned.reason, planned)
        if (eye := self._next_verification()) is not None:
            return self._with_hand(StepName.VERIFY, (eye,), is_steady)
        return NextStep(StepName.DONE, (), self._takes())

    def _is_early(self, step: NextStep, observation: Observation) -> bool:
        """Return True while the wearer is given time to see what comes."""
        pause_ns = _PAUSE_NS[self.settings.name]
        if pause_ns == 0 or step.name not in (StepName.CURSOR, StepName.VERIFY):
            self._waiting = None, 0
            return False
        if observation.hand is None:  # its pose is still on its way
            return True
        if self._waiting[0] != (step.name, step.eyes):
            self._waiting = (step.name, step.eyes), observation.hand.t_host_ns
        return observation.hand.t_host_ns - self._waiting[1] < pause_ns

    def _turn(self) -> tuple[Eye, ...]:
        """Return whose turn it is in the next alignment."""
        settings = self.settings
        if settings.name == "recommended":
            done = [alignment.eyes for alignment in self._calibration.alignments.values()]
            return planned_eyes("recommended", done, settings.usable_eyes)
        if not settings.in_turn:
            return settings.usable_eyes
        return min(((eye,) for eye in settings.usable_eyes), key=self._made)

    def _made(self, eyes: tuple[Eye, ...]) -> int:
        """Return the number of alignments in which these eyes were open."""
        made = (alignment.eyes for alignment in self._calibration.alignments.values())
        return sum(set(eyes) <= set(one) for one in made)

    def _worst_advice(self) -> Advice | None:
        """Return the advice for the eye that is to be repeated with the largest expected error."""
        results = self._calibration.results
        if results is None:
            return None
        usable = [eye for eye in results.advice if eye in self.settings.usable_eyes]
        repeated = [eye for eye in usable if results.verdicts[eye].name == "repeat"]
        worst = max(repeated, key=lambda eye: results.benefits[eye].after_arcmin, default=None)
        return None if worst is None else results.advice[worst]

    def _advised_eyes(self) -> tuple[Eye, ...]:
        """Return the eyes of a further alignment of the paper's plan, if one is advised."""
        advice = self._worst_advice()
        is_due = self._made(self._turn()) < self.settings.alignments
        if self.settings.name == "recommended" or advice is None or is_due:
            return ()
        return advice.eyes or self.settings.usable_eyes

    def _planned(self) -> Planned | None:
        """Return the next alignment, decided once for each result and hand."""
        calibration = self._calibration
        hand = calibration.raised or calibration.steady_hand
        newest = calibration.newest_hand or hand
        assert hand is not None
        assert newest is not None
        key = calibration.results, tuple(calibration.alignments), calibration.raised, hand
        if self._decided is None or self._decided[0] != key:
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
                    plan="recommended",
                    usable_eyes=self.settings.usable_eyes,
                    settings=self.settings.placement,
                    solve=calibration.settings.solve,
                ),
            )
        return self._decided[1]

    def _unverified(self) -> tuple[Eye, ...]:
        """Return the eyes to verify that have not been, nor were skipped."""
        done = {*self._calibration.verifications, *self.skipped, *self._calibration.unmoved}
        return tuple(eye for eye in self.settings.usable_eyes if eye not in done)

    def _fault(self, *names: VerdictName) -> str:
        """Return the reason of the first verdict with one of these names; empty if none has."""
        return next((one.reason for one in self._verdicts() if one.name in names), "")

    def _verdicts(self) -> list[Verdict]:
        """Return the verdicts on the usable eyes; an eye may have been aligned before a choice."""
        results = self._calibration.results
        found = {} if results is None else results.verdicts
        return [one for eye, one in found.items() if eye in self.settings.usable_eyes]

    def _end(self, unverified: tuple[Eye, ...]) -> str:
        """Return why the recommended plan ends now; else empty."""
        results = self._calibration.results
        if results is None:
            return ""
        found = {eye: one.name for eye, one in results.verdicts.items()}
        is_judged = all(found.get(eye) in _JUDGED for eye in self.settings.usable_eyes)
        is_verified = not (unverified and self.settings.verify)
        # A stored calibration that its verification does not refuse is kept.
        is_kept = not self._calibration.alignments or self._next_verification() is None
        return "every eye has its verdict" if is_judged and is_verified and is_kept else ""

    def _next_verification(self) -> Eye | None:
        """Return the eye to verify next, if no alignment comes first."""
        if not self.settings.verify:
            return None
        return next_verification(
            self._calibration.results,
            self._calibration.verifications,
            usable_eyes=tuple(
                eye
                for eye in self.settings.usable_eyes
                if eye not in self.skipped | self._calibration.unmoved
            ),
            settings=self.settings.placement,
        )

    def _takes(self) -> str:
        """Return what it would take to be accepted."""
        reasons = dict.fromkeys(one.reason for one in self._verdicts())
        return " ".join(reasons) or "nothing more is planned"

    def _with_hand(self, name: StepName, eyes: tuple[Eye, ...], is_steady: bool) -> NextStep:
        """Return a step that needs a still hand and acknowledged projections."""
        if is_steady and self._calibration.is_applied:
            return NextStep(name, eyes, _TEXTS[name])
        before = StepName.WAIT if is_steady else StepName.RAISE
        return NextStep(before, eyes, _TEXTS[before], awaited=name)


_TEXTS: Mapping[StepName, str] = {
    StepName.RAISE: "the wearer raises the hand and holds it still",
    StepName.CURSOR: "the hand becomes the cursor where it is",
    StepName.ALIGN: "the wearer aligns the hand with the cursor and confirms",
    StepName.SOLVE: "the alignments are solved",
    StepName.APPLY: "the projections are sent",
    StepName.WAIT: "the headset has not acknowledged its projections yet",
    StepName.VERIFY: "the wearer verifies an eye",
    StepName.NUDGE: "the wearer moves the outline until it covers the hand, and confirms",
}
