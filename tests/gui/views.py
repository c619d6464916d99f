"""Everything that the wizard can show, and snapshots for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product
from typing import Any

from handcal.calibration.plan import NextStep, PlanSettings, StepName
from handcal.calibration.states import CalibrationSettings, State
from handcal.calibration.verifying import VerifyingView
from handcal.core.types import EYES, Eye, Float64, Verdict, VerdictName, Verification
from handcal.link.nudges import NudgeSum
from handcal.register.results import SolveSettings
from handcal.register.verdict import VerdictSettings
from handcal.session.session import SessionRecord
from handcal.session.state import SessionEvent, SessionState
from handcal.session.trial import make_trial
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.guide.steps import Wizard, save_view
from handcal_gui.calibrate.guide.view import Action, Step, WizardView

RECOMMENDED = PlanSettings("recommended", is_automatic=True)
_ZERO = (0.0, 0.0, 0.0)
NUDGED = VerifyingView("left", NudgeSum(3.0, -4.0, 0.01), _ZERO, _ZERO, True, False)
PLANNED: dict[StepName, tuple[State, tuple[Eye, ...]]] = {
    StepName.RAISE: (State.SHOW_HAND, ("left",)),
    StepName.CURSOR: (State.APPLIED, ("right",)),
    StepName.ALIGN: (State.ALIGN, ("left",)),
    StepName.SOLVE: (State.ALIGNED, EYES),
    StepName.APPLY: (State.SOLVED, EYES),
    StepName.WAIT: (State.APPLYING, EYES),
    StepName.VERIFY: (State.APPLIED, ("left",)),
    StepName.NUDGE: (State.VERIFY, ("left",)),
    StepName.DONE: (State.APPLIED, ()),
}
"""State and eyes with each next step of a plan."""
Maker = Callable[..., Snapshot]
VERIFIED = Verification((0.0, 0.0, 0.0), (1.0, -2.0), (0.001, 0.0, 0.0))


def judged(
    snapshot: Maker, left: VerdictName, right: VerdictName, state: State, **changes: Any
) -> Snapshot:
    """Return a snapshot with these verdicts, of eyes that were verified."""
    seen = snapshot(state, verified=dict.fromkeys(EYES, VERIFIED), **changes)
    assert seen.procedure.results is not None
    verdicts: dict[Eye, Verdict] = {
        "left": Verdict(left, "as told"),
        "right": Verdict(right, "as told"),
    }
    results = replace(seen.procedure.results, verdicts=verdicts)
    procedure = replace(seen.procedure, results=results)
    if state is State.APPLIED:
        procedure = replace(procedure, applied_shift_m=results.rendered_shift_m)
    return replace(seen, procedure=procedure)


def with_target(target_arcmin: float) -> CalibrationSettings:
    """Return settings with a target of the lab."""
    return CalibrationSettings(
        solve=SolveSettings(verdict=VerdictSettings(target_arcmin=target_arcmin))
    )


def with_events(record: SessionRecord, *events: tuple[str, dict[str, Any]]) -> SessionRecord:
    """Return the record of a session in which more events were recorded that set φ."""
    last = record.events[-1]
    more = (replace(last, name=name, data=data) for name, data in events)
    record = replace(record, events=(*record.events, *more))
    state = SessionState()
    for event in record.events:
        state.apply(event)
    return replace(
        record,
        fine_tuned=state.fine_tuned,
        set_by_hand_m=state.set_by_hand_m,
        went_back=state.went_back,
    )


def fine_tuned(record: SessionRecord, shifts_m: Mapping[Eye, Float64]) -> SessionRecord:
    """Return the record of a session with these shifts, set by hand."""
    data = {"shift_m": {eye: one.tolist() for eye, one in shifts_m.items()}}
    return with_events(record, (SessionEvent.FINE_TUNED, data))


def tried(seen: Snapshot) -> Snapshot:
    """Return a snapshot with a trial of the left eye's result, far over any target."""
    assert seen.procedure.results is not None
    calibrated_m = seen.procedure.results.rendered_shift_m["left"]
    display = seen.record.rig.eyes["left"]
    trials = {1: make_trial(display, "left", 0.4, calibrated_m, [0.05, 0.0, 0.0])}
    return replace(seen, record=replace(seen.record, trials=trials))


