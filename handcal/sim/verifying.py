"""The simulated wearer's verification: looks at the outline, presses keys, looks again.

A person sees how two outlines differ across them, not along them. So the drawn outline is compared
with the hand's silhouette in the display, along the silhouette's normals, for the movement and
growth that would make them coincide.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial import KDTree

from handcal.core.display import arcmin_from_px, eye_projection, view_of_eye
from handcal.core.geometry import invert, project, transform
from handcal.core.types import EyeDisplay, Float64
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.sim.hand import HandModel

_POINTS = 300
_FEWEST_POINTS = 20
_STEP_M = 1e-3
# Points whose normal faces the eye are on no silhouette: those at a cut.
_ACROSS = 0.5
# Half a step either way is as good; a little more does not make the wearer press again.
_CONTENT_STEPS = 0.75
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
) -> SeenDifference | None:
    """Return how the drawn outline differs from the hand for the true eye.

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
        The outline as sent by the PC.

    Returns
    -------
    SeenDifference or None
        None if almost nothing of the outline is on the display.
    """
    points = transform(invert(T_W_hand), outline_W_m[:: max(1, len(outline_W_m) // _POINTS)])
    _, nearest = _tree(hand).query(points)
    normals = hand.normals[nearest].astype(np.float64)
    away_m = np.einsum("ij,ij->i", points - hand.vertices_m[nearest], normals)
    silhouette = points - away_m[:, None] * normals
    seen = eye_projection(display, true_shift_m) @ view_of_eye(display, T_W_H)
    seen_px = project(seen, transform(T_W_hand, silhouette))
    beside_px = project(seen, transform(T_W_hand, silhouette + _STEP_M * normals))
    drawn_px = project(drawn @ invert(T_W_H), transform(T_W_hand, points))
    across = beside_px - seen_px
    length = np.linalg.norm(across, axis=1)
    is_used = (drawn_px >= 0.0).all(axis=1) & (
        drawn_px <= [display.width_px - 1, display.height_px - 1]
    ).all(axis=1)
    is_used &= length > _ACROSS * np.median(length)
    if is_used.sum() < _FEWEST_POINTS:
        return None
    n = across[is_used] / length[is_used, None]
    from_centre = seen_px[is_used] - seen_px[is_used].mean(axis=0)
    J = np.column_stack([n, np.einsum("ij,ij->i", n, from_centre)])
    gap_px = np.einsum("ij,ij->i", n, seen_px[is_used] - drawn_px[is_used])
    right_px, down_px, size = np.linalg.lstsq(J, gap_px, rcond=None)[0]
    right, down = (
        float(np.copysign(arcmin_from_px(display, abs(px)), px)) for px in (right_px, down_px)
    )
    return SeenDifference(right, down, float(size))


@lru_cache(maxsize=2)
def _tree(hand: HandModel) -> KDTree:
    return KDTree(hand.vertices_m)


class SimulatedVerification:
    """One verification by the wearer, in time.

    Parameters
    ----------
    request : VerifyRequest
    error : SeenDifference
        Error with which this wearer sees the difference, the same at every look.
    look_s, press_s : float
        Times of a look, and of one press of a key.
    """

    def __init__(
        self, request: VerifyRequest, error: SeenDifference, look_s: float, press_s: float
    ) -> None:
        self.request = request
        self._error = error
        self._look_s = look_s
        self._press_s = press_s
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
            self._next_s = t_s + (self._press_s if self._presses else _EFFECT_S)
            return self._moved, False
        if not np.array_equal(drawn, self._drawn):
            self._drawn = drawn
            self._next_s = t_s + self._look_s
            self._samples.clear()
        if t_s >= self._sample_s:
            self._sample_s = t_s + _SAMPLE_S
            seen = see()
            self._samples += [] if seen is None else [seen]
        if t_s < self._next_s or len(self._samples) < _FEWEST_SAMPLES:
            return None, False
        self._decide()
        self._next_s = t_s + self._look_s
        self._samples.clear()
        return (None, False) if self._presses else (self._moved, True)

    def _decide(self) -> None:
        """Decide which keys to press after a look; none if the drawing fits well enough."""
        self._looks += 1
        if self._looks > _MOST_LOOKS:
            return
        right_arcmin, down_arcmin, size = np.mean(
            [[one.right_arcmin, one.down_arcmin, one.size] for one in self._samples], axis=0
        )
        step, size_step = self.request.step_arcmin, self.request.step_size
        counts = (
            (right_arcmin + self._error.right_arcmin) / step,
            (down_arcmin + self._error.down_arcmin) / step,
            (size + self._error.size) / size_step,
        )
        for axis, count in enumerate(counts):
            if abs(count) > _CONTENT_STEPS:
                press = np.zeros(3)
                press[axis] = np.sign(count) * (size_step if axis == 2 else step)
                self._presses += [(press[0], press[1], press[2])] * round(abs(count))
