"""The guide: the steps, one sentence, the preconditions, a picture; its buttons are in a bar."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from PySide6.QtCore import QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import QAction, QResizeEvent, QShortcut
from PySide6.QtWidgets import QComboBox, QLabel, QWidget

from handcal.calibration.plan import PlanSettings
from handcal.calibration.states import State
from handcal.core.types import EyePlan
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme, font_px, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.guide.action_bar import ActionBar
from handcal_gui.calibrate.guide.picture import OF_THE_RESULT, GuidePicture
from handcal_gui.calibrate.guide.progress_ring import ProgressRing
from handcal_gui.calibrate.guide.rows import PreconditionRows, StepRail
from handcal_gui.calibrate.guide.steps import Wizard
from handcal_gui.calibrate.guide.view import WEARERS, Action, Step, WizardView
from handcal_gui.calibrate.trials.comparison_row import ComparisonRow
from handcal_gui.widgets.brief import show_briefly
from handcal_gui.widgets.fields import tool_button
from handcal_gui.widgets.layouts import fit_soon, hbox, vbox
from handcal_gui.widgets.sentence import sentence

_ORDERS: dict[EyePlan, str] = {
    "each": tr("One eye after the other"),
    "both": tr("Both eyes at once"),
    "left": tr("Left eye only"),
    "right": tr("Right eye only"),
}
"""The eyes that the paper's plan aligns, and their order."""
_MOST_PRECONDITIONS = 3
_COMPARING = {
    False: tr("The wearer compares two drawings. Record the answer in Trials, or stop comparing."),
    True: tr("The wearer compares two drawings. Record the answer here, or stop comparing."),
}
"""Beside the panels, and in the station, which shows no trials."""
_NO_TRIALS = tr("Trials are recorded once φ is solved, beside the panels: press F11, then T")
_RING_PX = 9 * SPACING_PX, 10 * SPACING_PX, 16 * SPACING_PX
_SENTENCE_SCALE, _ROW_SCALE = (1.2, 1.5, 2.0), (1.0, 1.1, 1.3)
"""Size of the ring and scales of texts: beside panels, without them in a small window, and in a
large one."""
_LARGE_PX, _LARGE_SCALE = (1400, 1100), 1.5
"""Width and height from which the guide has larger texts, and their scale."""
_LOW_WINDOW = 45.5
"""Height of the window, in sizes of the font, below which the guide has smaller gaps, and its
preconditions are side by side; no message may move its buttons."""
_DETAILED, _SEEN = {False: 42.0, True: 33.5}, 29.5
"""Heights of the room for the guide, without its messages, from which its result has details, below
the views of the eyes and beside them, and from which it has these views; in sizes of the font."""
_ARCMIN, _FAR_ARCMIN, _GROWTH = 1.0, 5.0, 0.002
_NUDGES: dict[tuple[str, str], tuple[float, float, float]] = {
    (tr("Move the outline left"), "Left"): (-_ARCMIN, 0.0, 0.0),
    (tr("Move the outline right"), "Right"): (_ARCMIN, 0.0, 0.0),
    (tr("Move the outline up"), "Up"): (0.0, -_ARCMIN, 0.0),
    (tr("Move the outline down"), "Down"): (0.0, _ARCMIN, 0.0),
    (tr("Move the outline far left"), "Shift+Left"): (-_FAR_ARCMIN, 0.0, 0.0),
    (tr("Move the outline far right"), "Shift+Right"): (_FAR_ARCMIN, 0.0, 0.0),
    (tr("Move the outline far up"), "Shift+Up"): (0.0, -_FAR_ARCMIN, 0.0),
    (tr("Move the outline far down"), "Shift+Down"): (0.0, _FAR_ARCMIN, 0.0),
    (tr("Make the outline larger"), "+ ="): (0.0, 0.0, _GROWTH),
    (tr("Make the outline smaller"), "-"): (0.0, 0.0, -_GROWTH),
}
"""Name and keys of each nudge; its movement right and down in arcminutes, and its growth."""
_GO_BACK = {
    "former": (tr("Draw with the previous φ, or with the newest again"), "G"),
    "offline": (tr("Draw with the offline calibration"), "Shift+G"),
}
"""Name and key of each φ that the headset can go back to."""


