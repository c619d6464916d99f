"""The dialog with the settings of a RealSense."""

from __future__ import annotations

from typing import Literal

from PySide6.QtGui import QIcon
from PySide6.QtWidgets import (
    QCheckBox,
    QDialog,
    QDialogButtonBox,
    QFormLayout,
    QSpinBox,
    QWidget,
)

from handcal.camera.settings import Preset, Profile, RealSenseSettings
from handcal_gui.app.theme import SPACING_PX
from handcal_gui.app.translation import tr
from handcal_gui.widgets.fields import (
    choice,
    fill_row,
    label_for,
    make_equally_wide,
    paragraph,
    whole_number,
    with_name,
)
from handcal_gui.widgets.layouts import vbox

_ABOUT = tr(
    "Choose how the RealSense takes images. Calibrate without filters: they smooth and invent "
    "depth."
)
_AS_IT_IS = tr("Keep the camera's setting")
_PROFILES: dict[Profile, str] = {
    "auto": tr("Largest (1280 × 720 or 848 × 480 px, 30 Hz)"),
    "1280x720": "1280 × 720 px, 30 Hz",
    "848x480": "848 × 480 px, 30 Hz",
}
_PRESETS: dict[Preset | Literal[""], str] = {
    "": _AS_IT_IS,
    "default": tr("Default"),
    "hand": tr("Hand"),
    "high_accuracy": tr("High accuracy"),
    "high_density": tr("High density"),
    "medium_density": tr("Medium density"),
}
_LASER_STEP_MW = 30
"""One step below 0 mW, the number stands for the camera's own setting."""


class CameraSettingsDialog(QDialog):
    """Image size, preset, exposure, laser power and filters.

    Parameters
    ----------
    settings : RealSenseSettings
        The current settings; the serial number is not shown and does not change.
    """

    def __init__(self, settings: RealSenseSettings, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("cameraSettings")
        self.setWindowTitle(tr("Camera settings"))
        self._serial = settings.serial
        self._profile = choice(
            "profile",
            tr("Image size"),
            _PROFILES,
            tr("Size and rate of both depth and colour images."),
        )
        self._preset = choice(
            "preset",
            tr("Depth preset"),
            _PRESETS,
            tr("The RealSense SDK's visual preset; the settings below take precedence."),
        )
        self._exposure = _number(
            "exposure", 0, 200_000, 500, " µs", tr("Of the depth image; a frame lasts 33,333 µs.")
        )
        self._exposure.setSpecialValueText(tr("Automatic"))
        self._laser = _number(
            "laser",
            -_LASER_STEP_MW,
            360,
            _LASER_STEP_MW,
            " mW",
            tr("Power of the projector; 0 mW switches it off."),
        )
        self._laser.setSpecialValueText(_AS_IT_IS)
        self._whole = with_name(
            QCheckBox(tr("For the &whole image, even once a hand is found")),
            "wholeImage",
            tr("Exposure of colour for the whole image"),
            tr("Measures the exposure of colour on the whole image, not on the hand once found."),
        )
        self._spatial = _filter(
            "spatial", tr("&Spatial"), tr("Smooths each depth image, keeping edges.")
        )
        self._temporal = _filter(
            "temporal", tr("&Temporal"), tr("Averages over the last depth images.")
        )
        self._holes = _filter(
            "holes", tr("&Hole filling"), tr("Fills in depth where none was measured.")
        )
        self._lay_out()
        self._show(settings)

    def settings(self) -> RealSenseSettings:
        """Return the settings shown."""
        return RealSenseSettings(
            serial=self._serial,
            profile=self._profile.currentData(),
            preset=self._preset.currentData() or None,
            exposure_us=float(self._exposure.value()) or None,
            laser_power_mw=None if self._laser.value() < 0 else float(self._laser.value()),
            expose_whole_image=self._whole.isChecked(),
            spatial_filter=self._spatial.isChecked(),
            temporal_filter=self._temporal.isChecked(),
            hole_filling=self._holes.isChecked(),
        )

    def _show(self, settings: RealSenseSettings) -> None:
        self._profile.setCurrentIndex(self._profile.findData(settings.profile))
        self._preset.setCurrentIndex(self._preset.findData(settings.preset or ""))
        self._exposure.setValue(round(settings.exposure_us or 0))
        power_mw = settings.laser_power_mw
        self._laser.setValue(-_LASER_STEP_MW if power_mw is None else round(power_mw))
        self._whole.setChecked(settings.expose_whole_image)
        self._spatial.setChecked(settings.spatial_filter)
        self._temporal.setChecked(settings.temporal_filter)
        self._holes.setChecked(settings.hole_filling)

    def _lay_out(self) -> None:
        filters = QWidget()
        fill_row(filters, self._spatial, self._temporal, self._holes, grows=self._holes)
        make_equally_wide((self._profile, self._preset))
        form = QFormLayout()
        form.setSpacing(SPACING_PX)
        for title, field in (
            (tr("&Image size"), self._profile),
            (tr("Depth &preset"), self._preset),
            (tr("&Exposure of depth"), self._exposure),
            (tr("Exposure of colour"), self._whole),
            (tr("&Laser power"), self._laser),
            (tr("Depth filters"), filters),
        ):
            form.addRow(label_for(field, title), field)
        standard = QDialogButtonBox.StandardButton
        buttons = QDialogButtonBox(standard.Ok | standard.Cancel | standard.RestoreDefaults)
        for one in buttons.buttons():
            one.setIcon(QIcon())  # like all other buttons
        restore = with_name(
            buttons.button(standard.RestoreDefaults), "restore", tr("Restore defaults")
        )
        restore.setText(tr("Restore &defaults"))
        restore.clicked.connect(lambda: self._show(RealSenseSettings()))
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        what = paragraph("cameraAbout", _ABOUT)
        vbox(what, form, buttons, on=self, margins=2 * SPACING_PX, spacing=2 * SPACING_PX)


def _number(name: str, low: int, high: int, step: int, unit: str, help_text: str) -> QSpinBox:
    field = whole_number(name, low, high, help_text)
    field.setSingleStep(step)
    field.setSuffix(unit)
    return field


def _filter(name: str, text: str, help_text: str) -> QCheckBox:
    label = tr("{} filter").format(text.replace("&", ""))
    return with_name(QCheckBox(text), name, label, help_text)
