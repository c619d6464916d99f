"""What the wizard says and offers at each moment; no Qt, so that every case can be tested."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from handcal.station.procedure import State
from handcal.station.snapshot import Snapshot
from handcal.types import EYES, Alignment, Eye, EyePlan
from handcal_gui.widgets.numbers import counted
from handcal_gui.widgets.sentence import sentence

PLANS: dict[EyePlan, str] = {
    "each": "One eye after the other",
    "both": "Both eyes at once",
    "left": "Left eye only",
    "right": "Right eye only",
}
_DISTANCE = "at forearm's length, 40 to 60 cm from the eyes"
_LEAST_ALIGN_NS = 1_500_000_000


class Step(StrEnum):
    """The steps, in order; the value is the title."""

    CONNECT = "Connect"
    SHOW_HAND = "Show hand"
    MAKE_CURSOR = "Make cursor"
    ALIGN = "Align"
    SOLVE = "Solve"
    VERIFY = "Verify"
    SAVE = "Save"


STEPS = tuple(Step)


class Action(StrEnum):
    """What the buttons ask for; the value is the engine's command, or the wizard's own move."""

    NEXT = "next"
    MAKE_CURSOR = "make cursor"
    CONFIRM = "confirm"
    SOLVE = "solve"
    APPLY = "apply"
    ANOTHER = "another alignment"
    REPEAT_LEFT = "repeat left eye"
    REPEAT_RIGHT = "repeat right eye"
    REDO = "redo"
    BACK = "back"
    FINISH = "finish"
    NEXT_WEARER = "next wearer"
    EXPORT = "export"


@dataclass(frozen=True, slots=True)
class Check:
    """One precondition, and whether it holds."""

    text: str
    holds: bool


@dataclass(frozen=True, slots=True)
class Offer:
    """One button."""

    action: Action
    label: str
    """Of a button other than the main one, with & before the letter that presses it with Alt."""
    is_enabled: bool = True
    discards: str = ""
    """What is lost, if anything is: then only a click or the letter presses the button."""


@dataclass(frozen=True, slots=True)
class View:
    """What the wizard shows."""

    step: Step
    sentence: str
    """What the wearer, or the technician, must do."""
    checks: tuple[Check, ...]
    main: Offer
    """What the space bar does."""
    others: tuple[Offer, ...] = ()
    note: str = ""
    """What just happened or goes on, such as a refusal; empty if nothing."""


def next_eyes(plan: EyePlan, alignments: Collection[Alignment]) -> tuple[Eye, ...]:
    """Return the eyes that the next alignment is for."""
    if plan == "both":
        return EYES
    if plan != "each":
        return (plan,)
    counts = {eye: sum(eye in alignment.eyes for alignment in alignments) for eye in EYES}
    return ("right",) if counts["right"] < counts["left"] else ("left",)


def is_complete(plan: EyePlan, alignments: Collection[Alignment]) -> bool:
    """Tell whether every eye of the plan has been aligned."""
    eyes = (plan,) if plan in EYES else EYES
    return all(any(eye in alignment.eyes for alignment in alignments) for eye in eyes)


class Wizard:
    """Knows where the technician is: the engine's state, and the moves that only the wizard has.

    Attributes
    ----------
    plan : EyePlan
    """

    def __init__(self, plan: EyePlan = "each") -> None:
        self.plan = plan
        self._repeat: Eye | None = None
        self._free = Step.CONNECT

    def step(self, snapshot: Snapshot) -> Step:
        """Return the present step."""
        match snapshot.procedure.state:
            case State.ALIGN:
                self._free = Step.VERIFY
                return Step.ALIGN
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
        """Make a move that the engine has no part in."""
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
                self._repeat = _REPEATS.get(action)
                self._free = Step.SHOW_HAND
            case _:
                raise ValueError(f"{action} is the engine's")

    def view(self, snapshot: Snapshot) -> View:
        """Return what to show."""
        return _VIEWS[self.step(snapshot)](self, snapshot)

    def eyes(self, snapshot: Snapshot) -> tuple[Eye, ...]:
        """Return the eyes that the next alignment is for."""
        if self._repeat is not None:
            return (self._repeat,)
        return next_eyes(self.plan, snapshot.procedure.alignments.values())

    def _connect(self, snapshot: Snapshot) -> View:
        camera, link = snapshot.camera, snapshot.link
        checks = (
            Check(
                "No picture from the camera" if camera.problem else f"Camera: {camera.name}",
                not camera.problem and camera.rate_hz > 0,
            ),
            Check(sentence(snapshot.link_problem) or "Headset connected", link.connected),
            Check(
                f"Headset tells its pose {link.pose_rate_hz:.0f} times a second"
                if link.pose_rate_hz
                else "No pose from the headset yet",
                link.pose_rate_hz > 0,
            ),
        )
        return View(
            Step.CONNECT,
            "Put the headset on the wearer and wait until camera and headset answer.",
            checks,
            Offer(Action.NEXT, "Next", all(check.holds for check in checks)),
        )

    def _show_hand(self, snapshot: Snapshot) -> View:
        back = Offer(Action.BACK, "&Back")
        if snapshot.procedure.state is State.SHOW_HAND and snapshot.procedure.alignments:
            back = Offer(Action.SOLVE, "Keep the alignments &so far")
        return View(
            Step.SHOW_HAND,
            f"Raise one bare hand {_DISTANCE}, palm toward you and fingers a little apart.",
            (_hand_check(snapshot),),
            Offer(Action.NEXT, "Next", _hand_check(snapshot).holds),
            (back,),
        )

    def _make_cursor(self, snapshot: Snapshot) -> View:
        seen = snapshot.observation
        is_steady = seen is not None and seen.is_steady
        return View(
            Step.MAKE_CURSOR,
            f"Hold the hand still: it becomes the cursor for {_names(self.eyes(snapshot))}.",
            (_hand_check(snapshot), Check("Hand held still", is_steady)),
            Offer(Action.MAKE_CURSOR, "Make cursor", is_steady),
            (Offer(Action.BACK, "&Back"),),
        )

    def _align(self, snapshot: Snapshot) -> View:
        procedure, seen = snapshot.procedure, snapshot.observation
        hand = _hand_check(snapshot)
        is_straight = seen is not None and seen.rotation_rad is not None and not seen.is_over_limit
        limit_deg = np.degrees(procedure.guard_limit_rad)
        cursor = procedure.cursor
        # A second press of what made the cursor must not confirm a hand that has not moved.
        is_due = cursor is not None and snapshot.t_host_ns - cursor.t_host_ns > _LEAST_ALIGN_NS
        close = ""
        if len(procedure.eyes) == 1:
            close = f"Close the {'right' if procedure.eyes[0] == 'left' else 'left'} eye. "
        return View(
            Step.ALIGN,
            f"{close}Move the hand until it lies under the cursor, then confirm in the headset.",
            (hand, Check(f"Hand turned by less than {limit_deg:.0f}°", is_straight)),
            Offer(Action.CONFIRM, "Confirm for the wearer", hand.holds and is_due),
            (Offer(Action.REDO, "&Make another cursor", discards="Discards this cursor"),),
            procedure.refusal,
        )

    def _solve(self, snapshot: Snapshot) -> View:
        procedure = snapshot.procedure
        count = len(snapshot.procedure.alignments)
        aligned = Check(f"{counted(count, 'alignment')} confirmed", True)
        redo = Offer(
            Action.REDO,
            "&Discard and repeat",
            discards="Deletes the last alignment; the session panel can restore it",
        )
        if procedure.state is State.ALIGNED or procedure.results is None:
            return View(
                Step.SOLVE,
                "The wearer may lower the hand. Solve where the eyes are.",
                (aligned,),
                Offer(Action.SOLVE, "Solve"),
                (redo,),
            )
        verdicts = _verdict_checks(snapshot)
        if procedure.state is State.APPLYING:
            wait = "Waiting for the headset to acknowledge its projections."
            return View(
                Step.SOLVE, wait, (aligned, *verdicts), Offer(Action.APPLY, "Sending…", False)
            )
        return View(
            Step.SOLVE,
            "Send the corrected projections to the headset.",
            (aligned, *verdicts),
            Offer(Action.APPLY, "Send to the headset"),
            (redo,),
            snapshot.problem,
        )

    def _verify(self, snapshot: Snapshot) -> View:
        checks = _verdict_checks(snapshot)
        if snapshot.procedure.results is None and snapshot.procedure.alignments:
            return View(
                Step.VERIFY,
                "The alignments have changed. Solve again.",
                checks,
                Offer(Action.SOLVE, "Solve"),
                (Offer(Action.ANOTHER, "&Add alignment"),),
            )
        if not is_complete(self.plan, snapshot.procedure.alignments.values()):
            eyes = _names(self.eyes(snapshot))
            return View(
                Step.VERIFY,
                f"Now the same with {eyes}.",
                checks,
                Offer(Action.ANOTHER, f"Align {eyes}"),
                (Offer(Action.NEXT, "Leave it at &one eye"),),
            )
        return View(
            Step.VERIFY,
            "The wearer looks at the raised hand: the outline should lie on it. Add an alignment, "
            "or fine-tune φ, if it does not.",
            checks,
            Offer(Action.NEXT, "It fits"),
            (
                Offer(Action.ANOTHER, "&Add alignment"),
                Offer(Action.REPEAT_LEFT, "Add l&eft eye"),
                Offer(Action.REPEAT_RIGHT, "Add &right eye"),
            ),
        )

    def _save(self, snapshot: Snapshot) -> View:
        where = snapshot.session_path
        others = (Offer(Action.EXPORT, "E&xport…"), Offer(Action.BACK, "&Back"))
        if snapshot.record.is_finished:
            return View(
                Step.SAVE,
                "The session is complete. Take the headset off, or go on with the next wearer.",
                (Check(f"Saved in {where}", True),),
                Offer(Action.NEXT_WEARER, "Next wearer"),
                others,
            )
        return View(
            Step.SAVE,
            "Everything is saved already; finish the session when nothing more is to be done.",
            (Check(f"Saved in {where}", not snapshot.problem),),
            Offer(Action.FINISH, "Finish session"),
            others,
            snapshot.problem,
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


_REPEATS: dict[Action, Eye] = {Action.REPEAT_LEFT: "left", Action.REPEAT_RIGHT: "right"}


def _hand_check(snapshot: Snapshot) -> Check:
    seen = snapshot.observation
    if seen is not None and seen.hand is not None:
        return Check("Hand found", True)
    problem = seen.problem if seen is not None else ""
    return Check(sentence(problem or "no hand in view"), False)


def _verdict_checks(snapshot: Snapshot) -> tuple[Check, ...]:
    results = snapshot.procedure.results
    if results is None:
        return ()
    return tuple(
        Check(f"{eye.capitalize()} eye: {verdict.name}, {verdict.reason}", verdict.name == "accept")
        for eye, verdict in results.verdicts.items()
    )


def _names(eyes: Sequence[Eye]) -> str:
    return "both eyes" if len(eyes) == 2 else f"the {eyes[0]} eye"
