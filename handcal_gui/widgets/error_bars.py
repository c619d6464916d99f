"""A small picture of a session's result: the error of each eye before and after, as bars."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import cast

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QGuiApplication, QPainter, QPixmap

from handcal.core.types import EYES, Eye, VerdictName
from handcal.session.library import EyeOutcome
from handcal_gui.app.theme import Colors, colors
from handcal_gui.app.translation import tr
from handcal_gui.widgets.result_rows import EYE_NAMES, NOTHING, VERDICT_COLORS

PICTURE_PX = QSize(40, 23)
_BAR_PX = 4
_SCALE_ARCMIN = 30.0
"""Error of a bar as wide as the picture, the same for all sessions; larger ones are cut."""


PICTURE_LEGEND = tr("Bars: error before, after; left eye above")
LIBRARY_LEGEND = tr("Bars: expected error before, after; left eye above")
PICTURE_HELP = tr(
    "Bars of the small picture: the left eye above the right one, each with its error before\n"
    "the calibration (grey) and after it (coloured; full if the eye is accepted, and no trials\n"
    "are over the target). The whole\nwidth is {:.0f}′."
).format(_SCALE_ARCMIN)


def error_bars(eyes: Mapping[Eye, EyeOutcome]) -> QPixmap:
    """Return a picture of two bars for each eye; an after bar is full if the eye is accepted.

    It is an outline if trials contradict the acceptance.
    """
    bars = tuple(map(eyes.get, EYES)) if has_bars(eyes) else ()
    return _draw(bars, colors(), QGuiApplication.primaryScreen().devicePixelRatio())


def has_bars(eyes: Mapping[Eye, EyeOutcome]) -> bool:
    """Return whether an error of an eye is known; damaged results may have none."""
    errors = (error for one in eyes.values() for error in (one.before_arcmin, after_arcmin(one)))
    return any(error is not None for error in errors)


def error_text(eyes: Mapping[Eye, EyeOutcome]) -> str:
    """Return the same as text, a line for each eye."""
    return "\n".join(
        tr("{}: {} before, {} after").format(
            EYE_NAMES[eye], _arcmin(one.before_arcmin), _arcmin(after_arcmin(one))
        )
        for eye, one in eyes.items()
    )


def picture_text(eyes: Mapping[Eye, EyeOutcome]) -> str:
    """Return the same as text, with what the bars mean; empty if there is no picture."""
    return f"{error_text(eyes)}\n{PICTURE_HELP}" if has_bars(eyes) else ""


def after_arcmin(one: EyeOutcome) -> float | None:
    """Return the error after the calibration, and after its verification if there was one."""
    return one.expected_arcmin if one.remaining_arcmin is None else one.remaining_arcmin


def _arcmin(error: float | None) -> str:
    return NOTHING if error is None else f"{error:.1f}′"


@lru_cache(maxsize=512)
def _draw(eyes: tuple[EyeOutcome | None, ...], now: Colors, ratio: float) -> QPixmap:
    picture = QPixmap(PICTURE_PX * ratio)
    picture.setDevicePixelRatio(ratio)
    picture.fill(Qt.GlobalColor.transparent)
    if not any(eyes):
        return picture
    painter = QPainter(picture)
    painter.fillRect(QRectF(0, 0, PICTURE_PX.width(), PICTURE_PX.height()), QColor(now.canvas))
    for i, one in enumerate(eyes):
        if one is None:
            continue
        top = 1.0 + i * (2 * _BAR_PX + 4)
        painter.fillRect(_bar(one.before_arcmin, top), QColor(now.muted))
        shade = QColor(getattr(now, _shade(one)))
        after = _bar(after_arcmin(one), top + _BAR_PX + 1)
        if one.is_accepted and not one.is_doubted:
            painter.fillRect(after, shade)
        else:
            painter.setPen(shade)
            painter.drawRect(after.adjusted(0.5, 0.5, -0.5, -0.5))
    painter.end()
    return picture


def _shade(one: EyeOutcome) -> str:
    """Return the name of the theme's colour for an eye: none for a φ that was not judged."""
    if one.is_doubted:
        return "warning"
    known = VERDICT_COLORS if one.is_judged else {}
    return known.get(cast(VerdictName, one.verdict), "muted")


def _bar(error_arcmin: float | None, top: float) -> QRectF:
    share = min(max(error_arcmin or 0.0, 0.0) / _SCALE_ARCMIN, 1.0)
    return QRectF(1.0, top, share * (PICTURE_PX.width() - 2), _BAR_PX)
