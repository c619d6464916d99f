"""The wizard's step, texts and buttons; without Qt, so that every case can be tested."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from handcal.register.verdict import Advice
from handcal.station.snapshot import Snapshot
from handcal.station.states import State
from handcal.types import EYES, Alignment, Eye, EyePlan
from handcal_gui.pages.wizard.preconditions import (
    eyes_accepted,
    hand_found,
    hand_still,
    is_placed,
    is_steady,
    is_unsolved,
    needs_look,
)
from handcal_gui.pages.wizard.step_views import (
    ADVICE_S,
    LOOK,
    READ_S,
    SHOWN_S,
    STILL_S,
    UNUSABLE,
    VERIFY_AGAIN,
    align_view,
    connect_view,
    distance,
    doubt_sentence,
    eye_names,
    falsified_view,
    kept_fact,
    save_view,
    solve_view,
    verification_view,
)
from handcal_gui.pages.wizard.view import (
    EYE_WORDS,
    STEPS,
    Action,
    ButtonSpec,
    Step,
    WizardView,
)
from handcal_gui.translation import tr

PLANS: dict[EyePlan, str] = {
    "each": tr("One eye after the other"),
    "both": tr("Both eyes at once"),
    "left": tr("Left eye only"),
    "right": tr("Right eye only"),
}
_MOST_BY_ITSELF = 2
"""Most further alignments of an eye that are begun without asking."""


def next_eyes(plan: EyePlan, alignments: Collection[Alignment]) -> tuple[Eye, ...]:
    """Return the eyes that the next alignment is for."""
    if plan == "both":
        return EYES
    if plan != "each":
        return (plan,)
    counts = {eye: sum(eye in alignment.eyes for alignment in alignments) for eye in EYES}
    return ("right",) if counts["right"] < counts["left"] else ("left",)


def is_complete(plan: EyePlan, alignments: Collection[Alignment]) -> bool:
    """Return whether every eye of the plan has been aligned."""
    eyes = (plan,) if plan in EYES else EYES
    return all(any(eye in alignment.eyes for alignment in alignments) for eye in eyes)


class Wizard:
    """The current step: from the engine's state, and from moves that concern only the wizard.

    Attributes
    ----------
    plan : EyePlan
    is_held : bool
        True if every step waits for a person.
    """

    def __init__(self, plan: EyePlan = "each") -> None:
        self.plan = plan
        self.is_held = False
        self._repeat: tuple[Eye, ...] | None = None
        self._skipped: set[Eye] = set()
        self._free = Step.CONNECT

    def step(self, snapshot: Snapshot) -> Step:
        """Return the current step."""
        match snapshot.procedure.state:
            case State.ALIGN:
                self._free = Step.VERIFY
                return Step.ALIGN
            case State.VERIFY:
                self._free = Step.VERIFY
                return Step.VERIFY
            case State.APPLYING if snapshot.record.verified_now:
                return Step.VERIFY
            case State.ALIGNED | State.SOLVED | State.APPLYING:
                self._free = Step.VERIFY
                return Step.SOLVE
            case State.APPLIED:
                if self._free is Step.SAVE and is_unsolved(snapshot):
                    self._free = Step.VERIFY
                if self._free is Step.VERIFY:
                    self._repeat = None
            case State.SHOW_HAND:
                if self._free in (Step.VERIFY, Step.SAVE):
                    self._free = Step.SHOW_HAND  # after a redo
        return self._free

    def move(self, action: Action, snapshot: Snapshot) -> None:
        """Make a move that does not involve the engine."""
        place = STEPS.index(self._free)
        match action:
            case Action.NEXT:
                is_resumed = place == 0 and snapshot.procedure.state is State.APPLIED
                self._free = Step.VERIFY if is_resumed else STEPS[place + 1]
            case Action.BACK:
                is_another = snapshot.procedure.state is State.APPLIED
                to_verify = is_another and self._free is Step.SHOW_HAND
                self._free = Step.VERIFY if to_verify else STEPS[place - 1]
            case Action.ANOTHER | Action.REPEAT_LEFT | Action.REPEAT_RIGHT:
                advice = _advice(snapshot) if self._is_complete(snapshot) else None
                # The advice of a session that follows a plan names no eyes.
                self._repeat = _REPEATS.get(action, (advice.eyes or EYES) if advice else None)
                self._free = Step.SHOW_HAND
            case Action.SKIP:
                self._skipped |= set(self.unverified(snapshot)[:1])
            case _:
                raise ValueError(f"{action} is an action of the engine")

    def view(self, snapshot: Snapshot) -> WizardView:
        """Return the view of a snapshot."""
        return replace(self._view(snapshot), is_aligned=self._is_complete(snapshot))

    def _view(self, snapshot: Snapshot) -> WizardView:
        match self.step(snapshot):
            case Step.CONNECT:
                return connect_view(snapshot)
            case Step.SHOW_HAND:
                return self._show_hand(snapshot)
            case Step.MAKE_CURSOR:
                return self._make_cursor(snapshot)
            case Step.ALIGN:
                return align_view(snapshot)
            case Step.SOLVE:
                return solve_view(snapshot)
            case Step.VERIFY:
                view = self._verify(snapshot)
                return replace(view, fact=view.fact or kept_fact(snapshot.procedure))
            case Step.SAVE:
                return save_view(snapshot, is_held=self.is_held)

    def eyes(self, snapshot: Snapshot) -> tuple[Eye, ...]:
        """Return the eyes that the next alignment is for."""
        if self._repeat is not None:
            return self._repeat
        return next_eyes(self.plan, snapshot.procedure.alignments.values())

    def unverified(self, snapshot: Snapshot) -> tuple[Eye, ...]:
        """Return the solved eyes that are still to be verified, in order."""
        procedure = snapshot.procedure
        solved = () if procedure.results is None else procedure.results.eyes
        done = {*procedure.verifications, *self._skipped}
        return tuple(eye for eye in EYES if eye in solved and eye not in done)

    def _is_complete(self, snapshot: Snapshot) -> bool:
        return is_complete(self.plan, snapshot.procedure.alignments.values())

    def _show_hand(self, snapshot: Snapshot) -> WizardView:
        back = ButtonSpec(Action.BACK, tr("&Back"))
        if snapshot.procedure.state is State.SHOW_HAND and snapshot.procedure.alignments:
            back = ButtonSpec(Action.SOLVE, tr("Keep the alignments &so far"))
        return WizardView(
            Step.SHOW_HAND,
            tr("Raise one bare hand {}, palm toward you and fingers a little apart.").format(
                distance(snapshot)
            ),
            (hand_found(snapshot),),
            ButtonSpec(Action.NEXT, tr("Next"), is_placed(snapshot)),
            (back,),
            runs_after_s=SHOWN_S,
        )

    def _make_cursor(self, snapshot: Snapshot) -> WizardView:
        still = tr("Hold the hand still: it becomes the cursor for {}.").format(
            eye_names(self.eyes(snapshot))
        )
        return WizardView(
            Step.MAKE_CURSOR,
            LOOK if needs_look(snapshot) else still,
            (hand_found(snapshot), hand_still(snapshot)),
            ButtonSpec(Action.MAKE_CURSOR, tr("Make cursor"), is_steady(snapshot)),
            (ButtonSpec(Action.BACK, tr("&Back")),),
            runs_after_s=STILL_S,
        )

    def _verify(self, snapshot: Snapshot) -> WizardView:
        preconditions = eyes_accepted(snapshot)
        if snapshot.procedure.state is State.APPLYING:
            wait = tr("Waiting for the headset to acknowledge its projections.")
            sending = ButtonSpec(Action.APPLY, tr("Sending…"), False)
            return WizardView(Step.VERIFY, wait, preconditions, sending)
        if snapshot.procedure.verifying is not None:
            return verification_view(snapshot, snapshot.procedure.verifying)
        if snapshot.procedure.results is None and snapshot.procedure.alignments:
            return WizardView(
                Step.VERIFY,
                tr("The alignments have changed. Solve again."),
                preconditions,
                ButtonSpec(Action.SOLVE, tr("Solve")),
                (ButtonSpec(Action.ANOTHER, tr("&Add alignment")),),
            )
        is_usable = not any(one.verdict in UNUSABLE for one in preconditions)
        if is_usable and not self._is_complete(snapshot):
            eyes = eye_names(self.eyes(snapshot))
            return WizardView(
                Step.VERIFY,
                tr("Next, align {}.").format(eyes),
                preconditions,
                ButtonSpec(Action.ANOTHER, tr("Align {}").format(eyes)),
                (ButtonSpec(Action.NEXT, tr("Fini&sh with one eye")),),
                runs_after_s=READ_S,
            )
        each = (
            ButtonSpec(Action.REPEAT_LEFT, tr("Align &left eye")),
            ButtonSpec(Action.REPEAT_RIGHT, tr("Align &right eye")),
        )
        if is_usable and (unverified := self.unverified(snapshot)):
            eye = unverified[0]
            text = tr("Raise the hand and hold it still to measure the error of the {} eye.")
            if len(unverified) > 1:
                text = tr(
                    "Raise the hand and hold it still to measure the error of each eye, the {} "
                    "first."
                )
            return WizardView(
                Step.VERIFY,
                text.format(EYE_WORDS[eye]),
                (hand_found(snapshot), hand_still(snapshot), *preconditions),
                ButtonSpec(
                    Action.VERIFY,
                    tr("Verify the {} eye").format(EYE_WORDS[eye]),
                    is_steady(snapshot),
                ),
                (ButtonSpec(Action.SKIP, tr("&Skip")), *each),
                runs_after_s=STILL_S,
            )
        if advice := _advice(snapshot):
            eyes = eye_names(advice.eyes or EYES)
            others = (one for one in each if _REPEATS[one.action] != advice.eyes)
            few = advice.is_accepted and advice.alignments <= _MOST_BY_ITSELF
            return WizardView(
                Step.VERIFY,
                tr("Not accepted yet: align {} again, or finish as it is.").format(eyes),
                preconditions,
                ButtonSpec(Action.ANOTHER, tr("Align {}").format(eyes)),
                (ButtonSpec(Action.NEXT, tr("Finish a&s it is")), *others),
                runs_after_s=ADVICE_S if few else None,
            )
        if falsified := falsified_view(preconditions):
            return falsified
        if not is_usable:
            return WizardView(
                Step.VERIFY,
                tr("Do not use this result. Follow the advice below, then add alignments."),
                preconditions,
                ButtonSpec(Action.ANOTHER, tr("Add alignment")),
                (ButtonSpec(Action.NEXT, tr("Finish a&s it is")), *each),
            )
        doubt = doubt_sentence(snapshot)
        if doubt or not self._skipped:
            return WizardView(
                Step.VERIFY,
                doubt
                or tr(
                    "The wearer has verified and corrected the result. Finish, or add an alignment."
                ),
                preconditions,
                ButtonSpec(Action.NEXT, tr("Finish as it is") if doubt else tr("Finish")),
                (ButtonSpec(Action.ANOTHER, tr("&Add alignment")), *each),
            )
        return WizardView(
            Step.VERIFY,
            tr(
                "The wearer looks at the raised hand: the outline should lie on it. If it "
                "does not, "
                "add an alignment or fine-tune φ."
            ),
            preconditions,
            ButtonSpec(Action.NEXT, tr("It fits")),
            (
                ButtonSpec(Action.ANOTHER, tr("&Add alignment")),
                *(VERIFY_AGAIN[eye] for eye in EYES if eye in self._skipped),
            ),
        )


_REPEATS: dict[Action, tuple[Eye, ...]] = {
    Action.REPEAT_LEFT: ("left",),
    Action.REPEAT_RIGHT: ("right",),
}


def _advice(snapshot: Snapshot) -> Advice | None:
    """Return the advice for the eye to be repeated with the largest expected error, or None."""
    results = snapshot.procedure.results
    if results is None:
        return None
    repeated = [eye for eye in results.advice if results.verdicts[eye].name == "repeat"]
    worst = max(repeated, key=lambda eye: results.benefits[eye].after_arcmin, default=None)
    return None if worst is None else results.advice[worst]
