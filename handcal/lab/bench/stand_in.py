"""Reprojection errors of wearers who calibrate with an imperfect rig."""

from __future__ import annotations

import numpy as np

from handcal.core.display import reprojection_arcmin
from handcal.core.progress import Progress
from handcal.core.types import EYES, Float64, Rig
from handcal.lab.bench.trials import run_trials, trial_hand
from handcal.register.guard import GuardSettings
from handcal.register.solve import solve_alignment
from handcal.report.statistics import MeanInterval, mean_interval
from handcal.sim.overlay import overlay_by_eye
from handcal.sim.wearer import draw_eyes, draw_placement_error
from handcal.sim.wearer_settings import WearerSettings

_POINTS = 3000
_DEPTH_SIGMA_M = 0.001


def reprojection_of_wearers(rig: Rig, worn_rig: Rig, wearers: int, progress: Progress) -> Float64:
    """Return each wearer's mean reprojection error, arcmin, after one alignment with both eyes.

    They differ in eyes, hands and placement errors; wearer n is the same for every rig.

    Parameters
    ----------
    rig : Rig
        Rig used for calibration and rendering.
    worn_rig : Rig
        The true rig.
    wearers : int
    progress : callable
    """
    placement = WearerSettings()

    def reprojection(number: int) -> float:
        rng = np.random.default_rng(number)
        true_m = draw_eyes(rng, placement)
        error = draw_placement_error(rng, placement)
        while np.linalg.norm(error.rotation_rad) > GuardSettings().limit_rad:
            error = draw_placement_error(rng, placement)
        hand = trial_hand(number)
        alignment = overlay_by_eye(
            rng,
            hand,
            rig,
            true_m,
            _POINTS,
            _DEPTH_SIGMA_M,
            placement_error=error,
            worn_rig=worn_rig,
        )
        solved = solve_alignment(alignment, rig)
        solved_m = {eye: solved[eye].shift_m for eye in EYES}
        return reprojection_arcmin(rig, solved_m, true_m, worn_rig)

    return np.array(run_trials(reprojection, range(wearers), progress))


def ratio_of_means(errors: Float64, baseline: Float64) -> MeanInterval:
    """Return the ratio of two means (N,) over the same wearers, with its 95 % interval.

    The ratio is linearised (Cochran 1977, Sampling Techniques, section 6.4).
    """
    ratio = float(errors.mean() / baseline.mean())
    about = mean_interval((errors - ratio * baseline) / baseline.mean())
    return MeanInterval(ratio, ratio + about.low, ratio + about.high, about.level, about.clusters)
