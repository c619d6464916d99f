"""A dialog for the user test's trials with a cube in the room (Hu et al. 2021)."""

from __future__ import annotations

import os
import queue
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QDialog, QGridLayout, QWidget

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.core.types import Eye, Float64
from handcal.io.files import user_path
from handcal.session.journal import JOURNAL
from handcal.session.session import Session
from handcal.session.trial import Trial
from handcal.station.checks.doctor import Finding, Health
from handcal.station.user_test.cube import StudyLeader, TrialOrder, record_user_trials
from handcal_gui.app.theme import SPACING_PX, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.evaluate.devices import depth_camera, paired_headset
from handcal_gui.evaluate.entries import UserEntries
from handcal_gui.widgets.action_strip import action_strip
from handcal_gui.widgets.entries_form import EntriesForm
from handcal_gui.widgets.fields import button, main_button, paragraph, with_name
from handcal_gui.widgets.finding_line import FindingLine
from handcal_gui.widgets.job_bar import JobBar
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.result_rows import EYE_NAMES
from handcal_gui.widgets.table import Row, Table

STEP_M = 0.00025
_POLL_S = 0.1
_MOVES: dict[str, tuple[str, int, int, int, Qt.Key]] = {
    # text; row and column; axis of φ, from 1, with its sign; key. The drawing of something nearer
    # than the virtual image moves against the eye.
    "up": (tr("Up"), 0, 1, 2, Qt.Key.Key_Up),
    "left": (tr("Left"), 1, 0, 1, Qt.Key.Key_Left),
    "right": (tr("Right"), 1, 2, -1, Qt.Key.Key_Right),
    "down": (tr("Down"), 2, 1, -2, Qt.Key.Key_Down),
    "larger": (tr("Larger"), 0, 3, 3, Qt.Key.Key_Plus),
    "smaller": (tr("Smaller"), 2, 3, -3, Qt.Key.Key_Minus),
}
_KEY_SIGNS = dict(zip(_MOVES, "↑←→↓+−", strict=True))
Record: TypeAlias = Callable[..., tuple[Trial, ...]]


@dataclass(frozen=True, slots=True)
class _Step:
    """A request to the study leader."""

    text: str
    button: str
    is_adjusting: bool = False


class _Desk:
    """Passes requests of the trials' thread to the dialog, and the answers back."""

    def __init__(self, tell: Callable[[_Step], object], progress: Progress) -> None:
        self.answers: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._tell, self._progress = tell, progress

    @property
    def leader(self) -> StudyLeader:
        """The study leader behind the dialog."""
        return StudyLeader(self._place, self._adjust)

    def _place(self, depth_m: float) -> None:
        self._tell(
            _Step(
                tr(
                    "Put the cube {:g} m from the eyes, with two or three faces towards them."
                ).format(depth_m),
                tr("It is there"),
            )
        )
        while self._answer():
            pass

    def _adjust(self, eye: Eye, shift_m: Float64, draw: Callable[[Float64], None]) -> Float64:
        self._tell(
            _Step(
                tr("{}: move the drawn corners until they cover the cube's.").format(
                    EYE_NAMES[eye]
                ),
                tr("They coincide"),
                is_adjusting=True,
            )
        )
        shift_m = shift_m.copy()
        while move := self._answer():
            shift_m[abs(move) - 1] += STEP_M * (1 if move > 0 else -1)
            draw(shift_m)
        return shift_m

    def _answer(self) -> int:
        """Return the next move, or 0 if the step is done."""
        while True:
            self._progress.check()
            try:
                return self.answers.get(timeout=_POLL_S)
            except queue.Empty:
                continue


