"""The verification of one eye while it is in progress.

With the hand at rest and the other eye closed, the wearer moves what the eye draws until the hand's
outline covers the hand. The wearer's nudges come from the headset as sums, the technician's from
the PC as steps; both add up.
"""

from __future__ import annotations

import secrets
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handcal.calibration.hands import PlacedHand, RecentHands
from handcal.core.display import view_of_eye
from handcal.core.errors import HandError
from handcal.core.geometry import invert, transform
from handcal.core.types import EYES, Eye, EyeDisplay, Float64, Rig, Verification
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.link.server import Nudge
from handcal.register.model import nudged_shift_m
from handcal.session.journal import Event
from handcal.session.state import VERIFYING, SessionEvent

SKIPPED = "verification_skipped"
CHANGED = "The drawing has changed. Look and confirm again."
"""Shown if a confirmation is of another drawing than the present one."""
_OFFSET_ARCMIN = 8.0, 12.0
_OFFSET_SIZE = 0.015, 0.025
_ENDS = (
    SKIPPED,
    "cursor_made",
    SessionEvent.SOLVED,
    SessionEvent.APPLIED,
    SessionEvent.FINE_TUNED,
    SessionEvent.FINISHED,
)
"""Events that end a verification."""


@dataclass(frozen=True, slots=True)
class VerifyingView:
    """A verification in progress."""

    eye: Eye
    moved: NudgeSum
    """All movement of the drawing so far: the error found so far."""
    before_m: tuple[float, float, float]
    shift_m: tuple[float, float, float]
    """φ before the verification, and with the movement so far."""
    can_undo: bool
    began_host_ns: int = 0
    """Time of its first frame; 0 if it was resumed."""
    is_set_aside: bool = False
    """True if the program has moved the drawing aside, for the wearer to bring it back."""


@dataclass(slots=True, eq=False)
class Verifying:
    """One eye's drawing, moved by the wearer."""

    request: VerifyRequest
    """As sent to the headset."""
    display: EyeDisplay
    """Of this eye."""
    before_m: Float64
    """(3,); φ that the eye is drawn with at the start."""
    hand_E_m: Float64
    """(3,); centre of the hand in the eye's E."""
    began_host_ns: int = 0
    """Time of its first frame; 0 if it was resumed."""
    moved: NudgeSum = field(default_factory=NudgeSum)
    """All movement by the wearer and the technician so far."""
    offset: NudgeSum = field(default_factory=NudgeSum)
    """Movement by the program, for the wearer to bring the drawing back."""
    shift_m: Float64 = field(init=False)
    """(3,); φ with both."""
    fits: Nudge | None = None
    """The wearer's confirmation that the drawing covers the hand, until it is judged."""
    refusal: str = ""
    """Reason why the last confirmation was refused; empty if none was."""
    _heard: NudgeSum = field(default_factory=NudgeSum)
    _session: int = 0
    _earlier: list[NudgeSum] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.shift_m = self.before_m

    @property
    def eye(self) -> Eye:
        """The eye that is verified."""
        return self.request.eye

    def view(self) -> VerifyingView:
        """Return the verification as it is now."""
        return VerifyingView(
            self.eye,
            self.moved,
            _triple(self.before_m),
            _triple(self.shift_m),
            can_undo=bool(self._earlier),
            began_host_ns=self.began_host_ns,
            is_set_aside=self.offset != NudgeSum(),
        )

    def nudge(self, right_arcmin: float, down_arcmin: float, size: float) -> None:
        """Move the drawing; ValueError if it is moved too far."""
        before = self.moved
        self._draw(before.plus(right_arcmin, down_arcmin, size))
        self._earlier.append(before)

    def hear(self, nudge: Nudge) -> tuple[float, float, float] | None:
        """Take the wearer's sums; return what they add to the last ones, None if nothing.

        A confirmation counts only for the drawing that the wearer has seen.
        """
        heard = nudge.moved
        before = self._heard if nudge.session == self._session else NudgeSum()
        self._heard, self._session = heard, nudge.session
        step = (
            heard.right_arcmin - before.right_arcmin,
            heard.down_arcmin - before.down_arcmin,
            heard.size - before.size,
        )
        if any(step):
            return step
        if nudge.fits:
            self.fits = nudge
        return None

    def judge(self, fits: Nudge, hands: RecentHands) -> PlacedHand | str:
        """Return the hand that the drawing fits, or what the wearer must do before it counts."""
        if not fits.is_timed:
            return "The headset's clock was set. Look and confirm again."
        if fits.problem:
            return CHANGED
        try:
            hand = hands.nearest(fits.t_host_ns)
        except HandError as error:
            return f"{error}. Hold it up and confirm again."
        if hands.steady() is None:
            return "Hold your hand still, and confirm again."
        return hand

    @property
    def is_moved(self) -> bool:
        """True if somebody has moved the drawing: only then is it evidence that it fits."""
        return self.moved != NudgeSum()

    @property
    def needs_proof(self) -> bool:
        """True if the drawing must be set aside before a confirmation counts."""
        return not self.is_moved and self.offset == NudgeSum()

    def set_aside(self, offset: NudgeSum) -> None:
        """Move the drawing aside; ValueError if it is moved too far."""
        self.offset = offset
        self._draw(self.moved)

    def undo(self) -> None:
        """Undo the last nudge; ValueError if there is none."""
        if not self._earlier:
            raise ValueError("there is no nudge to undo")
        self._draw(self._earlier.pop())

    def result(self, hand_E_m: Float64, outline_sigma_px: float) -> Verification:
        """Return the verification, with the hand and its outline when the drawing fitted."""
        return Verification(
            before_m=_triple(self.before_m),
            nudge_arcmin=(self.moved.right_arcmin, self.moved.down_arcmin),
            nudge_size=self.moved.size,
            after_m=_triple(self.shift_m),
            hand_E_m=_triple(hand_E_m),
            offset_arcmin=(self.offset.right_arcmin, self.offset.down_arcmin),
            offset_size=self.offset.size,
            outline_sigma_px=outline_sigma_px,
        )

    def event(self) -> dict[str, Any]:
        """Return what the journal keeps, so that the verification can be resumed."""
        return {
            "eye": self.eye,
            "before_m": list(_triple(self.before_m)),
            "hand_E_m": list(_triple(self.hand_E_m)),
            "nudge_arcmin": [self.moved.right_arcmin, self.moved.down_arcmin],
            "nudge_size": self.moved.size,
            "offset_arcmin": [self.offset.right_arcmin, self.offset.down_arcmin],
            "offset_size": self.offset.size,
        }

    def _draw(self, moved: NudgeSum) -> None:
        total = moved.plus(self.offset.right_arcmin, self.offset.down_arcmin, self.offset.size)
        self.shift_m = nudged_shift_m(
            self.display,
            self.before_m,
            self.hand_E_m,
            total.right_arcmin,
            total.down_arcmin,
            total.size,
        )
        self.moved = moved
        self.fits = None


