"""The guide's step, texts and buttons: it shows the plan's next step, and decides nothing.

Without Qt, so that every case can be tested.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import ceil

import numpy as np

from handcal.calibration.hands import MATCH_NS
from handcal.calibration.plan import NextStep, StepName
from handcal.calibration.states import State
from handcal.calibration.verifying import VerifyingView
from handcal.core.types import Eye, Verdict, VerdictName
from handcal.register.guard import turn_advice
from handcal.register.results import USED, Results
from handcal.register.verdict import is_helpful
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.report.cells import signed
from handcal.session.drawn import drawn_shifts
from handcal.session.record import eye_trials
from handcal.session.session import SessionRecord
from handcal.session.trial import SAME_SHIFT_M, EyeTrials, is_doubted
from handcal.station.snapshot import Snapshot
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.guide.view import (
    EYE_WORDS,
    MOST_OTHERS,
    Action,
    ButtonSpec,
    Precondition,
    Step,
    WizardView,
)
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.sentence import lowered, sentence
from handcal_gui.widgets.times import session_time

VERIFY_AGAIN: dict[Eye, ButtonSpec] = {
    "left": ButtonSpec(Action.VERIFY_LEFT, tr("Verify &left eye")),
    "right": ButtonSpec(Action.VERIFY_RIGHT, tr("Verify &right eye")),
}
LOOK = tr("Keep the hand up, and look slowly to the left and to the right.")
UNUSABLE: frozenset[VerdictName] = frozenset({"implausible", "contradicted"})
SETTLED: frozenset[VerdictName] = frozenset({"accept", "keep"})
"""Verdicts after which a session can be finished without anything left to decide."""
_LEAST_LOOK_NS = 1_500_000_000
"""Time from a drawing to its confirmation: a second press of a key confirms nothing unseen."""
_GATE_MARGIN_M = 0.05
"""From the depth gate to where the hand is to be held: its palm, with fingers before and behind."""
_FOREARM_M = 0.45
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
        self._has_moved = False
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
        if not self._has_moved and snapshot.procedure.verifying is not None:
            self._page = None  # the wearer goes on with the verification in which a session stopped
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
        self._has_moved = True
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
    elif not _more_helps(snapshot):
        text = tr("Not good yet: {}. More would hardly change that. Finish as it is, or go on.")
        text = text.format(_not_settled(snapshot))
        main = ButtonSpec(end_action(snapshot), tr("Finish as it is"))
        return WizardView(Step.VERIFY, text, preconditions, main, _more(snapshot)[:MOST_OTHERS])
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


def _more_helps(snapshot: Snapshot) -> bool:
    """Return whether anything that can be advised is expected to bring *Good* nearer."""
    results = snapshot.procedure.results
    return results is None or any(
        is_helpful(one, results.benefits[eye], snapshot.settings.solve.verdict)
        for eye, one in results.advice.items()
    )


def _not_settled(snapshot: Snapshot) -> str:
    """Return the names of the eyes whose result is not good yet."""
    results = snapshot.procedure.results
    verdicts = results.verdicts if results is not None else {}
    return eye_names([eye for eye, one in verdicts.items() if one.name not in SETTLED])


def connect_view(snapshot: Snapshot) -> WizardView:
    """Return the view while camera and headset are connected."""
    camera, link = snapshot.camera, snapshot.link
    has_poses = link.connected and link.pose_rate_hz > 0
    preconditions = (
        Precondition(
            tr("No image from the camera")
            if camera.problem
            else tr("Camera: {}").format(camera.name),
            not camera.problem and camera.rate_hz > 0,
        ),
        Precondition(sentence(snapshot.link_problem) or tr("Headset connected"), link.connected),
        Precondition(
            tr("Headset pose: {:.0f} Hz").format(link.pose_rate_hz)
            if has_poses
            else tr("No pose from the headset yet"),
            has_poses,
        ),
    )
    if snapshot.contradiction and not camera.problem:
        preconditions = (Precondition(sentence(snapshot.contradiction), False), *preconditions[1:])
    seen = snapshot.observation
    is_refused = seen is not None and seen.contradiction is not None
    is_refused |= bool(snapshot.contradiction) and snapshot.procedure.results is None
    has_failed = bool(snapshot.contradiction) and is_refused
    # Evidence against a result that is there does not keep anybody from looking at it.
    is_ready = not has_failed and all(
        one.holds for one in preconditions[bool(snapshot.contradiction) :]
    )
    former = snapshot.record.facts.former
    puts_on, label, fact = tr("Put the headset on the wearer"), tr("Begin"), ""
    if begun := _made(snapshot.record):
        puts_on, label = tr("Make sure that the headset sits as before"), tr("Continue")
        fact = tr("This session continues where it stopped, with {}.").format(begun)
    elif former:
        puts_on = tr("Make sure that the headset sits well on the wearer")
        fact = tr(
            "The former result is used again ({}): the wearer verifies each eye first, and "
            "alignments follow only if they are needed."
        ).format(session_time(former))
    text = tr("{} and wait until camera and headset are connected.").format(puts_on)
    if is_ready:
        text = tr("{}, then press {}.").format(puts_on, label)
    elif has_failed:
        text = tr("A check has failed. Follow its advice, then press {}.").format(label)
    return WizardView(
        Step.CONNECT,
        text,
        preconditions,
        ButtonSpec(Action.NEXT, label, is_ready),
        fact=fact,
    )


def align_view(snapshot: Snapshot) -> WizardView:
    """Return the view while the wearer overlays the cursor."""
    procedure = snapshot.procedure
    cursor, was = procedure.cursor, procedure.refused_for
    seen_ns = snapshot.t_host_ns - cursor.t_host_ns if cursor is not None else 0
    preconditions = (
        can_match(snapshot),
        _as_cursor(snapshot),
        _looked(tr("Cursor shown for {:g} s"), seen_ns),
    )
    close = ""
    if len(procedure.eyes) == 1:
        close = tr("Close the {} eye. ").format(
            EYE_WORDS["right" if procedure.eyes[0] == "left" else "left"]
        )
    return WizardView(
        Step.ALIGN,
        tr("{}Move the hand until it lies under the cursor, then confirm in the headset.").format(
            close
        ),
        preconditions,
        ButtonSpec(
            Action.CONFIRM,
            tr("Confirm for the wearer"),
            _all_hold(preconditions) and is_placed(snapshot) and snapshot.link.connected,
        ),
        (ButtonSpec(Action.REDO, tr("&Make another cursor"), discards=tr("Discards this cursor")),),
        # The preconditions say what the live hand lacks.
        "" if was or not preconditions[0].holds else procedure.refusal,
        fact=tr("Last refused: {}.").format(lowered(was)) if was else "",
    )


def _as_cursor(snapshot: Snapshot) -> Precondition:
    """Return whether the guard would accept the live hand; if not, with its reason."""
    seen, limit_rad = snapshot.observation, snapshot.settings.guard.limit_rad
    limit_deg = round(float(np.degrees(limit_rad)), 1)
    straight = tr("Hand rotated by less than {:g}°").format(limit_deg)
    if seen is None or seen.rotation_rad is None:
        return Precondition(straight, False)
    angle_rad = float(np.linalg.norm(seen.rotation_rad))
    if seen.has_changed and angle_rad <= limit_rad:
        return Precondition(sentence(seen.shape_text), False)
    if seen.is_over_limit:
        advice = turn_advice(seen.rotation_rad).text
        text = tr("Turned {:.1f}°: {}").format(np.degrees(angle_rad), lowered(advice))
        return Precondition(text, False)
    return Precondition(straight, True)


def sending(results: Results) -> tuple[str, str]:
    """Return what the main button does with a solved result, and its label."""
    kept = _kept(results)
    used = [eye for eye in results.verdicts if eye not in kept]
    if not kept:
        text = tr("Send the corrected projections to the headset.")
        return text, tr("Send to the headset")
    faulty = [eye for eye in kept if results.verdicts[eye].name in UNUSABLE]
    if not used:
        text = tr("Keep the offline calibration of {}.")
        if faulty:
            text = tr(
                "Do not use this result: keep the offline calibration of {}, and follow the "
                "advice below."
            )
        return text.format(eye_names(kept)), tr("Keep offline")
    text = tr("Send the {} eye's projection; the {} eye keeps the offline calibration.")
    if faulty:
        text = tr(
            "Send the {} eye's projection; the {} eye keeps the offline calibration: its result "
            "is {}."
        )
    used_word, kept_word = EYE_WORDS[used[0]], EYE_WORDS[kept[0]]
    text = text.format(used_word, kept_word, VERDICT_WORDS[results.verdicts[kept[0]].name].lower())
    return text, tr("Send {} eye").format(used_word)


def verification_view(snapshot: Snapshot, verifying: VerifyingView) -> WizardView:
    """Return the view while an eye's outline is moved until it covers the hand."""
    eye, moved = verifying.eye, verifying.moved
    other: Eye = "right" if eye == "left" else "left"
    across = EYE_WORDS["left" if moved.right_arcmin < 0 else "right"]
    along = tr("up") if moved.down_arcmin < 0 else tr("down")
    text = tr(
        "Close the {} eye. Move the outline onto the hand: in the headset, or here with the "
        "arrow keys, + and −."
    ).format(EYE_WORDS[other])
    if verifying.is_set_aside:
        text = tr("It was moved aside on purpose: bringing it back is the evidence. {}").format(
            text
        )
    elif eye in snapshot.record.facts.verified:
        text = tr("Once more, to be sure. {}").format(text)
    total_arcmin = float(np.hypot(moved.right_arcmin, moved.down_arcmin))
    seen_ns = snapshot.t_host_ns - verifying.began_host_ns
    preconditions = (
        can_match(snapshot),
        hand_still(snapshot),
        _looked(tr("Outline shown for {:g} s"), seen_ns),
    )
    return WizardView(
        Step.VERIFY,
        text,
        preconditions,
        ButtonSpec(
            Action.VERIFIED,
            tr("It covers the hand"),
            _all_hold(preconditions) and snapshot.link.connected,
        ),
        (
            ButtonSpec(Action.UNDO_NUDGE, tr("&Undo"), verifying.can_undo),
            ButtonSpec(Action.SKIP, tr("&Skip")),
        ),
        snapshot.procedure.refusal,
        fact=tr("{} eye's outline moved by {:.1f}′: {:.1f}′ {}, {:.1f}′ {}, size {}\u00a0%").format(
            EYE_WORDS[eye].capitalize(),
            total_arcmin,
            abs(moved.right_arcmin),
            across,
            abs(moved.down_arcmin),
            along,
            signed(100 * moved.size, 1),
        ),
    )


