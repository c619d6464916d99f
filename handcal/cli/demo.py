"""A complete calibration of a simulated wearer, operated by a script.

The wearer and the headset run in a separate process, and reach the engine only through rendered
frames and real datagrams. The true eye positions are drawn again from the seed afterwards, to
measure the error of the result.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from handcal.display import reprojection_arcmin
from handcal.errors import HandcalError
from handcal.register.solve import solve_alignment
from handcal.sim.wearer import WearerSettings, draw_eyes
from handcal.station.procedure import Calibration, Observation, State
from handcal.station.settings import StationSettings
from handcal.station.station import Station
from handcal.types import EYES, Eye, Rig

_PATIENCE_S = 60.0
_PATIENCE_STEPS = 300
"""Minimum number of station steps before giving up, so that a slow computer gets more time."""


@dataclass(frozen=True, slots=True)
class DemoSettings:
    """Settings of the demonstration."""

    seed: int = 1
    """Seed of the wearer, the hand, the room and all noise."""
    alignments: int = 1
    """Number of alignments; of each eye, if `eyes` is ``"each"``."""
    eyes: Literal["both", "each"] = "both"
    loss: float = 0.0
    reorder: float = 0.0
    """Share of the link's datagrams lost, and reordered, in each direction."""
    worn_rig: str = ""
    """Path of the rig that the wearer really looks through; empty: the rig of the calibration."""


def run_demo(
    settings: DemoSettings, rig_path: Path, output: Path, report: Callable[[str, float], None]
) -> dict[str, Any]:
    """Calibrate one simulated wearer, and compare the result with the truth.

    Parameters
    ----------
    settings : DemoSettings
    rig_path : Path
    output : Path
        Folder in which the session is created.
    report : callable
        Called with the current step and the share of the whole that is done.

    Returns
    -------
    dict
        JSON-able: see docs/commands.md.

    Raises
    ------
    HandcalError
        If the headset does not answer, the wearer does not finish a step, or the disk is full.
    """
    station_settings = StationSettings(
        rig=str(rig_path),
        worn_rig=settings.worn_rig,
        seed=settings.seed,
        loss=settings.loss,
        reorder=settings.reorder,
        sessions=str(output),
    )
    with Station(station_settings, "Simulated wearer") as station:
        report("Connecting to the virtual headset", 0.0)
        observations = _follow_plan(station, settings, report)
        statistics = station.step().link
        station.finish()
    calibration, rig = station.calibration, station.rig
    return {
        "seed": settings.seed,
        "session": str(station.session.path),
        **_judge(calibration, station, settings),
        "guard": {
            "rejected": calibration.refused,
            "accepted_deg": max(
                float(np.degrees(np.linalg.norm(alignment.rotation_rad)))
                for alignment in calibration.alignments.values()
            ),
        },
        "link": {
            "sent": statistics.sent,
            "lost": statistics.lost,
            "acked": statistics.acked,
        },
        "timing_ms": _timing(calibration, rig, observations),
    }


def _follow_plan(
    station: Station, settings: DemoSettings, report: Callable[[str, float], None]
) -> list[Observation]:
    """Do every planned alignment; solve and apply after each."""
    calibration = station.calibration
    each: tuple[tuple[Eye, ...], ...] = (
        (EYES,) if settings.eyes == "both" else (("left",), ("right",))
    )
    plan = each * settings.alignments
    observations: list[Observation] = []

    def watch(until: Callable[[Observation], bool], complaint: str) -> None:
        deadline_s = time.monotonic() + _PATIENCE_S
        steps = 0
        while time.monotonic() < deadline_s or steps < _PATIENCE_STEPS:
            steps += 1
            station.require_headset()
            snapshot = station.step()
            if snapshot.problem:
                raise HandcalError(snapshot.problem)
            if snapshot.observation is not None:
                observations.append(snapshot.observation)
                if until(snapshot.observation):
                    return
        raise HandcalError(f"{complaint} within {_PATIENCE_S:.0f} s")

    for number, eyes in enumerate(plan):
        which = "both eyes" if len(eyes) == 2 else f"the {eyes[0]} eye"
        label = f"Alignment {number + 1} of {len(plan)}, {which}"
        report(f"{label}: waiting for a steady hand", (number + 0.1) / len(plan))
        watch(lambda seen: seen.is_steady, "the wearer did not hold the hand still")
        calibration.make_cursor(eyes)
        report(f"{label}: wearer aligns", (number + 0.3) / len(plan))
        watch(lambda seen: seen.state is State.ALIGNED, "the wearer did not align the hand")
        report(f"{label}: solving", (number + 0.9) / len(plan))
        calibration.solve()
        calibration.apply()
        calibration.wait_applied()
        report(f"{label}: applied and acknowledged", (number + 1.0) / len(plan))
    return observations


def _judge(calibration: Calibration, station: Station, settings: DemoSettings) -> dict[str, Any]:
    """Compare the result with the wearer's true eyes."""
    assert calibration.results is not None
    results, rig, worn_rig = calibration.results, station.rig, station.worn_rig
    eyes_m = draw_eyes(np.random.default_rng(settings.seed), WearerSettings())
    # Relative to the rig's C0, which differs from the true one.
    truth_m = {
        eye: shift_m + rig.eyes[eye].t_C0_V_m - worn_rig.eyes[eye].t_C0_V_m
        for eye, shift_m in eyes_m.items()
    }
    solved_m = {eye: shift.shift_m for eye, shift in results.eyes.items()}
    nothing_m = {eye: np.zeros(3) for eye in EYES}
    return {
        "eyes": {
            eye: {
                "shift_mm": (1e3 * shift.shift_m).tolist(),
                "true_shift_mm": (1e3 * truth_m[eye]).tolist(),
                "sigma_mm": (1e3 * np.sqrt(np.diag(shift.covariance_m2))).tolist(),
                "error_mm": float(1e3 * np.linalg.norm(shift.shift_m - truth_m[eye])),
                "verdict": results.verdicts[eye].name,
                "reason": results.verdicts[eye].reason,
            }
            for eye, shift in results.eyes.items()
        },
        "reprojection_arcmin": {
            "before": reprojection_arcmin(rig, nothing_m, eyes_m, worn_rig),
            "after": reprojection_arcmin(rig, solved_m, eyes_m, worn_rig),
        },
    }


def _timing(
    calibration: Calibration, rig: Rig, observations: list[Observation]
) -> dict[str, float | None]:
    """Return the median milliseconds of each stage.

    Segmentation and guard as they ran, beside the virtual headset and the rendering.
    """
    solve_ms = []
    for alignment in calibration.alignments.values():
        started_s = time.perf_counter()
        solve_alignment(replace(alignment, eyes=EYES), rig)
        solve_ms.append(1e3 * (time.perf_counter() - started_s))
    segment_ms = [seen.segment_ms for seen in observations if seen.hand is not None]
    guard_ms = [seen.guard_ms for seen in observations if seen.guard_ms is not None]
    return {
        "segment": float(np.median(np.array(segment_ms, dtype=float))),
        "guard": float(np.median(np.array(guard_ms, dtype=float))),
        "solve_both_eyes": float(np.median(solve_ms)),
    }
