"""The simulated person who wears the headset.

Sees only what a real user would see: the displays, and their own hand through their own eyes. The
engine receives only the hand in front of the camera and the button.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from handcal.core.display import view_of_eye
from handcal.core.geometry import interpolate_pose, invert, rigid
from handcal.core.types import EYES, LOOK_AROUND, Eye, Float64, Rig
from handcal.link.nudges import NudgeSum, VerifyRequest
from handcal.sim.hand import HandModel
from handcal.sim.placement import PlacementError, apply_placement_error, match_cursor
from handcal.sim.silhouette import overlay_outline, view_outline
from handcal.sim.verifying import SeenDifference, SimulatedVerification, see_difference
from handcal.sim.wearer_settings import WearerSettings

_Phase: TypeAlias = Literal["raised", "reaching", "awaiting", "verifying"]

_CURSOR_POINTS = 150
_LOWERED_M = 0.35
_AT_ONCE_S = 1e-3
_FAR_M = 0.05
_ARCMIN = np.radians(1.0 / 60.0)
_EYE_SIGMA_M = 0.0005  # each eye's own deviation along each axis
_NOVICE_RAD = 0.23  # rotation of a novice's first overlay
# Error with which an outline is seen to cover the hand: right and down (arcmin) and relative in
# size; one for each verification.
_SEEING_SIGMAS = np.array([2.0, 2.0, 0.005])
_LOOK_AROUND_RAD, _LOOK_AROUND_S = 0.06, 2.0  # amplitude and period of the head's movement
_KEEP = "Keep your hand"
"""In prompts that ask the wearer not to lower the hand."""


@dataclass(frozen=True, slots=True, eq=False)
class DisplayView:
    """The content of the headset's displays at one instant."""

    t_s: float
    cursor_W_m: Float64 | None
    """(N, 3); the points drawn as cursor, W."""
    cursor_id: int
    P: Mapping[Eye, Float64]
    """each (3, 4); pixels from points in V, as rendered now."""
    T_V_H: Mapping[Eye, Float64]
    """each (4, 4)."""
    eyes: tuple[Eye, ...]
    """The eyes to keep open."""
    guard_red: bool
    """True if the live hand is drawn red."""
    prompt: str
    verify: VerifyRequest | None = None
    """The eye to verify; None if there is none."""
    outline_W_m: Float64 | None = None
    """(N, 3); the live hand's outline as drawn for that eye, W; None if it is not drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class WearerAction:
    """The wearer's action at one instant."""

    T_W_H: Float64
    T_W_hand: Float64
    """(4, 4); poses of the headset and of the hand."""
    confirm: bool
    """True at the instants when the button is pressed."""
    nudge: NudgeSum | None = None
    """In a verification, all presses of its keys so far, at the instants of one more."""
    fits: bool = False
    """True at the instants when the wearer says that the outline covers the hand."""


@dataclass(frozen=True, slots=True, eq=False)
class _Move:
    """A minimum-jerk movement of the hand toward a goal (Flash & Hogan 1985).

    It may dip on the way, as with a relaxing arm.
    """

    T_from: Float64
    start_s: float
    duration_s: float
    dip_m: float = 0.0

    def pose(self, t_s: float, T_goal: Float64) -> Float64:
        tau = float(np.clip((t_s - self.start_s) / self.duration_s, 0.0, 1.0))
        done = min(tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2), 1.0)
        T = interpolate_pose(self.T_from, T_goal, done)
        T[1, 3] += self.dip_m * np.sin(np.pi * tau) ** 2
        return T

    @property
    def end_s(self) -> float:
        return self.start_s + self.duration_s


class _Sway:
    """Smooth, aimless motion: two sines about and along each axis."""

    def __init__(
        self,
        rng: np.random.Generator,
        size_m: float,
        size_rad: float,
        band_hz: tuple[float, float],
    ) -> None:
        self._sizes = np.repeat([size_rad, size_m], 3)[:, None] * rng.uniform(0.3, 0.7, (6, 2))
        self._rate_rad_s = 2.0 * np.pi * rng.uniform(*band_hz, (6, 2))
        self._phase_rad = rng.uniform(0.0, 2.0 * np.pi, (6, 2))

    def pose(self, t_s: float) -> Float64:
        sway = (self._sizes * np.sin(self._rate_rad_s * t_s + self._phase_rad)).sum(1)
        return rigid(sway[:3], sway[3:])


