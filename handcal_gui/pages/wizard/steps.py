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
from handcal_gui.pages.wizard.view import STEPS, Action, ButtonSpec, Precondition, Step, WizardView
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.sentence import sentence

PLANS: dict[EyePlan, str] = {
    "each": "One eye after the other",
    "both": "Both eyes at once",
    "left": "Left eye only",
    "right": "Right eye only",
}
DISTANCE = "at forearm's length, 40 to 60 cm from the eyes"
_LEAST_ALIGN_NS = 1_500_000_000
UNUSABLE: frozenset[VerdictName] = frozenset({"implausible", "contradicted"})
_SHOWN_S, _STILL_S, _READ_S, _ADVICE_S = 0.6, 1.2, 1.5, 3.0
"""Waiting times of steps that run by themselves: for the hand, and to read a text or an advice."""
_MOST_BY_ITSELF = 2
"""Most further alignments of an eye that are begun without asking."""
_SENDS_UNUSABLE = "Draws with a result that should not be used"


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
                "No image from the camera" if camera.problem else f"Camera: {camera.name}",
                not camera.problem and camera.rate_hz > 0,
            ),
            Precondition(sentence(snapshot.link_problem) or "Headset connected", link.connected),
            Precondition(
                f"Headset pose: {link.pose_rate_hz:.0f} Hz"
                if link.pose_rate_hz
                else "No pose from the headset yet",
                link.pose_rate_hz > 0,
            ),
        )
        is_ready = all(check.holds for check in checks)
        if snapshot.contradiction and not camera.problem:
            checks = (Precondition(sentence(snapshot.contradiction), False), *checks[1:])
        return WizardView(
            Step.CONNECT,
            "Put the headset on the wearer and wait until camera and headset are connected.",
            checks,
            ButtonSpec(Action.NEXT, "Begin", is_ready),
        )

    def _show_hand(self, snapshot: Snapshot) -> WizardView:
        back = ButtonSpec(Action.BACK, "&Back")
        if snapshot.procedure.state is State.SHOW_HAND and snapshot.procedure.alignments:
            back = ButtonSpec(Action.SOLVE, "Keep the alignments &so far")
        return WizardView(
            Step.SHOW_HAND,
            f"Raise one bare hand {DISTANCE}, palm toward you and fingers a little apart.",
            (hand_check(snapshot),),
            ButtonSpec(Action.NEXT, "Next", is_placed(snapshot)),
            (back,),
            runs_after_s=_SHOWN_S,
        )

    def _make_cursor(self, snapshot: Snapshot) -> WizardView:
        return WizardView(
            Step.MAKE_CURSOR,
            f"Hold the hand still: it becomes the cursor for {eye_names(self.eyes(snapshot))}.",
            (hand_check(snapshot), still_check(snapshot)),
            ButtonSpec(Action.MAKE_CURSOR, "Make cursor", is_steady(snapshot)),
            (ButtonSpec(Action.BACK, "&Back"),),
            runs_after_s=_STILL_S,
        )

    def _align(self, snapshot: Snapshot) -> WizardView:
        procedure, seen = snapshot.procedure, snapshot.observation
        hand = hand_check(snapshot)
        is_straight = seen is not None and seen.rotation_rad is not None and not seen.is_over_limit
        limit_deg = np.degrees(procedure.guard_limit_rad)
        cursor = procedure.cursor
        # A second press of the key that made the cursor must not confirm a hand that has not moved.
        is_due = cursor is not None and snapshot.t_host_ns - cursor.t_host_ns > _LEAST_ALIGN_NS
        close = ""
        if len(procedure.eyes) == 1:
            close = f"Close the {'right' if procedure.eyes[0] == 'left' else 'left'} eye. "
        return WizardView(
            Step.ALIGN,
            f"{close}Move the hand until it lies under the cursor, then confirm in the headset.",
            (hand, Precondition(f"Hand rotated by less than {limit_deg:.0f}°", is_straight)),
            ButtonSpec(Action.CONFIRM, "Confirm for the wearer", is_placed(snapshot) and is_due),
            (ButtonSpec(Action.REDO, "&Make another cursor", discards="Discards this cursor"),),
            procedure.refusal,
        )

    def _solve(self, snapshot: Snapshot) -> WizardView:
        procedure = snapshot.procedure
        count = len(snapshot.procedure.alignments)
        aligned = Precondition(f"{pluralize(count, 'alignment')} confirmed", True)
        redo = ButtonSpec(
            Action.REDO,
            "&Discard and repeat",
            discards="Deletes the last alignment; the session panel can restore it",
        )
        if procedure.state is State.ALIGNED or procedure.results is None:
            return WizardView(
                Step.SOLVE,
                "The wearer may lower the hand. Solve for the positions of the eyes.",
                (aligned,),
                ButtonSpec(Action.SOLVE, "Solve"),
                (redo,),
                runs_after_s=_SHOWN_S,
            )
        verdicts = verdict_checks(snapshot)
        if procedure.state is State.APPLYING:
            wait = "Waiting for the headset to acknowledge its projections."
            return WizardView(
                Step.SOLVE, wait, (aligned, *verdicts), ButtonSpec(Action.APPLY, "Sending…", False)
            )
        names = {eye: verdict.name for eye, verdict in procedure.results.verdicts.items()}
        others: tuple[ButtonSpec, ...] = (redo,)
        send = ButtonSpec(Action.APPLY, "Send to the headset")
        instruction = "Send the corrected projections to the headset."
        kept = tuple(eye for eye, name in names.items() if name == "keep")
        if UNUSABLE.intersection(names.values()):
            instruction = "Do not use this result. Follow the advice below, then repeat."
            send = ButtonSpec(Action.APPLY, "Send to the headset", False)
            others += (ButtonSpec(Action.APPLY, "Send &anyway", discards=_SENDS_UNUSABLE),)
        elif len(kept) == len(names):
            instruction = f"Keep the offline calibration of {eye_names(kept)}."
            send = ButtonSpec(Action.APPLY, "Keep offline")
        elif kept:
            instruction = (
                f"Send the projections to the headset, those of {eye_names(kept)} offline."
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
            wait = "Waiting for the headset to acknowledge its projections."
            sending = ButtonSpec(Action.APPLY, "Sending…", False)
            return WizardView(Step.VERIFY, wait, checks, sending)
        if snapshot.procedure.verifying is not None:
            return nudge_view(snapshot, snapshot.procedure.verifying)
        if snapshot.procedure.results is None and snapshot.procedure.alignments:
            return WizardView(
                Step.VERIFY,
                "The alignments have changed. Solve again.",
                checks,
                ButtonSpec(Action.SOLVE, "Solve"),
                (ButtonSpec(Action.ANOTHER, "&Add alignment"),),
            )
        if not self._is_complete(snapshot):
            eyes = eye_names(self.eyes(snapshot))
            return WizardView(
                Step.VERIFY,
                f"Now repeat this with {eyes}.",
                checks,
                ButtonSpec(Action.ANOTHER, f"Align {eyes}"),
                (ButtonSpec(Action.NEXT, "Finish with &one eye"),),
                runs_after_s=_READ_S,
            )
        each = (
            ButtonSpec(Action.REPEAT_LEFT, "Add l&eft eye"),
            ButtonSpec(Action.REPEAT_RIGHT, "Add &right eye"),
        )
        is_usable = not any(check.verdict in UNUSABLE for check in checks)
        if is_usable and (unverified := self.unverified(snapshot)):
            eye = unverified[0]
            return WizardView(
                Step.VERIFY,
                f"Raise the hand and hold it still, to measure the error of the {eye} eye.",
                (hand_check(snapshot), still_check(snapshot), *checks),
                ButtonSpec(Action.VERIFY, f"Verify the {eye} eye", is_steady(snapshot)),
                (ButtonSpec(Action.SKIP, "&Skip"), *each),
                runs_after_s=_STILL_S,
            )
        if advice := _advice(snapshot):
            eyes = eye_names(advice.eyes or EYES)
            few = advice.is_accepted and advice.alignments <= _MOST_BY_ITSELF
            return WizardView(
                Step.VERIFY,
                f"Not accepted yet: align {eyes} again, or keep the result as it is.",
                checks,
                ButtonSpec(Action.ANOTHER, f"Add {eyes}"),
                (ButtonSpec(Action.NEXT, "Keep as it &is"), *each),
                runs_after_s=_ADVICE_S if few else None,
            )
        if not is_usable:
            return WizardView(
                Step.VERIFY,
                "Do not use this result. Follow the advice below, then add alignments.",
                checks,
                ButtonSpec(Action.ANOTHER, "Add alignment"),
                (ButtonSpec(Action.NEXT, "Keep as it &is"), *each),
            )
        if not self._skipped:
            return WizardView(
                Step.VERIFY,
                "The wearer has verified the result. Finish, or add an alignment.",
                checks,
                ButtonSpec(Action.NEXT, "Finish"),
                (ButtonSpec(Action.ANOTHER, "&Add alignment"), *each),
            )
        return WizardView(
            Step.VERIFY,
            "The wearer looks at the raised hand: the outline should lie on it. If it does not, "
            "add an alignment or fine-tune φ.",
            checks,
            ButtonSpec(Action.NEXT, "It fits"),
            (ButtonSpec(Action.ANOTHER, "&Add alignment"), *each),
        )

    def _save(self, snapshot: Snapshot) -> WizardView:
        checks = (
            Precondition(f"Saved in {snapshot.session_path}", not snapshot.problem),
            *verdict_checks(snapshot),
        )
        others = (ButtonSpec(Action.EXPORT, "E&xport…"), ButtonSpec(Action.BACK, "&Back"))
        is_accepted = len(checks) > 1 and all(check.holds for check in checks[1:])
        is_verified = is_accepted and len(snapshot.procedure.verifications) == len(checks) - 1
        unearned = frozenset() if is_verified else frozenset({Step.VERIFY})
        if snapshot.record.is_finished:
            return WizardView(
                Step.SAVE,
                "The session is complete. Take the headset off, or continue with the next wearer.",
                checks,
                ButtonSpec(Action.NEXT_WEARER, "Next wearer"),
                others,
                unearned=unearned,
            )
        return WizardView(
            Step.SAVE,
            "Everything is already saved. Finish the session when you are done.",
            checks,
            ButtonSpec(Action.FINISH, "Finish session"),
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
    other = "right" if eye == "left" else "left"
    across, along = ("right", "left")[moved.right_arcmin < 0], ("down", "up")[moved.down_arcmin < 0]
    total_arcmin = float(np.hypot(moved.right_arcmin, moved.down_arcmin))
    return WizardView(
        Step.VERIFY,
        f"Close the {other} eye. Arrow keys move the outline, + and − change its size, until it "
        "covers the hand.",
        (hand_check(snapshot), still_check(snapshot)),
        ButtonSpec(Action.VERIFIED, "It covers the hand", is_steady(snapshot)),
        (
            ButtonSpec(Action.UNDO_NUDGE, "&Undo", verifying.can_undo),
            ButtonSpec(Action.SKIP, "&Skip"),
        ),
        snapshot.procedure.refusal,
        fact=f"{eye.capitalize()} eye moved by {total_arcmin:.1f}′: "
        f"{abs(moved.right_arcmin):.1f}′ {across}, {abs(moved.down_arcmin):.1f}′ {along}, "
        f"size {100 * moved.size:+.1f} %",
    )


def eye_names(eyes: Sequence[Eye]) -> str:
    """Return eyes in words."""
    return "both eyes" if len(eyes) == 2 else f"the {eyes[0]} eye"