def falsified_view(
    preconditions: tuple[Precondition, ...], snapshot: Snapshot
) -> WizardView | None:
    """Return the view of a result against which there is evidence, which no alignment removes."""
    if not any(one.verdict == "contradicted" for one in preconditions):
        return None
    return WizardView(
        Step.VERIFY,
        tr("Do not use this result. Finish, follow the advice below, and calibrate again."),
        preconditions,
        ButtonSpec(end_action(snapshot), tr("Finish")),
        (ButtonSpec(Action.ANOTHER, tr("&Add alignment")),),
    )


def end_action(snapshot: Snapshot) -> Action:
    """Return the action that ends the session, by one press unless its data cannot be stored."""
    return Action.NEXT if snapshot.problem else Action.FINISH


def save_view(snapshot: Snapshot) -> WizardView:
    """Return the view of a session that is to be finished, or is."""
    preconditions = (
        Precondition(tr("Saved in {}").format(snapshot.session_path), not snapshot.problem),
        *eyes_accepted(snapshot),
    )
    others = (ButtonSpec(Action.EXPORT, tr("E&xport…")), ButtonSpec(Action.BACK, tr("&Back")))
    judged = preconditions[1:]
    doubted = doubted_eyes(snapshot)
    is_settled = bool(judged) and all(one.verdict in SETTLED for one in judged)
    is_good = bool(judged) and all(one.verdict == "accept" for one in judged)
    is_verified = is_good and len(snapshot.record.verified_now) == len(judged)
    unearned = frozenset() if is_verified else frozenset({Step.VERIFY})
    if snapshot.record.is_finished:
        text = tr(
            "The session is complete. Take the headset off, or continue with the next wearer."
        )
        if kept := [eye for eye in kept_eyes(snapshot) if is_settled]:
            text = tr(
                "The session is complete; the result is not used for {}. Take the headset off, or "
                "continue with the next wearer."
            ).format(eye_names(kept))
        if judged and not is_settled:
            text = tr(
                "The session is finished, but its result is not good yet. Go back to measure more, "
                "or continue with the next wearer."
            )
            if not _more_helps(snapshot):
                text = tr(
                    "The session is finished. Not good yet: {}. More would hardly change that. "
                    "Continue with the next wearer."
                ).format(_not_settled(snapshot))
        elif doubted:
            text = tr(
                "The session is finished, but trials of {} are over the target. Go back to measure "
                "again, or continue with the next wearer."
            ).format(eye_names(doubted))
        main = ButtonSpec(Action.NEXT_WEARER, tr("Next wearer"))
    else:
        text = tr("Everything is already saved. Finish the session when you are done.")
        if judged and not is_settled:
            text = tr("Not good yet. Go back to measure more, or finish as it is; all is saved.")
            if not _more_helps(snapshot):
                text = tr("Not good yet: {}. More would hardly change that. Finish; all is saved.")
                text = text.format(_not_settled(snapshot))
        elif doubted:
            text = tr(
                "Trials of {} are over the target. Go back to measure again, or finish as it is; "
                "all is saved."
            ).format(eye_names(doubted))
        if snapshot.problem:
            text = tr("Solve the problem below, then finish the session.")
        main = ButtonSpec(Action.FINISH, tr("Finish session"))
    return WizardView(
        Step.SAVE,
        text,
        preconditions,
        main,
        (*others, *keep_choices(snapshot)),
        fact=drawn_fact(snapshot),
        unearned=unearned,
    )


