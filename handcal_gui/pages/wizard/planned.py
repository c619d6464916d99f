"""The guide while the station follows the recommended plan: it shows the plan's next step."""

from __future__ import annotations

from dataclasses import replace

from handcal.register.results import USED
from handcal.station.plan import NextStep, StepName
from handcal.station.snapshot import Snapshot
from handcal.station.states import State
from handcal.types import EYES, Eye, EyePlan
from handcal_gui.pages.wizard.preconditions import (
    eyes_accepted,
    hand_found,
    hand_still,
    is_placed,
    is_steady,
    is_unsolved,
    needs_look,
    trials_of,
)
from handcal_gui.pages.wizard.step_views import (
    LOOK,
    SETTLED,
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
    sending,
    verification_view,
)
from handcal_gui.pages.wizard.steps import Wizard
from handcal_gui.pages.wizard.view import (
    EYE_WORDS,
    Action,
    ButtonSpec,
    Precondition,
    Step,
    WizardView,
)
from handcal_gui.translation import tr
from handcal_gui.widgets.result_rows import eyes_text
from handcal_gui.widgets.sentence import sentence

_STEPS = {
    StepName.RAISE: Step.SHOW_HAND,
    StepName.CURSOR: Step.MAKE_CURSOR,
    StepName.ALIGN: Step.ALIGN,
    StepName.SOLVE: Step.SOLVE,
    StepName.APPLY: Step.SOLVE,
    StepName.VERIFY: Step.VERIFY,
    StepName.NUDGE: Step.VERIFY,
    StepName.DONE: Step.VERIFY,
}
_STATES = {
    State.ALIGN: Step.ALIGN,
    State.ALIGNED: Step.SOLVE,
    State.SOLVED: Step.SOLVE,
    State.APPLYING: Step.SOLVE,
    State.VERIFY: Step.VERIFY,
}
_FOLLOWS = Step.SHOW_HAND
"""The guide's own step while the plan continues."""
_OMITTED = frozenset({Step.MAKE_CURSOR, Step.ALIGN, Step.SOLVE})
"""Steps that a session which begins with a stored result does without."""
_WAITS_FOR_HAND, _SENDING = tr("Waiting for the hand…"), tr("Sending…")


