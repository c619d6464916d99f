"""The wizard's face: the steps, one sentence, what is still missing, and the buttons."""

from __future__ import annotations

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QLabel,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from handcal.station.snapshot import Snapshot
from handcal.types import EyePlan
from handcal_gui.pages.wizard.steps import PLANS, STEPS, Check, Offer, Step, View, Wizard
from handcal_gui.theme import SPACING_PX, colors, icon, scale_font
from handcal_gui.widgets.fields import button, main_button

_MOST_CHECKS = 3
_MOST_OTHERS = 3


class WizardPanel(QWidget):
    """Shows a `Wizard` and asks for what it offers.

    Attributes
    ----------
    wizard : Wizard
    shown : View or None
        What it says now; None before the first snapshot.
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
        self.shown: View | None = None
        self._rail = _Rail()
        self._title = QLabel()
        self._sentence = QLabel(wordWrap=True)
        self._checks = [_CheckRow() for _ in range(_MOST_CHECKS)]
        self._note = QLabel(wordWrap=True)
        self._note.setObjectName("wizardNote")
        self._main = main_button("wizardMain")
        self._others = [button(f"wizardOther{i}", "") for i in range(_MOST_OTHERS)]
        self._plan = QComboBox()
        self._plan.setObjectName("wizardPlan")
        self._lay_out()
        self._main.clicked.connect(lambda: self._ask(self.shown.main if self.shown else None))
        for i, other in enumerate(self._others):
            other.clicked.connect(lambda _checked=False, i=i: self._ask_other(i))
        self._plan.currentIndexChanged.connect(self._choose_plan)

    def start(self, wizard: Wizard) -> None:
        """Show another wizard from now on."""
        self.wizard = wizard
        self._plan.setCurrentText(PLANS[wizard.plan])
        self.shown = None

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show what the wizard says of a snapshot."""
        view = self.wizard.view(snapshot)
        if view != self.shown:
            before, self.shown = self.shown, view
            self._refresh(view)
            if before is None or before.step is not view.step:
                self.step_changed.emit(view.step)

    def press_main(self) -> None:
        """Do what the main button does."""
        self._main.click()

    def changeEvent(self, event: QEvent) -> None:
        """Redraw icons when the colours change."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and self.shown is not None:
            self._refresh(self.shown)

    def _lay_out(self) -> None:
        scale_font(self._title, 1.6, is_bold=True)
        scale_font(self._sentence, 1.2)
        self._sentence.setAlignment(Qt.AlignmentFlag.AlignTop)
        # Two lines always, so that what is below stays where it is.
        self._sentence.setMinimumHeight(2 * self._sentence.fontMetrics().lineSpacing() + 2)
        self._note.setMinimumHeight(2 * self._note.fontMetrics().lineSpacing() + 2)
        self._note.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._plan.addItems(list(PLANS.values()))
        self._plan.setToolTip(
            "One eye after the other tells each eye's place, and takes two alignments.\n"
            "Both eyes at once is quicker, but cannot tell an eye distance that differs from the "
            "rig's."
        )
        plan_label = QLabel("E&yes")
        plan_label.setBuddy(self._plan)
        plan = QHBoxLayout()
        plan.addWidget(self._title)
        plan.addStretch()
        plan.addWidget(plan_label)
        plan.addWidget(self._plan)
        others = QHBoxLayout()
        for other in self._others:
            others.addWidget(other)
        others.addStretch()
        others.addStrut(self._others[0].sizeHint().height())
        layout = QVBoxLayout(self)
        layout.setContentsMargins(*4 * (2 * SPACING_PX,))
        layout.setSpacing(SPACING_PX)
        layout.addWidget(self._rail)
        layout.addSpacing(SPACING_PX)
        layout.addLayout(plan)
        layout.addWidget(self._sentence)
        layout.addSpacing(SPACING_PX // 2)
        for row in self._checks:
            layout.addWidget(row)
        layout.addWidget(self._note)
        layout.addWidget(self._main)
        layout.addLayout(others)
        layout.addStretch()

    def _refresh(self, view: View) -> None:
        self._rail.show_step(view.step)
        self._title.setText(view.step.value)
        self._sentence.setText(view.sentence)
        for i, row in enumerate(self._checks):
            row.show_check(view.checks[i] if i < len(view.checks) else None)
        self._note.setText(view.note)
        self._note.setStyleSheet(f"color: {colors().red}")
        self._main.setText(view.main.label)
        self._main.setEnabled(view.main.is_enabled)
        self._main.setToolTip("Space bar")
        for i, other in enumerate(self._others):
            other.setVisible(i < len(view.others))
            if i < len(view.others):
                other.setText(view.others[i].label)
                other.setEnabled(view.others[i].is_enabled)
        self._plan.setEnabled(view.step in (Step.CONNECT, Step.SHOW_HAND, Step.MAKE_CURSOR))

    def _ask(self, offer: Offer | None) -> None:
        if offer is not None and offer.is_enabled:
            self.asked.emit(offer.action)

    def _ask_other(self, i: int) -> None:
        if self.shown is not None and i < len(self.shown.others):
            self._ask(self.shown.others[i])

    def _choose_plan(self, index: int) -> None:
        plan: EyePlan = list(PLANS)[index]
        self.wizard.plan = plan
        self.plan_changed.emit(plan)


class _Rail(QWidget):
    """The steps in a row, the present one emphasised."""

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
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(SPACING_PX)
        layout.addWidget(self._icon)
        layout.addWidget(self._text, 1)
        self.setMinimumHeight(3 * SPACING_PX)

    def show_check(self, check: Check | None) -> None:
        if check is None:
            self._icon.clear()
            self._text.clear()
            return
        name, word = ("check", "Yes") if check.holds else ("wait", "Not yet")
        shade = colors().good if check.holds else colors().muted
        self._icon.setPixmap(icon(name, shade).pixmap(2 * SPACING_PX))
        self._icon.setAccessibleName(word)
        self._text.setText(check.text)