def used_anyway(seen: Snapshot) -> Snapshot:
    """Return a snapshot in which every result is final, whatever its verdict."""
    assert seen.procedure.results is not None
    solved_m = {eye: shift.shift_m for eye, shift in seen.procedure.results.eyes.items()}
    record = replace(fine_tuned(seen.record, solved_m), applied_shift_m=solved_m)
    return replace(seen, record=record)


def actions(view: WizardView) -> list[Action]:
    return [offer.action for offer in view.others]


def begun(*, is_held: bool = False) -> Wizard:
    """Return a guide in which *Begin* has been pressed."""
    wizard = Wizard()
    wizard.move(Action.NEXT)
    wizard.is_held = is_held
    return wizard


def all_views(snapshot: Callable[..., Snapshot], record: SessionRecord) -> list[WizardView]:
    """Return a view of every step of both plans, with every main button and every other one."""
    left = replace(next(iter(record.alignments.values())), eyes=("left",))
    former = replace(record.facts, former="session-20261124-024848-549254")
    none = replace(record, alignments={})
    views = [
        Wizard().view(planned_snapshot(snapshot, StepName.RAISE, record=one))
        for one in (record, none, replace(none, facts=former))
    ]
    each = PlanSettings("paper", in_turn=True)
    for plan, is_held in product((RECOMMENDED, each), (False, True)):
        wizard = begun(is_held=is_held)
        snapshots = [
            planned_snapshot(snapshot, name, plan=plan, record=one)
            for name in StepName
            for one in (record, replace(record, alignments={1: left}), none)
        ]
        done = planned_snapshot(snapshot, StepName.DONE, plan=plan)
        raising = planned_snapshot(snapshot, StepName.RAISE, plan=plan)
        asked = {"is_requested": True}, {"awaited": StepName.VERIFY}, {"awaited": StepName.CURSOR}
        snapshots += [with_next(raising, **one) for one in asked]
        snapshots += [
            replace(done, procedure=replace(done.procedure, results=None)),
            planned_snapshot(snapshot, StepName.DONE, plan=plan, verified={}),
            tried(judged(snapshot, "accept", "accept", State.APPLIED, plan=plan)),
            used_anyway(judged(snapshot, "keep", "accept", State.APPLIED, plan=plan)),
        ]
        for names in (("accept", "accept"), ("keep", "accept"), ("implausible", "repeat")):
            for state in (State.SOLVED, State.APPLIED):
                snapshots.append(judged(snapshot, *names, state, plan=plan))
        views.extend(wizard.view(one) for one in snapshots)
        for seen in (done, judged(snapshot, "accept", "accept", State.APPLIED, plan=plan)):
            wizard = begun(is_held=is_held)
            wizard.move(Action.NEXT)
            for is_finished in (False, True):
                finished = replace(seen.record, is_finished=is_finished)
                views.append(wizard.view(replace(seen, record=finished)))
    for is_finished in (False, True):
        seen = tried(judged(snapshot, "accept", "accept", State.APPLIED))
        views.append(save_view(replace(seen, record=replace(seen.record, is_finished=is_finished))))
    assert {view.step for view in views} == set(Step)
    offers = [offer for view in views for offer in (view.main, *view.others)]
    assert {offer.action for offer in offers} == set(Action)
    return list(dict.fromkeys(views))


def planned_snapshot(
    snapshot: Callable[..., Snapshot],
    name: StepName,
    *,
    plan: PlanSettings = RECOMMENDED,
    record: SessionRecord | None = None,
    verified: Mapping[Eye, Verification] | None = None,
    **procedure: Any,
) -> Snapshot:
    """Return a snapshot whose plan's next step has a name."""
    state, eyes = PLANNED[name]
    if name is StepName.NUDGE:
        procedure = {"verifying": NUDGED, **procedure}
    changes = {} if record is None else {"record": record}
    return snapshot(
        state,
        procedure={"eyes": eyes, **procedure},
        plan=plan,
        next_step=NextStep(name, eyes, "as told"),
        verified=verified,
        **changes,
    )


def with_next(seen: Snapshot, **changes: Any) -> Snapshot:
    """Return a snapshot with changes to its plan's next step."""
    assert seen.next_step is not None
    return replace(seen, next_step=replace(seen.next_step, **changes))
