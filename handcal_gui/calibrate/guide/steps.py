"""The guide's step, texts and buttons: it shows the plan's next step, and decides nothing.

Without Qt, so that every case can be tested.
"""

from __future__ import annotations

from dataclasses import replace

from handcal.calibration.plan import NextStep, StepName
from handcal.calibration.states import State
from handcal.core.types import Eye
from handcal.register.results import USED
from handcal.station.snapshot import Snapshot
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.guide.preconditions import (
    eyes_accepted,
    hand_found,
    hand_still,
    is_placed,
    is_steady,
    is_unsolved,
    needs_look,
    trials_of,
)
from handcal_gui.calibrate.guide.step_views import (
    LOOK,
    SETTLED,
    UNUSABLE,
    VERIFY_AGAIN,
    align_view,
    connect_view,
    distance,
    doubt_sentence,
    drawn_fact,
    end_action,
    eye_names,
    falsified_view,
    keep_choices,
    kept_eyes,
    save_view,
    sending,
    verification_view,
)
from handcal_gui.calibrate.guide.view import (
    EYE_WORDS,
    MOST_OTHERS,
    Action,
    ButtonSpec,
    Precondition,
    Step,
    WizardView,
)
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
_OMITTED = frozenset({Step.MAKE_CURSOR, Step.ALIGN, Step.SOLVE})
"""Steps that a session which begins with a stored result does without."""
_WAITS_FOR_HAND, _SENDING = tr("Waiting for the hand…"), tr("Sending…")
_BACK = ButtonSpec(Action.BACK, tr("&Back"))
_REPEAT = (
    ButtonSpec(Action.REPEAT_LEFT, tr("Align &left eye")),
    ButtonSpec(Action.REPEAT_RIGHT, tr("Align &right eye")),
)
_MOVES = {Action.NEXT: Step.SAVE, Action.FINISH: Step.SAVE, Action.BACK: Step.CONNECT}


