"""Commands to the station: for each action of the guide, and for each request of a panel."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial

from handcal.calibration.procedure import Calibration
from handcal.calibration.states import ProcedureError, State
from handcal.core.errors import FileError
from handcal.station.snapshot import Snapshot
from handcal.station.station import Station
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.docks import Panels
from handcal_gui.calibrate.guide.view import Action
from handcal_gui.engine.engine_thread import Command

_RECORD = tr("record the trial")
_KINDS = {"alignment": tr("alignment"), "trial": tr("trial")}

Submit = Callable[[str, Command], int]
"""Gives the engine a command by a name that completes "could not …"; returns its number."""


def calibrating(command: Callable[[Calibration], object]) -> Command:
    """Return a command to the procedure, which keeps data that it cannot write yet."""

    def command_station(station: Station) -> None:
        with suppress(FileError):
            command(station.calibration)

    return command_station


def connect_panels(
    panels: Panels, submit: Submit, on_doubted: Callable[[str, str], object]
) -> None:
    """Connect the requests of the panels with commands.

    `on_doubted` is called with a command's name and the reason why its trial may be wrong, or an
    empty one once it may not.
    """
    panels.link.restart_headset.clicked.connect(
        lambda: submit(tr("restart the headset"), Station.restart_headset)
    )
    _connect_fine_tuning(panels, submit)
    _connect_trials(panels, submit)
    panels.trials.doubted.connect(partial(on_doubted, _RECORD))
    for panel in (panels.session, panels.trials):
        panel.delete_requested.connect(
            lambda kind, number: submit(
                tr("delete the {}").format(_KINDS[kind]), lambda s: s.delete(kind, number)
            )
        )
        panel.restore_requested.connect(
            lambda kind, number: submit(
                tr("restore the {}").format(_KINDS[kind]), lambda s: s.restore(kind, number)
            )
        )
    panels.session.eye_distance_changed.connect(
        lambda typed: submit(
            tr("set the eye distance"), calibrating(lambda c: c.set_eye_distance(typed))
        )
    )


def _connect_fine_tuning(panels: Panels, submit: Submit) -> None:
    panels.fine_tune.shift_changed.connect(
        lambda shifts_m: submit(tr("set φ"), calibrating(lambda c: c.set_shift(shifts_m)))
    )
    panels.fine_tune.shift_settled.connect(
        lambda: submit(tr("record φ"), calibrating(Calibration.record_shift))
    )


def _connect_trials(panels: Panels, submit: Submit) -> None:
    trials, compare = panels.trials, tr("compare")
    trials.fine_tuned_m = panels.fine_tune.shift_m
    trials.eye_changed.connect(panels.fine_tune.choose_eye)
    # A φ shown only for comparison is not the one that the trial is about.
    trials.trial_requested.connect(panels.fine_tune.settle)
    trials.trial_requested.connect(
        lambda eye, depth_m: submit(_RECORD, lambda s: s.trials.save(eye, depth_m))
    )
    trials.show_target_requested.connect(
        lambda eye, depth_m: submit(
            tr("show the target"), lambda s: s.trials.show_target(eye, depth_m)
        )
    )
    trials.hide_target_requested.connect(
        lambda: submit(tr("hide the target"), lambda s: s.trials.hide_target())
    )
    trials.compare_requested.connect(lambda: submit(compare, lambda s: s.trials.compare()))
    trials.end_comparison_requested.connect(
        lambda: submit(compare, lambda s: s.trials.end_comparison())
    )
    trials.show_compared_requested.connect(
        lambda place: submit(compare, lambda s: s.trials.show_compared(place))
    )
    trials.comparison_answered.connect(
        lambda answer: submit(compare, lambda s: s.trials.answer(answer))
    )


def _confirm(calibration: Calibration) -> None:
    """Confirm for the wearer, who may have done so already."""
    if calibration.state is State.ALIGN:
        calibration.confirm()


def skipping(snapshot: Snapshot) -> Command:
    """Return the command that skips the verification shown, unless the wearer has ended it."""
    verifying, step = snapshot.procedure.verifying, snapshot.next_step
    eyes = (verifying.eye,) if verifying is not None else () if step is None else step.eyes

    def skip(station: Station) -> None:
        with suppress(FileError, ProcedureError):
            station.plan.skip(eyes[0])

    return skip if eyes else lambda _: None


COMMANDS: dict[Action, Command] = {
    Action.TAKE_STEP: Station.take_step,
    Action.CONFIRM: calibrating(_confirm),
    Action.REDO: calibrating(Calibration.redo),
    Action.VERIFIED: calibrating(Calibration.verified),
    Action.UNDO_NUDGE: calibrating(Calibration.undo_nudge),
    Action.ANOTHER: lambda station: station.plan.request(),
    Action.REPEAT_LEFT: lambda station: station.plan.request(("left",)),
    Action.REPEAT_RIGHT: lambda station: station.plan.request(("right",)),
    Action.WITHDRAW: lambda station: station.plan.withdraw(),
    Action.VERIFY_LEFT: calibrating(lambda calibration: calibration.verify("left")),
    Action.VERIFY_RIGHT: calibrating(lambda calibration: calibration.verify("right")),
    Action.FINISH: Station.finish,
}
"""The engine's part of each action of the guide."""
