"""A simulated wearer who makes the alignments of each calibration method: hands, points, a cube.

Alignments and their errors are simulated by rays through the displays, without any method's
equations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handcal.core.display import TARGET_SIDE_M, eye_projection, projection_matrix, view_of_eye
from handcal.core.geometry import invert, project, rigid, transform
from handcal.core.types import EYES, Alignment, Eye, Float64, Rig
from handcal.lab.study.trials import study_hand
from handcal.register.guard import GuardSettings
from handcal.rig.example import example_rig
from handcal.sim.hand import HandModel
from handcal.sim.overlay import overlay_by_eye
from handcal.sim.placement import apply_placement_error, overlay_hand, view_through
from handcal.sim.wearer import draw_eyes, draw_placement_error
from handcal.sim.wearer_settings import WearerSettings

_REACH_M = 0.35, 0.70
_CUBE_REACH_M = 0.48, 0.62
_CUBE_ASIDE_M = 0.02
_CUBE_TURN_RAD = 0.5
_EDGE_POINTS = 5
_SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_CORNERS_M = 0.5 * TARGET_SIDE_M * _SIGNS
# A face and the corner behind it: not all on one plane.
_MPAAM_CORNERS = (0, 2, 4, 6, 7)


@dataclass(frozen=True, slots=True, eq=False)
class StudyWearer:
    """A person who wears the example rig."""

    rig: Rig
    hand: HandModel
    true_shift_m: Mapping[Eye, Float64]
    """each (3,); φ of the eyes, in E's axes."""

    def T_E_H(self, eye: Eye) -> Float64:
        """Return the transform from the headset to an eye's E."""
        return view_of_eye(self.rig.eyes[eye], np.eye(4))

    def projection(self, eye: Eye, shift_m: Float64) -> Float64:
        """Return the rig's projection (3, 4) for an eye shift φ: pixels from points in H."""
        return eye_projection(self.rig.eyes[eye], shift_m) @ self.T_E_H(eye)

    def true_projection(self, eye: Eye) -> Float64:
        """Return the projection (3, 4) that the wearer needs."""
        return self.projection(eye, self.true_shift_m[eye])

    def eye_m(self, eye: Eye) -> Float64:
        """Return the position of an eye in H."""
        T_H_E = invert(self.T_E_H(eye))
        eye_m: Float64 = transform(T_H_E, self.true_shift_m[eye][None])[0]
        return eye_m


def draw_wearer(rng: np.random.Generator, hand_seed: int, placement: WearerSettings) -> StudyWearer:
    """Draw a wearer: the position of the headset, and the eyes behind it."""
    return StudyWearer(example_rig(), study_hand(hand_seed), draw_eyes(rng, placement))


def align_hand(
    wearer: StudyWearer,
    rng: np.random.Generator,
    eyes: Sequence[Eye],
    drawn_shift_m: Mapping[Eye, Float64],
    placement: WearerSettings,
    points: int,
    depth_sigma_m: float,
) -> Alignment:
    """Let the wearer overlay the hand on its cursor, rotated by no more than the guard allows.

    Parameters
    ----------
    wearer : StudyWearer
    rng : numpy.random.Generator
    eyes : sequence of eye
    drawn_shift_m : mapping of eye to (3,) float64
        φ that the cursor is drawn with.
    placement : WearerSettings
        Placement errors.
    points : int
        Number of points of each cloud.
    depth_sigma_m : float
        Standard deviation of each point's depth.
    """
    error = draw_placement_error(rng, placement)
    while np.linalg.norm(error.rotation_rad) > GuardSettings().limit_rad:
        error = draw_placement_error(rng, placement)
    return overlay_by_eye(
        rng,
        wearer.hand,
        wearer.rig,
        {eye: wearer.true_shift_m[eye] for eye in eyes},
        points,
        depth_sigma_m,
        placement_error=error,
        drawn_shift_m=drawn_shift_m,
    )