class Wizard:
    """The current step of the plan that the station follows, or a page beside it.

    The plan is held before *Begin* and after *Finish*, and while the guide is held: then the main
    button takes its next step.

    Attributes
    ----------
    is_held : bool
        True if every step waits for a person.
    """

    def __init__(self) -> None:
        self.is_held = False
        self._page: Step | None = Step.CONNECT
        self._latest = Step.SHOW_HAND

    @property
    def holds_plan(self) -> bool:
        """True if the plan should be held."""
        return self.is_held or self._page is not None

    def step(self, snapshot: Snapshot) -> Step:
        """Return the step of the guide that the plan's next step belongs to."""
        planned = snapshot.next_step
        if self._page is Step.SAVE and is_unsolved(snapshot):
            self._page = None
        if self._page is not None:
            return self._page
        step = _STATES.get(snapshot.procedure.state)
        if step is None and planned is not None:
            step = _STEPS.get(planned.name)
            if planned.awaited is StepName.VERIFY:
                step = Step.VERIFY
        # A verification is solved and sent at its own step.
        is_of_verification = step is Step.SOLVE and snapshot.record.verified_now
        self._latest = Step.VERIFY if is_of_verification else step or self._latest
        return self._latest

    def needs_frames(self, snapshot: Snapshot) -> bool:
        """Return whether the present step needs the camera's images."""
        planned = snapshot.next_step
        is_over = planned is not None and planned.name is StepName.DONE
        return self._page is None and not is_over

    def move(self, action: Action) -> None:
        """Turn to another page: *Connect* and *Save* lie before and after the plan.

        Raises
        ------
        ValueError
            If the action is the engine's alone.
        """
        if action not in _MOVES:
            raise ValueError(f"{action} is an action of the engine")
        if self._page is None or action is Action.FINISH:
            self._page = _MOVES[action]
        else:
            self._page = None

    def view(self, snapshot: Snapshot) -> WizardView:
        """Return the view of a snapshot."""
        record = snapshot.record
        aligned = {eye for alignment in record.alignments.values() for eye in alignment.eyes}
        view = replace(self._view(snapshot), is_aligned=aligned >= {*snapshot.plan.usable_eyes})
        is_former = record.facts.former and not record.alignments
        return replace(view, omitted=_OMITTED) if is_former else view

    def _view(self, snapshot: Snapshot) -> WizardView:
        step, procedure = self.step(snapshot), snapshot.procedure
        if step is Step.CONNECT:
            return connect_view(snapshot)
        if step is Step.SAVE:
            view = save_view(snapshot)
            slipped = ButtonSpec(Action.SLIPPED, tr("Headset &slipped"))
            if not snapshot.record.is_finished:
                return view
            return replace(view, others=(*view.others, slipped))
        if procedure.state is State.ALIGN:
            view = align_view(snapshot)
            if not _keeps_hand(snapshot):
                return view
            return replace(view, sentence=tr("{} The hand stays up.").format(view.sentence))
        if procedure.verifying is not None:
            return verification_view(snapshot, procedure.verifying)
        planned = snapshot.next_step
        if planned is None or planned.name in (StepName.WAIT, StepName.ALIGN, StepName.NUDGE):
            return _wait_view(step, snapshot)
        if procedure.state is State.APPLYING:
            return _wait_view(step, snapshot)
        if procedure.state in (State.ALIGNED, State.SOLVED) or planned.name is StepName.SOLVE:
            return self._solved(step, snapshot)
        match planned.name:
            case StepName.CURSOR:
                return self._cursor(planned, snapshot)
            case StepName.VERIFY:
                return self._ask_to_verify(planned, snapshot)
            case StepName.RAISE if planned.awaited is StepName.VERIFY:
                return self._ask_to_verify(planned, snapshot)
            case StepName.DONE:
                return replace(_done_view(planned, snapshot), fact=drawn_fact(snapshot))
        return _raise_view(planned, snapshot)

    def _cursor(self, planned: NextStep, snapshot: Snapshot) -> WizardView:
        names = eye_names(planned.eyes)
        text = tr("Hold the hand still: it becomes the cursor for {}.").format(names)
        if snapshot.record.alignments and _keeps_hand(snapshot):
            text = tr("Keep the hand up: the next cursor, for {}, follows at once.").format(names)
            if self.is_held:
                text = tr("Keep the hand up, and make the next cursor, for {}.").format(names)
        return WizardView(
            Step.MAKE_CURSOR,
            text,
            (hand_found(snapshot), hand_still(snapshot)),
            self._take_step(tr("Make cursor"), _WAITS_FOR_HAND, is_placed(snapshot)),
            _ways_out(planned, snapshot),
        )

    def _solved(self, step: Step, snapshot: Snapshot) -> WizardView:
        text = tr("Solve for the positions of the eyes.")
        if snapshot.procedure.state not in (State.ALIGNED, State.SOLVED):
            text = tr("The alignments have changed. Solve again.")
        main = self._take_step(tr("Solve"), tr("Solving…"), True)
        results = snapshot.procedure.results
        if snapshot.procedure.state is State.SOLVED and results is not None:
            text, label = sending(results)
            is_sent = any(one.name in USED for one in results.verdicts.values())
            main = self._take_step(label, _SENDING if is_sent else tr("Keeping offline…"), True)
        if snapshot.procedure.state in (State.ALIGNED, State.SOLVED):
            stays, may_sink = tr("{} The hand stays up."), tr("{} The wearer may lower the hand.")
            text = (stays if _keeps_hand(snapshot) else may_sink).format(text)
        redo = ButtonSpec(
            Action.REDO,
            tr("&Discard and repeat"),
            discards=tr("Deletes the last alignment; the session panel can restore it"),
        )
        return WizardView(
            step, text, eyes_accepted(snapshot), main, (redo,) if snapshot.record.alignments else ()
        )

    def _ask_to_verify(self, planned: NextStep, snapshot: Snapshot) -> WizardView:
        eye = planned.eyes[0]
        is_up = _keeps_hand(snapshot) and is_placed(snapshot)
        both = len(set(snapshot.plan.usable_eyes) - snapshot.record.facts.verified.keys()) > 1
        text = {
            (True, False): tr("Keep the hand up and still to measure the error of the {} eye."),
            (True, True): tr(
                "Keep the hand up and still to measure the error of each eye, the {} first."
            ),
            (False, False): tr(
                "Raise the hand and hold it still to measure the error of the {} eye."
            ),
            (False, True): tr(
                "Raise the hand and hold it still to measure the error of each eye, the {} first."
            ),
        }[is_up, both]
        return WizardView(
            Step.VERIFY,
            text.format(EYE_WORDS[eye]),
            (hand_found(snapshot), hand_still(snapshot), *eyes_accepted(snapshot)),
            self._take_step(
                tr("Verify the {} eye").format(EYE_WORDS[eye]),
                _WAITS_FOR_HAND,
                is_steady(snapshot),
            ),
            (ButtonSpec(Action.SKIP, tr("&Skip")), _BACK),
        )

    def _take_step(self, label: str, doing: str, can_do: bool) -> ButtonSpec:
        """Return the main button of a held plan; of one that runs, the present activity."""
        if self.is_held:
            return ButtonSpec(Action.TAKE_STEP, label, can_do)
        return ButtonSpec(Action.TAKE_STEP, doing, False)