def hand_centre_E_m(rig: Rig, eye: Eye, hand: PlacedHand) -> Float64:
    """Return the centre (3,) of a hand in an eye's E."""
    T_E_W = view_of_eye(rig.eyes[eye], hand.T_W_D @ invert(rig.T_H_D))
    return np.asarray(transform(T_E_W, hand.points_W_m).mean(axis=0))


def draw_offset(rng: np.random.Generator) -> NudgeSum:
    """Draw the movement of a drawing that fits, so that the wearer shows it by bringing it back.

    It is several times what a wearer overlooks, in any direction, with a growth either way.
    """
    distance_arcmin, angle_rad = rng.uniform(*_OFFSET_ARCMIN), rng.uniform(0.0, 2.0 * np.pi)
    return NudgeSum(
        float(distance_arcmin * np.cos(angle_rad)),
        float(distance_arcmin * np.sin(angle_rad)),
        float(rng.choice([-1.0, 1.0]) * rng.uniform(*_OFFSET_SIZE)),
    )


def new_id() -> int:
    """Return the id of another verification, which no earlier run of this program has used."""
    return secrets.randbits(31) | 1


def resumed(events: Iterable[Event], displays: Mapping[Eye, EyeDisplay]) -> Verifying | None:
    """Return the verification that a session was in when it ended, or None."""
    last: Event | None = None
    for event in events:
        is_result = event.name == SessionEvent.FACTS_SAVED and "verified" in event.data
        if event.name == VERIFYING:
            last = event
        elif event.name in _ENDS or event.name.startswith("alignment_") or is_result:
            last = None
    if last is None:
        return None
    try:
        eye: Eye = "left" if last.data["eye"] == "left" else "right"
        before_m, hand_E_m = (
            np.array(last.data[name], dtype=np.float64).reshape(3)
            for name in ("before_m", "hand_E_m")
        )
        verifying = Verifying(VerifyRequest(new_id(), eye), displays[eye], before_m, hand_E_m)
        aside = *last.data.get("offset_arcmin", (0.0, 0.0)), last.data.get("offset_size", 0.0)
        verifying.set_aside(NudgeSum(*aside))
        right_arcmin, down_arcmin = last.data["nudge_arcmin"]
        verifying.nudge(right_arcmin, down_arcmin, last.data["nudge_size"])
    except (KeyError, TypeError, ValueError):
        return None  # the eye is verified from the start
    return verifying


def skipped_eyes(events: Iterable[Event]) -> set[Eye]:
    """Return the eyes whose verification was skipped in a session."""
    named = [event.data.get("eye") for event in events if event.name == SKIPPED]
    return {eye for eye in EYES if eye in named}


def verify_prompt(eye: Eye) -> str:
    """Return what the wearer is asked to do."""
    other = "right" if eye == "left" else "left"
    return (
        f"Keep your hand up and still, and close your {other} eye. Move the outline with the "
        "arrow keys until it covers your hand, then confirm."
    )


SET_ASIDE_PROMPT = (
    "The outline was moved aside, to see that it is brought back. Move it until it covers your "
    "hand, then confirm."
)
"""Shown to a wearer who has moved nothing."""
UNMOVED_PROMPT = "The outline was not moved back, so this eye is not verified."


def _triple(values_m: Float64) -> tuple[float, float, float]:
    x_m, y_m, z_m = (float(value_m) for value_m in values_m)
    return x_m, y_m, z_m