class WizardPanel(QWidget):
    """Shows a `Wizard` and emits the actions of its buttons.

    Attributes
    ----------
    wizard : Wizard
    bar : ActionBar
        Its buttons, for the window's bottom strip.
    shown : WizardView or None
        The view shown; None before the first snapshot.
    picture : GuidePicture
    comparison : ComparisonRow
        Shown in the station while the wearer compares.
    asked : Signal(Action)
        A button was pressed.
    eyes_chosen : Signal(str)
        A person has chosen the eyes of the paper's plan: an `EyePlan`.
    hold_changed : Signal(bool)
        A person has chosen whether every step waits for a person.
    nudged : Signal(float, float, float)
        The outline of a verification should move to the right and down, in arcminutes, and to grow
        by a share.
    went_back : Signal(str)
        The headset should draw with the φ before the newest, ``"former"``, or with the offline
        calibration, ``"offline"``.
    step_changed : Signal(Step)
        Another step is shown.
    """

    asked = Signal(object)
    step_changed = Signal(object)
    eyes_chosen = Signal(str)
    hold_changed = Signal(bool)
    nudged = Signal(float, float, float)
    went_back = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("wizard")
        self.wizard = Wizard()
        self.shown: WizardView | None = None
        self.picture = GuidePicture()
        self.comparison = ComparisonRow()
        self.comparison.hide()
        self._is_station = self._is_large = False
        self._room = 0
        self._ring = ProgressRing("wizardRing")
        self._hold = self._hold_action()
        self._no_trials = QShortcut("T", self, lambda: show_briefly(self, _NO_TRIALS))
        self._no_trials.setEnabled(False)  # or it would take the key from the trials
        self._nudges = self._nudge_actions()
        self._undo = add_action(
            self, tr("Movement of the outline"), "", lambda: self.asked.emit(Action.UNDO_NUDGE)
        )
        self._undo.setObjectName("undo")
        self._undo.setEnabled(False)
        self._go_back = self._go_back_actions()
        self._rail = StepRail()
        self._title = QLabel()
        self._sentence = QLabel(wordWrap=True, textFormat=Qt.TextFormat.PlainText)
        self._preconditions = PreconditionRows(_MOST_PRECONDITIONS)
        self._fact = QLabel(wordWrap=True, textFormat=Qt.TextFormat.PlainText)
        self._fact.setObjectName("wizardFact")
        self._note = QLabel(wordWrap=True, textFormat=Qt.TextFormat.PlainText)
        self._note.setObjectName("wizardNote")
        self.bar = ActionBar()
        self._eyes: EyePlan | None = None
        self._plan = QComboBox()
        self._plan.setObjectName("wizardPlan")
        self._lay_out()
        self._fit_soon = fit_soon(self._fit, self)
        self.bar.asked.connect(self.asked)
        self._plan.currentIndexChanged.connect(
            lambda index: self.eyes_chosen.emit(list(_ORDERS)[index])
        )
        follow_theme(self, self._refresh)

    def start(self, wizard: Wizard, *, is_held: bool = True) -> None:
        """Switch to another wizard; if it is held, every step waits for a person."""
        self.wizard = wizard
        self.hold(is_held)
        self.shown = self._eyes = None
        self.bar.show_view(None)

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the wizard's view of a snapshot."""
        view = self.wizard.view(snapshot)
        if snapshot.comparing is not None:
            main = replace(view.main, is_enabled=False)
            said = _COMPARING[self._is_station]
            view = replace(view, sentence=said, main=main, others=(), note="", fact="")
        self.comparison.show_comparison(
            snapshot.comparing, has_seen_both=snapshot.has_compared_both, can_begin=False, count=0
        )
        self.comparison.setVisible(self._is_station and snapshot.comparing is not None)
        self.picture.step = view.step
        self._show_eyes(snapshot.plan)
        if view != self.shown:
            before, self.shown = self.shown, view
            self._refresh()
            if before is None or before.step is not view.step:
                self.step_changed.emit(view.step)
            if before is None or before.sentence != view.sentence:
                self.picture.show_snapshot(snapshot)  # before its turn, or it contradicts the text
        self._ring.show_count(*_count(snapshot, view))

    def hold(self, is_held: bool) -> None:
        """Let every step wait for a person, or let steps run automatically."""
        self.wizard.is_held = is_held
        self._hold.setChecked(is_held)
        self._refresh()

    def fill_window(self, is_station: bool, *, is_small: bool) -> None:
        """Use the room of a window without panels, or less, and do without the panels."""
        self._is_station = is_station
        self._no_trials.setEnabled(is_station)
        self._room = (1 if is_small else 2) if is_station else 0
        self._scale_texts()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Enlarge the texts of a guide that is so large that it is read from afar."""
        super().resizeEvent(event)
        least = QSize(*_LARGE_PX)
        is_large = self.size().expandedTo(least) == self.size()
        if is_large != self._is_large:
            self._is_large = is_large
            self._scale_texts()
        self._fit_soon.start()

    def _fit(self) -> None:
        """Leave out what a low window has no room for, or one with messages."""
        said = (one for one in (self._fact, self._note) if not one.isHidden())
        said_px = sum(one.heightForWidth(self._sentence.width()) for one in said)
        height = ((self.parentWidget() or self).height() - said_px) / font_px()
        has_details = height >= _DETAILED[self.picture.is_result_beside]
        is_low = self.window().height() / font_px() < _LOW_WINDOW
        self.picture.fit(has_details=has_details, has_eyes=height >= _SEEN)
        gap_px = SPACING_PX // 2 if is_low else SPACING_PX
        if (layout := self.layout()) is not None:
            layout.setContentsMargins(*3 * (2 * gap_px,), gap_px if is_low else 2 * gap_px)
            layout.setSpacing(gap_px)
        self._rail.set_gap(gap_px // 2)
        self._preconditions.fit(is_low=is_low)

    def _scale_texts(self) -> None:
        larger = _LARGE_SCALE if self._is_large else 1.0
        for texts, scale in (
            ([self._sentence], _SENTENCE_SCALE[self._room]),
            (
                [self._preconditions, self._fact, self._note, self.comparison],
                _ROW_SCALE[self._room],
            ),
            ([self.picture.result], 1.0),
        ):
            font = self.font()
            font.setPointSizeF(larger * scale * font.pointSizeF())
            for text in texts:
                text.setFont(font)
        self._sentence.setMinimumHeight(2 * self._sentence.fontMetrics().lineSpacing() + 2)
        self._ring.set_diameter(round(larger * _RING_PX[self._room]))

    def press_main(self) -> None:
        """Press the main button."""
        self.bar.press_main()

    def _hold_action(self) -> QAction:
        hold = add_action(
            self,
            tr("Hold"),
            "H",
            tooltip=tr("Hold: no step runs automatically; each waits for you (H)"),
        )
        hold.setShortcutContext(Qt.ShortcutContext.WindowShortcut)
        hold.setWhatsThis(tr("Hold the automatic steps, or let them run"))
        hold.setIconText(tr("Hold (H)"))
        hold.setCheckable(True)
        hold.triggered.connect(self._choose_hold)
        return hold

    def _nudge_actions(self) -> list[QAction]:
        """Return the actions that move the outline of a verification the way that keys point."""
        actions = []
        for (name, keys), nudge in _NUDGES.items():
            action = add_action(self, name, keys, partial(self.nudged.emit, *nudge))
            action.setShortcutContext(Qt.ShortcutContext.WindowShortcut)
            action.setEnabled(False)
            actions.append(action)
        return actions

    def _go_back_actions(self) -> list[QAction]:
        """Return the actions that have the headset draw with another φ; the guide is then held."""
        actions = []
        for to, (name, keys) in _GO_BACK.items():
            action = add_action(self, name, keys, partial(self._ask_to_go_back, to))
            action.setShortcutContext(Qt.ShortcutContext.WindowShortcut)
            action.setEnabled(False)
            actions.append(action)
        return actions

    def _ask_to_go_back(self, to: str) -> None:
        self.hold(True)  # or a plan would continue, and send another φ
        self.went_back.emit(to)

    def _choose_hold(self, is_held: bool) -> None:
        self.hold(is_held)
        self.hold_changed.emit(is_held)

    def _lay_out(self) -> None:
        scale_font(self._title, 1.6, is_bold=True)
        self._sentence.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._scale_texts()
        self._note.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._plan.addItems(list(_ORDERS.values()))
        self._plan.setMinimumWidth(12 * SPACING_PX)  # narrower than its longest text
        self._plan.setToolTip(
            tr(
                "One eye after the other measures the position of each eye and takes two "
                "alignments.\n"
                "Both eyes at once is quicker, but cannot measure an eye distance that "
                "differs from "
                "the rig's."
            )
        )
        plan_label = QLabel(tr("E&yes"))
        plan_label.setBuddy(self._plan)
        hold = tool_button(self._hold)
        self._choice = QWidget()
        hbox(plan_label, self._plan, on=self._choice, margins=0, spacing=SPACING_PX)
        head = hbox(self._title, 0, self._choice, self.picture.result.buttons, hold)
        layout = vbox(self._rail, on=self, margins=2 * SPACING_PX, spacing=SPACING_PX)
        layout.addLayout(head)
        self._ring.setToolTip(tr("Alignments made, or eyes verified"))
        said = self._sentence, self._preconditions, self._fact, self._note
        texts = vbox(*said, 0, spacing=SPACING_PX // 2)
        ring = vbox(self._ring, 0)
        layout.addLayout(hbox((texts, 1), ring, spacing=2 * SPACING_PX))
        layout.addWidget(self.comparison)
        layout.addWidget(self.picture, 1)

    def _refresh(self) -> None:
        view = self.shown
        if view is None:
            return
        self._rail.show_step(view)
        self._title.setText(view.step.label)
        self._sentence.setText(view.sentence)
        # The result card gives the verdicts, with their reasons.
        has_card = view.step in OF_THE_RESULT and view.main.action is not Action.VERIFIED
        self._choice.setVisible(view.step not in OF_THE_RESULT and self._eyes is not None)
        self.picture.result.buttons.setVisible(has_card)
        self._preconditions.show_preconditions(
            [one for one in view.preconditions if not (has_card and one.verdict)]
        )
        self._note.setText(sentence(view.note))
        self._note.setStyleSheet(f"color: {colors().red}")
        self._fact.setText(view.fact)
        self._fact.setVisible(bool(view.fact))
        self._note.setVisible(bool(view.note))
        self._fit_soon.start()
        for action in self._nudges:
            action.setEnabled(view.main.action is Action.VERIFIED)
        self._undo.setEnabled(
            any(one.action is Action.UNDO_NUDGE and one.is_enabled for one in view.others)
        )
        for action in self._go_back:
            action.setEnabled(view.step is not Step.CONNECT)
        why_quiet = ""
        if view.main.action in WEARERS:
            why_quiet = tr("The wearer confirms in the headset, or you:")
        self.bar.show_view(view, why_quiet=why_quiet)
        can_choose = view.step in (Step.CONNECT, Step.SHOW_HAND, Step.MAKE_CURSOR)
        if not can_choose:
            self._plan.clearFocus()  # otherwise Qt would pass the focus on
        self._plan.setEnabled(can_choose)

    def show_eyes_again(self) -> None:
        """Show the eyes of the plan with the next snapshot, after a choice that was refused."""
        self._eyes = None

    def _show_eyes(self, plan: PlanSettings) -> None:
        """Show which eyes are aligned, in a plan that leaves it to a person."""
        eyes = plan.eyes if plan.name == "paper" else None
        if eyes != self._eyes:
            self._eyes = eyes
            if eyes is not None:
                with QSignalBlocker(self._plan):
                    self._plan.setCurrentIndex(list(_ORDERS).index(eyes))
            self._refresh()


def _count(snapshot: Snapshot, view: WizardView) -> tuple[int, int, str]:
    """Return the alignments made and planned, or the eyes verified, and their name."""
    procedure, record, plan = snapshot.procedure, snapshot.record, snapshot.plan
    if view.omitted or view.step in OF_THE_RESULT:
        again = {procedure.verifying.eye} if procedure.verifying is not None else set()
        return len(record.verified_now - again), len(plan.usable_eyes), tr("verified")
    done = len(record.alignments)
    is_in_turn = plan.name == "recommended" or plan.in_turn
    planned = len(plan.usable_eyes) if is_in_turn else 1
    if plan.name == "paper":
        planned *= plan.alignments
    return done, max(planned, done + (procedure.state is State.ALIGN)), tr("aligned")
