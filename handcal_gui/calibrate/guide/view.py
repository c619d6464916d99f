"""The values that the wizard shows: steps, actions, preconditions, buttons; without Qt."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from handcal.core.types import Eye, VerdictName
from handcal_gui.app.translation import tr

EYE_WORDS: dict[Eye, str] = {"left": tr("left"), "right": tr("right")}
"""The eyes within a sentence."""


class Step(StrEnum):
    """The steps, in order."""

    CONNECT = "Connect"
    SHOW_HAND = "Show hand"
    MAKE_CURSOR = "Make cursor"
    ALIGN = "Align"
    SOLVE = "Solve"
    VERIFY = "Verify"
    SAVE = "Save"

    @property
    def label(self) -> str:
        """The step in the user's language."""
        return _TITLES[self]


_TITLES = {
    Step.CONNECT: tr("Connect"),
    Step.SHOW_HAND: tr("Show hand"),
    Step.MAKE_CURSOR: tr("Make cursor"),
    Step.ALIGN: tr("Align"),
    Step.SOLVE: tr("Solve"),
    Step.VERIFY: tr("Verify"),
    Step.SAVE: tr("Save"),
}
STEPS = tuple(Step)


class Action(StrEnum):
    """Actions of the buttons; the value is the engine's command, or a move within the guide."""

    NEXT = "next"
    BACK = "back"
    TAKE_STEP = "take the next step"
    CONFIRM = "confirm"
    ANOTHER = "another alignment"
    REPEAT_LEFT = "repeat left eye"
    REPEAT_RIGHT = "repeat right eye"
    WITHDRAW = "withdraw the alignment"
    REDO = "redo"
    VERIFIED = "confirm the verification"
    UNDO_NUDGE = "undo the last nudge"
    SKIP = "skip the verification"
    VERIFY_LEFT = "verify the left eye"
    VERIFY_RIGHT = "verify the right eye"
    USE_ANYWAY = "use the result anyway"
    KEEP_OFFLINE = "keep the offline calibration"
    SLIPPED = "begin again after the headset slipped"
    FINISH = "finish"
    NEXT_WEARER = "next wearer"
    EXPORT = "export"


ACTION_NAMES: dict[str, str] = {
    Action.TAKE_STEP: tr("take the next step"),
    Action.CONFIRM: tr("confirm"),
    Action.ANOTHER: tr("add an alignment"),
    Action.REPEAT_LEFT: tr("align the left eye"),
    Action.REPEAT_RIGHT: tr("align the right eye"),
    Action.WITHDRAW: tr("go back"),
    Action.REDO: tr("redo"),
    Action.VERIFIED: tr("confirm the verification"),
    Action.UNDO_NUDGE: tr("undo the last nudge"),
    Action.SKIP: tr("skip the verification"),
    Action.VERIFY_LEFT: tr("verify the left eye"),
    Action.VERIFY_RIGHT: tr("verify the right eye"),
    Action.USE_ANYWAY: tr("use the result anyway"),
    Action.KEEP_OFFLINE: tr("keep the offline calibration"),
    Action.FINISH: tr("finish"),
}
"""The engine's commands in the user's language, within "Could not …"."""

MOST_OTHERS = 4
"""Largest number of buttons beside the main one."""
WEARERS = Action.CONFIRM, Action.VERIFIED
"""Actions that are left to the wearer, in the headset."""


@dataclass(frozen=True, slots=True)
class Precondition:
    """A precondition, and whether it holds."""

    text: str
    holds: bool
    verdict: VerdictName | None = None
    """The verdict that it shows, if it shows one."""


@dataclass(frozen=True, slots=True)
class ButtonSpec:
    """A button: its action and its label."""

    action: Action
    label: str
    """On buttons other than the main one, & precedes the letter that presses it with Alt."""
    is_enabled: bool = True
    discards: str = ""
    """The loss that the button causes, if any: then only a click or the letter presses it."""


@dataclass(frozen=True, slots=True)
class WizardView:
    """Everything that the wizard shows at one moment."""

    step: Step
    sentence: str
    """The instruction to the wearer or the technician."""
    preconditions: tuple[Precondition, ...]
    main: ButtonSpec
    """The button that the space bar presses."""
    others: tuple[ButtonSpec, ...] = ()
    note: str = ""
    """The last event or current activity, such as a refusal; empty if none."""
    fact: str = ""
    """The findings so far; empty if there are none."""
    unearned: frozenset[Step] = frozenset()
    """Earlier steps that were left without what they are for."""
    omitted: frozenset[Step] = frozenset()
    """Steps that this session has not needed so far."""
    is_aligned: bool = True
    """False while an eye of the plan has not been aligned."""
