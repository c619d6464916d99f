"""Whole calibrations with simulated depth cameras: a RealSense D415, and AHAT of a HoloLens 2."""

from __future__ import annotations

from typing import cast

import numpy as np

from handcal.core.progress import Progress
from handcal.lab.bench.figure import BenchFigure
from handcal.lab.bench.settings import BenchSettings
from handcal.lab.bench.trials import Measured, run_trials
from handcal.lab.study.procedure_trial import ProcedureModel
from handcal.lab.study.procedures import ProcedureSettings, procedure_trial
from handcal.lab.study.run import Case
from handcal.sim.sensor import SensorName

_SEED = 1
_AT_MOST = 1.3
_CAMERAS: dict[str, SensorName] = {"D415": "d415", "AHAT": "ahat"}


def measure_cameras(settings: BenchSettings, progress: Progress) -> Measured:
    """Calibrate the same wearers with each camera, in one place on the headset."""
    if not settings.camera_wearers:
        progress.at(1.0)
        return Measured([], {})
    tasks = [(name, number) for number in range(settings.camera_wearers) for name in _CAMERAS]
    errors = run_trials(lambda task: _errors_arcmin(_CAMERAS[task[0]], task[1]), tasks, progress)
    by_camera: dict[str, list[float]] = {name: [] for name in _CAMERAS}
    for (name, _), found in zip(tasks, errors, strict=True):
        by_camera[name] += found
    mean = {name: float(np.mean(found)) for name, found in by_camera.items()}
    return Measured(
        [
            BenchFigure("calibration with a D415: mean error", mean["D415"], "′"),
            BenchFigure(
                "the same with a HoloLens 2's AHAT / D415",
                mean["AHAT"] / mean["D415"],
                "",
                at_most=_AT_MOST,
            ),
        ],
        {f"{name}_arcmin": found for name, found in by_camera.items()},
    )


def _errors_arcmin(sensor: SensorName, number: int) -> list[float]:
    """Return the error of each eye of a wearer after the recommended plan, verified."""
    plan: Case = {"wearer": number, "plan": "recommended", "variant": "plain", "scale": 1.0}
    rows = procedure_trial(ProcedureSettings(_SEED, ProcedureModel(sensor=sensor)), plan)
    return [cast("float", row["after_arcmin"]) for row in rows]
