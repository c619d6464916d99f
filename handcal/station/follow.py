"""A station led through its plan, for scripts: each step runs automatically."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from handcal.calibration.plan import StepName
from handcal.core.errors import CancelledError, HandcalError
from handcal.core.progress import Progress
from handcal.core.types import Eye
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
