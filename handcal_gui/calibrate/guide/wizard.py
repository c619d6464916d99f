"""The guide: the steps, one sentence, the preconditions, a picture; its buttons are in a bar."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import zip_longest
from typing import Literal

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QAction, QShortcut
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QHBoxLayout,
    QLabel,
    QProgressBar,
    QSizePolicy,
    QWidget,
)

from handcal.calibration.plan import PlanSettings
from handcal.calibration.states import State
from handcal.core.types import EyePlan
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import add_action
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme, icon, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.guide.action_bar import ActionBar
from handcal_gui.calibrate.guide.picture import OF_THE_RESULT, GuidePicture
from handcal_gui.calibrate.guide.steps import Wizard
from handcal_gui.calibrate.guide.view import (
    STEPS,
    WEARERS,
    Action,
    Precondition,
    Step,
    WizardView,
)
from handcal_gui.calibrate.trials.comparison_row import ComparisonRow
from handcal_gui.widgets.brief import show_briefly
from handcal_gui.widgets.fields import tool_button, with_name
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.result_rows import VERDICT_COLORS, VERDICT_ICONS
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
_NO_TRIALS = tr("Trials are recorded once φ is solved, beside the panels: press F11, then T.")
_PROGRESS_PX = 16 * SPACING_PX
_SENTENCE_SCALE, _ROW_SCALE = (1.2, 1.8), (1.0, 1.2)
"""Scales of texts: beside panels, and in the whole window."""
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
_GO_BACK: dict[Literal["former", "offline"], tuple[str, str]] = {
    "former": (tr("Draw with the previous φ, or with the newest again"), "G"),
    "offline": (tr("Draw with the offline calibration"), "Shift+G"),
}
"""Name and key of each φ that the headset can go back to."""


class WizardPanel(QWidget):
    """Shows a `Wizard`; who drives the engine sets what its buttons and keys do.

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
    choose_eyes : callable
        Given the eyes of the paper's plan that a person has chosen.
    remember_hold : callable
        Given whether a person wants every step to wait.
    nudge : callable
        Moves the outline of a verification to the right and down, in arcminutes, and has it grow
        by a share.
    go_back : callable
        Has the headset draw with the φ before the newest, ``"former"``, or with the offline
        calibration, ``"offline"``.
    step_changed : Signal(Step)
        Another step is shown.
    """

    step_changed = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("wizard")
        self.choose_eyes: Callable[[EyePlan], object] = lambda _eyes: None
        self.remember_hold: Callable[[bool], object] = lambda _is_held: None
        self.nudge: Callable[[float, float, float], object] = lambda *_: None
        self.go_back: Callable[[Literal["former", "offline"]], object] = lambda _to: None
        self.wizard = Wizard()
        self.shown: WizardView | None = None
        self.picture = GuidePicture()
        self.comparison = ComparisonRow()
        self.comparison.hide()
        self._is_station = False
        self._progress = with_name(QProgressBar(), "wizardProgress", tr("Progress"))
        self._hold = self._hold_action()
        self._no_trials = QShortcut("T", self, lambda: show_briefly(self, _NO_TRIALS))
        self._no_trials.setEnabled(False)  # or it would take the key from the trials
        self._nudges = self._nudge_actions()
        self._undo = add_action(
            self, tr("Movement of the outline"), "", lambda: self.bar.do(Action.UNDO_NUDGE)
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
        self._plan.currentIndexChanged.connect(lambda index: self.choose_eyes(list(_ORDERS)[index]))
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
            snapshot.comparing, has_seen_both=snapshot.has_compared_both, can_begin=False
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
        done, planned, unit = _count(snapshot, view)
        self._progress.setRange(0, planned)
        self._progress.setValue(done)
        self._progress.setFormat(f"{done}/{planned} {unit}")

    def hold(self, is_held: bool) -> None:
        """Let every step wait for a person, or let steps run automatically."""
        self.wizard.is_held = is_held
        self._hold.setChecked(is_held)
        self._refresh()

    def use_whole_window(self, is_station: bool) -> None:
        """Use the room of a window without panels, and do without the panels."""
        self._is_station = is_station
        self._no_trials.setEnabled(is_station)
        for texts, scales in (
            ([self._sentence], _SENTENCE_SCALE),
            (
                [self._preconditions, self._fact, self._note, self.comparison, self._progress],
                _ROW_SCALE,
            ),
        ):
            font = self.font()
            font.setPointSizeF(scales[is_station] * font.pointSizeF())
            for text in texts:
                text.setFont(font)

    def add_switch(self, station: QAction) -> None:
        """Offer to show only the guide, beside what holds the steps."""
        self._head.addWidget(tool_button(station))

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
            action = add_action(self, name, keys, partial(self._move, nudge))
            action.setShortcutContext(Qt.ShortcutContext.WindowShortcut)
            action.setEnabled(False)
            actions.append(action)
        return actions

    def _move(self, nudge: tuple[float, float, float]) -> None:
        self.nudge(*nudge)

    def _go_back_actions(self) -> list[QAction]:
        """Return the actions that have the headset draw with another φ; the guide is then held."""
        actions = []
        for to, (name, keys) in _GO_BACK.items():
            action = add_action(self, name, keys, partial(self._ask_to_go_back, to))
            action.setShortcutContext(Qt.ShortcutContext.WindowShortcut)
            action.setEnabled(False)
            actions.append(action)
        return actions

    def _ask_to_go_back(self, to: Literal["former", "offline"]) -> None:
        self.hold(True)  # or a plan would continue, and send another φ
        self.go_back(to)

    def _choose_hold(self, is_held: bool) -> None:
        self.hold(is_held)
        self.remember_hold(is_held)

    def _lay_out(self) -> None:
        scale_font(self._title, 1.6, is_bold=True)
        self._sentence.setAlignment(Qt.AlignmentFlag.AlignTop)
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
        self._head = hbox(self._title, 0, self._choice, self.picture.result.buttons, hold)
        layout = vbox(self._rail, on=self, margins=2 * SPACING_PX, spacing=SPACING_PX)
        layout.addLayout(self._head)
        self._progress.setToolTip(tr("Alignments made, or eyes verified"))
        self._progress.setFixedWidth(_PROGRESS_PX)
        said = self._sentence, self._preconditions, self._fact, self._note
        texts = vbox(*said, 0, spacing=SPACING_PX // 2)
        progress = vbox(self._progress, 0)
        layout.addLayout(hbox((texts, 1), progress, spacing=2 * SPACING_PX))
        layout.addWidget(self.comparison)
        layout.addWidget(self.picture, 1)
        self.use_whole_window(False)

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
        verified = set(record.facts.verified) & set(plan.usable_eyes)
        return len(verified), len(plan.usable_eyes), tr("eyes verified")
    done = len(record.alignments)
    is_in_turn = plan.name == "recommended" or plan.in_turn
    planned = len(plan.usable_eyes) if is_in_turn else 1
    if plan.name == "paper":
        planned *= plan.alignments
    return done, max(planned, done + (procedure.state is State.ALIGN)), tr("aligned")


class StepRail(QWidget):
    """The steps in a row, the current one emphasised."""

    def __init__(self) -> None:
        super().__init__()
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(SPACING_PX // 2)
        self._labels = {step: QLabel(alignment=Qt.AlignmentFlag.AlignCenter) for step in STEPS}
        for label in self._labels.values():
            scale_font(label, 0.85)
            label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            layout.addWidget(label)

    def show_step(self, view: WizardView) -> None:
        """Emphasise the step of a view, and mark those before it."""
        present = view.step
        place = STEPS.index(present)
        for i, (step, label) in enumerate(self._labels.items()):
            is_over = view.main.action is Action.NEXT_WEARER
            is_done = (i < place or is_over) and step not in view.omitted
            is_done &= view.is_aligned or step is not Step.ALIGN
            mark, color = ("✓ ", colors().good) if is_done else ("", colors().muted)
            if step in view.unearned:
                mark, color = "– ", colors().warning
            label.setText(f"{mark}{step.label}")
            if step is present:
                label.setText(f"{'✓' if is_over else '▸'} {step.label}")
                # A change of the theme reaches this widget's own palette only later.
                color = QApplication.palette().windowText().color().name()
            weight = "bold" if step is present else "normal"
            label.setStyleSheet(f"color: {color}; font-weight: {weight}")


class PreconditionRows(QWidget):
    """Preconditions, one below the other.

    Parameters
    ----------
    most : int
        Largest number of preconditions.
    """

    def __init__(self, most: int) -> None:
        super().__init__()
        self._rows = [_Row() for _ in range(most)]
        vbox(*self._rows, on=self, margins=0, spacing=SPACING_PX // 2)

    def show_preconditions(self, preconditions: Sequence[Precondition]) -> None:
        """Replace the preconditions."""
        for row, shown in zip_longest(self._rows, preconditions):
            row.show_precondition(shown)
        self.setVisible(bool(preconditions))


class _Row(QWidget):
    """One precondition: an icon, and a text."""

    def __init__(self) -> None:
        super().__init__()
        self._icon = QLabel()
        self._text = QLabel(wordWrap=True, textFormat=Qt.TextFormat.PlainText)
        hbox(self._icon, (self._text, 1), on=self, margins=0, spacing=SPACING_PX)

    def show_precondition(self, shown: Precondition | None) -> None:
        """Show a precondition, with the icon of its verdict if it has one; None hides the row."""
        self.setVisible(shown is not None)
        if shown is None:
            return
        name, word = ("check", tr("Yes")) if shown.holds else ("wait", tr("Not yet"))
        shade = colors().good if shown.holds else colors().muted
        if shown.verdict is not None:
            name, word = VERDICT_ICONS[shown.verdict], shown.verdict.capitalize()
            shade = getattr(colors(), VERDICT_COLORS[shown.verdict])
        self._icon.setPixmap(icon(name, shade).pixmap(2 * SPACING_PX))
        self._icon.setAccessibleName(word)
        self._text.setText(shown.text)
