"""The simulated wearer's verification: looks at the outline, presses keys, looks again.

A person sees how two outlines differ across them, not along them. So the drawn outline is compared
with the silhouette of the true hand in the display, along the silhouette's normals, for the
movement and growth that would make them coincide.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass, replace

import numpy as np

from handcal.core.display import arcmin_from_px
from handcal.core.types import Bool, EyeDisplay, Float64
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.sim.hand import HandModel
from handcal.sim.silhouette import find_gaps, view_outline

_LOOKS = 3
# Half a step either way is as good; a little more does not make the wearer press again.
_CONTENT_STEPS = 0.75
_LOOK_S, _PRESS_S = 0.6, 0.12  # times of a look, and of one press of a key
# The longest that a wearer waits for the effect of a key.
_EFFECT_S = 3.0
# The drawing trembles with the delay of camera and link; a person sees its middle.
_SAMPLE_S = 0.08
_FEWEST_SAMPLES = 4
# After these a person is content.
_MOST_LOOKS = 6


@dataclass(frozen=True, slots=True)
class SeenDifference:
    """Movement and growth of the drawing that would make it cover the hand."""

    right_arcmin: float
    down_arcmin: float
    size: float


def see_difference(
    display: EyeDisplay,
    true_shift_m: Float64,
    drawn: Float64,
    T_W_H: Float64,
    hand: HandModel,
    T_W_hand: Float64,
    outline_W_m: Float64,
    is_balanced: Callable[[Float64], Bool] | None = None,
) -> SeenDifference | None:
    """Return how the drawn outline differs from the hand's silhouette for the true eye.

    Parameters
    ----------
    display : EyeDisplay
    true_shift_m : (3,) float64
        φ of the true eye from C0.
    drawn : (3, 4) float64
        Projection used by the headset: pixels from points in H.
    T_W_H, T_W_hand : (4, 4) float64
        True poses of the headset and the hand.
    hand : HandModel
    outline_W_m : (N, 3) float64
        The outline as sent by the PC, in order.
    is_balanced : callable, optional
        As in `handcal.sim.silhouette.find_gaps`.

    Returns
    -------
    SeenDifference or None
        None if almost nothing of the outline is on the display.
    """
    view = view_outline(display, true_shift_m, T_W_H, drawn, outline_W_m)
    total = np.zeros(3)
    for _ in range(_LOOKS):
        gaps = find_gaps(hand, T_W_hand, view, is_balanced)
        if gaps is None:
            return None
        drawn_px = gaps.rim_px - gaps.gap_px[:, None] * gaps.across
        middle_px = drawn_px.mean(axis=0)
        grown = np.einsum("ij,ij->i", gaps.across, drawn_px - middle_px)
        step = np.linalg.lstsq(np.column_stack([gaps.across, grown]), gaps.gap_px, rcond=None)[0]
        total = total + step + [0.0, 0.0, total[2] * step[2]]
        # Move the drawing, and look again: parts that were far apart now find each other.
        moved_px = middle_px + step[:2] + (1.0 + step[2]) * (view.drawn_px - middle_px)
        view = replace(view, drawn_px=moved_px)
    right, down = (float(np.copysign(arcmin_from_px(display, abs(px)), px)) for px in total[:2])
    return SeenDifference(right, down, float(total[2]))


class SimulatedVerification:
    """One verification by the wearer, in time.

    Parameters
    ----------
    request : VerifyRequest
    error : SeenDifference
        Error with which this wearer sees the difference, the same at every look.
    """

    def __init__(self, request: VerifyRequest, error: SeenDifference) -> None:
        self.request = request
        self._error = error
        self._next_s = 0.0
        self._sample_s = 0.0
        self._looks = 0
        self._samples: list[SeenDifference] = []
        self._drawn = np.empty(0)
        self._presses: list[tuple[float, float, float]] = []
        self._moved = NudgeSum()

    def step(
        self, t_s: float, drawn: Float64, see: Callable[[], SeenDifference | None]
    ) -> tuple[NudgeSum | None, bool]:
        """Return all presses so far, if a key is pressed now, and whether the drawing fits.

        Parameters
        ----------
        t_s : float
        drawn : (3, 4) float64
            Projection used by the headset now: by it a person sees that the drawing has moved.
        see : callable
            Looks at the drawing.
        """
        if self._presses:
            if t_s < self._next_s:
                return None, False
            self._moved = self._moved.plus(*self._presses.pop())
            # After the last key, wait for the drawing.
            self._next_s = t_s + (_PRESS_S if self._presses else _EFFECT_S)
            return self._moved, False
        if not np.array_equal(drawn, self._drawn):
            self._drawn = drawn
            self._next_s = t_s + _LOOK_S
            self._samples.clear()
        if t_s >= self._sample_s:
            self._sample_s = t_s + _SAMPLE_S
            seen = see()
            self._samples += [] if seen is None else [seen]
        if t_s < self._next_s or len(self._samples) < _FEWEST_SAMPLES:
            return None, False
        self._decide()
        self._next_s = t_s + _LOOK_S
        self._samples.clear()
        return (None, False) if self._presses else (self._moved, True)

    def _decide(self) -> None:
        """Decide which keys to press after a look; none if the drawing fits well enough."""
        self._looks += 1
        if self._looks > _MOST_LOOKS:
            return
        mean = np.mean([astuple(sample) for sample in self._samples], axis=0)
        presses = presses_for(SeenDifference(*mean.tolist()), self._error, self.request)
        steps = self.request.step_arcmin, self.request.step_arcmin, self.request.step_size
        for axis, (whole, step) in enumerate(zip(presses, steps, strict=True)):
            press = np.zeros(3)
            press[axis] = np.sign(whole) * step
            self._presses += [(press[0], press[1], press[2])] * round(abs(whole) / step)


def presses_for(
    seen: SeenDifference, error: SeenDifference, request: VerifyRequest
) -> tuple[float, float, float]:
    """Return the movement by whole presses of keys after a look; zeros if the drawing fits."""
    steps = request.step_arcmin, request.step_arcmin, request.step_size
    wanted = (
        seen.right_arcmin + error.right_arcmin,
        seen.down_arcmin + error.down_arcmin,
        seen.size + error.size,
    )
    right, down, size = (
        step * round(move / step) if abs(move) > _CONTENT_STEPS * step else 0.0
        for move, step in zip(wanted, steps, strict=True)
    )
    return right, down, size
