"""The result card: for each eye the error before and after, the lab's target and the verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QGridLayout, QLabel, QSizePolicy, QWidget

from handcal.core.types import EYES, Eye, phi_text
from handcal.register.results import USED, Results
from handcal.session.judged_trials import EyeTrials
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import paragraph
from handcal_gui.widgets.layouts import vbox
from handcal_gui.widgets.result_rows import (
    EYE_NAMES,
    verdict_color,
    verdict_reason,
    verdict_word,
)


@dataclass(frozen=True, slots=True)
class Bar:
    """One error of an eye."""

    name: str
    arcmin: float | None
    """None if it was not measured."""
    is_judged: bool = True
    """False for an error that the target does not concern."""
    absent: str = ""
    """Text instead of an error that was not measured."""

    @property
    def text(self) -> str:
        """The error with its unit."""
        return self.absent if self.arcmin is None else f"{self.arcmin:.1f}′"


@dataclass(frozen=True, slots=True)
class EyeResult:
    """The result of one eye."""

    eye: Eye
    shade: str
    """Name of the theme's colour for the verdict."""
    word: str
    reason: str
    bars: tuple[Bar, ...]
    details: tuple[str, ...]
    """Error in depth without the calibration and with it, and the effect of one more alignment."""


def eye_results(results: Results, trials: Mapping[Eye, EyeTrials] = {}) -> list[EyeResult]:
    """Return the result of each solved eye, with the doubt that its trials cast on it."""
    found = []
    for eye in EYES:
        if eye not in results.eyes:
            continue
        benefit, verdict = results.benefits[eye], results.verdicts[eye]
        is_used = verdict.name in USED
        before = Bar(tr("Before, expected"), benefit.without_arcmin, is_judged=False)
        after_name = tr("After, expected") if is_used else tr("This result, not used")
        if (verified := results.verified.get(eye)) is not None:
            after = Bar(after_name, verified.now_arcmin, is_used)
            bars = [before, Bar(tr("Verification found"), verified.before_arcmin), after]
        else:
            after = Bar(after_name, benefit.after_arcmin, is_used)
            bars = [before, after, Bar(tr("Verification"), None, absent=tr("not verified"))]
        if trials:
            bars.append(_trials_bar(trials.get(eye)))
            bars.sort(key=lambda bar: bar.arcmin is None)  # the target's line ends before these
        another = tr("One more alignment: {:.1f}′ expected").format(
            results.expected_after_another_arcmin[eye]
        )
        details = (tr("Depth error: {}").format(benefit.depth), another) if is_used else ()
        given = results, eye, trials.get(eye)
        word, reason = verdict_word(*given), verdict_reason(*given)
        shade = verdict_color(verdict.name, trials.get(eye))
        found.append(EyeResult(eye, shade, word, reason, tuple(bars), details))
    return found


def _trials_bar(found: EyeTrials | None) -> Bar:
    if found is None:
        return Bar(tr("Trials"), None, absent=tr("none of this φ"))
    return Bar(tr("Trials, n = {}").format(found.count), found.mean_arcmin)


def result_text(
    results: Results,
    target_arcmin: float,
    head: Mapping[str, str] = {},
    trials: Mapping[Eye, EyeTrials] = {},
) -> str:
    """Return the card as plain text, one fact a line.

    Parameters
    ----------
    results : Results
    target_arcmin : float
        The lab's target.
    head : mapping of str to str
        Facts shown first, such as the wearer.
    trials : mapping of Eye to EyeTrials
    """
    lines = [f"{name}: {value}" for name, value in head.items()]
    lines.append(tr("Target: {:.1f}′").format(target_arcmin))
    for one in eye_results(results, trials):
        lines += ["", f"{EYE_NAMES[one.eye]}: {one.word}", one.reason]
        lines.append(tr("Solved: {}").format(phi_text(results.eyes[one.eye])))
        lines += [f"{bar.name}: {bar.text}" for bar in one.bars]
        lines += one.details
    return "\n".join(lines)