def align_points(
    wearer: StudyWearer,
    rng: np.random.Generator,
    count: int,
    eyes: Sequence[Eye],
    pointing_sigma_arcmin: float,
    tracking_sigma_m: float,
) -> tuple[Float64, dict[Eye, Float64]]:
    """Let the wearer align a tracked point with crosshairs all over the display, within reach.

    With both eyes open the crosshairs are fused: the errors of the eyes are independent, and their
    disparity is an error in depth. Each alignment has its own depth, from 0.35 to 0.70 m.

    Parameters
    ----------
    wearer : StudyWearer
    rng : numpy.random.Generator
    count : int
    eyes : sequence of eye
        The open eyes.
    pointing_sigma_arcmin : float
        Standard deviation about each of two axes.
    tracking_sigma_m : float
        Standard deviation of the tracked point, each axis.

    Returns
    -------
    points_m : (count, 3) float64
        As tracked, in H.
    pixels : mapping of eye to (count, 2) float64
    """
    depths_m = rng.permutation(np.linspace(*_REACH_M, count))
    points_m = np.array([_point_on_displays(wearer, rng, eyes, depth_m) for depth_m in depths_m])
    pixels = {}
    for eye in eyes:
        focal_px = wearer.rig.eyes[eye].K[0, 0]
        sigma_px = focal_px * np.radians(pointing_sigma_arcmin / 60.0)
        pixels[eye] = project(wearer.true_projection(eye), points_m) + rng.normal(
            0.0, sigma_px, (count, 2)
        )
    return points_m + rng.normal(0.0, tracking_sigma_m, points_m.shape), pixels


def align_cube(
    wearer: StudyWearer,
    rng: np.random.Generator,
    placement: WearerSettings,
    tracking_sigma_m: float,
) -> tuple[Float64, Float64]:
    """Let the wearer overlay a tracked cube on a virtual one, drawn uncalibrated in both eyes.

    Parameters
    ----------
    wearer : StudyWearer
    rng : numpy.random.Generator
    placement : WearerSettings
        Placement errors, as for a hand.
    tracking_sigma_m : float
        Standard deviation of each corner, each axis.

    Returns
    -------
    tracked_m, shown_m : (5, 3) float64
        Corners of the real cube, and of the virtual one in the virtual scene; in H.
    """
    error = draw_placement_error(rng, placement)
    middle_m = np.mean([invert(wearer.T_E_H(eye))[:3, 3] for eye in EYES], axis=0)
    aside_m = rng.uniform(-_CUBE_ASIDE_M, _CUBE_ASIDE_M, 2)
    T_H_shown = rigid(
        rng.normal(0.0, _CUBE_TURN_RAD, 3),
        middle_m + np.array([*aside_m, rng.uniform(*_CUBE_REACH_M)]),
    )
    edges_m = _edge_points_m()
    views = [
        view_through(
            wearer.rig.eyes[eye],
            wearer.true_shift_m[eye],
            np.eye(4),
            projection_matrix(wearer.rig.eyes[eye]) @ wearer.rig.eyes[eye].T_V_H,
            transform(T_H_shown, edges_m),
        )
        for eye in EYES
    ]
    placed = overlay_hand(edges_m, T_H_shown @ rigid(error.rotation_rad), views)
    assert placed is not None, "the cube is on the displays"
    T_H_cube = apply_placement_error(
        placed[0], np.mean([wearer.eye_m(eye) for eye in EYES], axis=0), error
    )
    corners_m = _CORNERS_M[list(_MPAAM_CORNERS)]
    tracked_m = transform(T_H_cube, corners_m)
    return tracked_m + rng.normal(0.0, tracking_sigma_m, (5, 3)), transform(T_H_shown, corners_m)


def _point_on_displays(
    wearer: StudyWearer, rng: np.random.Generator, eyes: Sequence[Eye], depth_m: float
) -> Float64:
    """Draw a point of H at a depth from the first eye that all open eyes see on their displays."""
    display = wearer.rig.eyes[eyes[0]]
    size_px = np.array([display.width_px, display.height_px]) - 1.0
    P = eye_projection(display, wearer.true_shift_m[eyes[0]])
    T_H_E = invert(wearer.T_E_H(eyes[0]))
    while True:
        ray = np.linalg.solve(P[:, :3], [*(rng.uniform(0.05, 0.95, 2) * size_px), 1.0])
        point_E_m = wearer.true_shift_m[eyes[0]] + depth_m * ray / ray[2]
        point_m = transform(T_H_E, point_E_m[None])
        seen_px = np.array([project(wearer.true_projection(eye), point_m)[0] for eye in eyes])
        if ((seen_px >= 0.0) & (seen_px <= size_px)).all():
            return np.asarray(point_m[0])


def _edge_points_m() -> Float64:
    """Return points along the cube's edges, (N, 3), in its frame."""
    ends = [
        (a, b) for i, a in enumerate(_CORNERS_M) for b in _CORNERS_M[i + 1 :] if (a != b).sum() == 1
    ]
    along = np.linspace(0.0, 1.0, _EDGE_POINTS)[:, None]
    return np.concatenate([a + along * (b - a) for a, b in ends])
