"""One calibration without a window, from the connected headset to the finished session."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from handcal.calibration.plan import PlanSettings, with_eyes
from handcal.core.errors import HandcalError
from handcal.core.progress import Progress
from handcal.core.types import EyePlan, PlanName
from handcal.link.pairing import Pairings
from handcal.station.checks.doctor import Health
from handcal.station.checks.preflight import check_station
from handcal.station.follow import Patience, deliver, follow_plan
from handcal.station.settings import StationSettings
from handcal.station.snapshot import Snapshot
from handcal.station.station import Station


@dataclass(frozen=True, slots=True)
class RunSettings:
    """Settings of a calibration without a window."""

    station: StationSettings = field(default_factory=StationSettings)
    wearer: str = ""
    """Name or code; stored in the session."""
    plan: PlanName = "paper"
    alignments: int = 1
    """Number of alignments of the paper's plan; of each eye, if `eyes` is ``"each"``. The
    recommended plan makes its own choice."""
    eyes: EyePlan = "both"
    """Only one for a wearer who sees with one eye."""
    patience_s: float = 60.0
    """Longest time for the wearer and the headset to do one step."""


def run_calibration(
    settings: RunSettings,
    progress: Progress = Progress(),
    pairings: Pairings | None = None,
    watchers: Iterable[Callable[[Snapshot], object]] = (),
) -> dict[str, Any]:
    """Calibrate one wearer; each step runs automatically, at the pace of its plan.

    The wearer holds the hand still in view of the camera, moves it under the cursor, and confirms.

    Parameters
    ----------
    settings : RunSettings
    progress : Progress
        Called with the present step and the share of the whole that is done.
    pairings : Pairings, optional
        The network headsets that may connect.
    watchers : iterable of callable
        See `Station.watch`.

    Returns
    -------
    dict
        JSON-able: see docs/commands.md.

    Raises
    ------
    HandcalError
        If a part of the station is not ready, the headset or the wearer does not do a step in time,
        or the disk is full. The session holds what was done by then.
    CancelledError
        If it was cancelled.
    """
    pairings = pairings or Pairings(())
    _require_ready(settings.station, pairings)
    plan = PlanSettings(
        settings.plan,
        is_automatic=True,
        verify=settings.plan == "recommended",
        alignments=settings.alignments,
    )
    wanted = replace(settings.station, plan=with_eyes(plan, settings.eyes))
    with Station(wanted, settings.wearer, pairings=pairings) as station:
        for watcher in watchers:
            station.watch(watcher)
        follow_plan(station, Patience(settings.patience_s), progress)
        snapshot = deliver(station)
        station.finish()
        return _result(station, snapshot)


def _require_ready(settings: StationSettings, pairings: Pairings) -> None:
    key = next((one.key for one in pairings.all), "")
    if settings.headset == "network" and not key:
        raise HandcalError("no headset is paired", "pair one with handcal pair")
    for finding in check_station(settings, key).values():
        if finding.health is Health.BROKEN:
            raise HandcalError(f"{finding.what.lower()}: {finding.found}", f"{finding.advice}")


def _result(station: Station, snapshot: Snapshot) -> dict[str, Any]:
    calibration, link = station.calibration, snapshot.link
    assert calibration.results is not None
    results, headset = calibration.results, station.headset
    return {
        "session": str(station.session.path),
        "plan": station.plan.settings.name,
        "rig": station.rig.name,
        "camera": calibration.camera.model,
        "headset": None
        if headset is None
        else {
            "device_id": headset.device_id,
            "name": headset.name,
            "runtime": headset.runtime,
            "app": headset.app,
        },
        "alignments": len(calibration.alignments),
        "refused": snapshot.record.refused,
        "eyes": {
            eye: {
                "shift_mm": (1e3 * shift.shift_m).tolist(),
                "sigma_mm": (1e3 * np.sqrt(np.diag(shift.covariance_m2))).tolist(),
                "verdict": results.verdicts[eye].name,
                "reason": results.verdicts[eye].reason,
                "evidence": [one.name for one in calibration.evidence.contradictions],
                "projection_acked": calibration.projection_acked[eye],
            }
            for eye, shift in results.eyes.items()
        },
        "link": {
            "sent": link.sent,
            "lost": link.lost,
            "acked": link.acked,
            "failed": link.failed,
            "given_up": dict(link.given_up),
            "latency_ms": link.latency_ms,
            "pose_rate_hz": link.pose_rate_hz,
        },
    }