class ResultCard(QWidget):
    """Shows the result of each eye, side by side."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("resultCard")
        self.setAccessibleName(tr("Result"))
        self._columns = {eye: _Column(eye) for eye in EYES}
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(2 * SPACING_PX)
        for i, column in enumerate(self._columns.values()):
            grid.addWidget(column, 0, i)
            grid.setColumnStretch(i, 1)
        follow_theme(self, self._refresh)

    def show_results(
        self,
        results: Results | None,
        target_arcmin: float,
        trials: Mapping[Eye, EyeTrials] = {},
    ) -> None:
        """Show results; without any, the card is empty."""
        found = {one.eye: one for one in eye_results(results, trials)} if results else {}
        widest = max((b.arcmin or 0.0 for one in found.values() for b in one.bars), default=0.0)
        scale_arcmin = 1.1 * max(widest, target_arcmin)
        for eye, column in self._columns.items():
            column.show_result(found.get(eye), target_arcmin, scale_arcmin)
        text = result_text(results, target_arcmin, trials=trials) if results else ""
        self.setAccessibleDescription(text)

    def show_details(self, is_shown: bool) -> None:
        """Show the error in depth and the effect of another alignment, or leave them out."""
        for column in self._columns.values():
            column.details.setVisible(is_shown)

    def _refresh(self) -> None:
        for column in self._columns.values():
            column.refresh()


class _Column(QWidget):
    """One eye: verdict, bars, depth, effect of another alignment, reason."""

    def __init__(self, eye: Eye) -> None:
        super().__init__()
        self._eye = eye
        self._result: EyeResult | None = None
        self._verdict = QLabel()
        self._verdict.setObjectName(f"card-verdict-{eye}")
        bold = QFont()
        bold.setBold(True)
        self._verdict.setFont(bold)  # its size is the card's
        self._bars = _Bars()
        self.details = QLabel(wordWrap=True)
        self._reason = paragraph(f"card-reason-{eye}")
        self._reason.setAlignment(Qt.AlignmentFlag.AlignTop)
        vbox(
            self._verdict,
            self._bars,
            self.details,
            (self._reason, 1),
            on=self,
            margins=0,
            spacing=SPACING_PX // 2,
        )

    def show_result(
        self, result: EyeResult | None, target_arcmin: float, scale_arcmin: float
    ) -> None:
        self._result = result
        word = tr("– Not solved") if result is None else result.word
        self._verdict.setText(f"{EYE_NAMES[self._eye]}: {word}")
        self._reason.setText(result.reason if result else "")
        self.details.setText("\n".join(result.details) if result else "")
        self._bars.show_bars(result, target_arcmin, scale_arcmin)
        self.refresh()

    def refresh(self) -> None:
        """Take the colours of the theme; style sheets would keep the size of the text."""
        shade = self._result.shade if self._result else "muted"
        for label, role in ((self._verdict, shade), (self.details, "muted")):
            palette = QPalette()
            palette.setColor(QPalette.ColorRole.WindowText, QColor(getattr(colors(), role)))
            label.setPalette(palette)
        self._bars.update()


class _Bars(QWidget):
    """Bars below one another on one scale, with a line at the target."""

    def __init__(self) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._result: EyeResult | None = None
        self._target = self._scale = 1.0

    def show_bars(
        self, result: EyeResult | None, target_arcmin: float, scale_arcmin: float
    ) -> None:
        self._result, self._target, self._scale = result, target_arcmin, scale_arcmin
        self.updateGeometry()
        self.update()

    def sizeHint(self) -> QSize:
        lines = 1 + (len(self._result.bars) if self._result else 3)
        return QSize(26 * SPACING_PX, lines * self._line_px())

    def minimumSizeHint(self) -> QSize:
        return self.sizeHint()

    def paintEvent(self, _: QPaintEvent) -> None:
        if self._result is None:
            return
        bars = self._result.bars
        painter = QPainter(self)
        line, metrics = self._line_px(), self.fontMetrics()
        name_px = max(metrics.horizontalAdvance(b.name) for b in bars) + SPACING_PX
        text_px = metrics.horizontalAdvance("888.8′") + SPACING_PX
        room = max(self.width() - name_px - text_px, 1)
        text = self.palette().windowText().color()
        good, late = QColor(colors().good), QColor(colors().warning)
        for i, bar in enumerate(bars):
            top = i * line
            painter.setPen(text)
            row = QRectF(0, top, self.width(), line)
            painter.drawText(row, Qt.AlignmentFlag.AlignVCenter, bar.name)
            length = room * (bar.arcmin or 0.0) / self._scale
            if bar.arcmin is not None:
                shade = good if bar.arcmin <= self._target else late
                painter.fillRect(
                    QRectF(name_px, top + line * 0.2, length, line * 0.6),
                    shade if bar.is_judged else QColor(colors().muted),
                )
            is_known = bar.arcmin is not None
            side = Qt.AlignmentFlag.AlignRight if is_known else Qt.AlignmentFlag.AlignLeft
            painter.setPen(text if is_known else QColor(colors().muted))
            free_px = self.width() - metrics.horizontalAdvance(bar.text)
            place = row if is_known else row.adjusted(min(name_px, free_px), 0, 0, 0)
            painter.drawText(place, Qt.AlignmentFlag.AlignVCenter | side, bar.text)
        x = name_px + room * self._target / self._scale
        painter.setPen(QPen(text, 1.5, Qt.PenStyle.DashLine))
        count = len(bars)
        known = sum(bar.arcmin is not None for bar in bars)
        painter.drawLine(round(x), 0, round(x), known * line)
        painter.setPen(text)
        label = tr("target {:g}′").format(self._target)
        width = metrics.horizontalAdvance(label)
        left = min(max(x - width / 2, 0.0), self.width() - width)
        painter.drawText(
            QRectF(left, count * line, width + 1, line), Qt.AlignmentFlag.AlignVCenter, label
        )

    def _line_px(self) -> int:
        return self.fontMetrics().height() + 2
