"""A complete calibration of a simulated wearer, operated by a script.

The wearer and the headset run in a separate process, and reach the engine only through rendered
frames and real datagrams. The true eye positions are drawn again from the seed afterwards, to
measure the error of the result.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from handcal.display import reprojection_arcmin
from handcal.errors import HandcalError
from handcal.link.server import LinkStatistics
from handcal.progress import Progress
from handcal.register.fuse import eye_position_m
from handcal.register.solve import solve_alignment
from handcal.rig.rig_file import read_rig
from handcal.sim.wearer import WearerSettings, draw_eyes
from handcal.station.evidence import Contradiction
from handcal.station.faults import Fault
from handcal.station.procedure import Calibration, Observation, State
from handcal.station.settings import StationSettings
from handcal.station.station import Station
from handcal.types import EYES, Eye, EyeDistance, Float64, Rig

_DELIVERY_S = 5.0
_PATIENCE_S = 60.0
_RULER_SIGMA_M = 0.001
_RULER = 1  # its random numbers are not the wearer's
_LASTING_S = 4.0
"""Passing evidence, such as a late camera on a busy computer, counts if it lasts this long."""
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
    fault: Fault = ""
    """Fault of the camera or the headset; empty: none."""
    eye_distance: Literal["none", "ruler", "headset"] = "none"
    """Measurement of the wearer's eye distance, with 1 mm of error: typed, or by the headset."""


def run_demo(
    settings: DemoSettings, rig_path: Path, output: Path, progress: Progress
) -> dict[str, Any]:
    """Calibrate one simulated wearer, and compare the result with the truth.

    Parameters
    ----------
    settings : DemoSettings
    rig_path : Path
    output : Path
        Folder in which the session is created.
    progress : Progress
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
    worn_rig = read_rig(Path(settings.worn_rig or rig_path))
    measured = (
        None if settings.eye_distance == "none" else measure_eye_distance(settings.seed, worn_rig)
    )
    station_settings = StationSettings(
        rig=str(rig_path),
        worn_rig=settings.worn_rig,
        seed=settings.seed,
        loss=settings.loss,
        reorder=settings.reorder,
        fault=settings.fault,
        eye_distance_m=(
            measured.value_m if measured and settings.eye_distance == "headset" else None
        ),
        sessions=str(output),
    )
    with Station(station_settings, "Simulated wearer") as station:
        if settings.eye_distance == "ruler":
            station.calibration.set_eye_distance(measured)
        progress.at(0.0, "Connecting to the virtual headset")
        try:
            observations = _follow_plan(station, settings, progress)
        except ContradictedError as error:
            return _contradicted(station, settings, error.contradiction)
        statistics = _delivered(station)
        station.finish()
    calibration, rig = station.calibration, station.rig
    return {
        "seed": settings.seed,
        "session": str(station.session.path),
        "alignments": len(calibration.alignments),
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
            "projection_acked": calibration.projection_acked,
        },
        "timing_ms": _timing(calibration, rig, observations),
    }


class ContradictedError(HandcalError):
    """Evidence that forbids to go on."""

    def __init__(self, contradiction: Contradiction) -> None:
        super().__init__(contradiction.text)
        self.contradiction = contradiction


def _require_no_contradiction(calibration: Calibration, passing: Contradiction | None) -> None:
    """Raise ContradictedError if evidence, passing or not, lets no alignment be taken."""
    found = [*calibration.evidence.contradictions]
    if passing is not None:
        found.append(passing)
    if found and not calibration.alignments:
        raise ContradictedError(found[0])


def _contradicted(
    station: Station, settings: DemoSettings, contradiction: Contradiction
) -> dict[str, Any]:
    """Return the report of a calibration that ended without an alignment."""
    station.session.save_facts(evidence=(contradiction.name,), contradictions=(contradiction.text,))
    return {
        "seed": settings.seed,
        "session": str(station.session.path),
        "alignments": 0,
        "eyes": {
            eye: {
                "verdict": "contradicted",
                "reason": contradiction.text,
                "evidence": [contradiction.name],
            }
            for eye in EYES
        },
    }


def _draw_eyes(seed: int) -> dict[Eye, Float64]:
    """Draw the wearer's φ as the virtual headset does."""
    return draw_eyes(np.random.default_rng(seed), WearerSettings())