def draw_placement_error(
    rng: np.random.Generator, settings: WearerSettings, turned_rad: float = 0.0
) -> PlacementError:
    """Draw the error of one placement, of a hand rotated by about `turned_rad`."""
    axis = rng.normal(size=3)
    angle_rad = turned_rad + settings.rotation_sigma_rad * rng.normal()
    return PlacementError(
        angle_rad * axis / np.linalg.norm(axis),
        settings.lateral_sigma_arcmin * _ARCMIN * rng.normal(size=2),
        settings.depth_sigma * rng.normal(),
    )


def draw_eyes(rng: np.random.Generator, settings: WearerSettings) -> dict[Eye, Float64]:
    """Draw both eyes' true shifts φ from C0, E axes, in metres."""
    common_m = rng.normal(0.0, settings.headset_sigma_m)
    apart_m = rng.normal(0.0, settings.eye_distance_sigma_m)
    shifts: dict[Eye, Float64] = {}
    for eye, side in zip(EYES, (-0.5, 0.5), strict=True):
        own_m = rng.normal(0.0, _EYE_SIGMA_M, 3)
        shift_m = common_m + own_m + [side * apart_m, 0.0, 0.0]
        shorten = settings.largest_shift_m / max(
            settings.largest_shift_m, float(np.linalg.norm(shift_m))
        )
        shifts[eye] = shorten * shift_m + settings.slip_m
    return shifts


