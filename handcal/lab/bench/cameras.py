"""Whole calibrations with simulated depth cameras: a RealSense D415, and AHAT of a HoloLens 2."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias, cast

import numpy as np

from handcal.camera.radial import DEPTH_SCALE_M, PinholeView, is_not_wrapped, white_brightness
from handcal.core.geometry import invert, transform
from handcal.core.progress import Progress
from handcal.core.types import Bool, Float32, Float64, Frame, Intrinsics, UInt16
from handcal.hand.segment import segment_hand
from handcal.hand.settings import SegmentSettings
from handcal.lab.bench.figure import BenchFigure
from handcal.lab.bench.settings import BenchSettings
from handcal.lab.bench.trials import Measured, run_trials
from handcal.lab.study.procedure_trial import ProcedureModel, See
from handcal.lab.study.procedures import ProcedureSettings, procedure_trial
from handcal.lab.study.run import Case
from handcal.lab.study.wearers import StudyWearer
from handcal.sim.ahat import AhatSettings, ahat_rays, sense_distance
from handcal.sim.raster import D415, draw_hand
from handcal.sim.sensor import SensorSettings, sense_depth

_SEED = 1
_POINTS = 1500
_WALL_M = 1.6
"""Shows the distance of a hand to a camera whose phase wraps at 1.055 m."""
_SKIN, _WHITE = 0.55, 0.8
_AT_MOST = 1.3
# An image that holds all of AHAT's view that is used, with smaller pixels than AHAT's.
_WIDE = Intrinsics(720, 720, 345.0, 345.0, 359.5, 359.5)
Sense: TypeAlias = Callable[[Float32, np.random.Generator], UInt16]
"""Returns a camera's depth of an ideal image, in its own units."""


def measure_cameras(settings: BenchSettings, progress: Progress) -> Measured:
    """Calibrate the same wearers with each camera, in one place on the headset."""
    if not settings.camera_wearers:
        progress.at(1.0)
        return Measured([], {})
    cameras = {"D415": _d415(), "AHAT": _ahat()}
    tasks = [(name, number) for number in range(settings.camera_wearers) for name in cameras]
    errors = run_trials(lambda task: _errors_arcmin(cameras[task[0]], task[1]), tasks, progress)
    by_camera: dict[str, list[float]] = {name: [] for name in cameras}
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


def _errors_arcmin(see: See, number: int) -> list[float]:
    """Return the error of each eye of a wearer after the recommended plan, verified."""
    plan: Case = {"wearer": number, "plan": "recommended", "variant": "plain", "scale": 1.0}
    rows = procedure_trial(ProcedureSettings(_SEED, ProcedureModel(see=see)), plan)
    return [cast("float", row["after_arcmin"]) for row in rows]


def _d415() -> See:
    settings = SensorSettings()

    def sense(depth_m: Float32, rng: np.random.Generator) -> UInt16:
        return sense_depth(depth_m, D415.fx, rng, settings)

    return _seen_by(D415, sense, D415, settings.depth_scale_m)


def _ahat() -> See:
    view, settings = PinholeView(ahat_rays()), AhatSettings()

    def sense(depth_m: Float32, rng: np.random.Generator) -> UInt16:
        reflectance = np.where(depth_m < _WALL_M, _SKIN, _WHITE).astype(np.float32)
        distance, brightness = sense_distance(depth_m, reflectance, _WIDE, rng, settings)
        distance_m = (distance / settings.units_per_m).astype(np.float32)
        bright = brightness.astype(np.float32)
        white = white_brightness(distance_m, bright)
        is_near = is_not_wrapped(distance_m, bright, settings.alias_m, white)
        return view.depth(np.where(is_near, distance_m, np.float32(0.0)))

    return _seen_by(_WIDE, sense, view.intrinsics, DEPTH_SCALE_M)


def _seen_by(ideal: Intrinsics, sense: Sense, camera: Intrinsics, scale_m: float) -> See:
    """Return the measured hand in front of a wall, drawn by one camera and sensed by another."""
    segment = SegmentSettings(points=_POINTS)

    def see(
        rng: np.random.Generator, wearer: StudyWearer, T_H_hand: Float64
    ) -> tuple[Float64, Bool]:
        drawn = draw_hand(wearer.hand, invert(wearer.rig.T_H_D) @ T_H_hand, ideal)
        height, width = drawn.depth_m.shape
        depth_m = np.full((ideal.height, ideal.width), _WALL_M, np.float32)
        box = depth_m[drawn.y0 : drawn.y0 + height, drawn.x0 : drawn.x0 + width]
        np.minimum(box, drawn.depth_m, out=box)
        frame = Frame(0, 0, 0, sense(depth_m, rng), scale_m, camera)
        cloud = segment_hand(frame, segment)
        return transform(wearer.rig.T_H_D, cloud.points_m), cloud.is_cut

    return see
