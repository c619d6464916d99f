"""One calibration without a window, from the connected headset to the finished session."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from handcal.calibration.plan import PlanSettings, StepName, with_eyes
from handcal.core.errors import CancelledError, HandcalError
from handcal.core.progress import Progress
from handcal.core.types import Eye, EyePlan, PlanName
from handcal.link.pairing import Pairings
from handcal.station.checks.doctor import Health
from handcal.station.checks.preflight import check_station
from handcal.station.settings import StationSettings
from handcal.station.snapshot import Snapshot
from handcal.station.station import Station

_DELIVERY_S = 5.0
# Steps that the station takes automatically, within a few frames.
_PASSING = (StepName.SOLVE, StepName.APPLY, StepName.WAIT, StepName.CURSOR, StepName.VERIFY)


@dataclass(frozen=True, slots=True)
class Patience:
    """Longest time for the wearer and the headset to do one step."""

    seconds: float
    frames: int = 0
    """Number of station steps that are waited at least, so that a slow computer gets more time."""


def follow_plan(station: Station, patience: Patience, progress: Progress = Progress()) -> None:
    """Calibrate the wearer of a station by its plan, from the connected headset to the result.

    The wearer holds the hand still in view of the camera, moves it under the cursor, and confirms.

    Parameters
    ----------
    station : Station
        Its plan runs automatically.
    patience : Patience
    progress : Progress
        Called with the present step and the share of the whole that is done.

    Raises
    ------
    HandcalError
        If the headset or the wearer does not do a step in time, or the disk is full. The session
        holds what was done by then.
    CancelledError
        If it was cancelled; the message names the session.
    """
    wait = partial(_wait, station, patience, progress)
    try:
        wait(0.0, "Waiting for the headset", lambda one: one.link.connected, "no headset connected")
        share, step = 0.0, None
        reached: tuple[object, ...] = ()
        while step is None or step.name is not StepName.DONE:
            doing = "to begin" if step is None else step.text
            what = "Following the plan" if step is None else f"{_named(step.eyes)}: {doing}"

            def is_further(seen: Snapshot, before: tuple[object, ...] = reached) -> bool:
                new = seen.next_step
                return new is not None and new.name not in _PASSING and _place(seen) != before

            seen = wait(share, what, is_further, f"the plan stopped at: {doing}")
            reached, step = _place(seen), seen.next_step
            share += 0.15 * (0.95 - share)  # how many steps remain is not known
        if station.calibration.results is None:
            raise HandcalError(f"there is no result: {step.text}")
        progress.at(1.0, f"Done: {step.text}")
    except HandcalError as error:  # Ctrl+C may also have ended the virtual headset
        if progress.is_cancelled():
            kept = f"cancelled; what was recorded is in {station.session.path}"
            raise CancelledError(kept) from error
        raise


def deliver(station: Station) -> Snapshot:
    """Return the state once every message is acknowledged, or after a while."""
    end_s = time.monotonic() + _DELIVERY_S
    while (snapshot := station.step()).link.unacked and time.monotonic() < end_s:
        pass
    return snapshot


def _wait(
    station: Station,
    patience: Patience,
    progress: Progress,
    share: float,
    what: str,
    until: Callable[[Snapshot], bool],
    complaint: str,
) -> Snapshot:
    """Run a station until a condition holds, and return the snapshot in which it does.

    Raises HandcalError after the wearer's patience, or as soon as it cannot hold any more.
    """
    progress.at(share, what)
    end_s, frames = time.monotonic() + patience.seconds, 0
    snapshot = None
    while time.monotonic() < end_s or frames < patience.frames:
        frames += 1
        progress.check()
        station.require_headset()
        snapshot = station.step()
        if snapshot.problem:
            raise HandcalError(snapshot.problem)
        if until(snapshot):
            return snapshot
    why = _reason(snapshot)
    raise HandcalError(f"{complaint} within {patience.seconds:g} s{f': {why}' if why else ''}")


def _named(eyes: Sequence[Eye]) -> str:
    return f"the {eyes[0]} eye" if len(eyes) == 1 else "both eyes"


def _place(snapshot: Snapshot) -> tuple[object, ...]:
    """Return what each step that the wearer does changes; two steps may differ in results only."""
    step = snapshot.next_step
    return step and (step.name, step.eyes), snapshot.procedure.results


def _reason(snapshot: Snapshot | None) -> str:
    """Return what was wrong at the end of a wait; empty if nothing was."""
    if snapshot is None:
        return ""
    problem = "" if snapshot.observation is None else snapshot.observation.problem
    refusal = snapshot.procedure.refusal
    return snapshot.contradiction or snapshot.link_problem or refusal or problem


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
