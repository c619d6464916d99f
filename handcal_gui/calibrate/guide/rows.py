"""Rows of the guide: its steps, and the preconditions of the present one."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest

from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import (
    QApplication,
    QBoxLayout,
    QHBoxLayout,
    QLabel,
    QSizePolicy,
    QWidget,
)

from handcal_gui.app.theme import SPACING_PX, colors, icon, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.guide.view import STEPS, Action, Precondition, Step, WizardView
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.result_rows import VERDICT_COLORS, VERDICT_ICONS

_IN_TWO_LINES = 0.65
"""Share of a row's width with which its text takes two lines."""


class StepRail(QWidget):
    """The steps in a row, the current one emphasised."""

    def __init__(self) -> None:
        super().__init__()
        self._row = layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        self._labels = {step: QLabel(alignment=Qt.AlignmentFlag.AlignCenter) for step in STEPS}
        for label in self._labels.values():
            scale_font(label, 0.85)
            label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            layout.addWidget(label)

    def set_gap(self, gap_px: int) -> None:
        """Set the gap between steps."""
        self._row.setSpacing(gap_px)

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
            # Shares as wide as their texts at their widest: gaps are alike, and no step moves.
            font = label.font()
            font.setBold(True)
            self._row.setStretch(i, QFontMetrics(font).horizontalAdvance(f"▸ {step.label}"))
            if step is present:
                label.setText(f"{'✓' if is_over else '▸'} {step.label}")
                # A change of the theme reaches this widget's own palette only later.
                color = QApplication.palette().windowText().color().name()
            weight = "bold" if step is present else "normal"
            label.setStyleSheet(f"color: {color}; font-weight: {weight}")


class PreconditionRows(QWidget):
    """Preconditions, one below the other, or side by side where there is little height.

    Parameters
    ----------
    most : int
        Largest number of preconditions.
    """

    def __init__(self, most: int) -> None:
        super().__init__()
        self._rows = [_Row() for _ in range(most)]
        self._box = vbox(*self._rows, on=self, margins=0, spacing=SPACING_PX // 2)

    def show_preconditions(self, preconditions: Sequence[Precondition]) -> None:
        """Replace the preconditions."""
        for row, shown in zip_longest(self._rows, preconditions):
            row.show_precondition(shown)
        self.setVisible(bool(preconditions))

    def fit(self, *, is_low: bool) -> None:
        """Put the preconditions side by side in a low window, if each has room for its text.

        The longest may take two lines, so that it does not move the picture while it changes.
        """
        needed_px = [0 if row.isHidden() else row.needed_px for row in self._rows]
        if sum(needed_px) > self.width():
            longest = needed_px.index(max(needed_px))
            needed_px[longest] = round(_IN_TWO_LINES * needed_px[longest])
        is_beside = is_low and sum(needed_px) <= self.width()
        directions = QBoxLayout.Direction
        self._box.setDirection(directions.LeftToRight if is_beside else directions.TopToBottom)
        for i, (row, one_px) in enumerate(zip(self._rows, needed_px, strict=True)):
            row.set_lines(2 if is_beside else 1)
            self._box.setStretch(i, one_px if is_beside else 0)


class _Row(QWidget):
    """One precondition: an icon, and a text."""

    def __init__(self) -> None:
        super().__init__()
        self._icon = QLabel()
        self._text = QLabel(wordWrap=True, textFormat=Qt.TextFormat.PlainText)
        hbox(self._icon, (self._text, 1), on=self, margins=0, spacing=SPACING_PX)
        self.set_lines(1)

    def set_lines(self, lines: int) -> None:
        """Have room for as many lines of text."""
        least_px = lines * self._text.fontMetrics().lineSpacing()
        self.setMinimumHeight(max(3 * SPACING_PX, least_px))

    @property
    def needed_px(self) -> int:
        """Width with the text in one line, and with a gap to the next precondition."""
        return 4 * SPACING_PX + self._text.fontMetrics().horizontalAdvance(self._text.text())

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
