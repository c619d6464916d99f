"""The result card: a word, a number and the final φ for each eye; behind *Why?* all the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QGridLayout, QSizePolicy, QWidget

from handcal.core.types import EYES, Eye, phi_text
from handcal.register.results import USED, Results
from handcal.report.cells import signed
from handcal.session.drawn import (
    DrawnShift,
    drawn_error_arcmin,
    drawn_shifts,
    is_judged,
    is_verified,
    result_word,
)
from handcal.session.record import SessionRecord, eye_trials
from handcal.session.trial import EyeTrials, is_doubted
from handcal_gui.app.theme import SPACING_PX, colors, follow_theme, scale_font
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import button, paragraph
from handcal_gui.widgets.layouts import hbox, vbox
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
    is_usable: bool
    """False for a result that must not be used."""
    error: str
    """The error that was verified, or else is expected; empty if there is none to rely on."""
    drawn: str
    """The final φ, which the headset draws with and the export names."""
    reason: str
    bars: tuple[Bar, ...]
    details: tuple[str, ...]
    """Error in depth without the calibration and with it, and the effect of one more alignment."""


def eye_results(
    results: Results, record: SessionRecord, target_arcmin: float
) -> dict[Eye, EyeResult]:
    """Return the result of each solved eye."""
    trials, drawn = eye_trials(results, record, target_arcmin), drawn_shifts(record, results)
    found = {}
    for eye in (eye for eye in EYES if eye in results.eyes):
        benefit, verdict = results.benefits[eye], results.verdicts[eye]
        is_final = is_judged(verdict.name, drawn[eye].kind)
        is_used = drawn[eye].kind == "solved"
        arcmin = drawn_error_arcmin(results, record.rig.eyes[eye], eye, drawn[eye])
        details = [tr("Depth error: {}").format(benefit.depth)]
        if is_used:
            another = results.expected_after_another_arcmin[eye]
            details.append(tr("One more alignment: {:.1f}′ expected").format(another))
        given = results, eye, trials.get(eye)
        bars = _bars(results, eye, trials, is_used=is_used, has_trials=bool(trials))
        found[eye] = EyeResult(
            eye,
            verdict_color(verdict.name, trials.get(eye)),
            verdict_word(*given),
            verdict.name not in ("implausible", "contradicted"),
            _error(results, record, eye, arcmin, trials.get(eye)),
            _drawn(drawn[eye]),
            verdict_reason(*given),
            bars,
            tuple(details) if is_used else (),
        )
        if not is_final:
            reason = tr("The solved φ is not final. It was judged: {}. {}")
            found[eye] = replace(
                found[eye],
                shade="warning" if arcmin > target_arcmin else "muted",
                word=result_word(verdict.name, drawn[eye].kind),
                error=tr("{:.1f}′ expected").format(arcmin),
                reason=reason.format(verdict_word(*given), verdict_reason(*given)),
                bars=(Bar(tr("Final φ, expected"), arcmin), *bars),
            )
    return found


def _error(
    results: Results, record: SessionRecord, eye: Eye, arcmin: float, trials: EyeTrials | None
) -> str:
    """Return the error of a final φ that was judged."""
    verdict = results.verdicts[eye].name
    if trials is not None and is_doubted(verdict, trials):
        return tr("{:.1f}′ in trials").format(trials.mean_arcmin)
    if verdict in ("implausible", "contradicted"):
        return ""
    is_after = verdict in USED and is_verified(record, results, eye, "solved")
    text = tr("{:.1f}′ after verification") if is_after else tr("{:.1f}′ expected")
    return text.format(arcmin)


def _drawn(drawn: DrawnShift) -> str:
    """Return which φ is final."""
    text = tr("Final φ: {}").format(drawn)
    if drawn.kind == "set by hand":
        phi = ", ".join(signed(1e3 * float(one), 2) for one in drawn.shift_m)
        text = tr("{}, ({}) mm").format(text, phi)
    return text


def _bars(
    results: Results,
    eye: Eye,
    trials: Mapping[Eye, EyeTrials],
    *,
    is_used: bool,
    has_trials: bool,
) -> tuple[Bar, ...]:
    benefit = results.benefits[eye]
    after_name = tr("After, expected") if is_used else tr("This result, not used")
    bars = [
        Bar(tr("Before, expected"), benefit.without_arcmin, is_judged=False),
        Bar(after_name, benefit.after_arcmin, is_used),
    ]
    if (verified := results.verified.get(eye)) is not None:
        bars.insert(1, Bar(tr("Verification found"), verified.before_arcmin))
    else:
        bars.append(Bar(tr("Verification"), None, absent=tr("not verified")))
    if has_trials:
        found = trials.get(eye)
        bars.append(
            Bar(tr("Trials"), None, absent=tr("none of this φ"))
            if found is None
            else Bar(tr("Trials, n = {}").format(found.count), found.mean_arcmin)
        )
    # The target's line ends before those that were not measured.
    return tuple(sorted(bars, key=lambda bar: bar.arcmin is None))


def result_text(
    results: Results, record: SessionRecord, target_arcmin: float, head: Mapping[str, str] = {}
) -> str:
    """Return the card as plain text, one fact a line; `head` holds facts that are shown first."""
    lines = [f"{name}: {value}" for name, value in head.items()]
    lines.append(tr("Target: {:.1f}′").format(target_arcmin))
    for eye, one in eye_results(results, record, target_arcmin).items():
        lines += ["", f"{EYE_NAMES[eye]}: {one.word} {one.error}".rstrip(), one.drawn, one.reason]
        lines.append(tr("Solved: {}").format(phi_text(results.eyes[eye])))
        lines += [f"{bar.name}: {bar.text}" for bar in one.bars]
        lines += one.details
    return "\n".join(lines)


class ResultCard(QWidget):
    """Shows the result of each eye, side by side.

    Parameters
    ----------
    is_explained : bool
        Whether the reasons are in sight at first.
    """

    def __init__(self, parent: QWidget | None = None, *, is_explained: bool = False) -> None:
        super().__init__(parent)
        self.setObjectName("resultCard")
        self.setAccessibleName(tr("Result"))
        self._columns = {eye: _Column(eye) for eye in EYES}
        self._why = button("why", tr("Wh&y?"))
        self._why.setToolTip(tr("Show or hide the reasons, all errors, and what would help"))
        self._why.setCheckable(True)
        self._why.toggled.connect(self._explain)
        grid = QGridLayout()
        grid.setSpacing(2 * SPACING_PX)
        for i, eye_column in enumerate(self._columns.values()):
            grid.addWidget(eye_column, 0, i)
            grid.setColumnStretch(i, 1)
        why = vbox(self._why, 0)
        hbox((grid, 1), why, on=self, margins=0, spacing=SPACING_PX)
        self._why.setChecked(is_explained)
        self._explain(is_explained)
        follow_theme(self, self._refresh)

    def show_results(
        self, results: Results | None, record: SessionRecord | None, target_arcmin: float
    ) -> None:
        """Show results; without any, the card is empty."""
        found: Mapping[Eye, EyeResult] = {}
        text = ""
        if results is not None and record is not None:
            found = eye_results(results, record, target_arcmin)
            text = result_text(results, record, target_arcmin)
        bars = [bar for one in found.values() for bar in one.bars]
        scale_arcmin = 1.1 * max((bar.arcmin or 0.0 for bar in bars), default=0.0)
        for eye, eye_column in self._columns.items():
            eye_column.show_result(
                found.get(eye),
                target_arcmin,
                max(scale_arcmin, 1.1 * target_arcmin),
                [bar.name for bar in bars],
            )
        self.setAccessibleDescription(text)

    def _explain(self, is_explained: bool) -> None:
        for eye_column in self._columns.values():
            eye_column.explain(is_explained)

    def _refresh(self) -> None:
        for eye_column in self._columns.values():
            eye_column.refresh()


class _Column(QWidget):
    """One eye: verdict, error, and final φ; below, what explains them."""

    def __init__(self, eye: Eye) -> None:
        super().__init__()
        self._eye = eye
        self._result: EyeResult | None = None
        self._is_explained = False
        self._verdict = paragraph(f"card-verdict-{eye}")
        scale_font(self._verdict, 1.2, is_bold=True)
        self._drawn = paragraph(f"card-drawn-{eye}")
        self._bars = _Bars()
        self._reason = paragraph(f"card-reason-{eye}")
        self._details = paragraph(f"card-details-{eye}")
        self.why = QWidget()
        gap_px = SPACING_PX // 2
        vbox(self._bars, self._details, on=self.why, margins=0, spacing=gap_px)
        parts = self._verdict, self._drawn, self._reason, self.why
        vbox(*parts, 0, on=self, margins=0, spacing=gap_px)

    def show_result(
        self,
        result: EyeResult | None,
        target_arcmin: float,
        scale_arcmin: float,
        names: Sequence[str],
    ) -> None:
        self._result = result
        word = tr("– Not solved") if result is None else f"{result.word} {result.error}".rstrip()
        self._verdict.setText(f"{EYE_NAMES[self._eye]}: {word}")
        self._drawn.setText(result.drawn if result else "")
        self._reason.setText(result.reason if result else "")
        self._details.setText("\n".join(result.details) if result else "")
        self._bars.show_bars(result.bars if result else (), target_arcmin, scale_arcmin, names)
        self.explain(self._is_explained)
        self.refresh()

    def explain(self, is_explained: bool) -> None:
        """Show what is behind *Why?*; the reason not to use a result is always in sight."""
        self._is_explained = is_explained
        is_refused = self._result is not None and not self._result.is_usable
        self.why.setVisible(is_explained)
        self._reason.setVisible(is_explained or is_refused)

    def refresh(self) -> None:
        """Take the colours of the theme; style sheets would keep the size of the text."""
        shade = self._result.shade if self._result else "muted"
        for label, role in ((self._verdict, shade), (self._details, "muted")):
            palette = QPalette()
            palette.setColor(QPalette.ColorRole.WindowText, QColor(getattr(colors(), role)))
            label.setPalette(palette)
        self._bars.update()


class _Bars(QWidget):
    """Bars below one another, with a line at the target; on the scale of the other eye's, too."""

    def __init__(self) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self._bars: tuple[Bar, ...] = ()
        self._target = self._scale = 1.0
        self._names: tuple[str, ...] = ()

    def show_bars(
        self,
        bars: tuple[Bar, ...],
        target_arcmin: float,
        scale_arcmin: float,
        names: Sequence[str],
    ) -> None:
        self._bars, self._target, self._scale = bars, target_arcmin, scale_arcmin
        self._names = tuple(names)
        self.updateGeometry()
        self.update()

    def sizeHint(self) -> QSize:
        lines = 1 + (len(self._bars) or 3)
        return QSize(26 * SPACING_PX, lines * self._line_px())

    def minimumSizeHint(self) -> QSize:
        return QSize(self._name_px() + self._text_px() + 2 * SPACING_PX, self.sizeHint().height())

    def px_per_arcmin(self) -> float:
        """Return the scale of the bars."""
        return max(self.width() - self._name_px() - self._text_px(), 1) / self._scale

    def paintEvent(self, _: QPaintEvent) -> None:
        if not self._bars:
            return
        painter = QPainter(self)
        line, metrics, scale = self._line_px(), self.fontMetrics(), self.px_per_arcmin()
        name_px = self._name_px()
        text, muted = self.palette().windowText().color(), QColor(colors().muted)
        for i, bar in enumerate(self._bars):
            row = QRectF(0, i * line, self.width(), line)
            painter.setPen(text)
            painter.drawText(row, Qt.AlignmentFlag.AlignVCenter, bar.name)
            if bar.arcmin is None:
                painter.setPen(muted)
                row = row.adjusted(name_px, 0, 0, 0)
                painter.drawText(row, Qt.AlignmentFlag.AlignVCenter, bar.text)
                continue
            good = colors().good if bar.arcmin <= self._target else colors().warning
            length = QRectF(name_px, (i + 0.2) * line, scale * bar.arcmin, 0.6 * line)
            painter.fillRect(length, QColor(good) if bar.is_judged else muted)
            right = Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignRight
            painter.drawText(row, right, bar.text)
        x = round(name_px + scale * self._target)
        known = sum(bar.arcmin is not None for bar in self._bars)
        painter.setPen(QPen(text, 1.5, Qt.PenStyle.DashLine))
        painter.drawLine(x, 0, x, known * line)
        painter.setPen(text)
        label = tr("target {:g}′").format(self._target)
        width = metrics.horizontalAdvance(label) + 1
        left = min(max(x - width / 2, 0.0), self.width() - width)
        place = QRectF(left, len(self._bars) * line, width, line)
        painter.drawText(place, Qt.AlignmentFlag.AlignVCenter, label)

    def _line_px(self) -> int:
        return self.fontMetrics().height() + 2

    def _name_px(self) -> int:
        metrics = self.fontMetrics()
        return max(map(metrics.horizontalAdvance, self._names), default=0) + SPACING_PX

    def _text_px(self) -> int:
        return self.fontMetrics().horizontalAdvance("888.8′") + SPACING_PX
