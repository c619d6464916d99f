"""The scrolled part of the fine-tune panel: its controls, with the keys below them."""

from __future__ import annotations

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent, QResizeEvent
from PySide6.QtWidgets import QFrame, QLabel, QLayout, QScrollArea, QWidget

from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.layouts import fit_soon, vbox

_KEYS = tr(
    "Arrow keys move the picture: ← → φ1, ↑ ↓ φ2; PgUp PgDn make it larger or smaller (φ3). "
    "E changes the eye."
)


class ControlsArea(QScrollArea):
    """Scrolls controls, with the keys below them where there is room; no higher than both.

    Parameters
    ----------
    controls : QLayout
        Without a parent.
    """

    def __init__(self, controls: QLayout) -> None:
        super().__init__(widgetResizable=True)
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._controls, self._keys = controls, QLabel(text=_KEYS, wordWrap=True)
        body = QWidget()
        body.setToolTip(_KEYS)
        margins = SPACING_PX, SPACING_PX // 2, SPACING_PX, 0
        vbox(controls, self._keys, 1, on=body, margins=margins, spacing=SPACING_PX // 2)
        self.setWidget(body)
        self._fit_soon = fit_soon(self._fit, self)

    @property
    def shows_keys(self) -> bool:
        """True if the keys are in sight."""
        return self._keys.isVisible()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Leave the arrow keys to the enclosing panel."""
        event.ignore()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Fit what is said to the new size."""
        super().resizeEvent(event)
        self._fit_soon.start()

    def changeEvent(self, event: QEvent) -> None:
        """Fit what is said to the new font."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.FontChange:
            self._fit_soon.start()

    def _fit(self) -> None:
        """Leave the keys to the tooltip where they would have to be scrolled to."""
        # Beside a scroll bar, too: Qt keeps one that the text needs only because of the bar.
        bar_px = self.verticalScrollBar().sizeHint().width()
        keys_px = self._keys.heightForWidth(self.width() - bar_px - 2 * SPACING_PX)
        least_px = self._controls.totalMinimumSize().height() + keys_px + SPACING_PX
        self._keys.setVisible(least_px <= self.height())
        self.setMaximumHeight(least_px)