def doubt_sentence(snapshot: Snapshot) -> str:
    """Return the next step after a result that its trials contradict; else empty."""
    doubted = doubted_eyes(snapshot)
    text = tr("Trials of {} are over the target. Add an alignment, or finish as it is.")
    return text.format(eye_names(doubted)) if doubted else ""


def drawn_fact(snapshot: Snapshot) -> str:
    """Return why the headset does not draw the final φ now, or how to go on; empty if it does."""
    procedure, results = snapshot.procedure, snapshot.procedure.results
    if results is None or procedure.state is not State.APPLIED:
        return ""
    final, drawn_m = drawn_shifts(snapshot.record, results), procedure.applied_shift_m
    others: list[Eye] = [
        eye
        for eye in results.eyes
        if np.abs(drawn_m[eye] - final[eye].shift_m).max() >= SAME_SHIFT_M
    ]
    if others:
        text = tr("The headset draws {} with another φ for the moment: {}.")
        moved = tr("it is moved for a trial") if snapshot.trial_eye else tr("it is being set")
        return text.format(eye_names(others), moved)
    former_m, solved_m = procedure.former_shift_m, results.rendered_shift_m
    is_back = any((drawn_m[eye] != solved_m[eye]).any() for eye in solved_m)
    can_return = all(eye in former_m and (former_m[eye] == solved_m[eye]).all() for eye in solved_m)
    return tr("Press G to return to the newest φ.") if is_back and can_return else ""


