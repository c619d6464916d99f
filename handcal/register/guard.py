"""The guard: rotation and change of shape from the cursor to the live hand, at camera rate.

Beside it, the pairs of cursor and hand points for a live display.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation
from small_gicp import KdTree

from handcal.core.geometry import rigid, rotation_vector, transform
from handcal.core.types import Bool, Float64
from handcal.register.rigid import RigidResult, RigidSettings, register_rigid
from handcal.register.shape import ShapeChange, measure_shape_change
from handcal.register.solve import check_cloud
from handcal.register.surface import Surface, describe_surface, mean_point, nearest

Axis: TypeAlias = Literal["x", "y", "z"]
AXES: tuple[Axis, Axis, Axis] = ("x", "y", "z")

# Mean error with 1 mm of noise 0.13°, and 0.24° with 300 points.
_LIVE = RigidSettings(max_points=700, tolerance_m=3e-4)
_ONCE = RigidSettings(max_points=800, tolerance_m=3e-4)
# More points than for the rotation: with 500 the noise of the shape is a millimetre.
_SHAPE = RigidSettings(max_points=1000, tolerance_m=3e-4)
_LIVE_SHAPE = RigidSettings(max_points=700, tolerance_m=3e-4)
# A registration that starts near its end may stop sooner: its mean error is 0.12°.
_FOLLOWED_TOLERANCE_M = 1e-3
# A hand that fits this much worse than after the last full registration may have been lost.
_LOST = 2.0

# Advice for turning the hand back about each of D's axes, in the positive and negative sense. The
# wearer looks the same way as the camera: x right, y down, z away.
_ADVICE: dict[Axis, tuple[str, str]] = {
    "x": ("Tip your fingers toward you", "Tip your fingers away from you"),
    "y": (
        "Turn the right edge of your hand toward you",
        "Turn the right edge of your hand away from you",
    ),
    "z": ("Tilt your hand clockwise", "Tilt your hand anticlockwise"),
}


@dataclass(frozen=True, slots=True)
class GuardSettings:
    """Limits beyond which an alignment is refused."""

    advice_rad: float = float(np.radians(3.0))
    """Rotation from which the headset advises the wearer to turn the hand back."""
    limit_rad: float = float(np.radians(9.0))
    """Largest rotation; 9° in the paper, where its error reaches 4 mm."""
    shape_limit_m: float = 0.0025
    """Largest change of the hand's shape, rms over its surface. The joints of real hands moved by
    twice as much, and φ was wrong by 4 mm on average."""


class RotationGuard:
    """Measures rotations and changes of shape against one cursor.

    Parameters
    ----------
    cursor_m : (N, 3) float64
    cursor_cut : (N,) bool or None
    settings : RigidSettings
        The default is fast enough for every frame.
    """

    def __init__(
        self,
        cursor_m: Float64,
        cursor_cut: Bool | None = None,
        settings: RigidSettings = _LIVE,
    ) -> None:
        self._settings = settings
        self._cursor = describe_surface(cursor_m, cursor_cut, settings.max_points)
        self._given = cursor_m, cursor_cut
        self._shape_cursors = {settings.max_points: self._cursor}
        self._newest: tuple[Float64, Surface] | None = None
        self._found: tuple[RigidResult, Float64] | None = None
        self._lost_m2 = 0.0

    def rotation(self, hand_m: Float64, hand_cut: Bool | None = None) -> Float64:
        """Return the rotation vector from the cursor to the hand, (3,), rad.

        Both clouds must be in the same frame; the vector is about its axes.

        Raises
        ------
        HandError
            If nearly all points lie beside cut edges.
        """
        return _rotation(self._register(self._describe(hand_m, hand_cut)))

    def follow(self, hand_m: Float64, hand_cut: Bool | None = None) -> Float64:
        """Return the rotation of a hand tracked between frames, in less time than `rotation`.

        The registration starts from the last hand's, moved with its mean; if that does not fit, it
        starts from scratch. Raises as `rotation`.
        """
        hand = self._describe(hand_m, hand_cut)
        self._newest = hand_m, hand
        middle_m = mean_point(hand.points_m)
        fit = None
        if self._found is not None:
            last, last_middle_m = self._found
            moved = rigid(translation_m=middle_m - last_middle_m)
            settings = replace(self._settings, tolerance_m=_FOLLOWED_TOLERANCE_M)
            T_start = moved @ last.T_target_source
            fit = register_rigid(self._cursor, hand, settings, T_start)
        if fit is None or fit.history_m2[-1] > self._lost_m2:
            fit = self._register(hand)
            self._lost_m2 = _LOST * fit.history_m2[-1]
        self._found = fit, middle_m
        return _rotation(fit)

    def shape_change(
        self, hand_m: Float64, hand_cut: Bool | None = None, *, is_live: bool = False
    ) -> ShapeChange:
        """Return the change of shape from the cursor to the hand, along the axes of their frame.

        It takes four times as long as `rotation`, and three times for a live hand, with half as
        much again of noise. It starts from the last hand that `follow` found. Raises as `rotation`.
        """
        settings = _LIVE_SHAPE if is_live else _SHAPE
        count = settings.max_points
        if count not in self._shape_cursors:
            self._shape_cursors[count] = describe_surface(*self._given, count)
        cursor = self._shape_cursors[count]
        if self._newest and self._newest[0] is hand_m and count == self._settings.max_points:
            hand = self._newest[1]
        else:
            hand = describe_surface(hand_m, hand_cut, count)
        T_start = None
        if self._found is not None:
            last, last_middle_m = self._found
            moved_m = mean_point(hand.points_m) - last_middle_m
            T_start = rigid(translation_m=moved_m) @ last.T_target_source
        fit = register_rigid(cursor, hand, settings, T_start)
        return measure_shape_change(cursor, hand, fit)

    def _describe(self, hand_m: Float64, hand_cut: Bool | None) -> Surface:
        return describe_surface(hand_m, hand_cut, self._settings.max_points)

    def _register(self, hand: Surface) -> RigidResult:
        return register_rigid(self._cursor, hand, self._settings)


def _rotation(fit: RigidResult) -> Float64:
    return rotation_vector(fit.T_target_source[:3, :3])


def rotation_between(cursor_m: ArrayLike, hand_m: ArrayLike) -> Float64:
    """Return the rotation vector from the cursor to the hand.

    Parameters
    ----------
    cursor_m, hand_m : (N, 3), (M, 3) array_like
        Unordered clouds in one frame.

    Returns
    -------
    (3,) float64
        In rad, about the frame's axes.

    Raises
    ------
    ValueError
        For NaN, a wrong shape, fewer than 100 points, or points on one line.

    Examples
    --------
    >>> import handcal
    >>> session = handcal.example_session()
    >>> alignment = session.alignments[1]
    >>> rotation_rad = handcal.rotation_between(alignment.cursor_m, alignment.hand_m)
    >>> print(f"{np.degrees(np.linalg.norm(rotation_rad)):.1f}°")
    1.5°
    """
    guard = RotationGuard(check_cloud("cursor_m", cursor_m), settings=_ONCE)
    return guard.rotation(check_cloud("hand_m", hand_m))


@dataclass(frozen=True, slots=True)
class TurnAdvice:
    """Advice for turning the hand back about the axis of its largest rotation."""

    axis: Axis
    """Axis of the depth camera: pitch, yaw, roll of the hand."""
    angle_rad: float
    """Rotation to apply, right-handed about that axis."""
    text: str
    """Instruction for the wearer, without the angle or a full stop."""


def turn_advice(rotation_rad: ArrayLike) -> TurnAdvice:
    """Return the advice that undoes a rotation from the cursor to the hand.

    Parameters
    ----------
    rotation_rad : (3,) array_like
        Rotation vector about D's axes, as `RotationGuard.rotation` gives it in D.
    """
    back_rad = -np.asarray(rotation_rad, dtype=np.float64)
    index = int(np.argmax(np.abs(back_rad)))
    axis, angle_rad = AXES[index], float(back_rad[index])
    return TurnAdvice(axis, angle_rad, _ADVICE[axis][0 if angle_rad > 0 else 1])


Pairs: TypeAlias = NDArray[np.intp]

_CURSOR_POINTS = 1000
_STEPS = 4
# As in the solver: a pair farther apart than this many medians is an outlier.
_OUTLIER_MEDIANS = 3.0


def matched_pairs(
    cursor_m: Float64,
    hand_m: Float64,
    rotation_rad: Float64,
    cursor_is_cut: Bool,
    count: int = 300,
) -> Pairs:
    """Pair points of the hand with their nearest cursor points after a registration.

    The rotation is known from the guard, so only the translation is estimated: a coarse
    registration for display. The solver has its own (`handcal.register.consistent`).

    Parameters
    ----------
    cursor_m, hand_m : (N, 3), (M, 3) float64
        In one frame.
    rotation_rad : (3,) float64
        From the cursor to the hand, about that frame's axes.
    cursor_is_cut : (N,) bool
        Points beside a cut edge; pairs that end there are left out, as are outliers.
    count : int
        Number of hand points to pair.

    Returns
    -------
    (K, 2) int
        Indices into cursor and hand.
    """
    cursor_index, hand_index = _thin(len(cursor_m), _CURSOR_POINTS), _thin(len(hand_m), count)
    if not (len(cursor_index) and len(hand_index)):
        return np.empty((0, 2), dtype=np.intp)
    cursor, hand = cursor_m[cursor_index], hand_m[hand_index]
    back = Rotation.from_rotvec(rotation_rad).inv().as_matrix()
    moved = transform(rigid(back), hand - hand.mean(axis=0)) + cursor.mean(axis=0)
    tree = KdTree(cursor)
    for _ in range(_STEPS):
        _, partner = nearest(tree, moved)
        moved += np.median(cursor[partner] - moved, axis=0)
    distance_m, partner = nearest(tree, moved)
    is_kept = ~cursor_is_cut[cursor_index[partner]]
    is_kept &= distance_m <= _OUTLIER_MEDIANS * np.median(distance_m)
    return np.column_stack([cursor_index[partner], hand_index])[is_kept]


def _thin(length: int, count: int) -> NDArray[np.intp]:
    """Return about `count` indices below `length`, evenly spread."""
    return np.arange(0, length, max(1, length // count))
