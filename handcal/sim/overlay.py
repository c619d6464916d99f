"""Single alignments by a simulated person who looks through the displays."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handcal.core.display import projection_matrix, view_of_eye
from handcal.core.errors import HandcalError
from handcal.core.geometry import invert, rigid, transform
from handcal.core.types import EYES, Alignment, Bool, Eye, Float64, Rig
from handcal.sim.hand import HandModel
from handcal.sim.placement import PlacementError, apply_placement_error
from handcal.sim.raster import visible_points
from handcal.sim.silhouette import overlay_outline, silhouette, view_outline

_FOREARM_M = 0.04
_FEWEST_POINTS = 20
# Position of the raised palm and its spread, so that it is on both displays.
_PALM_H_M = np.array([0.0, 0.088, 0.51])
_PALM_SPREAD_M = np.array([0.015, 0.006, 0.025])
_PALM_TURN_RAD = 0.1
_NO_ERROR = PlacementError(np.zeros(3), np.zeros(2), 0.0)


def overlay_by_eye(
    rng: np.random.Generator,
    hand: HandModel,
    rig: Rig,
    true_shift_m: Mapping[Eye, Float64],
    points: int,
    depth_sigma_m: float = 0.0,
    *,
    placement_error: PlacementError = _NO_ERROR,
    drawn_shift_m: Mapping[Eye, Float64] | None = None,
    worn_rig: Rig | None = None,
) -> Alignment:
    """Return an alignment by a person who overlays the hand on its cursor.

    Parameters
    ----------
    rng : numpy.random.Generator
    hand : HandModel
    rig : Rig
    true_shift_m : mapping of eye to (3,) float64
        φ of the open eyes.
    points : int
        Number of points of each cloud; the two are sampled independently.
    depth_sigma_m : float
        Standard deviation of each point's depth noise.
    placement_error : PlacementError
        Error of the overlay.
    drawn_shift_m : mapping of eye to (3,) float64, optional
        φ with which the cursor is drawn; default: the offline calibration.
    worn_rig : Rig, optional
        The true rig, if it differs from the `rig` known to the engine.

    Returns
    -------
    Alignment
        With W = H, as the head does not move.

    Raises
    ------
    HandcalError
        If the cursor is on no display.
    """
    worn = worn_rig or rig

    def see(T_H_hand: Float64) -> tuple[Float64, Bool]:
        points_D_m, is_cut = visible_points(
            hand,
            invert(worn.T_H_D) @ T_H_hand,
            points,
            rng,
            intrinsics=worn.depth_intrinsics,
            forearm_m=_FOREARM_M,
            depth_sigma_m=depth_sigma_m,
        )
        return transform(rig.T_H_D, points_D_m), is_cut

    drawn_m = {eye: np.zeros(3) for eye in EYES} | dict(drawn_shift_m or {})
    palm_m = _PALM_H_M + rng.uniform(-1.0, 1.0, 3) * _PALM_SPREAD_M
    T_H_raised = rigid(rng.normal(0.0, _PALM_TURN_RAD, 3), palm_m)
    cursor_m, cursor_is_cut = see(T_H_raised)
    viewpoints_m = [invert(view_of_eye(rig.eyes[eye], np.eye(4)))[:3, 3] for eye in true_shift_m]
    # Drawn without a camera's faults: what an eye at the viewpoints sees of the raised hand.
    seen_from_m = transform(invert(T_H_raised), np.mean(viewpoints_m, axis=0)[None])[0]
    rim = silhouette(hand, seen_from_m)
    on_hand = (rim.points_m - hand.wrist_m) @ hand.arm_axis <= _FOREARM_M
    views = [
        view_outline(
            worn.eyes[eye],
            shift_m,
            np.eye(4),
            projection_matrix(rig.eyes[eye], drawn_m[eye]) @ worn.eyes[eye].T_V_H,
            transform(T_H_raised, rim.points_m[on_hand]),
            rim.normals[on_hand] @ T_H_raised[:3, :3].T,
        )
        for eye, shift_m in true_shift_m.items()
    ]
    turned = T_H_raised @ rigid(placement_error.rotation_rad)
    placed = overlay_outline(hand, turned, views)
    if placed is None or len(cursor_m) < _FEWEST_POINTS:
        raise HandcalError(
            "with this rig, a hand raised half a metre from the headset is not on the displays, "
            "or the depth camera does not see it",
            "check the rig file",
        )
    eyes_m = [
        transform(invert(view_of_eye(worn.eyes[eye], np.eye(4))), shift_m[None])[0]
        for eye, shift_m in true_shift_m.items()
    ]
    hand_m, hand_is_cut = see(
        apply_placement_error(placed[0], np.mean(eyes_m, axis=0), placement_error)
    )
    R_D_raised = rig.T_H_D[:3, :3].T @ T_H_raised[:3, :3]
    return Alignment(
        cursor_m=cursor_m,
        hand_m=hand_m,
        cursor_is_cut=cursor_is_cut,
        hand_is_cut=hand_is_cut,
        T_E_W={eye: view_of_eye(rig.eyes[eye], np.eye(4)) for eye in EYES},
        eyes=tuple(true_shift_m),
        rotation_rad=R_D_raised @ placement_error.rotation_rad,
        t_a_ns=0,
        t_b_ns=1,
        drawn_shift_m=drawn_m,
    )
