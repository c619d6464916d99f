"""The trials panel: trials of the user test and their statistics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from time import monotonic

import numpy as np
from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QToolButton,
    QWidget,
)

from handcal.calibration.states import State
from handcal.core.display import TARGET_DEPTHS_M
from handcal.core.types import EYES, Eye, Float64
from handcal.session.comparison import read_comparisons
from handcal.session.session import SessionRecord
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.parts.record_tabs import RecordTabs
from handcal_gui.calibrate.parts.undo_strip import UndoStrip
from handcal_gui.calibrate.trials.comparison_row import ComparisonRow
from handcal_gui.calibrate.trials.trial_plot import TrialPlot
from handcal_gui.widgets.fields import let_keys_choose, paragraph
from handcal_gui.widgets.key_cap import KeyCap
from handcal_gui.widgets.layouts import hbox, vbox
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

_WHAT = tr(
    "A trial is the error of the calibrated φ relative to the φ with which the drawn target covers "
    "the real one. The calibrated φ is the solved one, or 0 for an eye that keeps the offline "
    "calibration."
)
_UNTOUCHED = tr(
    "φ of the {} has not been touched since its last trial at this distance. "
    "Press T again if this is a separate trial."
)
_ZERO = tr(
    "φ of the {} has not been fine-tuned: the error would be 0 px. "
    "Press T again if the wearer sees no error; fine-tune φ first otherwise."
)
_LEAST_APART_S = 1.0
"""A double click neither confirms a doubtful trial nor records a second one."""


class TrialsPanel(QWidget):
    """Records trials and shows them.

    Attributes
    ----------
    record_action : QAction
    trial_requested : Signal(str, float)
        Eye, and the target's distance in metres.
    eye_changed : Signal(str)
        Eye of the next trial, which is to be fine-tuned.
    show_target_requested : Signal(str, float)
        Eye and distance of the target to show in the headset instead of the present one.
    hide_target_requested : Signal()
    compare_requested, end_comparison_requested : Signal()
    show_compared_requested, comparison_answered : Signal(str)
        As in `ComparisonRow`.
    doubted : Signal(str)
        Reason why the user must confirm the trial by requesting it again; empty if there is none
        any more.
    delete_requested, restore_requested : Signal(str, int)
        "trial", and its number.
    fine_tuned_m : callable
        Returns φ of each eye as set by hand, which the headset may not have yet; empty if unknown.
    """

    trial_requested = Signal(str, float)
    eye_changed = Signal(str)
    show_target_requested = Signal(str, float)
    hide_target_requested = Signal()
    compare_requested = Signal()
    end_comparison_requested = Signal()
    show_compared_requested = Signal(str)
    comparison_answered = Signal(str)
    doubted = Signal(str)
    delete_requested = Signal(str, int)
    restore_requested = Signal(str, int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("trials")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._snapshot: Snapshot | None = None
        self._record: SessionRecord | None = None
        self.fine_tuned_m: Callable[[], Mapping[Eye, Float64]] = dict
        self._is_read_only = self._is_doubtful = self._is_finished = False
        self._eyes, self._depth = QComboBox(), QComboBox()
        self._shows_target = QCheckBox(tr("Show the tar&get in the headset"))
        self._eye: Eye | None = None  # of the next trial, as said last
        self._target: tuple[Eye, float] | None = None  # requested
        self._compared = 0
        self._pressed_s = -_LEAST_APART_S
        self._comparison = ComparisonRow()
        self._comparison.begun.connect(self.compare_requested)
        self._comparison.ended.connect(self.end_comparison_requested)
        self._comparison.show_requested.connect(self.show_compared_requested)
        self._comparison.answered.connect(self.comparison_answered)
        self._fill_choices()
        self._make_record_action()
        self._hint = paragraph("trialsHint", _WHAT)
        self._message = paragraph("message")
        self._summary = paragraph("summary")
        self._table = Table(
            "trials", tr("Trials"), tr("Trials appear here as they are recorded"), "one"
        )
        self._table.offer_delete(partial(self.delete_requested.emit, "trial"))
        self._statistics = Table("statistics-of-trials", tr("Statistics of trials"))
        self._plot = TrialPlot()
        self._strip = UndoStrip(self)
        self._strip.restore_requested.connect(
            lambda deletion: self.restore_requested.emit(deletion.kind, deletion.number)
        )
        self._lay_out()
        self._refresh()

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
        self._compared = len(read_comparisons(record.events))
        if before is None or trials_id(before) != trials_id(record):
            self._table.show_rows(TRIAL_COLUMNS, trial_rows(record))
            self._summary.setText(statistics_text(record.trials))
            self._statistics.show_rows(STATISTICS_COLUMNS, statistics_rows(record.trials))
            self._plot.show_trials(record.trials)
        self._show_deletions()
        self._refresh()

    def set_read_only(self, is_read_only: bool) -> None:
        """Prepare for another session, read-only or running."""
        self._is_read_only = is_read_only
        self._snapshot = self._eye = None
        self._table.set_read_only(is_read_only)
        self._show_deletions()
        self._refresh()

    def _next_eye(self) -> Eye:
        chosen: Eye | None = self._eyes.currentData()
        if chosen is not None:
            return chosen
        trials = tuple(self._record.trials.values()) if self._record else ()
        results = self._snapshot.procedure.results if self._snapshot else None
        if results is not None and len(results.eyes) == 1:
            return next(iter(results.eyes))
        return "right" if trials and trials[-1].eye == "left" else "left"

    def _obstacle(self) -> str:
        """Return the reason why no trial can be recorded now; empty if one can."""
        if self._is_read_only:
            return tr("This session is only shown. To record trials, resume it or calibrate again.")
        if self._snapshot is None:
            return tr("Trials are recorded while a session runs.")
        procedure, eye = self._snapshot.procedure, self._next_eye()
        if procedure.state is State.VERIFY:
            return tr("An eye is being verified; confirm or skip that first.")
        if procedure.state is not State.APPLIED or procedure.results is None:
            return tr("Solve and apply the alignments first.")
        if self._snapshot.comparing is not None:  # the drawing may be without the calibration
            return tr("Answer the comparison first, or stop it.")
        if eye not in procedure.results.eyes:
            return tr("The {} has not been aligned.").format(EYE_NAMES[eye].lower())
        return ""

    def _is_zero(self) -> bool:
        """Return whether the next trial would have an error of zero."""
        procedure = self._snapshot.procedure if self._snapshot else None
        if self._obstacle() or procedure is None or procedure.results is None:
            return False
        eye = self._next_eye()
        calibrated_m = procedure.results.rendered_shift_m[eye]
        return bool(np.allclose(self._shift_m(eye), calibrated_m, rtol=0.0, atol=1e-6))

    def _shift_m(self, eye: Eye) -> Float64:
        """Return φ as set by hand, also while the headset does not have it yet."""
        assert self._snapshot is not None
        tuned_m = self.fine_tuned_m() or self._snapshot.procedure.applied_shift_m
        return tuned_m[eye]

    def _is_untouched(self) -> bool:
        """Return whether the next trial would repeat the last one of its eye and distance."""
        procedure = self._snapshot.procedure if self._snapshot else None
        if self._obstacle() or procedure is None or self._record is None:
            return False
        eye, depth_m = self._next_eye(), self._depth.currentData()
        before = [
            trial
            for trial in self._record.trials.values()
            if trial.eye == eye and trial.target_depth_m == depth_m
        ]
        return bool(before) and bool(
            np.allclose(self._shift_m(eye), before[-1].adjusted_shift_m, rtol=0.0, atol=1e-6)
        )

    def _doubt(self) -> str:
        """Return the reason why the next trial may be a mistake; empty if there is none."""
        doubt = _ZERO if self._is_zero() else _UNTOUCHED if self._is_untouched() else ""
        return doubt.format(EYE_NAMES[self._next_eye()].lower())

    def _refresh(self) -> None:
        obstacle = self._obstacle()
        was_finished = self._is_finished
        self._is_finished = self._record is not None and self._record.is_finished
        has_ended = self._is_finished and not was_finished
        if self._is_doubtful and (has_ended or not self._doubt()):
            self._forget_doubt()
        self.record_action.setEnabled(not obstacle)
        self._message.setText(
            obstacle
            or tr("Fine-tune φ of the {}, then record.").format(EYE_NAMES[self._next_eye()].lower())
        )
        if not obstacle and self._eye != self._next_eye():
            self._eye = self._next_eye()
            self.eye_changed.emit(self._eye)
        is_compared = self._snapshot is not None and self._snapshot.comparing is not None
        has_trials = self._record is not None and bool(self._record.trials)
        self._hint.setVisible(not has_trials and not is_compared)  # they need its room
        self._shows_target.setEnabled(not obstacle)
        if obstacle or has_ended:
            self._shows_target.setChecked(False)
        self._request_target()
        self._show_comparison(can_compare=not obstacle)

    def _show_comparison(self, *, can_compare: bool) -> None:
        snapshot = self._snapshot
        self._comparison.show_comparison(
            None if snapshot is None else snapshot.comparing,
            has_seen_both=snapshot is not None and snapshot.has_compared_both,
            can_begin=can_compare,
            count=self._compared,
        )

    def _request_target(self) -> None:
        """Request another target in the headset if the choice has changed."""
        is_shown = self._shows_target.isChecked()
        target = (self._next_eye(), self._depth.currentData()) if is_shown else None
        if target == self._target:
            return
        self._target = target
        if target is None:
            self.hide_target_requested.emit()
        else:
            self.show_target_requested.emit(*target)

    def _show_deletions(self) -> None:
        can_undo = self._record is not None and not self._is_read_only
        found = deletions(self._record) if self._record and can_undo else []
        trials = [deletion for deletion in found if deletion.kind == "trial"]
        self._strip.show_deletions(trials)

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
        else:
            self.trial_requested.emit(self._next_eye(), self._depth.currentData())

    def _choose_eye(self) -> None:
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
        self._eyes.setCurrentIndex(len(EYES))
        self._eyes.currentIndexChanged.connect(self._choose_eye)
        let_keys_choose(self._eyes, self, tr("Next choice of the eye"), "E")
        self._depth.setAccessibleName(tr("Distance of the target"))
        self._depth.setToolTip(tr("Distance of the target from the eye, in metres"))
        for depth_m in TARGET_DEPTHS_M:
            self._depth.addItem(f"{depth_m:g} m", depth_m)
        self._depth.currentIndexChanged.connect(self._request_target)
        let_keys_choose(self._depth, self, tr("Next distance of the target"), "D")
        self._shows_target.setToolTip(
            tr(
                "Draw the target for this eye, at this distance straight ahead, until a "
                "cursor is made "
                "or the session is finished"
            )
        )
        self._shows_target.toggled.connect(self._request_target)

    def _make_record_action(self) -> None:
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

    def _lay_out(self) -> None:
        record = QToolButton()
        record.setDefaultAction(self.record_action)
        key = KeyCap("recordKey", "T")
        choices = hbox(self._eyes, self._depth, key, record, 1, spacing=SPACING_PX)
        tabs = RecordTabs()
        for page, title in (
            (self._table, tr("Trials")),
            (self._statistics, tr("Statistics")),
            (self._plot, tr("Plot")),
        ):
            tabs.addTab(page, title)
        vbox(
            self._message,
            choices,
            self._shows_target,
            self._comparison,
            self._hint,  # below the buttons, which stay in place when it goes
            (tabs, 1),
            self._summary,
            hbox((self._strip, 1), self._strip.button),
            on=self,
            margins=(SPACING_PX, SPACING_PX // 2, SPACING_PX, SPACING_PX // 2),
            spacing=SPACING_PX // 2,
        )