class PlannedWizard(Wizard):
    """The current step of a plan that the station follows automatically.

    Parameters
    ----------
    usable_eyes : tuple of eye

    The plan is held before *Begin* and after *Finish*, and while the guide is held: then the main
    button takes its next step.
    """

    def __init__(self, usable_eyes: tuple[Eye, ...] = EYES) -> None:
        plan: EyePlan = "each" if len(usable_eyes) > 1 else usable_eyes[0]
        super().__init__(plan)
        self.usable_eyes = usable_eyes
        self._latest = _FOLLOWS

    @property
    def holds_plan(self) -> bool:
        """True if the plan should be held."""
        return self.is_held or self._free is not _FOLLOWS

    def step(self, snapshot: Snapshot) -> Step:
        """Return the step of the guide that the plan's next step belongs to."""
        procedure = snapshot.procedure
        if self._free is Step.SAVE and is_unsolved(snapshot):
            self._free = _FOLLOWS
        if self._free is not _FOLLOWS:
            return self._free
        step = _STATES.get(procedure.state)
        if step is None and procedure.next_step is not None:
            step = _STEPS.get(procedure.next_step.name)
        # A verification is solved and sent at its own step.
        is_of_verification = step is Step.SOLVE and snapshot.record.verified_now
        self._latest = Step.VERIFY if is_of_verification else step or self._latest
        return self._latest

    def move(self, action: Action, snapshot: Snapshot) -> None:  # noqa: ARG002 (as in Wizard)
        """Make a move that does not involve the engine."""
        if action not in (Action.NEXT, Action.BACK):
            raise ValueError(f"{action} is an action of the engine")
        ends = {Action.NEXT: Step.SAVE, Action.BACK: Step.CONNECT}
        self._free = ends[action] if self._free is _FOLLOWS else _FOLLOWS

    def eyes(self, snapshot: Snapshot) -> tuple[Eye, ...]:
        """Return the eyes that the next alignment is for."""
        planned = snapshot.procedure.next_step
        return (planned.eyes if planned is not None else ()) or self.usable_eyes

    def view(self, snapshot: Snapshot) -> WizardView:
        """Return the view of a snapshot."""
        view = super().view(snapshot)
        is_former = snapshot.record.facts.former and not snapshot.procedure.alignments
        return replace(view, omitted=_OMITTED) if is_former else view

    def _view(self, snapshot: Snapshot) -> WizardView:
        step, procedure = self.step(snapshot), snapshot.procedure
        if step is Step.CONNECT:
            return connect_view(snapshot)
        if step is Step.SAVE:
            return self._saved(snapshot)
        if procedure.state is State.ALIGN:
            view = align_view(snapshot)
            return replace(view, sentence=tr("{} The hand stays up.").format(view.sentence))
        if procedure.verifying is not None:
            return verification_view(snapshot, procedure.verifying)
        planned = procedure.next_step
        if planned is None or planned.name in (StepName.WAIT, StepName.ALIGN, StepName.NUDGE):
            return self._wait(step, snapshot)
        if procedure.state is State.APPLYING:
            return self._wait(step, snapshot)
        if procedure.state in (State.ALIGNED, State.SOLVED) or planned.name is StepName.SOLVE:
            return self._solved(step, snapshot)
        match planned.name:
            case StepName.CURSOR:
                return self._cursor(planned, snapshot)
            case StepName.VERIFY:
                return self._ask_to_verify(planned, snapshot)
            case StepName.DONE:
                fact = _drawn_otherwise(snapshot) or kept_fact(procedure)
                return replace(self._done(planned, snapshot), fact=fact)
        return self._raise(snapshot)

    def _raise(self, snapshot: Snapshot) -> WizardView:
        text = tr(
            "Raise one bare hand {}, palm toward you and fingers a little apart; hold it still."
        ).format(distance(snapshot))
        looks = needs_look(snapshot)
        awaited = tr("Waiting…") if looks else _WAITS_FOR_HAND
        return WizardView(
            Step.SHOW_HAND,
            LOOK if looks else text,
            (hand_found(snapshot), hand_still(snapshot)),
            ButtonSpec(Action.TAKE_STEP, awaited, False),
            (ButtonSpec(Action.BACK, tr("&Back")),),
        )

    def _cursor(self, planned: NextStep, snapshot: Snapshot) -> WizardView:
        names = eye_names(planned.eyes)
        text = tr("Hold the hand still: it becomes the cursor for {}.").format(names)
        if snapshot.procedure.alignments:
            text = tr("Keep the hand up: the next cursor, for {}, follows at once.").format(names)
            if self.is_held:
                text = tr("Keep the hand up, and make the next cursor, for {}.").format(names)
        return WizardView(
            Step.MAKE_CURSOR,
            text,
            (hand_found(snapshot), hand_still(snapshot)),
            self._take_step(tr("Make cursor"), _WAITS_FOR_HAND, is_placed(snapshot)),
            (ButtonSpec(Action.BACK, tr("&Back")),),
        )

    def _solved(self, step: Step, snapshot: Snapshot) -> WizardView:
        text = tr("Solve for the positions of the eyes; the hand stays up.")
        if snapshot.procedure.state not in (State.ALIGNED, State.SOLVED):
            text = tr("The alignments have changed. Solve again.")
        main = self._take_step(tr("Solve"), tr("Solving…"), True)
        results = snapshot.procedure.results
        if snapshot.procedure.state is State.SOLVED and results is not None:
            instruction, label = sending(results)
            text = tr("{} The hand stays up.").format(instruction)
            is_sent = any(one.name in USED for one in results.verdicts.values())
            main = self._take_step(label, _SENDING if is_sent else tr("Keeping offline…"), True)
        redo = ButtonSpec(
            Action.REDO,
            tr("&Discard and repeat"),
            discards=tr("Deletes the last alignment; the session panel can restore it"),
        )
        return WizardView(
            step,
            text,
            eyes_accepted(snapshot),
            main,
            (redo,) if snapshot.procedure.alignments else (),
        )

    def _ask_to_verify(self, planned: NextStep, snapshot: Snapshot) -> WizardView:
        eye = planned.eyes[0]
        text = tr("Keep the hand up and still to measure the error of the {} eye.")
        if len(set(self.usable_eyes) - snapshot.procedure.verifications.keys()) > 1:
            text = tr("Keep the hand up and still to measure the error of each eye, the {} first.")
        return WizardView(
            Step.VERIFY,
            text.format(EYE_WORDS[eye]),
            (hand_found(snapshot), hand_still(snapshot), *eyes_accepted(snapshot)),
            self._take_step(
                tr("Verify the {} eye").format(EYE_WORDS[eye]),
                _WAITS_FOR_HAND,
                is_steady(snapshot),
            ),
            (ButtonSpec(Action.BACK, tr("&Back")),),
        )

    def _wait(self, step: Step, snapshot: Snapshot) -> WizardView:
        procedure, planned = snapshot.procedure, snapshot.procedure.next_step
        text = tr("The hand stays up while the headset receives its projections.")
        is_refused = procedure.is_applied and procedure.state is not State.APPLYING
        if planned is not None and planned.name is StepName.WAIT and is_refused:
            text = f"{sentence(planned.text)}."
        main = ButtonSpec(Action.TAKE_STEP, _SENDING, False)
        back = (ButtonSpec(Action.BACK, tr("&Back")),)
        return WizardView(step, text, eyes_accepted(snapshot), main, back)

    def _done(self, planned: NextStep, snapshot: Snapshot) -> WizardView:
        procedure, preconditions = snapshot.procedure, eyes_accepted(snapshot)
        if any(one.verdict not in SETTLED for one in preconditions) or not preconditions:
            view = self._not_accepted(preconditions, snapshot)
            return view if preconditions else replace(view, sentence=f"{sentence(planned.text)}.")
        text = tr("Not every eye has been verified. Finish as it is, or verify an eye.")
        main = ButtonSpec(Action.NEXT, tr("Finish as it is"))
        if set(procedure.verifications) >= set(self.usable_eyes):
            text = tr("Verified before the alignments changed. Finish, or verify an eye again.")
            if snapshot.record.verified_now:
                text = tr(
                    "Not every eye has been verified since the alignments changed. Finish, or "
                    "verify an eye again."
                )
            elif snapshot.record.trials and not trials_of(snapshot):
                text = tr(
                    "Verified, and tested in trials, before the alignments changed. Finish, or "
                    "verify an eye again."
                )
            if snapshot.record.verified_now >= set(self.usable_eyes):
                text = tr(
                    "The wearer has verified and corrected the result. Finish, or verify an eye "
                    "again."
                )
                if any(one.verdict == "keep" for one in preconditions):
                    text = tr(
                        "Verified; the result is not used for every eye. Finish, or verify again."
                    )
            main = ButtonSpec(Action.NEXT, tr("Finish"))
        if doubt := doubt_sentence(snapshot):
            text, main = doubt, ButtonSpec(Action.NEXT, tr("Finish as it is"))
        verify = (VERIFY_AGAIN[eye] for eye in self.usable_eyes)
        others = (ButtonSpec(Action.ANOTHER, tr("&Add alignment")), *verify)
        return WizardView(Step.VERIFY, text, preconditions, main, others)

    def _not_accepted(
        self, preconditions: tuple[Precondition, ...], snapshot: Snapshot
    ) -> WizardView:
        """Return the view of a plan that has ended without an accepted result."""
        if falsified := falsified_view(preconditions):
            return falsified
        procedure, can_do = snapshot.procedure, is_steady(snapshot)
        text = tr("Not accepted yet. Raise the hand and hold it still, then add an alignment.")
        main = ButtonSpec(Action.ANOTHER, tr("Add alignment"), can_do)
        others = [VERIFY_AGAIN[eye] for eye in self.usable_eyes]
        again: list[Eye] = []
        if (results := procedure.results) is not None:
            again = [eye for eye, one in results.advice.items() if one.verify]
            again.sort(key=lambda eye: -results.benefits[eye].after_arcmin)  # the worse one first
        if any(one.verdict in UNUSABLE for one in preconditions):
            text = tr("Do not use this result. Follow the advice below, then add alignments.")
        elif again and all(eye in procedure.verifications for eye in self.usable_eyes):
            text = tr(
                "Not accepted yet: verify {} again. Another alignment would change little."
            ).format(eye_names(sorted(again)))
            first = VERIFY_AGAIN[again[0]]
            others.remove(first)
            others.insert(0, ButtonSpec(Action.ANOTHER, tr("&Add alignment")))
            label = tr("Verify the {} eye").format(EYE_WORDS[again[0]])
            main = ButtonSpec(first.action, label, can_do)
        return WizardView(
            Step.VERIFY,
            text,
            (hand_found(snapshot), hand_still(snapshot), *preconditions),
            main,
            (*others, ButtonSpec(Action.NEXT, tr("Finish a&s it is"))),
        )

    def _saved(self, snapshot: Snapshot) -> WizardView:
        view = save_view(snapshot, is_held=self.is_held)
        view = replace(view, fact=_drawn_otherwise(snapshot) or view.fact)
        if not snapshot.record.is_finished:
            return view
        slipped = ButtonSpec(Action.SLIPPED, tr("Headset &slipped"))
        return replace(view, others=(*view.others, slipped))

    def _take_step(self, label: str, doing: str, can_do: bool) -> ButtonSpec:
        """Return the main button of a held plan; of one that runs, the present activity."""
        if self.is_held:
            return ButtonSpec(Action.TAKE_STEP, label, can_do)
        return ButtonSpec(Action.TAKE_STEP, doing, False)


def _drawn_otherwise(snapshot: Snapshot) -> str:
    """Return a note if the headset draws with a φ other than that of the result; else empty."""
    procedure = snapshot.procedure
    results, drawn_m = procedure.results, procedure.applied_shift_m
    if results is None or procedure.state is not State.APPLIED:
        return ""
    solved_m = results.rendered_shift_m
    others = [eye for eye in solved_m if (drawn_m[eye] != solved_m[eye]).any()]
    if not others:
        return ""
    which = tr("a fine-tuned φ")
    if snapshot.record.went_back:
        is_offline = not any(drawn_m[eye].any() for eye in solved_m)
        which = tr("the offline calibration's φ") if is_offline else tr("an earlier φ")
    former_m = procedure.former_shift_m
    can_return = all(eye in former_m and (former_m[eye] == solved_m[eye]).all() for eye in solved_m)
    how = tr("Press G to return.") if can_return else tr("Reset φ in Fine-tune to return.")
    found = tr("{}: drawn, saved and exported with {}; the verdict applies to the solved φ.")
    return f"{found.format(eyes_text(others), which)} {how}"
