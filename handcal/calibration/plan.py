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
from handcal.calibration.sight import Observation
from handcal.calibration.states import ProcedureError, State
from handcal.core.errors import FileError, HandError
from handcal.core.types import EYES, Eye, EyePlan, Float64, Frame, PlanName, Verdict, VerdictName
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

    @property
    def displacement_W_m(self) -> Float64 | None:
        """(3,); from the raised hand to the cursor, if the plan chooses its place."""
        return None if self.planned is None else self.planned.displacement_W_m


class Plan:
    """Leads one calibration by a plan, frame by frame.

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
    observation : Observation or None
        Of the newest frame; None before the first.
    step : NextStep or None
        The step that was next at that frame, or was taken then.
    """

    def __init__(
        self,
        calibration: Calibration,
        settings: PlanSettings,
        verifies_first: bool = False,
        skipped: Collection[Eye] = (),
    ) -> None:
        self.settings = settings
        self.skipped = set(skipped)
        self.observation: Observation | None = None
        self.step: NextStep | None = None
        self._calibration = calibration
        self._verifies_first = verifies_first
        self._placed: tuple[object, Planned | None] | None = None
        self._is_over = False
        self._requested: tuple[Eye, ...] = ()
        self._next_since: tuple[object, int] = None, 0

    def advance(
        self, frame: Frame | None, *, is_held: bool = False, is_pressed: bool = False
    ) -> None:
        """Take a frame through the calibration, from the picture to the projections.

        Every calibration goes this way from top to bottom, each frame as far as it is due.

        Parameters
        ----------
        frame : Frame or None
            None if none has arrived since the last.
        is_held : bool
            True if the plan takes no step by itself now.
        is_pressed : bool
            True if a person has the next step taken.

        Raises
        ------
        LinkError
            If the link is closed, or projections were not acknowledged in time.
        FileError
            If the session cannot be written, which keeps the data; the step is done anyway.
        """
        calibration = self._calibration
        if frame is not None:
            # Frame → hand → observation. The head's pose at the exposure may arrive some frames
            # later, so the hand that is placed now may be of an earlier frame.
            observation = calibration.see(frame)
            # Observation → alignment or verification → journal. The wearer's press was some time
            # ago, so the hand of that time is judged, not the newest.
            self.observation = calibration.judge(observation)
        if calibration.state is State.APPLYING:
            # Link → journal. The headset acknowledges projections some frames after they were sent.
            calibration.poll_applied()
        if self.observation is None or (frame is None and not is_pressed):
            return
        # Procedure. The plan only chooses; the calibration refuses what is out of turn. A cursor
        # that was withdrawn has made it forget the hands, so the observation may be outdated.
        is_steady = self.observation.is_steady and calibration.steady_hand is not None
        self.step = step = self.next_step(is_steady)
        is_due = is_pressed or (not is_held and self._is_due(step, self.observation))
        try:
            match step.name if is_due else None:
                case StepName.CURSOR:
                    # Hand → cursor: where the hand is, or where an alignment tells most.
                    calibration.make_cursor(step.eyes, step.displacement_W_m)
                case StepName.SOLVE:
                    # Alignments → φ → verdict → journal. All are fused by their covariances, and
                    # judged by evidence from outside: residuals cannot tell that φ is right.
                    if calibration.state is State.ALIGNED:
                        self._requested = ()
                    calibration.solve()
                case StepName.APPLY:
                    # φ → projections → link. An eye that is not to be used keeps its offline one.
                    calibration.apply(keeps_hand=self.settings.name == "recommended")
                case StepName.VERIFY:
                    # Projections → wearer, whose nudges of the drawing are one more observation.
                    calibration.verify(step.eyes[0])
                case StepName.DONE if not self._is_over:
                    calibration.release_hand()
            self._is_over = is_due and step.name is StepName.DONE
        except (ProcedureError, HandError) as error:
            self.step = replace(step, name=StepName.WAIT, text=str(error), planned=None)

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

    def skip(self, eye: Eye) -> None:
        """Verify an eye no further, whether its verification is in progress or would be next.

        Raises
        ------
        ProcedureError
            If it is neither: the wearer may just have ended it.
        FileError
            If the session cannot be written; the verification ends anyway.
        """
        calibration = self._calibration
        if calibration.verifying is not None and calibration.verifying.eye == eye:
            self.skipped.add(eye)
            calibration.skip_verification()
            return
        is_next = eye == (next(iter(self._unverified()), None) or self._next_verification())
        if not is_next or calibration.state not in (State.SHOW_HAND, State.APPLIED):
            raise ProcedureError(f"there is no verification of the {eye} eye to skip")
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

    def _is_due(self, step: NextStep, observation: Observation) -> bool:
        """Return whether the plan takes a step by itself now; the wearer first sees what comes."""
        if not self.settings.is_automatic:
            return False
        pause_ns = _PAUSE_NS[self.settings.name]
        if pause_ns == 0 or step.name not in (StepName.CURSOR, StepName.VERIFY):
            self._next_since = None, 0
            return True
        if observation.hand is None:  # its pose is still on its way
            return False
        if self._next_since[0] != (step.name, step.eyes):
            self._next_since = (step.name, step.eyes), observation.hand.t_host_ns
        return observation.hand.t_host_ns - self._next_since[1] >= pause_ns

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
        return sum(set(eyes) <= set(opened) for opened in made)

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
        # Hands and results are the same only as objects. The search takes longer than a frame.
        key = calibration.results, tuple(calibration.alignments), calibration.raised, hand
        if self._placed is None or self._placed[0] != key:
            self._placed = (
                key,
                next_alignment(
                    hand.points_W_m,
                    hand.cloud.is_cut,
                    calibration.T_W_H(newest),
                    calibration.rig,
                    calibration.results,
                    [alignment.eyes for alignment in calibration.alignments.values()],
                    calibration.applied_shift_m,
                    plan="recommended",
                    usable_eyes=self.settings.usable_eyes,
                    settings=self.settings.placement,
                    solve=calibration.settings.solve,
                ),
            )
        return self._placed[1]

    def _unverified(self) -> tuple[Eye, ...]:
        """Return the eyes to verify that have not been, nor were skipped."""
        done = {*self._calibration.verifications, *self.skipped, *self._calibration.unmoved}
        return tuple(eye for eye in self.settings.usable_eyes if eye not in done)

    def _fault(self, *names: VerdictName) -> str:
        """Return the reason of the first verdict with one of these names; empty if none has."""
        return next((verdict.reason for verdict in self._verdicts() if verdict.name in names), "")

    def _verdicts(self) -> list[Verdict]:
        """Return the verdicts on the usable eyes; an eye may have been aligned before a choice."""
        results = self._calibration.results
        verdicts = {} if results is None else results.verdicts
        return [verdict for eye, verdict in verdicts.items() if eye in self.settings.usable_eyes]

    def _end(self, unverified: tuple[Eye, ...]) -> str:
        """Return why the recommended plan ends now; else empty."""
        results = self._calibration.results
        if results is None:
            return ""
        names = {eye: verdict.name for eye, verdict in results.verdicts.items()}
        is_judged = all(names.get(eye) in _JUDGED for eye in self.settings.usable_eyes)
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
        reasons = dict.fromkeys(verdict.reason for verdict in self._verdicts())
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
