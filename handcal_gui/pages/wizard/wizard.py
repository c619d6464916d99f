"""The wizard's page: the steps, one sentence, the preconditions; its buttons are in a bar."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QLabel,
    QSizePolicy,
    QWidget,
)

from handcal.station.snapshot import Snapshot
from handcal.types import EyePlan
from handcal_gui.pages.wizard.action_bar import ActionBar
from handcal_gui.pages.wizard.steps import PLANS, STEPS, Precondition, Step, Wizard, WizardView
from handcal_gui.theme import SPACING_PX, colors, follow_theme, icon, scale_font
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.result_rows import VERDICT_COLORS, VERDICT_ICONS

_MOST_CHECKS = 3


class WizardPanel(QWidget):
    """Shows a `Wizard` and emits the actions of its buttons.

    Attributes
    ----------
    wizard : Wizard
    bar : ActionBar
        Its buttons, for the window's bottom strip.
    shown : WizardView or None
        The view shown; None before the first snapshot.
    asked : Signal(Action)
        A button was pressed.
    plan_changed : Signal(str)
    step_changed : Signal(Step)
        Another step is shown.
    """

    asked = Signal(object)
    step_changed = Signal(object)
    plan_changed = Signal(str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("wizard")
        self.wizard = Wizard()
        self.shown: WizardView | None = None
        self._rail = _Rail()
        self._title = QLabel()
        self._sentence = QLabel(wordWrap=True)
        self._checks = [_CheckRow() for _ in range(_MOST_CHECKS)]
        self._note = QLabel(wordWrap=True)
        self._note.setObjectName("wizardNote")
        self.bar = ActionBar()
        self._plan = QComboBox()
        self._plan.setObjectName("wizardPlan")
        self._lay_out()
        self.bar.asked.connect(self.asked)
        self._plan.currentIndexChanged.connect(self._choose_plan)
        follow_theme(self, self._refresh)

    def start(self, wizard: Wizard) -> None:
        """Switch to another wizard."""
        self.wizard = wizard
        self._plan.setCurrentText(PLANS[wizard.plan])
        self.shown = None
        self.bar.show_view(None)

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the wizard's view of a snapshot."""
        view = self.wizard.view(snapshot)
        if view != self.shown:
            before, self.shown = self.shown, view
            self._refresh()
            if before is None or before.step is not view.step:
                self.step_changed.emit(view.step)

    def press_main(self) -> None:
        """Press the main button."""
        self.bar.press_main()

    def _lay_out(self) -> None:
        scale_font(self._title, 1.6, is_bold=True)
        scale_font(self._sentence, 1.2)
        self._sentence.setAlignment(Qt.AlignmentFlag.AlignTop)
        # Always two lines, so that the widgets below do not move.
        self._sentence.setMinimumHeight(2 * self._sentence.fontMetrics().lineSpacing() + 2)
        self._note.setMinimumHeight(2 * self._note.fontMetrics().lineSpacing() + 2)
        self._note.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._plan.addItems(list(PLANS.values()))
        self._plan.setToolTip(
            "One eye after the other measures the position of each eye and takes two alignments.\n"
            "Both eyes at once is quicker, but cannot measure an eye distance that differs from "
            "the rig's."
        )
        plan_label = QLabel("E&yes")
        plan_label.setBuddy(self._plan)
        plan = hbox(self._title, 0, plan_label, self._plan)
        layout = vbox(self._rail, on=self, margins=2 * SPACING_PX, spacing=SPACING_PX)
        layout.addSpacing(SPACING_PX)
        layout.addLayout(plan)
        layout.addWidget(self._sentence)
        layout.addSpacing(SPACING_PX // 2)
        for row in self._checks:
            layout.addWidget(row)
        layout.addWidget(self._note)
        layout.addStretch()

    def _refresh(self) -> None:
        view = self.shown
        if view is None:
            return
        self._rail.show_step(view.step)
        self._title.setText(view.step.value)
        self._sentence.setText(view.sentence)
        for i, row in enumerate(self._checks):
            row.show_check(view.checks[i] if i < len(view.checks) else None)
        self._note.setText(view.note)
        self._note.setStyleSheet(f"color: {colors().red}")
        self.bar.show_view(view)
        can_choose = view.step in (Step.CONNECT, Step.SHOW_HAND, Step.MAKE_CURSOR)
        if not can_choose:
            self._plan.clearFocus()  # otherwise Qt would pass the focus on
        self._plan.setEnabled(can_choose)

    def _choose_plan(self, index: int) -> None:
        plan: EyePlan = list(PLANS)[index]
        self.wizard.plan = plan
        self.plan_changed.emit(plan)


class _Rail(QWidget):
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

    def show_step(self, present: Step) -> None:
        place = STEPS.index(present)
        for i, (step, label) in enumerate(self._labels.items()):
            mark = "✓ " if i < place else ""
            color = colors().good if i < place else colors().muted
            label.setText(f"{mark}{step.value}")
            if step is present:
                label.setText(f"▸ {step.value}")
                color = self.palette().windowText().color().name()
            weight = "bold" if step is present else "normal"
            label.setStyleSheet(f"color: {color}; font-weight: {weight}")


class _CheckRow(QWidget):
    """One precondition: an icon, and a text."""

    def __init__(self) -> None:
        super().__init__()
        self._icon = QLabel()
        self._text = QLabel(wordWrap=True)
        hbox(self._icon, (self._text, 1), on=self, margins=0, spacing=SPACING_PX)
        self.setMinimumHeight(3 * SPACING_PX)

    def show_check(self, check: Precondition | None) -> None:
        self.setVisible(check is not None)
        if check is None:
            return
        name, word = ("check", "Yes") if check.holds else ("wait", "Not yet")
        shade = colors().good if check.holds else colors().muted
        if check.verdict is not None:
            name, word = VERDICT_ICONS[check.verdict], check.verdict.capitalize()
            shade = getattr(colors(), VERDICT_COLORS[check.verdict])
        self._icon.setPixmap(icon(name, shade).pixmap(2 * SPACING_PX))
        self._icon.setAccessibleName(word)
        self._text.setText(check.text)
