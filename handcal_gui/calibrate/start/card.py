"""A framed part of a page, with an icon and a title."""

from __future__ import annotations

from PySide6.QtWidgets import QFrame, QGridLayout, QLabel, QVBoxLayout, QWidget

from handcal_gui.app.theme import SPACING_PX, follow_theme, icon, scale_font
from handcal_gui.widgets.fields import paragraph
from handcal_gui.widgets.layouts import vbox


class Card(QFrame):
    """A frame with an icon, a title and a hint; `body` holds the controls.

    Attributes
    ----------
    body : QVBoxLayout
    hint : QLabel
    """

    def __init__(
        self, title: str, hint: str, icon_name: str, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setFrameShape(QFrame.Shape.StyledPanel)
        self.setAccessibleName(title)
        self._icon_name = icon_name
        self._icon = QLabel()
        heading = QLabel(title)
        scale_font(heading, 1.3, is_bold=True)
        self._head = head = QGridLayout()
        head.setHorizontalSpacing(SPACING_PX)
        head.setVerticalSpacing(SPACING_PX // 2)
        head.setColumnStretch(1, 1)
        head.addWidget(self._icon, 0, 0)
        head.addWidget(heading, 0, 1)
        self.hint = paragraph(text=hint)
        head.addWidget(self.hint, 1, 0, 1, 3)
        self.body = QVBoxLayout()
        self.body.setSpacing(SPACING_PX)
        across, down = 2 * SPACING_PX, 3 * SPACING_PX // 2
        vbox(head, (self.body, 1), on=self, margins=(across, down, across, down), spacing=down)
        follow_theme(self, self._refresh)

    def add_to_head(self, widget: QWidget) -> None:
        """Add a widget to the right of the title, where it takes no height."""
        self._head.addWidget(widget, 0, 2)

    def _refresh(self) -> None:
        self._icon.setPixmap(icon(self._icon_name).pixmap(3 * SPACING_PX))