def _true_eye_distance_m(seed: int, worn_rig: Rig) -> float:
    left_m, right_m = (
        eye_position_m(worn_rig.eyes[eye], shift_m) for eye, shift_m in _draw_eyes(seed).items()
    )
    return float(np.linalg.norm(right_m - left_m))


def measure_eye_distance(seed: int, worn_rig: Rig) -> EyeDistance:
    """Return the wearer's eye distance as measured with an error drawn from the seed.

    Raises HandcalError if the worn rig's is not a person's.
    """
    error = np.random.default_rng([seed, _RULER]).normal()
    true_m = _true_eye_distance_m(seed, worn_rig)
    try:
        return EyeDistance(true_m + error * _RULER_SIGMA_M)
    except ValueError as problem:
        raise HandcalError(f"the worn rig is not of a person: {problem}") from problem


def _delivered(station: Station) -> LinkStatistics:
    """Return the link's counters once every message is acknowledged, or after a while."""
    deadline_s = time.monotonic() + _DELIVERY_S
    while (statistics := station.step().link).unacked and time.monotonic() < deadline_s:
        pass
    return statistics


def _follow_plan(station: Station, settings: DemoSettings, progress: Progress) -> list[Observation]:
    """Do every planned alignment; solve and apply after each."""
    calibration = station.calibration
    each: tuple[tuple[Eye, ...], ...] = (
        (EYES,) if settings.eyes == "both" else (("left",), ("right",))
    )
    plan = each * settings.alignments
    observations: list[Observation] = []

    def watch(until: Callable[[Observation], bool], complaint: str) -> None:
        fine_s = time.monotonic()
        deadline_s = fine_s + _PATIENCE_S
        steps = 0
        while time.monotonic() < deadline_s or steps < _PATIENCE_STEPS:
            steps += 1
            station.require_headset()
            snapshot = station.step()
            if snapshot.problem:
                raise HandcalError(snapshot.problem)
            if snapshot.observation is not None:
                observations.append(snapshot.observation)
                passing = snapshot.observation.contradiction
                now_s = time.monotonic()
                fine_s = now_s if passing is None else fine_s
                lasts = now_s - fine_s > _LASTING_S
                _require_no_contradiction(calibration, passing if lasts else None)
                if until(snapshot.observation):
                    return
        raise HandcalError(f"{complaint} within {_PATIENCE_S:.0f} s")

    for number, eyes in enumerate(plan):
        which = "both eyes" if len(eyes) == 2 else f"the {eyes[0]} eye"
        label = f"Alignment {number + 1} of {len(plan)}, {which}"
        progress.at((number + 0.1) / len(plan), f"{label}: waiting for a steady hand")
        watch(
            lambda seen: seen.is_steady and calibration.is_applied,
            "the wearer did not hold the hand still",
        )
        calibration.make_cursor(eyes)
        progress.at((number + 0.3) / len(plan), f"{label}: wearer aligns")
        watch(lambda seen: seen.state is State.ALIGNED, "the wearer did not align the hand")
        progress.at((number + 0.9) / len(plan), f"{label}: solving")
        calibration.solve()
        calibration.apply()
        calibration.wait_applied()
        progress.at((number + 1.0) / len(plan), f"{label}: applied and acknowledged")
    return observations


def _judge(calibration: Calibration, station: Station, settings: DemoSettings) -> dict[str, Any]:
    """Compare the result with the wearer's true eyes."""
    assert calibration.results is not None
    results, rig, worn_rig = calibration.results, station.rig, station.worn_rig
    eyes_m = _draw_eyes(settings.seed)
    measured = results.measured_eye_distance
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
                "evidence": [one.name for one in calibration.evidence.contradictions],
            }
            for eye, shift in results.eyes.items()
        },
        "eye_distance": {
            "true_m": _true_eye_distance_m(settings.seed, worn_rig),
            "used": None if measured is None else asdict(measured),
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
