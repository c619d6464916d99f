"""Messages of a verification: the eye that is verified, and the wearer's nudges.

The wearer moves what one eye draws until the hand's outline covers the hand. A nudge holds all
movement since the verification and the link's session began, so that the newest message is enough.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from handcal.core.types import Eye
from handcal.link import handcal_pb2 as pb
from handcal.link.drawn import DIGEST_BYTES
from handcal.link.fields import MalformedError, read_eyes

MAX_NUDGE_ARCMIN = 300.0
MAX_NUDGE_SIZE = 0.3
"""Largest movement of a drawing along each axis, and largest growth; a hand spans some 900′."""


@dataclass(frozen=True, slots=True)
class VerifyRequest:
    """The eye whose drawing the wearer should move."""

    verify_id: int
    """Different for each verification; not 0."""
    eye: Eye
    step_arcmin: float = 1.0
    step_size: float = 0.002
    """Added to a nudge by one press of a key."""


@dataclass(frozen=True, slots=True)
class NudgeSum:
    """The movement of a drawing by the wearer since a verification began."""

    right_arcmin: float = 0.0
    down_arcmin: float = 0.0
    size: float = 0.0
    """Growth of the drawing: 0.01 is one per cent larger."""

    def __post_init__(self) -> None:
        largest = max(abs(self.right_arcmin), abs(self.down_arcmin))
        # NaN fails every comparison.
        if not (largest <= MAX_NUDGE_ARCMIN and abs(self.size) <= MAX_NUDGE_SIZE):
            raise ValueError(
                f"a drawing is moved by at most {MAX_NUDGE_ARCMIN:g}′ along each axis, and grows "
                f"by at most {100 * MAX_NUDGE_SIZE:g} %"
            )

    def plus(self, right_arcmin: float, down_arcmin: float, size: float) -> NudgeSum:
        """Return the sum with another movement; ValueError if it becomes too large."""
        return NudgeSum(
            self.right_arcmin + right_arcmin, self.down_arcmin + down_arcmin, self.size + size
        )


def verify(request: VerifyRequest | None) -> pb.Envelope:
    """Make the request to verify an eye; None ends the verification."""
    if request is None:
        return pb.Envelope(verify=pb.Verify())
    return pb.Envelope(
        verify=pb.Verify(
            verify_id=request.verify_id,
            eye=pb.EYE_LEFT if request.eye == "left" else pb.EYE_RIGHT,
            step_arcmin=request.step_arcmin,
            step_size=request.step_size,
        )
    )


def read_verify(message: pb.Verify) -> VerifyRequest | None:
    """Read a request to verify an eye; None if there is nothing to verify."""
    if not message.verify_id:
        return None
    steps = message.step_arcmin, message.step_size
    if not all(math.isfinite(step) and step > 0.0 for step in steps):
        raise MalformedError("steps of a verification that are not positive")
    return VerifyRequest(message.verify_id, read_eyes([message.eye])[0], *steps)


def nudge(
    request: VerifyRequest, moved: NudgeSum, fits: bool, t_headset_ns: int, drawn: bytes
) -> pb.Envelope:
    """Make the wearer's nudge, with the digest of what is drawn at that time."""
    return pb.Envelope(
        nudge=pb.Nudge(
            verify_id=request.verify_id,
            right_arcmin=moved.right_arcmin,
            down_arcmin=moved.down_arcmin,
            size=moved.size,
            fits=fits,
            t_headset_ns=t_headset_ns,
            drawn=drawn,
        )
    )


def read_nudge(message: pb.Nudge) -> NudgeSum:
    """Read the movement of a nudge whose digest has the right size."""
    if len(message.drawn) != DIGEST_BYTES:
        raise MalformedError("a nudge without a digest")
    try:
        return NudgeSum(message.right_arcmin, message.down_arcmin, message.size)
    except ValueError as error:
        raise MalformedError(str(error)) from error