class TrialsDialog(QDialog):
    """Leads through the trials of one session: place the cube, adjust φ, for each eye.

    Parameters
    ----------
    entries : UserEntries
        With the session.
    record : callable
        Like `record_user_trials`.

    Attributes
    ----------
    told : Signal(object)
        The next request to the study leader, from the trials' thread.
    """

    told = Signal(object)

    def __init__(
        self,
        entries: UserEntries,
        parent: QWidget | None = None,
        record: Record = record_user_trials,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("trialsDialog")
        self.setWindowTitle(tr("Record trials"))
        self.entries = entries
        self._record = record
        self._desk: _Desk | None = None
        self._step: _Step | None = None
        self._has_session, self._stored = False, ""
        self.form = EntriesForm(UserEntries, ("headset", "cube"))
        self.form.show_entries(entries)
        self._instruction = paragraph("instruction")
        self._found = FindingLine("trials")
        self._bar = JobBar()
        self._start = main_button("start", tr("Start"))
        self._next = main_button("next", tr("They coincide"))
        self._next.setMinimumWidth(self._next.sizeHint().width())
        self._starting, self._going = action_strip(self._start), action_strip(self._next)
        self._close = button("close", tr("&Close"))
        self._table = Table("trials-recorded", tr("Trials recorded"))
        self._table.hide()
        self._moves = {
            name: button(
                name,
                f"{text} {_KEY_SIGNS[name]}",
                text,
                tr("{} ({:g} mm of φ)").format(text, 1e3 * STEP_M),
            )
            for name, (text, *_) in _MOVES.items()
        }
        self.told.connect(self._show_step)
        self.form.changed.connect(self._keep)
        self._start.clicked.connect(self.start)
        self._next.clicked.connect(partial(self._answer, 0))
        for name, move in self._moves.items():
            *_, axis, key = _MOVES[name]
            move.setShortcut(key)
            move.clicked.connect(partial(self._answer, axis))
        self._close.clicked.connect(self.accept)
        self._bar.failed.connect(self._show_failure)
        self._bar.busy_changed.connect(self._refresh)
        self._lay_out()
        self._found.show_finding(self._place_found())
        self._refresh()

    def start(self) -> None:
        """Connect, and begin with the first distance."""
        entries = self.entries
        order = TrialOrder(
            user_path(entries.sessions),
            user_path(entries.cube) if entries.cube else None,
        )
        connect = None if entries.headset == "virtual" else paired_headset

        def work(progress: Progress) -> object:
            self._desk = desk = _Desk(self.told.emit, progress)
            return self._record(order, connect, depth_camera, desk.leader, progress)

        self._table.hide()
        self._stored = ""
        self._bar.run(tr("Waiting for the headset"), work, self._show_trials)

    def done(self, result: int) -> None:
        """Cancel the trials, and close."""
        self._bar.stop()
        super().done(result)

    def _answer(self, move: int) -> None:
        if self._desk is not None and self._step is not None:
            if move == 0:
                is_placed = not self._step.is_adjusting
                self._bar.say(tr("Looking for the cube") if is_placed else tr("Storing the trial"))
                self._step = None
                self._refresh()
            self._desk.answers.put(move)

    def _show_step(self, step: _Step) -> None:
        if self._bar.is_busy:
            self._step = step
            self._bar.wait_for_user()
            self._refresh()

    def _show_trials(self, trials: tuple[Trial, ...]) -> None:
        self._step = None
        self._table.show_rows(
            (tr("Mean error, px"), tr("Mean error, ′")),
            [
                Row(
                    f"{EYE_NAMES[trial.eye]}, {trial.target_depth_m:g} m",
                    (f"{trial.error_px.mean():.1f}", f"{trial.error_arcmin.mean():.1f}"),
                    tr("Mean over the four corners."),
                )
                for trial in trials
            ],
        )
        self._table.show()
        self._stored = tr("trials stored: {}").format(len(trials))
        self._found.show_finding(self._place_found())
        self._refresh()

    def _show_failure(self, why: str) -> None:
        self._step = None
        self._found.show_finding(Finding("", Health.BROKEN, why))
        self._refresh()

    def _place_found(self) -> Finding:
        """Return whose session takes the trials, and what it holds, or why it cannot."""
        folder = user_path(self.entries.sessions)
        self._has_session = os.path.isfile(folder / JOURNAL)
        if not self._has_session:
            return Finding(
                "",
                Health.BROKEN,
                tr("{} is not one session").format(self.entries.sessions),
                tr("close this window and choose the wearer's session under Sessions"),
            )
        try:
            record = Session.open(folder)
        except FileError as error:
            self._has_session = False
            return Finding("", Health.BROKEN, str(error))
        whose = record.wearer or tr("a wearer without a name")
        if record.simulated:
            whose = tr("{} (simulated: {})").format(whose, record.simulated)
        session = tr("the session of {} holds no trial yet").format(whose)
        if record.trials:
            count = pluralize(len(record.trials), tr("trial"), tr("trials"))
            session = tr("the session of {} holds {}; new ones are added").format(whose, count)
        return Finding("", Health.GOOD, self._stored or session, self._stored and session)

    def _keep(self) -> None:
        self.entries = self.form.take(self.entries)

    def _refresh(self) -> None:
        step = self._step if self._bar.is_busy else None
        self.form.setEnabled(not self._bar.is_busy)
        self._starting.setVisible(not self._bar.is_busy)
        self._going.setVisible(self._bar.is_busy)
        self._start.setEnabled(not self._bar.is_busy and self._has_session)
        self._next.setEnabled(step is not None)
        for move in self._moves.values():
            move.setEnabled(step is not None and step.is_adjusting)
        self._next.setText(tr("They coincide") if step is None else step.button)
        first = tr("Let the wearer put the headset on, and start.")
        if self._stored:
            first = tr("The trials are stored. Close, or start again to add others.")
        if self._bar.is_busy:
            first = ""
        self._instruction.setText(first if step is None else step.text)

    def _lay_out(self) -> None:
        scale_font(self._instruction, 1.6, is_bold=True)
        self._instruction.setMinimumHeight(self._instruction.fontMetrics().height())
        pad = with_name(QWidget(), "moves", tr("Moves of φ"))
        grid = QGridLayout(pad)
        grid.setContentsMargins(0, 0, 0, 0)
        for name, move in self._moves.items():
            _, row, column, *_ = _MOVES[name]
            grid.addWidget(move, row, column)
        foot = hbox(self._close, (self._bar, 1), self._starting, self._going, spacing=SPACING_PX)
        vbox(
            self.form,
            self._instruction,
            pad,
            (self._table, 1),
            self._found,
            foot,
            on=self,
            margins=2 * SPACING_PX,
            spacing=SPACING_PX,
        )
