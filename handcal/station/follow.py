"""A station led through its plan, for scripts: each step as soon as it can be done."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from handcal.errors import HandcalError
from handcal.progress import Progress
from handcal.station.plan import StepName
from handcal.station.snapshot import Snapshot
from handcal.station.states import Observation, State
from handcal.station.station import Station
from handcal.types import Eye

_DELIVERY_S = 5.0
# Steps that the station does by itself, within a few frames.
_PASSING = (StepName.SOLVE, StepName.APPLY, StepName.WAIT, StepName.CURSOR, StepName.VERIFY)


@dataclass(frozen=True, slots=True)
class Patience:
    """Longest time for the wearer and the headset to do one step."""

    seconds: float
    frames: int = 0
    """Number of station steps that are waited at least, so that a slow computer gets more time."""


def follow_plan(
    station: Station,
    alignments: Sequence[tuple[Eye, ...]],
    patience: Patience,
    progress: Progress = Progress(),
) -> None:
    """Calibrate the wearer of a station by its plan, from the connected headset to the result.

    The wearer holds the hand still in view of the camera, moves it under the cursor, and confirms.

    Parameters
    ----------
    station : Station
        If its plan is automatic, the plan decides what is done.
    alignments : sequence of tuple of eye
        Eyes open in each alignment of a plan that is not automatic; solved and applied after each.
    patience : Patience
    progress : Progress
        Called with the present step and the share of the whole that is done.

    Raises
    ------
    HandcalError
        If the headset or the wearer does not do a step in time, or the disk is full. The session
        holds what was done by then.
    CancelledError
        If it was cancelled.
    """
    led = _Led(station, patience, progress)
    led.wait(0.0, "Waiting for the headset", _is_connected, "no headset connected")
    if station.plan.settings.is_automatic:
        led.follow()
    else:
        led.align(alignments)


def deliver(station: Station) -> Snapshot:
    """Return the state once every message is acknowledged, or after a while."""
    end_s = time.monotonic() + _DELIVERY_S
    while (snapshot := station.step()).link.unacked and time.monotonic() < end_s:
        pass
    return snapshot


@dataclass(frozen=True, slots=True)
class _Led:
    """A station whose plan is followed."""

    station: Station
    patience: Patience
    progress: Progress

    def follow(self) -> None:
        """Let the station follow its plan to the end."""
        share, step = 0.0, None
        reached: tuple[object, ...] = ()
        while step is None or step.name is not StepName.DONE:
            doing = "to begin" if step is None else step.text
            what = "Following the plan" if step is None else f"{' and '.join(step.eyes)} {doing}"

            def is_further(seen: Snapshot, before: tuple[object, ...] = reached) -> bool:
                new = seen.procedure.next_step
                return new is not None and new.name not in _PASSING and _place(seen) != before

            seen = self.wait(share, what.strip(), is_further, f"the plan stopped at: {doing}")
            reached, step = _place(seen), seen.procedure.next_step
            share += 0.15 * (0.95 - share)  # how many steps remain is not known
        if self.station.calibration.results is None:
            raise HandcalError(f"there is no result: {step.text}")

    def align(self, alignments: Sequence[tuple[Eye, ...]]) -> None:
        """Make every alignment; solve and apply after each."""
        calibration, count = self.station.calibration, len(alignments)
        for done, eyes in enumerate(alignments):
            which = "both eyes" if len(eyes) == 2 else f"the {eyes[0]} eye"
            label = f"Alignment {done + 1} of {count}, {which}"
            self.wait(
                (done + 0.1) / count,
                f"{label}: waiting for a steady hand",
                lambda seen: (
                    _observed(seen, lambda one: one.is_steady) and seen.procedure.is_applied
                ),
                "the wearer did not hold the hand still",
            )
            calibration.make_cursor(eyes)
            self.wait(
                (done + 0.3) / count,
                f"{label}: the wearer aligns and confirms",
                lambda seen: seen.procedure.state is State.ALIGNED,
                "the wearer did not align the hand",
            )
            self.progress.at((done + 0.8) / count, f"{label}: solving")
            calibration.solve()
            calibration.apply()
            self.wait(
                (done + 0.9) / count,
                f"{label}: waiting for the headset to apply it",
                lambda seen: seen.procedure.state is State.APPLIED,
                "the headset did not apply the result",
            )
            self.progress.at((done + 1.0) / count, f"{label}: applied and acknowledged")

    def wait(
        self, share: float, what: str, until: Callable[[Snapshot], bool], complaint: str
    ) -> Snapshot:
        """Run the station until a condition holds, and return the snapshot in which it does.

        Raises HandcalError after the wearer's patience, or as soon as it cannot hold any more.
        """
        self.progress.at(share, what)
        end_s, frames = time.monotonic() + self.patience.seconds, 0
        snapshot = None
        while time.monotonic() < end_s or frames < self.patience.frames:
            frames += 1
            self.progress.check()
            self.station.require_headset()
            snapshot = self.station.step()
            if snapshot.problem:
                raise HandcalError(snapshot.problem)
            if until(snapshot):
                return snapshot
        why = _reason(snapshot)
        raise HandcalError(
            f"{complaint} within {self.patience.seconds:g} s{f': {why}' if why else ''}"
        )


def _place(snapshot: Snapshot) -> tuple[object, ...]:
    """Return what each step that the wearer does changes; two steps may differ in results only."""
    step = snapshot.procedure.next_step
    return step and (step.name, step.eyes), snapshot.procedure.results


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
