"""What the headset needs to find this program and be trusted by it."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import (
    QGridLayout,
    QGroupBox,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QWidget,
)

from handcal_gui.theme import SPACING_PX, number_font


class PairingBox(QGroupBox):
    """The address to connect to, and the pairing key, hidden until asked for.

    Attributes
    ----------
    new_key_requested : Signal()
        The user wants another key.
    """

    new_key_requested = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__("Pairing", parent)
        self.setObjectName("pairing")
        self._address = QLabel()
        self._address.setObjectName("pairing-address")
        self._address.setFont(number_font())
        self._address.setTextInteractionFlags(
            Qt.TextInteractionFlag.TextSelectableByMouse
            | Qt.TextInteractionFlag.TextSelectableByKeyboard
        )
        self._address.setToolTip("Host and port that the headset must connect to, by UDP")
        self._key = QLineEdit()
        self._key.setObjectName("pairing-key")
        self._key.setAccessibleName("Pairing key")
        self._key.setReadOnly(True)
        self._key.setToolTip(
            "Whoever knows the key can pose as the headset: give it to the headset only"
        )
        self._show = _button("Show", "Show the pairing key")
        self._show.setCheckable(True)
        self._show.toggled.connect(self._reveal)
        copy = _button("Copy", "Copy the pairing key to the clipboard")
        copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(self._key.text()))
        renew = _button("New key…", "Make a new key; the headset must then be given it")
        renew.clicked.connect(self.new_key_requested)
        self._lay_out(self._show, copy, renew)
        self._reveal(False)

    def show_pairing(self, address: str, key: str) -> None:
        """Show an address, as host:port, and a key, hidden at first."""
        self._address.setText(address)
        self._key.setText(key)
        self._key.setCursorPosition(0)
        self._show.setChecked(False)

    def _reveal(self, is_shown: bool) -> None:
        modes = QLineEdit.EchoMode
        self._key.setEchoMode(modes.Normal if is_shown else modes.Password)

    def _lay_out(self, *buttons: QPushButton) -> None:
        row = QHBoxLayout()
        row.addStretch()
        for button in buttons:
            row.addWidget(button)
        grid = QGridLayout(self)
        grid.setSpacing(SPACING_PX)
        key_label = QLabel("&Key")
        key_label.setBuddy(self._key)
        grid.addWidget(QLabel("Address"), 0, 0)
        grid.addWidget(self._address, 0, 1)
        grid.addWidget(key_label, 1, 0)
        grid.addWidget(self._key, 1, 1)
        grid.addLayout(row, 2, 0, 1, 2)
        grid.setColumnStretch(1, 1)


def _button(text: str, tooltip: str) -> QPushButton:
    button = QPushButton(text)
    button.setToolTip(tooltip)
    button.setAutoDefault(False)
    return button
