"""One calibration without a window, from the connected headset to the finished session."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from handcal.errors import HandcalError
from handcal.link.pairing import Pairings
from handcal.progress import Progress
from handcal.station.doctor import Health
from handcal.station.plan import NextStep, PlanSettings, StepName, paper_alignments, usable_eyes
from handcal.station.preflight import check_station
from handcal.station.procedure import Observation, State
from handcal.station.settings import StationSettings
from handcal.station.snapshot import Snapshot
from handcal.station.station import Station
from handcal.types import EyePlan, PlanName

_DELIVERY_S = 5.0


@dataclass(frozen=True, slots=True)
class RunSettings:
    """Settings of a calibration without a window."""

    station: StationSettings = field(default_factory=StationSettings)
    wearer: str = ""
    """Name or code; stored in the session."""
    plan: PlanName = "paper"
    alignments: int = 1
    """Number of alignments of the paper's plan; of each eye, if `eyes` is ``"each"``. The
    recommended plan decides by itself."""
    eyes: EyePlan = "both"
    """One eye for a wearer who sees with one."""
    patience_s: float = 60.0
    """Longest time for the wearer and the headset to do one step."""


def run_calibration(
    settings: RunSettings,
    progress: Progress = Progress(),
    pairings: Pairings | None = None,
    watchers: Iterable[Callable[[Snapshot], object]] = (),
) -> dict[str, Any]:
    """Calibrate one wearer; each step follows by itself as soon as it can.

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
    is_recommended = settings.plan == "recommended"
    usable = usable_eyes(settings.eyes)
    plan = PlanSettings(settings.plan, usable, is_automatic=is_recommended)
    wanted = replace(settings.station, plan=plan)
    with Station(wanted, settings.wearer, pairings=pairings) as station:
        for watcher in watchers:
            station.watch(watcher)
        run = _Run(station, settings, progress)
        run.wait(0.0, "Waiting for the headset", _is_connected, "no headset connected")
        if is_recommended:
            run.follow_recommended()
        else:
            run.follow_paper()
        snapshot = _deliver(station)
        station.finish()
        return _result(station, snapshot)


def _require_ready(settings: StationSettings, pairings: Pairings) -> None:
    key = next((one.key for one in pairings.all), "")
    if settings.headset == "network" and not key:
        raise HandcalError("no headset is paired; pair one with handcal pair")
    for finding in check_station(settings, key).values():
        if finding.health is Health.BROKEN:
            raise HandcalError(f"{finding.what.lower()}: {finding.found}; {finding.advice}")


@dataclass(frozen=True, slots=True)
class _Run:
    """The steps of one calibration."""

    station: Station
    settings: RunSettings
    progress: Progress

    def follow_recommended(self) -> None:
        """Let the station follow its plan to the end."""
        share, step = 0.0, None
        while step is None or step.name is not StepName.DONE:
            done = step

            def is_other(seen: Snapshot, done: NextStep | None = done) -> bool:
                new = seen.procedure.next_step
                return new is not None and (
                    done is None or (new.name, new.eyes) != (done.name, done.eyes)
                )

            doing = "to begin" if done is None else done.text
            what = "Following the plan" if done is None else f"{' and '.join(done.eyes)} {doing}"
            snapshot = self.wait(share, what.strip(), is_other, f"the plan stopped at: {doing}")
            step = snapshot.procedure.next_step
            share += 0.1 * (0.95 - share)  # how many steps remain is not known
        if self.station.calibration.results is None:
            raise HandcalError(f"there is no result: {step.text}")

    def follow_paper(self) -> None:
        """Make every alignment; solve and apply after each."""
        settings, calibration = self.settings, self.station.calibration
        plan = paper_alignments(settings.eyes, settings.alignments)
        for number, eyes in enumerate(plan):
            which = "both eyes" if len(eyes) == 2 else f"the {eyes[0]} eye"
            label = f"Alignment {number + 1} of {len(plan)}, {which}"
            part = self.progress.part(number / len(plan), (number + 1) / len(plan))
            run = _Run(self.station, settings, part)
            run.wait(
                0.1,
                f"{label}: waiting for a steady hand",
                lambda seen: (
                    _observed(seen, lambda one: one.is_steady) and seen.procedure.is_applied
                ),
                "the wearer did not hold the hand still",
            )
            calibration.make_cursor(eyes)
            run.wait(
                0.3,
                f"{label}: the wearer aligns and confirms",
                lambda seen: seen.procedure.state is State.ALIGNED,
                "the wearer did not align the hand",
            )
            part.at(0.8, f"{label}: solving")
            calibration.solve()
            calibration.apply()
            run.wait(
                0.9,
                f"{label}: waiting for the headset to apply it",
                lambda seen: seen.procedure.state is State.APPLIED,
                "the headset did not apply the result",
            )

    def wait(
        self, share: float, what: str, until: Callable[[Snapshot], bool], complaint: str
    ) -> Snapshot:
        """Run the station until a condition holds, and return the snapshot in which it does.

        Raises HandcalError after the wearer's patience, or as soon as it cannot hold any more.
        """
        self.progress.at(share, what)
        end_s = time.monotonic() + self.settings.patience_s
        snapshot = None
        while time.monotonic() < end_s:
            self.progress.check()
            self.station.require_headset()
            snapshot = self.station.step()
            if snapshot.problem:
                raise HandcalError(snapshot.problem)
            if until(snapshot):
                return snapshot
        why = _reason(snapshot)
        raise HandcalError(
            f"{complaint} within {self.settings.patience_s:g} s{f': {why}' if why else ''}"
        )


def _is_connected(snapshot: Snapshot) -> bool:
    return snapshot.link.connected


def _observed(snapshot: Snapshot, is_true: Callable[[Observation], bool]) -> bool:
    return snapshot.observation is not None and is_true(snapshot.observation)


def _reason(snapshot: Snapshot | None) -> str:
    """Return what was wrong at the end of a wait; empty if nothing was."""
    if snapshot is None:
        return ""
    problem = "" if snapshot.observation is None else snapshot.observation.problem
    refusal = snapshot.procedure.refusal
    return snapshot.contradiction or snapshot.link_problem or refusal or problem


def _deliver(station: Station) -> Snapshot:
    """Return the state once every message is acknowledged, or after a while."""
    end_s = time.monotonic() + _DELIVERY_S
    while (snapshot := station.step()).link.unacked and time.monotonic() < end_s:
        pass
    return snapshot


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
        "refused": calibration.refused,
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
