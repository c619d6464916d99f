"""Texts and buttons of the wizard at each step; without Qt, so that every case can be tested."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from handcal.register.verdict import Advice
from handcal.station.procedure import State
from handcal.station.snapshot import Snapshot
from handcal.station.verifying import VerifyingView
from handcal.types import EYES, Alignment, Eye, EyePlan, VerdictName
from handcal_gui.pages.wizard.checks import (
    hand_check,
    is_placed,
    is_steady,
    still_check,
    verdict_checks,
)
from handcal_gui.pages.wizard.view import (
    EYE_WORDS,
    STEPS,
    Action,
    ButtonSpec,
    Precondition,
    Step,
    WizardView,
)
from handcal_gui.translation import tr
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.sentence import sentence

PLANS: dict[EyePlan, str] = {
    "each": tr("One eye after the other"),
    "both": tr("Both eyes at once"),
    "left": tr("Left eye only"),
    "right": tr("Right eye only"),
}
DISTANCE = tr("at forearm's length, 40 to 60 cm from the eyes")
_LEAST_ALIGN_NS = 1_500_000_000
UNUSABLE: frozenset[VerdictName] = frozenset({"implausible", "contradicted"})
_SHOWN_S, _STILL_S, _READ_S, _ADVICE_S = 0.6, 1.2, 1.5, 3.0
"""Waiting times of steps that run by themselves: for the hand, and to read a text or an advice."""
_MOST_BY_ITSELF = 2
"""Most further alignments of an eye that are begun without asking."""
_SENDS_UNUSABLE = tr("Draws with a result that should not be used")


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
            case State.APPLYING if snapshot.procedure.verifications:
                return Step.VERIFY
            case State.ALIGNED | State.SOLVED | State.APPLYING:
                self._free = Step.VERIFY
                return Step.SOLVE
            case State.APPLIED:
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
        return _VIEWS[self.step(snapshot)](self, snapshot)

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

    def _connect(self, snapshot: Snapshot) -> WizardView:
        camera, link = snapshot.camera, snapshot.link
        checks = (
            Precondition(
                tr("No image from the camera")
                if camera.problem
                else tr("Camera: {}").format(camera.name),
                not camera.problem and camera.rate_hz > 0,
            ),
            Precondition(
                sentence(snapshot.link_problem) or tr("Headset connected"), link.connected
            ),
            Precondition(
                tr("Headset pose: {:.0f} Hz").format(link.pose_rate_hz)
                if link.pose_rate_hz
                else tr("No pose from the headset yet"),
                link.pose_rate_hz > 0,
            ),
        )
        is_ready = all(check.holds for check in checks)
        if snapshot.contradiction and not camera.problem:
            checks = (Precondition(sentence(snapshot.contradiction), False), *checks[1:])
        return WizardView(
            Step.CONNECT,
            tr("Put the headset on the wearer and wait until camera and headset are connected."),
            checks,
            ButtonSpec(Action.NEXT, tr("Begin"), is_ready),
        )

    def _show_hand(self, snapshot: Snapshot) -> WizardView:
        back = ButtonSpec(Action.BACK, tr("&Back"))
        if snapshot.procedure.state is State.SHOW_HAND and snapshot.procedure.alignments:
            back = ButtonSpec(Action.SOLVE, tr("Keep the alignments &so far"))
        return WizardView(
            Step.SHOW_HAND,
            tr("Raise one bare hand {}, palm toward you and fingers a little apart.").format(
                DISTANCE
            ),
            (hand_check(snapshot),),
            ButtonSpec(Action.NEXT, tr("Next"), is_placed(snapshot)),
            (back,),
            runs_after_s=_SHOWN_S,
        )

    def _make_cursor(self, snapshot: Snapshot) -> WizardView:
        return WizardView(
            Step.MAKE_CURSOR,
            tr("Hold the hand still: it becomes the cursor for {}.").format(
                eye_names(self.eyes(snapshot))
            ),
            (hand_check(snapshot), still_check(snapshot)),
            ButtonSpec(Action.MAKE_CURSOR, tr("Make cursor"), is_steady(snapshot)),
            (ButtonSpec(Action.BACK, tr("&Back")),),
            runs_after_s=_STILL_S,
        )

    def _align(self, snapshot: Snapshot) -> WizardView:
        procedure, seen = snapshot.procedure, snapshot.observation
        hand = hand_check(snapshot)
        is_straight = seen is not None and seen.rotation_rad is not None and not seen.is_over_limit
        limit_deg = round(float(np.degrees(procedure.guard_limit_rad)), 1)
        cursor = procedure.cursor
        # A second press of the key that made the cursor must not confirm a hand that has not moved.
        is_due = cursor is not None and snapshot.t_host_ns - cursor.t_host_ns > _LEAST_ALIGN_NS
        close = ""
        if len(procedure.eyes) == 1:
            close = tr("Close the {} eye. ").format(
                EYE_WORDS["right" if procedure.eyes[0] == "left" else "left"]
            )
        return WizardView(
            Step.ALIGN,
            tr(
                "{}Move the hand until it lies under the cursor, then confirm in the headset."
            ).format(close),
            (
                hand,
                Precondition(tr("Hand rotated by less than {:g}°").format(limit_deg), is_straight),
            ),
            ButtonSpec(
                Action.CONFIRM, tr("Confirm for the wearer"), is_placed(snapshot) and is_due
            ),
            (
                ButtonSpec(
                    Action.REDO, tr("&Make another cursor"), discards=tr("Discards this cursor")
                ),
            ),
            procedure.refusal,
        )

    def _solve(self, snapshot: Snapshot) -> WizardView:
        procedure = snapshot.procedure
        count = len(snapshot.procedure.alignments)
        aligned = Precondition(
            tr("{} confirmed").format(pluralize(count, tr("alignment"), tr("alignments"))), True
        )
        redo = ButtonSpec(
            Action.REDO,
            tr("&Discard and repeat"),
            discards=tr("Deletes the last alignment; the session panel can restore it"),
        )
        if procedure.state is State.ALIGNED or procedure.results is None:
            return WizardView(
                Step.SOLVE,
                tr("The wearer may lower the hand. Solve for the positions of the eyes."),
                (aligned,),
                ButtonSpec(Action.SOLVE, tr("Solve")),
                (redo,),
                runs_after_s=_SHOWN_S,
            )
        verdicts = verdict_checks(snapshot)
        if procedure.state is State.APPLYING:
            wait = tr("Waiting for the headset to acknowledge its projections.")
            return WizardView(
                Step.SOLVE,
                wait,
                (aligned, *verdicts),
                ButtonSpec(Action.APPLY, tr("Sending…"), False),
            )
        names = {eye: verdict.name for eye, verdict in procedure.results.verdicts.items()}
        others: tuple[ButtonSpec, ...] = (redo,)
        send = ButtonSpec(Action.APPLY, tr("Send to the headset"))
        instruction = tr("Send the corrected projections to the headset.")
        kept = tuple(eye for eye, name in names.items() if name == "keep")
        if UNUSABLE.intersection(names.values()):
            instruction = tr("Do not use this result. Follow the advice below, then repeat.")
            send = ButtonSpec(Action.APPLY, tr("Send to the headset"), False)
            others += (ButtonSpec(Action.APPLY, tr("Send &anyway"), discards=_SENDS_UNUSABLE),)
        elif len(kept) == len(names):
            instruction = tr("Keep the offline calibration of {}.").format(eye_names(kept))
            send = ButtonSpec(Action.APPLY, tr("Keep offline"))
        elif kept:
            instruction = tr("Send the projections to the headset, those of {} offline.").format(
                eye_names(kept)
            )
        return WizardView(
            Step.SOLVE,
            instruction,
            (aligned, *verdicts),
            send,
            others,
            snapshot.problem,
            runs_after_s=_READ_S,
        )

    def _verify(self, snapshot: Snapshot) -> WizardView:
        checks = verdict_checks(snapshot)
        if snapshot.procedure.state is State.APPLYING:
            wait = tr("Waiting for the headset to acknowledge its projections.")
            sending = ButtonSpec(Action.APPLY, tr("Sending…"), False)
            return WizardView(Step.VERIFY, wait, checks, sending)
        if snapshot.procedure.verifying is not None:
            return nudge_view(snapshot, snapshot.procedure.verifying)
        if snapshot.procedure.results is None and snapshot.procedure.alignments:
            return WizardView(
                Step.VERIFY,
                tr("The alignments have changed. Solve again."),
                checks,
                ButtonSpec(Action.SOLVE, tr("Solve")),
                (ButtonSpec(Action.ANOTHER, tr("&Add alignment")),),
            )
        if not self._is_complete(snapshot):
            eyes = eye_names(self.eyes(snapshot))
            return WizardView(
                Step.VERIFY,
                tr("Now repeat this with {}.").format(eyes),
                checks,
                ButtonSpec(Action.ANOTHER, tr("Align {}").format(eyes)),
                (ButtonSpec(Action.NEXT, tr("Finish with &one eye")),),
                runs_after_s=_READ_S,
            )
        each = (
            ButtonSpec(Action.REPEAT_LEFT, tr("Add l&eft eye")),
            ButtonSpec(Action.REPEAT_RIGHT, tr("Add &right eye")),
        )
        is_usable = not any(check.verdict in UNUSABLE for check in checks)
        if is_usable and (unverified := self.unverified(snapshot)):
            eye = unverified[0]
            return WizardView(
                Step.VERIFY,
                tr("Raise the hand and hold it still, to measure the error of the {} eye.").format(
                    EYE_WORDS[eye]
                ),
                (hand_check(snapshot), still_check(snapshot), *checks),
                ButtonSpec(
                    Action.VERIFY,
                    tr("Verify the {} eye").format(EYE_WORDS[eye]),
                    is_steady(snapshot),
                ),
                (ButtonSpec(Action.SKIP, tr("&Skip")), *each),
                runs_after_s=_STILL_S,
            )
        if advice := _advice(snapshot):
            eyes = eye_names(advice.eyes or EYES)
            few = advice.is_accepted and advice.alignments <= _MOST_BY_ITSELF
            return WizardView(
                Step.VERIFY,
                tr("Not accepted yet: align {} again, or keep the result as it is.").format(eyes),
                checks,
                ButtonSpec(Action.ANOTHER, tr("Add {}").format(eyes)),
                (ButtonSpec(Action.NEXT, tr("Keep as it &is")), *each),
                runs_after_s=_ADVICE_S if few else None,
            )
        if not is_usable:
            return WizardView(
                Step.VERIFY,
                tr("Do not use this result. Follow the advice below, then add alignments."),
                checks,
                ButtonSpec(Action.ANOTHER, tr("Add alignment")),
                (ButtonSpec(Action.NEXT, tr("Keep as it &is")), *each),
            )
        if not self._skipped:
            return WizardView(
                Step.VERIFY,
                tr("The wearer has verified the result. Finish, or add an alignment."),
                checks,
                ButtonSpec(Action.NEXT, tr("Finish")),
                (ButtonSpec(Action.ANOTHER, tr("&Add alignment")), *each),
            )
        return WizardView(
            Step.VERIFY,
            tr(
                "The wearer looks at the raised hand: the outline should lie on it. If it "
                "does not, "
                "add an alignment or fine-tune φ."
            ),
            checks,
            ButtonSpec(Action.NEXT, tr("It fits")),
            (ButtonSpec(Action.ANOTHER, tr("&Add alignment")), *each),
        )

    def _save(self, snapshot: Snapshot) -> WizardView:
        checks = (
            Precondition(tr("Saved in {}").format(snapshot.session_path), not snapshot.problem),
            *verdict_checks(snapshot),
        )
        others = (ButtonSpec(Action.EXPORT, tr("E&xport…")), ButtonSpec(Action.BACK, tr("&Back")))
        is_accepted = len(checks) > 1 and all(check.holds for check in checks[1:])
        is_verified = is_accepted and len(snapshot.procedure.verifications) == len(checks) - 1
        unearned = frozenset() if is_verified else frozenset({Step.VERIFY})
        if snapshot.record.is_finished:
            return WizardView(
                Step.SAVE,
                tr(
                    "The session is complete. Take the headset off, or continue with the "
                    "next wearer."
                ),
                checks,
                ButtonSpec(Action.NEXT_WEARER, tr("Next wearer")),
                others,
                unearned=unearned,
            )
        return WizardView(
            Step.SAVE,
            tr("Everything is already saved. Finish the session when you are done."),
            checks,
            ButtonSpec(Action.FINISH, tr("Finish session")),
            others,
            snapshot.problem,
            runs_after_s=None if snapshot.problem else _READ_S,
            unearned=unearned,
        )


_VIEWS = {
    Step.CONNECT: Wizard._connect,
    Step.SHOW_HAND: Wizard._show_hand,
    Step.MAKE_CURSOR: Wizard._make_cursor,
    Step.ALIGN: Wizard._align,
    Step.SOLVE: Wizard._solve,
    Step.VERIFY: Wizard._verify,
    Step.SAVE: Wizard._save,
}


_REPEATS: dict[Action, tuple[Eye, ...]] = {
    Action.REPEAT_LEFT: ("left",),
    Action.REPEAT_RIGHT: ("right",),
}


def _advice(snapshot: Snapshot) -> Advice | None:
    """Return the advice for the eye with the largest expected error; None if none is to repeat."""
    results = snapshot.procedure.results
    if results is None:
        return None
    repeated = [eye for eye in results.advice if results.verdicts[eye].name == "repeat"]
    worst = max(repeated, key=lambda eye: results.benefits[eye].after_arcmin, default=None)
    return None if worst is None else results.advice[worst]


def nudge_view(snapshot: Snapshot, verifying: VerifyingView) -> WizardView:
    """Return the view while an eye's outline is moved until it covers the hand."""
    eye, moved = verifying.eye, verifying.moved
    other: Eye = "right" if eye == "left" else "left"
    across = EYE_WORDS["left" if moved.right_arcmin < 0 else "right"]
    along = tr("up") if moved.down_arcmin < 0 else tr("down")
    total_arcmin = float(np.hypot(moved.right_arcmin, moved.down_arcmin))
    return WizardView(
        Step.VERIFY,
        tr(
            "Close the {} eye. Arrow keys move the outline, + and − change its size, "
            "until it covers the hand."
        ).format(EYE_WORDS[other]),
        (hand_check(snapshot), still_check(snapshot)),
        ButtonSpec(Action.VERIFIED, tr("It covers the hand"), is_steady(snapshot)),
        (
            ButtonSpec(Action.UNDO_NUDGE, tr("&Undo"), verifying.can_undo),
            ButtonSpec(Action.SKIP, tr("&Skip")),
        ),
        snapshot.procedure.refusal,
        fact=tr("{} eye moved by {:.1f}′: {:.1f}′ {}, {:.1f}′ {}, size {:+.1f} %").format(
            EYE_WORDS[eye].capitalize(),
            total_arcmin,
            abs(moved.right_arcmin),
            across,
            abs(moved.down_arcmin),
            along,
            100 * moved.size,
        ),
    )


def eye_names(eyes: Sequence[Eye]) -> str:
    """Return eyes in words."""
    return tr("both eyes") if len(eyes) == 2 else tr("the {} eye").format(EYE_WORDS[eyes[0]])