def keep_choices(snapshot: Snapshot) -> tuple[ButtonSpec, ...]:
    """Return the button that uses results that are no better than before, or drops them again."""
    results = snapshot.procedure.results
    kept = kept_eyes(snapshot)
    if results is None or not kept or snapshot.procedure.state is not State.APPLIED:
        return ()
    final = drawn_shifts(snapshot.record, results)
    if all(final[eye].kind == "solved" for eye in kept):
        return (ButtonSpec(Action.KEEP_OFFLINE, tr("Keep &offline")),)
    return (ButtonSpec(Action.USE_ANYWAY, tr("&Use it anyway")),)


def kept_eyes(snapshot: Snapshot) -> list[Eye]:
    """Return the usable eyes whose result is no better than the offline calibration."""
    results = snapshot.procedure.results
    verdicts = results.verdicts if results is not None else {}
    return [eye for eye in snapshot.plan.usable_eyes if _name(verdicts, eye) == "keep"]


def _name(verdicts: Mapping[Eye, Verdict], eye: Eye) -> str:
    return verdicts[eye].name if eye in verdicts else ""


def _kept(results: Results) -> tuple[Eye, ...]:
    """Return the eyes for which the headset draws with the offline calibration."""
    verdicts = results.verdicts
    return tuple(eye for eye in verdicts if verdicts[eye].name not in USED)


def _looked(text: str, shown_ns: int) -> Precondition:
    """Return whether the wearer has had the time to look at a drawing, as a precondition."""
    return Precondition(text.format(_LEAST_LOOK_NS / 1e9), shown_ns > _LEAST_LOOK_NS)


def _all_hold(preconditions: Sequence[Precondition]) -> bool:
    return all(one.holds for one in preconditions)


