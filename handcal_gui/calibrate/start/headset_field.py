"""The choice of the headset, with the address and pairing key of a network headset."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QLabel, QLineEdit, QVBoxLayout, QWidget

from handcal.station.settings import HeadsetKind, StationSettings
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.connect.key_field import KeyField
from handcal_gui.widgets.fields import choice, fill_row, whole_number, with_name

_HEADSETS: dict[HeadsetKind, str] = {
    "virtual": tr("Virtual headset"),
    "network": tr("Network headset"),
}


class HeadsetField(QWidget):
    """The virtual headset, or a network headset with address, port and pairing key.

    Parameters
    ----------
    pairing_key : str
        Masked until the user reveals it.

    Attributes
    ----------
    changed : Signal()
    """

    changed = Signal()

    def __init__(self, pairing_key: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._headset = choice("headset", tr("Headset"), _HEADSETS)
        self._host = with_name(
            QLineEdit(),
            "host",
            tr("Address to listen on"),
            tr("Address of this computer on which to listen for the headset; 0.0.0.0 for all."),
        )
        self._port = whole_number("port", 1, 65535, tr("UDP port that the headset connects to."))
        self._address = QWidget()
        address = (QLabel(tr("at")), self._host, QLabel(tr("port")), self._port)
        fill_row(self._address, *address, grows=self._host)
        self._key = KeyField(tr("Cop&y"))
        self._key.set_key(pairing_key)
        self._pairing = QWidget()
        fill_row(self._pairing, QLabel(tr("Pairing key")), self._key, grows=self._key)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(SPACING_PX // 2)
        first = QWidget()
        fill_row(first, self._headset, self._address, grows=self._address)
        layout.addWidget(first)
        layout.addWidget(self._pairing)
        self._headset.currentIndexChanged.connect(self._show_fitting)
        self._headset.currentIndexChanged.connect(self.changed)
        self._host.textChanged.connect(self.changed)
        self._port.valueChanged.connect(self.changed)
        self._show_fitting()

    def show_settings(self, settings: StationSettings) -> None:
        """Show the headset of a station."""
        self._headset.setCurrentIndex(self._headset.findData(settings.headset))
        self._host.setText(settings.host)
        self._port.setValue(settings.port)

    def take(self, settings: StationSettings) -> StationSettings:
        """Return settings with the headset shown."""
        return replace(
            settings,
            headset=self._headset.currentData(),
            host=self._host.text().strip(),
            port=self._port.value(),
        )

    def set_pairing_key(self, pairing_key: str) -> None:
        """Show another key."""
        self._key.set_key(pairing_key)

    def _show_fitting(self) -> None:
        is_network = self._headset.currentData() == "network"
        self._address.setVisible(is_network)
        self._pairing.setVisible(is_network)