def _keeps_hand(snapshot: Snapshot) -> bool:
    """Return whether the plan has the wearer keep the hand up from one step to the next."""
    return snapshot.plan.name == "recommended"


def _ways_out(planned: NextStep, snapshot: Snapshot) -> tuple[ButtonSpec, ...]:
    """Return the buttons beside the next cursor: how not to make it."""
    if planned.is_requested:
        return (ButtonSpec(Action.WITHDRAW, tr("&Back")),)
    results = snapshot.procedure.results
    if results is None or _keeps_hand(snapshot):
        return (_BACK,)
    is_one = len(results.eyes) < len(snapshot.plan.usable_eyes)
    end = tr("Fini&sh with one eye") if is_one else tr("Finish a&s it is")
    return (ButtonSpec(end_action(snapshot), end), _BACK)


def _raise_view(planned: NextStep, snapshot: Snapshot) -> WizardView:
    text = tr(
        "Raise one bare hand {}, palm toward you and fingers a little apart; hold it still."
    ).format(distance(snapshot))
    if planned.awaited is StepName.CURSOR and snapshot.record.alignments:
        text = tr("For {}: {}").format(eye_names(planned.eyes), f"{text[0].lower()}{text[1:]}")
    looks = needs_look(snapshot)
    awaited = tr("Waiting…") if looks else _WAITS_FOR_HAND
    return WizardView(
        Step.SHOW_HAND,
        LOOK if looks else text,
        (hand_found(snapshot), hand_still(snapshot)),
        ButtonSpec(Action.TAKE_STEP, awaited, False),
        _ways_out(planned, snapshot),
        snapshot.procedure.refusal,
    )


def _wait_view(step: Step, snapshot: Snapshot) -> WizardView:
    procedure, planned = snapshot.procedure, snapshot.next_step
    text = tr("Waiting for the headset to acknowledge its projections.")
    doing = _SENDING
    ways_out: tuple[ButtonSpec, ...] = (_BACK,)
    if _keeps_hand(snapshot):
        text = tr("The hand stays up while the headset receives its projections.")
    is_refused = procedure.is_applied and procedure.state is not State.APPLYING
    if planned is not None and planned.name is StepName.WAIT and is_refused:
        text, doing = f"{sentence(planned.text)}.", tr("Waiting…")
        ways_out = _ways_out(planned, snapshot)
    main = ButtonSpec(Action.TAKE_STEP, doing, False)
    return WizardView(step, text, eyes_accepted(snapshot), main, ways_out)


