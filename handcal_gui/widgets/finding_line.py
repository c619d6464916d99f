"""A line that shows a finding and its remedy."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QLabel, QWidget

from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme, icon
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import button, paragraph, with_name
from handcal_gui.widgets.sentence import sentence

_ICONS = {Health.GOOD: "check", Health.LIMITED: "warning", Health.BROKEN: "cross"}
_WORDS = {Health.GOOD: tr("Good"), Health.LIMITED: tr("Note"), Health.BROKEN: tr("Problem")}


class FindingLine(QWidget):
    """Shows a finding by icon and text, with a button to fix it where one click can."""

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(f"{name}Finding")
        self._finding: Finding | None = None
        self._is_waiting = False
        self._mend: Callable[[], object] | None = None
        self._icon = with_name(QLabel(), f"{name}Health")
        self._icon.setFixedSize(2 * SPACING_PX, 2 * SPACING_PX)
        self._text = paragraph(f"{name}Found")
        self._text.setAlignment(Qt.AlignmentFlag.AlignTop)  # beside the icon
        self._text.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self._button = button(f"{name}Fix")
        self._button.hide()
        self._button.clicked.connect(self._click)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, SPACING_PX)
        layout.setSpacing(SPACING_PX)
        layout.addWidget(self._icon, 0, Qt.AlignmentFlag.AlignTop)
        layout.addWidget(self._text, 1)
        layout.addWidget(self._button, 0, Qt.AlignmentFlag.AlignTop)
        follow_theme(self, self._refresh)

    def keep_room(self) -> None:
        """Be as high without a button as with one, so that what is below does not move."""
        gap_px = SPACING_PX // 2  # or a long finding would touch the next field
        layout = self.layout()
        assert layout is not None
        layout.setContentsMargins(0, 0, 0, gap_px)
        self.setMinimumHeight(max(3 * SPACING_PX, self._button.sizeHint().height() + gap_px))

    def clear(self) -> None:
        """Show nothing."""
        self._finding = None
        self._text.clear()
        self._icon.clear()
        self._button.hide()

    def show_finding(
        self,
        finding: Finding,
        fix: str = "",
        mend: Callable[[], object] | None = None,
        *,
        is_waiting: bool = False,
        need: str = "",
    ) -> None:
        """Show a finding; `fix` labels the button that calls `mend`.

        If it waits only for a later step, a clock stands in place of the sign of its health. Its
        advice is followed by what is needed first.
        """
        self._finding, self._mend, self._is_waiting = finding, mend, is_waiting
        parts = filter(None, (finding.found, finding.advice, need))
        self._text.setText(" ".join(map(_full_sentence, parts)))
        self._button.setText(fix)
        self._button.setVisible(bool(fix))
        self._refresh()

    def _refresh(self) -> None:
        if self._finding is None:
            return
        health = self._finding.health
        shades = {
            Health.GOOD: colors().good,
            Health.LIMITED: colors().warning,
            Health.BROKEN: colors().red,
        }
        name, shade, word = _ICONS[health], shades[health], _WORDS[health]
        if self._is_waiting:
            name, shade, word = "wait", colors().muted, tr("Not yet")
        self._icon.setPixmap(icon(name, shade).pixmap(2 * SPACING_PX))
        self._icon.setAccessibleName(word)
        self._icon.setToolTip(word)

    def _click(self) -> None:
        if self._mend is not None:
            self._mend()


def _full_sentence(text: str) -> str:
    return f"{sentence(text)}{'' if text.endswith('.') else '.'}"
