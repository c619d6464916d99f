"""Ideal alignments by a simulated person without placement error."""

from __future__ import annotations

import numpy as np

from handcal.core.progress import Progress
from handcal.core.types import EYES, Method
from handcal.lab.bench.figure import BenchFigure
from handcal.lab.bench.settings import BenchSettings
from handcal.lab.bench.trials import Errors, Measured, collect_errors, trial_hand
from handcal.register.solve import solve_alignment
from handcal.rig.example import example_rig
from handcal.sim.overlay import overlay_by_eye

_ASIDE_M, _ALONG_M = 0.005, 0.010
_BIAS_MM = 0.3


def measure_wearer(settings: BenchSettings, progress: Progress) -> Measured:
    """Measure the bias in φ3 for an eye 10 mm nearer to the display and 10 mm farther."""
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
            BenchFigure("bias at φ3 = ±10 mm", bias_mm, "mm", at_most=_BIAS_MM),
            BenchFigure("share of φ3 that paper misses", 100 * float(missed), "%"),
        ],
        rows,
    )