def _done_view(planned: NextStep, snapshot: Snapshot) -> WizardView:
    """Return the view of a plan that has ended."""
    usable, record = snapshot.plan.usable_eyes, snapshot.record
    preconditions = eyes_accepted(snapshot)
    if any(one.verdict not in SETTLED for one in preconditions) or not preconditions:
        view = _not_accepted_view(preconditions, snapshot)
        return view if preconditions else replace(view, sentence=f"{sentence(planned.text)}.")
    text = tr("Not every eye has been verified. Finish as it is, or verify an eye.")
    end = end_action(snapshot)
    main = ButtonSpec(end, tr("Finish as it is"))
    if set(record.facts.verified) >= set(usable):
        text = tr("Verified before the alignments changed. Finish, or verify an eye again.")
        if record.verified_now:
            text = tr(
                "Not every eye has been verified since the alignments changed. Finish, or "
                "verify an eye again."
            )
        elif record.trials and not trials_of(snapshot):
            text = tr(
                "Verified, and tested in trials, before the alignments changed. Finish, or "
                "verify an eye again."
            )
        if record.verified_now >= set(usable):
            text = tr("The wearer has verified and corrected the result. Finish, or measure more.")
            if any(one.verdict == "keep" for one in preconditions):
                text = tr(
                    "Verified; the result is not used for every eye. Finish, or measure more."
                )
        main = ButtonSpec(end, tr("Finish"))
    if doubt := doubt_sentence(snapshot):
        text, main = doubt, ButtonSpec(end, tr("Finish as it is"))
    return WizardView(Step.VERIFY, text, preconditions, main, _more(snapshot))


def _more(snapshot: Snapshot) -> tuple[ButtonSpec, ...]:
    """Return the buttons that measure more after the end of a plan."""
    usable = snapshot.plan.usable_eyes
    add = ButtonSpec(Action.ANOTHER, tr("&Add alignment"))
    unverified = [eye for eye in usable if eye not in snapshot.record.verified_now]
    if kept := keep_choices(snapshot):
        return (*kept, *(VERIFY_AGAIN[eye] for eye in kept_eyes(snapshot)), add)
    if _keeps_hand(snapshot) or len(usable) == 1:
        return (add, *(VERIFY_AGAIN[eye] for eye in usable))
    return (add, *(VERIFY_AGAIN[eye] for eye in unverified)) if unverified else (add, *_REPEAT)


def _not_accepted_view(preconditions: tuple[Precondition, ...], snapshot: Snapshot) -> WizardView:
    """Return the view of a plan that has ended without an accepted result."""
    if falsified := falsified_view(preconditions, snapshot):
        return falsified
    can_do, usable = is_steady(snapshot), snapshot.plan.usable_eyes
    text = tr("Not good yet. Add an alignment, or finish as it is.")
    main = ButtonSpec(Action.ANOTHER, tr("Add alignment"))
    others = [one for one in _more(snapshot) if one.action is not Action.ANOTHER]
    again: list[Eye] = []
    if (results := snapshot.procedure.results) is not None:
        again = [eye for eye, one in results.advice.items() if one.verify]
        again.sort(key=lambda eye: -results.benefits[eye].after_arcmin)  # the worse one first
    if any(one.verdict in UNUSABLE for one in preconditions):
        text = tr("Do not use this result. Follow the advice below, then add alignments.")
    elif again and all(eye in snapshot.record.facts.verified for eye in usable):
        text = tr("Not good yet: verify {} again. Another alignment would change little.").format(
            eye_names(sorted(again))
        )
        first = VERIFY_AGAIN[again[0]]
        others = [VERIFY_AGAIN[eye] for eye in usable if eye != again[0]]
        others.insert(0, ButtonSpec(Action.ANOTHER, tr("&Add alignment")))
        label = tr("Verify the {} eye").format(EYE_WORDS[again[0]])
        main = ButtonSpec(first.action, label, can_do)
    return WizardView(
        Step.VERIFY,
        text,
        (hand_found(snapshot), hand_still(snapshot), *preconditions),
        main,
        (*others[: MOST_OTHERS - 1], ButtonSpec(end_action(snapshot), tr("Finish a&s it is"))),
    )
