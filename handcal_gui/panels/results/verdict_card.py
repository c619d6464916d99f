"""The verdict on one eye: symbol, word and reason."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QFrame, QLabel, QWidget

from handcal.types import Eye, Verdict
from handcal_gui.theme import SPACING_PX, colors, follow_theme, scale_font
from handcal_gui.translation import tr
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.result_rows import EYE_NAMES, NOTHING, VERDICT_COLORS, VERDICT_WORDS
from handcal_gui.widgets.sentence import sentence

_REASON_LINES = 4


class VerdictCard(QFrame):
    """Shows the verdict on one eye; its height does not depend on the reason."""

    def __init__(self, eye: Eye, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(f"verdict-{eye}")
        self.setFrameShape(QFrame.Shape.StyledPanel)
        self._verdict: Verdict | None = None
        self._word = QLabel()
        scale_font(self._word, 1.25, is_bold=True)
        self._reason = QLabel()
        self._reason.setTextFormat(Qt.TextFormat.PlainText)
        self._reason.setWordWrap(True)
        self._reason.setAlignment(Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignLeft)
        self._reason.setMinimumHeight(_REASON_LINES * self._reason.fontMetrics().lineSpacing())
        vbox(
            QLabel(EYE_NAMES[eye]),
            self._word,
            (self._reason, 1),
            on=self,
            margins=(SPACING_PX, SPACING_PX // 2, SPACING_PX, SPACING_PX // 2),
            spacing=SPACING_PX // 2,
        )
        self.show_verdict(None)
        follow_theme(self, self._recolor)

    def show_verdict(self, verdict: Verdict | None, word: str = "") -> None:
        """Show a verdict, by its own or another word; None if the eye is in no alignment."""
        self._verdict = verdict
        if verdict is None:
            self._word.setText(tr("{} Not solved").format(NOTHING))
            self._reason.setText(tr("Not in any alignment"))
        else:
            self._word.setText(word or VERDICT_WORDS[verdict.name])
            self._reason.setText(sentence(verdict.reason))
        self.setToolTip(self._reason.text())
        self.setAccessibleDescription(self._reason.text())
        self._recolor()

    def show_reason(self, is_shown: bool) -> None:
        """Show the reason below the verdict, or only in the tooltip."""
        self._reason.setVisible(is_shown)

    def _recolor(self) -> None:
        palette = QPalette(self.palette())
        if self._verdict is not None:
            color = QColor(getattr(colors(), VERDICT_COLORS[self._verdict.name]))
            palette.setColor(QPalette.ColorRole.WindowText, color)
        self._word.setPalette(palette)
