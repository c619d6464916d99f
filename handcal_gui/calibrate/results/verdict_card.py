"""The verdict on one eye: symbol, word and reason."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QFrame, QLabel, QWidget

from handcal.core.types import Eye
from handcal.register.results import Results
from handcal.session.judged_trials import EyeTrials
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.result_rows import (
    EYE_NAMES,
    NOTHING,
    verdict_color,
    verdict_reason,
    verdict_word,
)

_REASON_LINES = 4


class VerdictCard(QFrame):
    """Shows the verdict on one eye; its height does not depend on the reason."""

    def __init__(self, eye: Eye, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName(f"verdict-{eye}")
        self.setFrameShape(QFrame.Shape.StyledPanel)
        self._eye = eye
        self._shade = ""
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

    def show_verdict(self, results: Results | None, trials: EyeTrials | None = None) -> None:
        """Show the eye's verdict, with the doubt that its trials cast on it."""
        eye = self._eye
        if results is None or eye not in results.verdicts:
            self._shade = ""
            self._word.setText(tr("{} Not solved").format(NOTHING))
            self._reason.setText(tr("Not in any alignment"))
        else:
            self._shade = verdict_color(results.verdicts[eye].name, trials)
            self._word.setText(verdict_word(results, eye, trials))
            self._reason.setText(verdict_reason(results, eye, trials))
        self.setToolTip(self._reason.text())
        self.setAccessibleDescription(self._reason.text())
        self._recolor()

    def show_reason(self, is_shown: bool) -> None:
        """Show the reason below the verdict, or only in the tooltip."""
        self._reason.setVisible(is_shown)

    def _recolor(self) -> None:
        palette = QPalette(self.palette())
        if self._shade:
            palette.setColor(QPalette.ColorRole.WindowText, QColor(getattr(colors(), self._shade)))
        self._word.setPalette(palette)
