"""The choice of the camera."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLineEdit, QStackedWidget, QWidget

from handcal.camera.recordings import RECORDING_SUFFIXES
from handcal.camera.settings import HoloLens2Settings, RealSenseSettings
from handcal.station.settings import Source, StationSettings
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.start.camera_settings import CameraSettingsDialog
from handcal_gui.widgets.fields import button, choice, fill_row, with_name
from handcal_gui.widgets.path_field import PathField

_SOURCES: dict[Source, str] = {
    "simulator": tr("Simulator"),
    "realsense": "RealSense",
    "hololens2": "HoloLens 2",
    "oak": "OAK-D",
    "orbbec": "Orbbec",
    "recording": tr("Recording"),
}
_PATTERN = tr("RealSense recordings ({})").format(
    " ".join(f"*{suffix}" for suffix in RECORDING_SUFFIXES)
)


class CameraField(QWidget):
    """Simulator, RealSense with its settings, others by address or number, or a recording.

    Attributes
    ----------
    changed : Signal()
    """

    changed = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._source = choice("source", tr("Camera"), _SOURCES)
        self._serial = with_name(
            QLineEdit(placeholderText=tr("Any serial number")),
            "serial",
            tr("Serial number"),
        )
        self._realsense = RealSenseSettings()
        edit = button(
            "editRealSense",
            tr("Settin&gs…"),
            tr("Camera settings"),
            tr("Image size, preset, exposure, laser power and filters."),
        )
        camera = QWidget()
        fill_row(camera, self._serial, edit, grows=self._serial)
        self._host = with_name(
            QLineEdit(placeholderText=tr("Address of the headset")), "hololens2Host", tr("Address")
        )
        self._hololens2 = HoloLens2Settings()
        self._other = QLineEdit(placeholderText=tr("Any serial number"))
        with_name(self._other, "otherSerial", tr("Serial number"))
        self._recording = PathField(tr("Recording"), "either", _PATTERN)
        details = QStackedWidget()
        pages = {"realsense": camera, "hololens2": self._host, "recording": self._recording}
        pages |= dict.fromkeys(("oak", "orbbec"), self._other)
        for page in dict.fromkeys(pages.values()):
            details.addWidget(page)
        fill_row(self, self._source, details, grows=details)

        def show_details() -> None:
            page = pages.get(self._source.currentData())
            details.setVisible(page is not None)  # or the row is as wide as the widest page
            if page is not None:
                details.setCurrentWidget(page)

        self._source.currentIndexChanged.connect(show_details)
        show_details()
        self._source.currentIndexChanged.connect(self.changed)
        self._serial.textChanged.connect(self.changed)
        self._host.textChanged.connect(self.changed)
        self._other.textChanged.connect(self.changed)
        edit.clicked.connect(self.edit_realsense)
        self._recording.changed.connect(self.changed)

    def show_settings(self, settings: StationSettings) -> None:
        """Show the camera of a station."""
        self._source.setCurrentIndex(self._source.findData(settings.source))
        self._realsense = settings.realsense
        self._serial.setText(settings.realsense.serial)
        self._other.setText(settings.serial)
        self._hololens2 = settings.hololens2
        self._host.setText(settings.hololens2.host)
        self._recording.set_path(settings.recording)

    def take(self, settings: StationSettings) -> StationSettings:
        """Return settings with the camera shown."""
        return replace(
            settings,
            source=self._source.currentData(),
            realsense=replace(self._realsense, serial=self._serial.text().strip()),
            hololens2=replace(self._hololens2, host=self._host.text().strip()),
            serial=self._other.text().strip(),
            recording=self._recording.path,
        )

    def edit_realsense(self) -> None:
        """Open the dialog with the settings of the RealSense."""
        dialog = CameraSettingsDialog(self._realsense, self)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.accepted.connect(lambda: self._on_realsense_changed(dialog.settings()))
        dialog.open()

    def _on_realsense_changed(self, settings: RealSenseSettings) -> None:
        self._realsense = settings
        self.changed.emit()
