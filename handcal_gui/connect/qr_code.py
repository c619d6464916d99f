"""A QR code, black on white in every theme, as cameras read it best."""

from __future__ import annotations

from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from handcal.link.invitation import qr_matrix
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr

_LEAST_PX = 4
"""Size of a module in logical pixels at which a headset's camera reads the code at arm's length."""


class QrCode(QWidget):
    """Shows a text as a QR code; empty without one."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("qrCode")
        self.setAccessibleName(tr("QR code"))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._rows: tuple[tuple[bool, ...], ...] = ()

    def show_text(self, text: str) -> None:
        """Show another text; an empty one shows nothing."""
        self._rows = qr_matrix(text) if text else ()
        self.setAccessibleDescription(text)
        self.update()

    def sizeHint(self) -> QSize:
        """Return the size at which the code is read well."""
        side = 33 * _LEAST_PX + 2 * SPACING_PX
        return QSize(2 * side, 2 * side)

    def minimumSizeHint(self) -> QSize:
        """Return half of that."""
        return self.sizeHint() / 2

    def paintEvent(self, _event: QPaintEvent) -> None:
        """Draw the modules as squares of whole device pixels."""
        if not self._rows:
            return
        painter = QPainter(self)
        ratio = self.devicePixelRatioF()
        painter.scale(1.0 / ratio, 1.0 / ratio)
        count = len(self._rows)
        width, height = round(ratio * self.width()), round(ratio * self.height())
        module = max(1, min(width, height) // count)
        left, top = (width - count * module) // 2, (height - count * module) // 2
        painter.fillRect(QRect(left, top, count * module, count * module), Qt.GlobalColor.white)
        for y, row in enumerate(self._rows):
            for x, is_dark in enumerate(row):
                if is_dark:
                    place = QRect(left + x * module, top + y * module, module, module)
                    painter.fillRect(place, Qt.GlobalColor.black)
        painter.end()
