"""The trials panel: it guides through the trials of the user test, and shows what came of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from itertools import product
from time import monotonic
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QCheckBox, QComboBox, QToolButton, QWidget

from handcal.calibration.states import State
from handcal.core.display import TARGET_DEPTHS_M
from handcal.core.types import EYES, Eye, Float64
from handcal.session.session import SessionRecord
from handcal.session.trial import (
    SAME_SHIFT_M,
    Trial,
    count_comparisons,
    read_comparisons,
    trial_spread,
)
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.record_tabs import RecordTabs
from handcal_gui.calibrate.parts.undo_strip import UndoStrip
from handcal_gui.calibrate.trials.comparison_row import ComparisonRow
from handcal_gui.engine.engine_thread import Submit, no_engine
from handcal_gui.widgets.fields import let_keys_choose, paragraph, whole_number
from handcal_gui.widgets.key_cap import KeyCap
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.plots import Plot
from handcal_gui.widgets.result_rows import EYE_NAMES
from handcal_gui.widgets.session_rows import (
    STATISTICS_COLUMNS,
    TRIAL_COLUMNS,
    deletions,
    statistics_rows,
    statistics_text,
    trial_rows,
    trials_id,
)
from handcal_gui.widgets.table import Table

_SIGNS: dict[Eye, tuple[str, float]] = {"left": ("o", -0.012), "right": ("t1", 0.012)}
"""Symbol, and an offset in metres so that the eyes do not hide each other."""
_MEAN_HALF_WIDTH_M = 0.025
_MARGIN_M = 0.05
_PADDING = 0.1
"""Room above and below what is drawn, as a share of its height."""
if TYPE_CHECKING:
    from handcal_gui.calibrate.fine_tune.panel import FineTunePanel

RECORD = tr("record the trial")
_MEANING = tr(
    "A trial is the error of the calibrated φ relative to the φ with which the drawn target covers "
    "the real one. It does not change the calibration: afterwards the final φ is drawn again."
)
_UNTOUCHED = tr(
    "φ of the {} has not been moved since the trial began. Move it first, or press T again if the "
    "wearer sees no error."
)
_EACH, _MOST_EACH = 3, 50
"""Trials of each eye at each distance, at first, and at most."""
_LEAST_APART_S = 1.0
"""A double click neither confirms a doubtful trial nor records a second one."""


class TrialsPanel(QWidget):
    """Guides through trials, records them, and shows them with the comparisons.

    Attributes
    ----------
    record_action : QAction
    submit : callable
        Gives the engine a command.
    fine_tune : FineTunePanel or None
        The panel in which φ is moved for a trial.
    doubted : Signal(str)
        Reason why the user must confirm the trial by requesting it again; empty if there is none
        any more.
    """

    doubted = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("trials")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.submit: Submit = no_engine
        self.fine_tune: FineTunePanel | None = None
        self._snapshot: Snapshot | None = None
        self._record: SessionRecord | None = None
        self._is_read_only = self._is_doubtful = self._is_finished = False
        self._eye: Eye | None = None  # of the next trial, as said last
        self._target: tuple[Eye, float, bool] | None = None  # requested
        self._pressed_s = -_LEAST_APART_S
        self._comparison = ComparisonRow()
        self._eyes, self._depth = QComboBox(), QComboBox()
        self._fill_choices()
        self._each = whole_number(
            "each", 1, _MOST_EACH, tr("Trials of each eye at each distance that the guide asks for")
        )
        self._each.setSuffix(tr(" of each"))
        self._each.setValue(_EACH)
        self._each.valueChanged.connect(self._refresh)
        self._shows_target = QCheckBox(tr("Show the tar&get in the headset"))
        self._shows_target.setToolTip(
            tr("Draw the target of the next trial, until a cursor is made or the session finished")
        )
        self._starts_aside = QCheckBox(tr("Start moved aside at &random"))
        self._starts_aside.setToolTip(
            tr(
                "Each trial begins with the drawing moved aside, as the method of adjustment asks "
                "for, instead of the calibrated φ"
            )
        )
        for box in (self._shows_target, self._starts_aside):
            box.toggled.connect(self._request_target)
        self.record_action = add_action(
            self,
            tr("Record trial"),
            "T",
            self._ask,
            tooltip=tr("Record the error of the calibrated φ relative to the φ set by hand (T)"),
            # Also from the fine-tune panel, where the study leader works.
            context=Qt.ShortcutContext.WindowShortcut,
        )
        self.record_action.setAutoRepeat(False)
        self._hint = paragraph("trialsHint", _MEANING)
        self._message = paragraph("message")
        self._summary = paragraph("summary")
        self._table = Table(
            "trials", tr("Trials"), tr("Trials appear here as they are recorded"), "one"
        )
        self._table.offer_delete(
            lambda number: self.submit(tr("delete the trial"), lambda s: s.delete("trial", number))
        )
        self._statistics = Table("statistics-of-trials", tr("Statistics of trials"))
        self._plot = TrialPlot()
        self._strip = UndoStrip(
            self,
            lambda one: self.submit(
                tr("restore the trial"), lambda s: s.restore(one.kind, one.number)
            ),
        )
        self._lay_out()
        self._refresh()

    @property
    def comparison(self) -> ComparisonRow:
        """The row of buttons for blinded comparisons."""
        return self._comparison

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the session's trials, and enable recording if it is possible."""
        self._snapshot = snapshot
        if snapshot.record is not self._record:
            self.show_record(snapshot.record)
        else:
            self._refresh()

    def show_record(self, record: SessionRecord) -> None:
        """Show the trials of a session."""
        before, self._record = self._record, record
        if before is None or trials_id(before) != trials_id(record):
            self._table.show_rows(TRIAL_COLUMNS, trial_rows(record))
            self._statistics.show_rows(STATISTICS_COLUMNS, statistics_rows(record.trials))
            self._plot.show_trials(record.trials)
        found = statistics_text(record.trials), comparisons_text(record)
        self._summary.setText("\n".join(filter(None, found)))
        self._show_deletions()
        self._refresh()

    def set_read_only(self, is_read_only: bool) -> None:
        """Prepare for another session, read-only or running."""
        self._is_read_only = is_read_only
        self._snapshot = self._eye = None
        self._table.set_read_only(is_read_only)
        self._show_deletions()
        self._refresh()

    def _counts(self) -> dict[tuple[Eye, float], int]:
        """Return how many trials of the present φ there are for each that the guide asks for."""
        results = self._snapshot.procedure.results if self._snapshot else None
        eyes: tuple[Eye, ...] = EYES if results is None else tuple(results.eyes)
        chosen_eye, chosen_m = self._eyes.currentData(), self._depth.currentData()
        depths_m = TARGET_DEPTHS_M if chosen_m is None else (chosen_m,)
        eyes = eyes if chosen_eye is None else (chosen_eye,)
        made: Counter[tuple[Eye, float]] = Counter()
        for trial in (self._record.trials if self._record else {}).values():
            known_m = results.rendered_shift_m.get(trial.eye) if results else None
            if known_m is not None:
                apart_m = np.abs(trial.calibrated_shift_m - known_m).max()
                made[trial.eye, trial.target_depth_m] += int(apart_m < SAME_SHIFT_M)
        return {(eye, depth_m): made[eye, depth_m] for depth_m, eye in product(depths_m, eyes)}

    def _next(self) -> tuple[Eye, float]:
        """Return eye and distance of the next trial: eyes in turn, one distance after the other."""
        counts, each = self._counts(), self._each.value()
        due = [one for one in counts if counts[one] < each]
        if not due:
            return min(counts, key=lambda one: counts[one])
        return min((one for one in due if one[1] == due[0][1]), key=lambda one: counts[one])

    def _obstacle(self) -> str:
        """Return the reason why no trial can be recorded now; empty if one can."""
        if self._is_read_only:
            return tr("This session is only shown. To record trials, resume it or calibrate again.")
        if self._snapshot is None:
            return tr("Trials are recorded while a session runs.")
        procedure = self._snapshot.procedure
        if procedure.state is State.VERIFY:
            return tr("An eye is being verified; confirm or skip that first.")
        if procedure.state is not State.APPLIED or procedure.results is None:
            return tr("Solve and apply the alignments first.")
        if self._snapshot.comparing is not None:  # the drawing may be without the calibration
            return tr("Answer the comparison first, or stop it.")
        eye, _ = self._next()
        if eye not in procedure.results.eyes:
            return tr("The {} has not been aligned.").format(EYE_NAMES[eye].lower())
        return ""

    def _doubt(self) -> str:
        """Return the reason why the next trial may be a mistake; empty if there is none."""
        if self._obstacle() or self.fine_tune is None or self.fine_tune.is_touched:
            return ""
        return _UNTOUCHED.format(EYE_NAMES[self._next()[0]].lower())

    def _guide(self) -> str:
        """Return which trial is next, and what to do for it."""
        counts, each = self._counts(), self._each.value()
        left = sum(max(each - made, 0) for made in counts.values())
        if not left:
            return tr("All {} trials are recorded. T records more.").format(each * len(counts))
        (eye, depth_m), total = self._next(), each * len(counts)
        text = tr(
            "Trial {} of {}: {}, {:g} m. Put the real target there. Move the drawn one onto it, by "
            "the keys of Fine-tune (Ctrl+6). Then press T."
        )
        return text.format(total - left + 1, total, EYE_NAMES[eye].lower(), depth_m)

    def _refresh(self) -> None:
        obstacle, was_finished = self._obstacle(), self._is_finished
        self._is_finished = self._record is not None and self._record.is_finished
        has_ended = self._is_finished and not was_finished
        if self._is_doubtful and (has_ended or not self._doubt()):
            self._forget_doubt()
        self.record_action.setEnabled(not obstacle)
        self._message.setText(obstacle or self._guide())
        eye, _ = self._next()
        if not obstacle and self._eye != eye:
            self._eye = eye
            if self.fine_tune is not None:
                self.fine_tune.choose_eye(eye)
        snapshot = self._snapshot
        is_compared = snapshot is not None and snapshot.comparing is not None
        has_trials = self._record is not None and bool(self._record.trials)
        self._hint.setVisible(not has_trials and not is_compared)  # they need its room
        self._shows_target.setEnabled(not obstacle)
        if obstacle or has_ended:
            self._shows_target.setChecked(False)
        self._request_target()
        self._comparison.show_comparison(
            None if snapshot is None else snapshot.comparing,
            has_seen_both=snapshot is not None and snapshot.has_compared_both,
            can_begin=not obstacle,
        )

    def _request_target(self) -> None:
        """Request another target in the headset if the choice has changed."""
        eye, depth_m = self._next()
        aside = self._starts_aside.isChecked()
        target = (eye, depth_m, aside) if self._shows_target.isChecked() else None
        self._starts_aside.setEnabled(target is not None)
        if target == self._target:
            return
        self._target = target
        if target is None:
            self.submit(tr("hide the target"), lambda s: s.trials.hide_target())
        else:
            self.submit(
                tr("show the target"),
                lambda s: s.trials.show_target(eye, depth_m, starts_aside=aside),
            )

    def _show_deletions(self) -> None:
        can_undo = self._record is not None and not self._is_read_only
        found = deletions(self._record) if self._record and can_undo else []
        self._strip.show_deletions([one for one in found if one.kind == "trial"])

    def _ask(self) -> None:
        """Request a trial; one that may be a mistake must be requested twice."""
        now_s = monotonic()
        if now_s - self._pressed_s < _LEAST_APART_S:
            return
        self._pressed_s = now_s
        doubt = self._doubt()
        self._is_doubtful = bool(doubt) and not self._is_doubtful
        if self._is_doubtful:
            self.doubted.emit(doubt)
            return
        eye, depth_m = self._next()
        if self.fine_tune is not None:
            self.fine_tune.settle()  # a φ shown only for comparison is not the trial's
            self.fine_tune.begin_trial()
        self.submit(RECORD, lambda s: s.trials.save(eye, depth_m))

    def _choose(self) -> None:
        self._forget_doubt()
        self._refresh()

    def _forget_doubt(self) -> None:
        if self._is_doubtful:
            self._is_doubtful = False
            self.doubted.emit("")

    def _fill_choices(self) -> None:
        self._eyes.setAccessibleName(tr("Eye"))
        self._eyes.setToolTip(tr("The eye that looks at the target; the other is closed"))
        for eye in EYES:
            self._eyes.addItem(EYE_NAMES[eye], eye)
        self._eyes.addItem(tr("Eyes in turn"), None)
        self._depth.setAccessibleName(tr("Distance of the target"))
        self._depth.setToolTip(tr("Distance of the target from the eye, in metres"))
        for depth_m in TARGET_DEPTHS_M:
            self._depth.addItem(f"{depth_m:g} m", depth_m)
        self._depth.addItem(tr("All distances"), None)
        for box, text, key in (
            (self._eyes, tr("Next choice of the eye"), "E"),
            (self._depth, tr("Next distance of the target"), "D"),
        ):
            box.setCurrentIndex(box.count() - 1)
            box.currentIndexChanged.connect(self._choose)
            let_keys_choose(box, self, text, key)

    def _lay_out(self) -> None:
        record = QToolButton()
        record.setDefaultAction(self.record_action)
        tabs = RecordTabs()
        for page, title in (
            (self._table, tr("Trials")),
            (self._statistics, tr("Statistics")),
            (self._plot, tr("Plot")),
        ):
            tabs.addTab(page, title)
        vbox(
            self._message,
            hbox(KeyCap("recordKey", "T"), record, self._eyes, self._depth, self._each, 1),
            hbox(self._shows_target, self._starts_aside, 1),
            self._comparison,
            self._hint,  # below the buttons, which stay in place when it goes
            (tabs, 1),
            self._summary,
            hbox((self._strip, 1), self._strip.button),
            on=self,
            margins=(SPACING_PX, SPACING_PX // 2, SPACING_PX, SPACING_PX // 2),
            spacing=SPACING_PX // 2,
        )


def comparisons_text(record: SessionRecord) -> str:
    """Return what the wearer chose in blinded comparisons; empty without any."""
    made = read_comparisons(record.events)
    if not made:
        return ""
    counts = count_comparisons(made)
    text = tr(
        "Blinded comparisons: with the calibration better in {} of {}, without it in {}, no "
        "difference in {}."
    )
    return text.format(counts.applied, len(made), counts.offline, counts.neither)


class TrialPlot(Plot):
    """Shows each trial, as in the table, and mean ± SD and number of the trials at a distance."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(
            "errors-of-trials",
            tr("Errors of trials"),
            tr("Distance of the target (m)"),
            tr("Error (′)"),
            parent,
        )
        self.setToolTip(
            tr(
                "The error of each trial, the mean over the target's four corners. At each\n"
                "distance: the mean of the n trials of both eyes, and one standard deviation (SD)\n"
                "of the trials above and below it, but not below 0. A single trial has no SD."
            )
        )
        self.item.setXRange(min(TARGET_DEPTHS_M) - _MARGIN_M, max(TARGET_DEPTHS_M) + _MARGIN_M)
        self.show_legend()
        self._mean = self.add_line("muted", name=tr("Mean ± SD (≥ 0)"))
        self._errors = {
            eye: self.add_line(eye, name=EYE_NAMES[eye], symbol=_SIGNS[eye][0]) for eye in EYES
        }
        self.show_trials({})

    def show_trials(self, trials: Mapping[int, Trial]) -> None:
        """Show a session's trials, by number."""
        for eye, line in self._errors.items():
            seen = [trial for trial in trials.values() if trial.eye == eye]
            at_m = [trial.target_depth_m + _SIGNS[eye][1] for trial in seen]
            errors = [float(trial.error_arcmin.mean()) for trial in seen]
            line.setData(*_unjoined(np.array(at_m), np.array(errors), 1))
        depths_m = sorted({*TARGET_DEPTHS_M, *(one.target_depth_m for one in trials.values())})
        ticks, marks, highest = [], [np.empty((0, 2))], 1.0
        for depth_m in depths_m:
            here = [number for number, one in trials.items() if one.target_depth_m == depth_m]
            name = tr("{:g} (n = {})").format(depth_m, len(here)) if trials else f"{depth_m:g}"
            ticks.append((depth_m, name))
            if here:
                spread = trial_spread(trials, here)
                mean, sd = spread.mean_arcmin, spread.trial_sd_arcmin or 0.0
                highest = max(highest, mean + sd, spread.max_arcmin)
                across = (-_MEAN_HALF_WIDTH_M, _MEAN_HALF_WIDTH_M, 0.0, 0.0)
                up = (mean, mean, max(mean - sd, 0.0), mean + sd)
                marks.append(np.column_stack([np.add(depth_m, across), up]))
        self.item.getAxis("bottom").setTicks([ticks])
        self.item.setYRange(0.0, highest, padding=_PADDING)  # no symbol is cut
        at_m, up_arcmin = np.vstack(marks).T
        self._mean.setData(*_unjoined(at_m, up_arcmin, 2))


def _unjoined(x: Float64, y: Float64, length: int) -> tuple[Float64, Float64]:
    """Insert NaN after every `length` points, where pyqtgraph interrupts the line."""
    after = np.arange(length, len(x) + 1, length)
    return np.insert(x, after, np.nan), np.insert(y, after, np.nan)
