"""Search for the placement errors with which the paper's method has its published error.

A method comparison is only as good as its simulated wearers. All their placement errors, lateral,
in depth and in rotation, are those of `WearerSettings` times one scale. The published solver may
swing to its last iteration; the search by its best iterate does not depend on where it stops.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from scipy.optimize import brentq

from handcal.core.display import TARGET_DEPTHS_M
from handcal.core.errors import HandcalError
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, Float64
from handcal.lab.study.methods import MethodSettings, rendered, study_wearer, target_errors
from handcal.lab.study.trials import BEST_ITERATE, solve_by_paper
from handcal.lab.study.wearers import StudyWearer, align_hand

PAPER_MEAN_ARCMIN, PAPER_SD_ARCMIN = 10.79, 3.21
"""Hu et al. 2021, user test: all corners."""

_SCALES = 0.0, 3.0
_NEAR_ENOUGH = 0.02


@dataclass(frozen=True, slots=True)
class NoiseFit:
    """The result of the search."""

    scale: float
    """Scale of the placement errors of `WearerSettings`."""
    mean_arcmin: float
    sd_arcmin: float
    """Error of the paper's method at this scale, over all corners of all wearers."""
    mean_by_scale: dict[float, float]
    """Mean error at each scale tried, in arcmin."""


def fit_noise(
    settings: MethodSettings,
    wearers: int,
    progress: Progress = Progress(),
    method: Literal["paper", "paper, best iterate"] = "paper",
) -> NoiseFit:
    """Search for the scale at which the paper's method has a mean error of 10.79′.

    By Brent's method; a wearer's errors differ between scales only in size. Eye
    distances are the rig's, as the paper's headset was set to its users.

    Parameters
    ----------
    settings : MethodSettings
        `noise_scale` and `wearers` do not matter.
    wearers : int
        Seconds each, for every scale tried.
    progress : Progress
        Reports each scale tried and the mean error with it.
    method : {"paper", "paper, best iterate"}

    Raises
    ------
    HandcalError
        If no scale from 0 to 3 gives it.
    """
    tried: dict[float, Float64] = {}

    def excess(scale: float) -> float:
        if scale not in tried:  # the search asks for its ends again
            scaled = replace(settings, noise_scale=scale)
            tried[scale] = np.array(
                [_errors_arcmin(scaled, wearer)[method] for wearer in range(wearers)]
            )
            progress.at(0.0, f"Noise {scale:.2f} by {method}: {tried[scale].mean():.1f}′")
        return float(tried[scale].mean()) - PAPER_MEAN_ARCMIN

    if excess(_SCALES[0]) > 0.0 or excess(_SCALES[1]) < 0.0:
        means = ", ".join(f"{errors.mean():.1f}′ at {scale:g}" for scale, errors in tried.items())
        raise HandcalError(
            f"no noise gives the paper's {PAPER_MEAN_ARCMIN}′ ({means})",
            "try more wearers",
        )
    scale = float(brentq(excess, *_SCALES, xtol=_NEAR_ENOUGH))
    nearest = min(tried, key=lambda found: abs(found - scale))
    errors = tried[nearest]
    means_arcmin = {found: float(tried[found].mean()) for found in sorted(tried)}
    return NoiseFit(nearest, float(errors.mean()), float(errors.std(ddof=1)), means_arcmin)


@lru_cache(maxsize=512)  # both searches try the same scales first
def _errors_arcmin(settings: MethodSettings, number: int) -> dict[str, Float64]:
    """Return the errors at all corners, (24,), after one alignment: published and best iterate."""
    wearer, placement = study_wearer(settings, {"eye_distance_sigma_mm": 0.0, "wearer": number})
    offline = dict.fromkeys(EYES, np.zeros(3))
    alignment = align_hand(
        wearer,
        np.random.default_rng([settings.seed, number, 2]),
        EYES,
        offline,
        placement,
        settings.points,
        settings.depth_sigma_m,
    )
    solved = {
        eye: solve_by_paper(
            alignment.cursor_m,
            alignment.hand_m,
            alignment.T_E_W[eye],
            wearer.rig.eyes[eye].z_C0_S_m,
        )[1]
        for eye in EYES
    }
    return {
        method: _corner_errors_arcmin(wearer, {eye: solved[eye][method] for eye in EYES})
        for method in ("paper", BEST_ITERATE)
    }


def _corner_errors_arcmin(wearer: StudyWearer, shift_m: Mapping[Eye, Float64]) -> Float64:
    projections = rendered(wearer, shift_m)
    return np.array(
        [
            error
            for depth_m in TARGET_DEPTHS_M
            for name, error in target_errors(wearer, projections, depth_m).items()
            if name.endswith("arcmin")
        ]
    )