def _made(record: SessionRecord) -> str:
    """Return the alignments and verifications so far, in words; empty if there are none."""
    held = (
        (len(record.alignments), tr("alignment"), tr("alignments")),
        (len(record.facts.verified), tr("verified eye"), tr("verified eyes")),
    )
    return ", ".join(pluralize(*one) for one in held if one[0])


def distance(snapshot: Snapshot) -> str:
    """Return how far from the camera the hand is to be held within the depth gate, in words."""
    gate_m = snapshot.settings.segment.reachable_m
    near_m, far_m = gate_m[0] + _GATE_MARGIN_M, gate_m[1] - _GATE_MARGIN_M
    text = tr("{:.0f} to {:.0f} cm from the camera").format(100 * near_m, 100 * far_m)
    is_forearm = near_m <= _FOREARM_M <= far_m
    return tr("at forearm's length, {}").format(text) if is_forearm else text


def eye_names(eyes: Sequence[Eye]) -> str:
    """Return eyes in words."""
    return tr("both eyes") if len(eyes) == 2 else tr("the {} eye").format(EYE_WORDS[eyes[0]])


def is_steady(snapshot: Snapshot) -> bool:
    """Return whether a cursor can be made of the hand."""
    return snapshot.observation is not None and snapshot.observation.is_steady


def hand_still(snapshot: Snapshot) -> Precondition:
    """Return whether the hand is held still and can be placed in time, as a precondition."""
    if needs_look(snapshot):
        return Precondition(tr("The wearer has looked slowly to the left and to the right"), False)
    return Precondition(tr("Hand held still"), is_steady(snapshot))


def is_unsolved(snapshot: Snapshot) -> bool:
    """Return whether a running session has no result, or none of its present alignments."""
    return snapshot.procedure.results is None and not snapshot.record.is_finished


def needs_look(snapshot: Snapshot) -> bool:
    """Return whether the wearer must turn the head before a hand can be placed in time."""
    return snapshot.observation is not None and snapshot.observation.needs_delay


def is_placed(snapshot: Snapshot) -> bool:
    """Return whether the newest hand has a place in the world."""
    return snapshot.observation is not None and snapshot.observation.hand is not None


def hand_found(snapshot: Snapshot) -> Precondition:
    """Return whether a hand is found, as a precondition, with the reason if there is none."""
    seen = snapshot.observation
    # A hand that is seen without a problem is placed with one of the next frames.
    if is_placed(snapshot) or (seen and seen.cloud is not None and not seen.problem):
        return Precondition(tr("Hand found"), True)
    without = tr("No image from the camera") if snapshot.camera.problem else tr("No hand in view")
    return Precondition((seen and sentence(seen.problem)) or without, False)


def can_match(snapshot: Snapshot) -> Precondition:
    """Return whether a confirmation would find its image: a hand is found, in enough of them."""
    needed_hz = ceil(0.5e9 / MATCH_NS)
    rate_hz = snapshot.camera.rate_hz
    if snapshot.camera.problem or rate_hz >= needed_hz:
        return hand_found(snapshot)
    text = tr("Images per second: {:.0f} of the {} needed. Close other programs.")
    return Precondition(text.format(rate_hz, needed_hz), False)


def trials_of(snapshot: Snapshot) -> dict[Eye, EyeTrials]:
    """Return the user-test trials of the present results."""
    results = snapshot.procedure.results
    if results is None:
        return {}
    return eye_trials(results, snapshot.record, snapshot.settings.solve.verdict.target_arcmin)


def doubted_eyes(snapshot: Snapshot) -> list[Eye]:
    """Return the accepted eyes whose user-test trials are over the lab's target."""
    results = snapshot.procedure.results
    verdicts = results.verdicts if results is not None else {}
    return [eye for eye, one in trials_of(snapshot).items() if is_doubted(verdicts[eye].name, one)]


def eyes_accepted(snapshot: Snapshot) -> tuple[Precondition, ...]:
    """Return the verdict on each solved eye that the plan is for, as a precondition."""
    results = snapshot.procedure.results
    if results is None:
        return ()
    return tuple(
        Precondition(
            tr("{} eye: {}. {}").format(
                EYE_WORDS[eye].capitalize(), VERDICT_WORDS[verdict.name], verdict.reason
            ),
            verdict.name == "accept",
            verdict.name,
        )
        for eye, verdict in results.verdicts.items()
        if eye in snapshot.plan.usable_eyes
    )
