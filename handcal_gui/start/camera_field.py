"""The choice of the camera."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QLineEdit, QStackedWidget, QWidget

from handcal.preflight import RECORDING_SUFFIXES
from handcal.station_settings import Source, StationSettings
from handcal_gui.widgets.fields import beside, choice, named
from handcal_gui.widgets.path_field import PathField

_SOURCES: dict[Source, str] = {
    "simulator": "Simulator",
    "realsense": "RealSense",
    "recording": "Recording",
}
_PATTERN = f"RealSense recordings ({' '.join(f'*{suffix}' for suffix in RECORDING_SUFFIXES)})"


class CameraField(QWidget):
    """Simulator, RealSense with its serial number, or a recording with its path.

    Attributes
    ----------
    changed : Signal()
    """

    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._source = choice("source", "Camera", _SOURCES)
        self._serial = named(
            QLineEdit(placeholderText="Serial number; any if empty"), "serial", "Serial number"
        )
        self._recording = PathField("Recording", "file", _PATTERN)
        details = QStackedWidget()
        for page in (QWidget(), self._serial, self._recording):  # in the order of _SOURCES
            details.addWidget(page)
        beside(self, self._source, details, grows=details)
        self._source.currentIndexChanged.connect(details.setCurrentIndex)
        self._source.currentIndexChanged.connect(self.changed)
        self._serial.textChanged.connect(self.changed)
        self._recording.changed.connect(self.changed)

    def show_settings(self, settings: StationSettings) -> None:
        """Show the camera of a station."""
        self._source.setCurrentIndex(self._source.findData(settings.source))
        self._serial.setText(settings.realsense.serial)
        self._recording.set_path(settings.recording)

    def take(self, settings: StationSettings) -> StationSettings:
        """Return settings with the camera shown."""
        return replace(
            settings,
            source=self._source.currentData(),
            realsense=replace(settings.realsense, serial=self._serial.text().strip()),
            recording=self._recording.path,
        )
