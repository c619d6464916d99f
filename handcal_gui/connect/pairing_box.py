"""The address and pairing key that the headset needs to connect."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QGridLayout, QLabel, QWidget

from handcal_gui.app.theme import SPACING_PX, number_font
from handcal_gui.app.translation import tr
from handcal_gui.connect.key_field import KeyField
from handcal_gui.widgets.fields import button, label_for
from handcal_gui.widgets.layouts import hbox

_RENEWING = tr("The new key must then be entered in the headset.")


class PairingBox(QWidget):
    """The address to connect to, and the pairing key, hidden until requested.

    Attributes
    ----------
    new_key_requested : Signal()
        The user requests another key.
    """

    new_key_requested = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("pairing")
        self._address = QLabel()
        self._address.setObjectName("pairing-address")
        self._address.setFont(number_font())
        self._address.setTextInteractionFlags(
            Qt.TextInteractionFlag.TextSelectableByMouse
            | Qt.TextInteractionFlag.TextSelectableByKeyboard
        )
        self._address.setToolTip(tr("Host and port that the headset must connect to, by UDP"))
        self._key = KeyField()
        renew = button("newKey", tr("&New key…"), tr("Make a new pairing key"), _RENEWING)
        renew.clicked.connect(self.new_key_requested)
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(SPACING_PX)
        grid.setVerticalSpacing(SPACING_PX // 2)
        grid.addWidget(QLabel(tr("Address")), 0, 0)
        grid.addLayout(hbox((self._address, 1), renew, spacing=SPACING_PX), 0, 1)
        grid.addWidget(label_for(self._key, tr("Key")), 1, 0)
        grid.addWidget(self._key, 1, 1)
        grid.setColumnStretch(1, 1)

    def show_pairing(self, address: str, key: str) -> None:
        """Show an address, as host:port, and a key, hidden at first."""
        self._address.setText(address)
        self._key.set_key(key)
