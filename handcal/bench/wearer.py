"""Alignments as a person makes them who looks through the displays and errs nowhere."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handcal.bench.figure import Figure
from handcal.bench.settings import BenchSettings
from handcal.bench.trials import Errors, Measured, Progress, collect_errors, trial_hand
from handcal.display import projection_matrix, view_of_eye
from handcal.geometry import invert, rigid, transform
from handcal.register.solve import solve_alignment
from handcal.rig.example import example_rig
from handcal.sim.hand import HandModel
from handcal.sim.placement import overlay_hand, view_through
from handcal.sim.raster import visible_points
from handcal.types import EYES, Alignment, Bool, Eye, Float64, Method, Rig

_ASIDE_M, _ALONG_M = 0.005, 0.010
_BIAS_MM = 0.3
_FOREARM_M = 0.04
# Where the palm is raised and how far that may differ, for all of it to be on both displays.
_PALM_H_M = np.array([0.0, 0.088, 0.51])
_PALM_SPREAD_M = np.array([0.015, 0.006, 0.025])
_PALM_TURN_RAD = 0.1


def measure_wearer(settings: BenchSettings, progress: Progress) -> Measured:
    """Measure the bias in φ3 of an eye 10 mm nearer to the display, and 10 mm farther."""
    rig = example_rig()

    def solve(along_m: float, trial: int) -> Errors:
        rng = np.random.default_rng(trial)
        true_m = np.array([*rng.uniform(-_ASIDE_M, _ASIDE_M, 2), along_m])
        eye = EYES[trial % 2]
        alignment = overlay_by_eye(rng, trial_hand(trial), rig, {eye: true_m}, settings.points)
        methods: list[Method] = ["consistent"]
        if trial < settings.slow_trials:
            methods.append("paper")
        return {m: solve_alignment(alignment, rig, m)[eye].shift_m - true_m for m in methods}

    by_place = collect_errors(solve, (-_ALONG_M, _ALONG_M), settings.trials, progress)
    rows = [
        {"true_phi_3_mm": 1e3 * along_m, "method": method, "trials": len(errors_m)}
        | {"mean_error_mm": (1e3 * errors_m.mean(axis=0)).tolist()}
        for along_m, errors in by_place.items()
        for method, errors_m in errors.items()
    ]
    bias_mm = max(
        abs(1e3 * float(errors["consistent"][:, 2].mean())) for errors in by_place.values()
    )
    missed = np.mean(
        [-errors["paper"][:, 2].mean() / along_m for along_m, errors in by_place.items()]
    )
    return Measured(
        [
            Figure("bias at φ3 = ±10 mm", bias_mm, "mm", at_most=_BIAS_MM),
            Figure("share of φ3 that paper misses", 100 * float(missed), "%"),
        ],
        rows,
    )


def overlay_by_eye(
    rng: np.random.Generator,
    hand: HandModel,
    rig: Rig,
    true_shift_m: Mapping[Eye, Float64],
    points: int,
    depth_sigma_m: float = 0.0,
) -> Alignment:
    """Let a person overlay the own hand on its cursor, drawn with the offline calibration.

    Parameters
    ----------
    rng : numpy.random.Generator
    hand : HandModel
    rig : Rig
    true_shift_m : mapping of eye to (3,) float64
        φ of the open eyes.
    points : int
        Of each cloud, as the depth camera sees it; both are sampled apart.
    depth_sigma_m : float
        Standard deviation of each point's depth noise.

    Returns
    -------
    Alignment
        In H for W: the head keeps still.
    """

    def see(T_H_hand: Float64) -> tuple[Float64, Bool]:
        points_D_m, is_cut = visible_points(
            hand,
            invert(rig.T_H_D) @ T_H_hand,
            points,
            rng,
            intrinsics=rig.depth_intrinsics,
            forearm_m=_FOREARM_M,
            depth_sigma_m=depth_sigma_m,
        )
        return transform(rig.T_H_D, points_D_m), is_cut

    palm_m = _PALM_H_M + rng.uniform(-1.0, 1.0, 3) * _PALM_SPREAD_M
    T_H_raised = rigid(rng.normal(0.0, _PALM_TURN_RAD, 3), palm_m)
    cursor_m, cursor_is_cut = see(T_H_raised)
    views = [
        view_through(
            rig.eyes[eye],
            shift_m,
            np.eye(4),
            projection_matrix(rig.eyes[eye]) @ rig.eyes[eye].T_V_H,
            cursor_m,
        )
        for eye, shift_m in true_shift_m.items()
    ]
    placed = overlay_hand(transform(invert(T_H_raised), cursor_m), T_H_raised, views)
    assert placed is not None, "the cursor is on the displays"
    hand_m, hand_is_cut = see(placed[0])
    return Alignment(
        cursor_m=cursor_m,
        hand_m=hand_m,
        cursor_is_cut=cursor_is_cut,
        hand_is_cut=hand_is_cut,
        T_E_W={eye: view_of_eye(rig.eyes[eye], np.eye(4)) for eye in EYES},
        eyes=tuple(true_shift_m),
        rotation_rad=np.zeros(3),
        t_a_ns=0,
        t_b_ns=1,
    )
