"""Everything that the wizard can show, and snapshots for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from handcal.link.nudges import NudgeSum
from handcal.session.session import SessionRecord
from handcal.session.state import SessionEvent, SessionState
from handcal.session.trial import make_trial
from handcal.station.plan import NextStep, StepName
from handcal.station.snapshot import Snapshot
from handcal.station.states import State
from handcal.station.verifying import VerifyingView
from handcal.types import EYES, Eye, Float64, Verdict, VerdictName, Verification
from handcal_gui.pages.wizard.planned import PlannedWizard
from handcal_gui.pages.wizard.step_views import save_view
from handcal_gui.pages.wizard.steps import PLANS, Wizard
from handcal_gui.pages.wizard.view import Action, Step, WizardView

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
    seen = snapshot(state, procedure={"verifications": dict.fromkeys(EYES, VERIFIED)}, **changes)
    assert seen.procedure.results is not None
    verdicts: dict[Eye, Verdict] = {
        "left": Verdict(left, "as told"),
        "right": Verdict(right, "as told"),
    }
    results = replace(seen.procedure.results, verdicts=verdicts)
    return replace(seen, procedure=replace(seen.procedure, results=results))


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


def actions(view: WizardView) -> list[Action]:
    return [offer.action for offer in view.others]


def all_views(snapshot: Callable[..., Snapshot], record: SessionRecord) -> list[WizardView]:
    """Return a view of every step, with every main button and every other one."""
    left = replace(next(iter(record.alignments.values())), eyes=("left",))
    one = replace(record, alignments={1: left})
    views = []
    for plan in PLANS:
        wizard = Wizard(plan)
        start = snapshot(State.SHOW_HAND, record=replace(record, alignments={}))
        for _ in range(3):
            views.append(wizard.view(start))
            wizard.move(Action.NEXT, start)
        states = (State.ALIGN, State.SHOW_HAND, State.ALIGNED, State.SOLVED, State.APPLYING)
        views.extend(wizard.view(snapshot(state)) for state in states)
        wizard.view(snapshot(State.SOLVED))
        views.append(wizard.view(snapshot(State.APPLIED, procedure={"results": None})))
        views.append(wizard.view(snapshot(State.APPLIED, record=one)))
        views.append(wizard.view(snapshot(State.VERIFY, procedure={"verifying": NUDGED})))
        applied = snapshot(State.APPLIED)
        for _ in range(3):  # each eye in turn, then the result
            views.append(wizard.view(applied))
            wizard.move(Action.SKIP, applied)
        wizard.move(Action.NEXT, applied)
        for is_finished in (False, True):
            finished = replace(record, is_finished=is_finished)
            views.append(wizard.view(snapshot(State.APPLIED, record=finished)))
    doubted = tried(judged(snapshot, "accept", "accept", State.APPLIED))
    for is_finished in (False, True):
        seen = replace(doubted, record=replace(doubted.record, is_finished=is_finished))
        views.append(save_view(seen, is_held=True))
    for is_held in (False, True):
        views.extend(_planned_views(snapshot, record, is_held=is_held))
    assert {view.step for view in views} == set(Step)
    offers = [offer for view in views for offer in (view.main, *view.others)]
    assert {offer.action for offer in offers} == set(Action)
    return list(dict.fromkeys(views))


def planned_snapshot(
    snapshot: Callable[..., Snapshot], name: StepName, **procedure: Any
) -> Snapshot:
    """Return a snapshot whose plan's next step has a name."""
    state, eyes = PLANNED[name]
    planned = {"plan": "recommended", "next_step": NextStep(name, eyes, "as told"), "eyes": eyes}
    if name is StepName.NUDGE:
        planned["verifying"] = NUDGED
    return snapshot(state, procedure={**planned, **procedure})


def _planned_views(
    snapshot: Callable[..., Snapshot], record: SessionRecord, *, is_held: bool
) -> list[WizardView]:
    """Return a view of every next step of a plan."""
    wizard = PlannedWizard()
    wizard.is_held = is_held
    snapshots = [planned_snapshot(snapshot, name) for name in StepName]
    former = replace(record.facts, former="session-20261124-024848-549254")
    again = replace(record, facts=former, alignments={})
    views = [
        wizard.view(planned_snapshot(snapshot, StepName.RAISE, alignments={})),
        wizard.view(
            replace(planned_snapshot(snapshot, StepName.RAISE, alignments={}), record=again)
        ),
        wizard.view(snapshots[0]),
    ]
    wizard.move(Action.NEXT, snapshots[0])
    views.extend(wizard.view(one) for one in snapshots)
    wizard.move(Action.NEXT, snapshots[-1])
    for is_finished in (False, True):
        finished = replace(record, is_finished=is_finished)
        views.append(wizard.view(replace(snapshots[-1], record=finished)))
    return views