class Wearer:
    """A person who follows the procedure, step by step in time.

    Parameters
    ----------
    seed : int
    rig : Rig
        Rig of the worn headset.
    hand : HandModel
        The wearer's hand.
    settings : WearerSettings, optional

    Attributes
    ----------
    true_shift_m : mapping of eye to (3,) float64
        φ of the true eyes from C0, E axes. Only for judging results; hidden from the engine.
    """

    def __init__(
        self, seed: int, rig: Rig, hand: HandModel, settings: WearerSettings | None = None
    ) -> None:
        self._settings = settings = settings or WearerSettings()
        self._rng = rng = np.random.default_rng(seed)
        self._rig = rig
        self._hand = hand
        self.true_shift_m: Mapping[Eye, Float64] = draw_eyes(rng, settings)
        self._is_naive = rng.random() < 0.5 if settings.novice is None else settings.novice
        self._head_sway = _Sway(rng, settings.head_sway_m, settings.head_sway_rad, (0.05, 0.25))
        self._hand_sway = _Sway(rng, settings.hand_sway_m, settings.hand_sway_rad, (0.2, 0.5))
        self._tremor = _Sway(rng, settings.tremor_m, 0.0, (8.0, 12.0))
        self._looks = 0.0
        self._stepped_s = 0.0
        self._T_W_H0 = rigid(rng.normal(0.0, 0.05, 3), rng.normal(0.0, 0.05, 3))
        self._phase: _Phase = "raised"
        self._T_W_raised = self._choose_place()
        self._T_W_hand = rigid(translation_m=[0.0, _LOWERED_M, 0.0]) @ self._T_W_raised
        self._move: _Move | None = None
        self._task: tuple[int, tuple[Eye, ...]] | None = None
        self._T_W_cursor: Float64 | None = None
        self._overlaid: Float64 | None = None
        self._error = self._draw_error(0.0)
        self._confirmed_s = 0.0
        self._P_confirmed: Mapping[Eye, Float64] = {}
        self._verification: SimulatedVerification | None = None

    def step(self, view: DisplayView) -> WearerAction:
        """Advance to `view.t_s`, reacting to the displays.

        Parameters
        ----------
        view : DisplayView
            Its times must not decrease between steps.
        """
        t_s = view.t_s
        T_W_H = self._T_W_H0 @ self._head_sway.pose(t_s) @ self._look_around(view)
        if self._move is None:
            self._move = _Move(self._T_W_hand, t_s, 2.0 * self._settings.movement_s)
        self._notice(view, self._move)
        overlay = self._overlay(view, T_W_H) if self._phase in ("reaching", "awaiting") else None
        confirm = overlay is not None and self._decide(view, self._move)
        goal = self._T_W_raised if overlay is None else overlay
        self._T_W_hand = self._move.pose(t_s, goal)
        T_W_hand = self._T_W_hand @ self._hand_sway.pose(t_s) @ self._tremor.pose(t_s)
        if self._verification is None or t_s < self._move.end_s:
            return WearerAction(T_W_H, T_W_hand, confirm)
        nudge, fits = self._look(self._verification, view, T_W_H, T_W_hand)
        return WearerAction(T_W_H, T_W_hand, confirm, nudge, fits)

    def _look_around(self, view: DisplayView) -> Float64:
        """Turn the head from side to side while asked to; begin and end slowly."""
        most = (view.t_s - self._stepped_s) / (0.25 * _LOOK_AROUND_S)
        self._stepped_s = view.t_s
        self._looks += float(np.clip((view.prompt == LOOK_AROUND) - self._looks, -most, most))
        phase = 2.0 * np.pi * view.t_s / _LOOK_AROUND_S
        return rigid([0.0, self._looks * _LOOK_AROUND_RAD * np.sin(phase), 0.0])

    def _notice(self, view: DisplayView, move: _Move) -> None:
        """Start aligning with a new cursor, and relax after the alignment."""
        task = None if view.cursor_W_m is None else (view.cursor_id, view.eyes)
        if view.verify is not None:
            self._verify(view, view.verify)
        elif self._phase == "verifying":
            # The hand stays up: another eye may follow, or another cursor.
            self._phase, self._verification = "raised", None
        elif self._phase == "raised":
            wait_s = self._settings.patience_s if task == self._task else 0.0
            if task is not None and view.t_s >= move.end_s + wait_s:
                self._take_up(view, task)
        elif task is None or (self._phase == "awaiting" and self._was_answered(view)):
            if view.prompt.startswith(_KEEP):
                self._stay(view.t_s)
            else:
                self._relax(view.t_s)
        elif task != self._task:
            self._take_up(view, task)

    def _verify(self, view: DisplayView, request: VerifyRequest) -> None:
        """Hold the hand where it is, and look at the outline."""
        if self._verification is None or self._verification.request != request:
            right, down, size = (self._rng.normal(size=3) * _SEEING_SIGMAS).tolist()
            self._verification = SimulatedVerification(request, SeenDifference(right, down, size))
        if self._phase in ("reaching", "awaiting"):
            self._stay(view.t_s)
        self._phase = "verifying"

    def _look(
        self,
        verification: SimulatedVerification,
        view: DisplayView,
        T_W_H: Float64,
        T_W_hand: Float64,
    ) -> tuple[NudgeSum | None, bool]:
        """Return the presses made so far if one is made now, and whether the drawing fits."""
        eye, outline_W_m = verification.request.eye, view.outline_W_m
        if outline_W_m is None:
            return None, False
        drawn = view.P[eye] @ view.T_V_H[eye]

        def see() -> SeenDifference | None:
            display, shift_m = self._rig.eyes[eye], self.true_shift_m[eye]
            return see_difference(display, shift_m, drawn, T_W_H, self._hand, T_W_hand, outline_W_m)

        return verification.step(view.t_s, drawn, see)

    def _stay(self, t_s: float) -> None:
        """Keep the hand where it is."""
        self._phase = "raised"
        self._T_W_raised = self._T_W_hand
        self._move = _Move(self._T_W_hand, t_s, _AT_ONCE_S)

    def _take_up(self, view: DisplayView, task: tuple[int, tuple[Eye, ...]]) -> None:
        assert view.cursor_W_m is not None
        if self._T_W_cursor is None or self._task is None or self._task[0] != task[0]:
            every = -(-len(view.cursor_W_m) // _CURSOR_POINTS)
            cursor_m = np.asarray(view.cursor_W_m[::every], dtype=np.float64)
            # How the drawn hand is turned, people see at a glance.
            recognised = self._recognised(cursor_m)
            self._T_W_cursor = self._overlaid = match_cursor(self._hand, cursor_m, recognised)
        self._task = task
        turned_rad = _NOVICE_RAD if self._is_naive else 0.0
        self._reach(view.t_s, self._draw_error(turned_rad))

    def _recognised(self, cursor_m: Float64) -> Float64:
        """Return roughly the pose of the hand that a cursor shows: of this hand, possibly moved."""
        moved_m = cursor_m.mean(axis=0) - self._T_W_hand[:3, 3]
        is_far = float(np.linalg.norm(moved_m)) > _FAR_M
        return rigid(translation_m=moved_m) @ self._T_W_hand if is_far else self._T_W_hand

    def _reach(self, t_s: float, error: PlacementError) -> None:
        self._phase = "reaching"
        self._error = error
        start_s = t_s + self._settings.reaction_s
        self._move = _Move(self._T_W_hand, start_s, self._settings.movement_s)

    def _relax(self, t_s: float) -> None:
        """Lower the hand and raise it again at another place."""
        self._phase = "raised"
        self._T_W_raised = self._choose_place()
        duration_s = 2.0 * self._settings.movement_s
        self._move = _Move(self._T_W_hand, t_s, duration_s, dip_m=_LOWERED_M)

    def _was_answered(self, view: DisplayView) -> bool:
        return any(not np.array_equal(P, view.P[eye]) for eye, P in self._P_confirmed.items())

    def _decide(self, view: DisplayView, move: _Move) -> bool:
        """Return whether to press the button; correct the hand instead if it is red."""
        settings, t_s = self._settings, view.t_s
        if self._phase == "reaching":
            if t_s < move.end_s + settings.dwell_s:
                return False
            if view.guard_red and not self._is_naive:
                self._reach(t_s, self._draw_error(0.0))
                return False
            return self._press(view)
        if view.guard_red and t_s > self._confirmed_s + settings.reaction_s:
            self._is_naive = False
            self._reach(t_s, self._draw_error(0.0))
            return False
        return t_s > self._confirmed_s + settings.patience_s and self._press(view)

    def _press(self, view: DisplayView) -> bool:
        self._phase = "awaiting"
        self._confirmed_s = view.t_s
        self._P_confirmed = dict(view.P)
        return True

    def _overlay(self, view: DisplayView, T_W_H: Float64) -> Float64 | None:
        """Return the pose that seems to overlap the cursor; None if too little is drawn."""
        assert view.cursor_W_m is not None
        assert self._T_W_cursor is not None
        assert self._overlaid is not None
        views = [
            view_outline(
                self._rig.eyes[eye],
                self.true_shift_m[eye],
                T_W_H,
                view.P[eye] @ view.T_V_H[eye],
                view.cursor_W_m.astype(np.float64),
            )
            for eye in view.eyes
        ]
        turned = self._T_W_cursor @ rigid(self._error.rotation_rad)
        start = rigid(turned[:3, :3], self._overlaid[:3, 3])
        placed = overlay_outline(self._hand, start, views)
        if placed is None:
            return None
        self._overlaid = placed[0]
        eye_m = np.mean([view.eye_W_m for view in views], axis=0)
        return apply_placement_error(placed[0], eye_m, self._error)

    def _draw_error(self, turned_rad: float) -> PlacementError:
        return draw_placement_error(self._rng, self._settings, turned_rad)

    def _choose_place(self) -> Float64:
        """Return a pose for the raised hand, upright, the palm facing the eyes."""
        settings, rng = self._settings, self._rng
        viewpoints_m = [invert(view_of_eye(d, np.eye(4)))[:3, 3] for d in self._rig.eyes.values()]
        palm_m = np.mean(viewpoints_m, axis=0) + settings.raise_m
        palm_m += rng.uniform(-1.0, 1.0, 3) * settings.raise_spread_m
        return self._T_W_H0 @ rigid(rng.normal(0.0, settings.raise_turn_rad, 3), palm_m)
