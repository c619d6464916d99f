"""Everything that the wizard can show."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from handcal.link.nudges import NudgeSum
from handcal.session.session import SessionRecord
from handcal.station.procedure import State
from handcal.station.snapshot import Snapshot
from handcal.station.verifying import VerifyingView
from handcal_gui.pages.wizard.steps import PLANS, Wizard
from handcal_gui.pages.wizard.view import Action, Step, WizardView

_ZERO = (0.0, 0.0, 0.0)


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
        nudged = VerifyingView("left", NudgeSum(3.0, -4.0, 0.01), _ZERO, _ZERO, True, False)
        views.append(wizard.view(snapshot(State.VERIFY, procedure={"verifying": nudged})))
        applied = snapshot(State.APPLIED)
        for _ in range(3):  # each eye in turn, then the result
            views.append(wizard.view(applied))
            wizard.move(Action.SKIP, applied)
        wizard.move(Action.NEXT, applied)
        for is_finished in (False, True):
            finished = replace(record, is_finished=is_finished)
            views.append(wizard.view(snapshot(State.APPLIED, record=finished)))
    assert {view.step for view in views} == set(Step)
    offers = [offer for view in views for offer in (view.main, *view.others)]
    assert {offer.action for offer in offers} == set(Action)
    return list(dict.fromkeys(views))
