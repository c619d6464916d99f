"""The camera panel: the camera's images with the segmented hand, and its frame rate."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path

import cv2
import numpy as np
from PySide6.QtCore import QBuffer, QIODevice, QPointF, QRectF, Qt
from PySide6.QtGui import QAction, QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import (
    QComboBox,
    QFileDialog,
    QLabel,
    QMessageBox,
    QSizePolicy,
    QWidget,
)

from handcal.calibration.sight import Observation
from handcal.camera.feed import CameraStatus
from handcal.core.errors import FileError
from handcal.core.types import Float64, Frame, UInt8, UInt16
from handcal.hand.settings import SegmentSettings
from handcal.io.files import write_atomic
from handcal.station.snapshot import Snapshot
from handcal_gui.app.theme import SPACING_PX, follow_theme, icon
from handcal_gui.app.translation import tr
from handcal_gui.calibrate.camera.hand_overlay import overlays
from handcal_gui.widgets.elided_label import ElidedLabel
from handcal_gui.widgets.fields import let_keys_choose, plain_message, tool_button
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.layouts import hbox, vbox
from handcal_gui.widgets.number_label import UNKNOWN, NumberLabel
from handcal_gui.widgets.sentence import sentence

NEAREST_M, FARTHEST_M = 0.2, 1.0
_HOLE = (10, 10, 12)
_GREY = 0.8
"""Share of grey in the colours beyond the depth gate."""
_BAR_PX = 12
_STATUS_NS = 200_000_000
"""Interval of the numbers below the image; nobody reads faster."""
_EMPTY = tr("The camera's image will appear here.")
_NO_COLOR = tr("This camera has no colour image.")


class Mode(StrEnum):
    """The images that are shown."""

    COLOR = tr("Colour")
    DEPTH = tr("Depth")
    BOTH = tr("Both")


class CameraPanel(QWidget):
    """Shows colour and depth with the hand, and the camera's frame rate, latency and losses.

    Parameters
    ----------
    parent : QWidget or None
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("camera-panel")
        self._frame: Frame | None = None
        self._caption = ""
        self._status_ns = 0
        self._pictures = _Pictures()
        self._status = _Status()
        self._freeze = QAction(tr("Freeze"), self, checkable=True, autoRepeat=False)
        self._freeze.setToolTip(tr("Freeze the image (F)"))
        self._freeze.setWhatsThis(tr("Freeze the camera's image"))
        self._freeze.setShortcut("F")
        self._freeze.setIconText(tr("Freeze (F)"))
        self._mode = QComboBox()
        self._mode.setAccessibleName(tr("Displayed image"))
        self._mode.setToolTip(tr("Show the colour image, the depth image or both"))
        self._mode.addItems(list(Mode))
        let_keys_choose(self._mode, self, tr("Next displayed image"), "M")
        self._mode.currentTextChanged.connect(lambda text: self._pictures.set_mode(Mode(text)))
        save = QAction(tr("Save image…"), self)
        save.triggered.connect(self._ask_where_to_save)
        self.addAction(save)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self._lay_out()
        self._pictures.set_mode(Mode.COLOR)
        follow_theme(self, self._draw_icons)
        self.begin(SegmentSettings())

    def begin(self, settings: SegmentSettings) -> None:
        """Clear the images, and mark the depth gate of a session's settings."""
        self._frame = None
        self._freeze.setChecked(False)
        self._pictures.begin(DepthColors((settings.depth_min_m, settings.depth_max_m)))
        self._pictures.show_text(message=_EMPTY)

    def set_mode(self, mode: Mode) -> None:
        """Show the colour image, the depth image or both."""
        self._mode.setCurrentText(mode)

    def show_snapshot(self, snapshot: Snapshot) -> None:
        """Show the newest frame, unless frozen, and the state of the camera."""
        if not self._freeze.isChecked() and snapshot.frame is not None:
            self._show_frame(snapshot.frame, snapshot.observation)
        message = "" if self._frame else _EMPTY
        if self._frame and snapshot.camera.problem:
            message = tr("No image")
        caption = tr("Frozen") if self._freeze.isChecked() else self._caption
        self._pictures.show_text(message=message, caption="" if message else caption)
        if 0 < snapshot.t_host_ns - self._status_ns < _STATUS_NS:
            return
        self._status_ns = snapshot.t_host_ns
        age_ms = (snapshot.t_host_ns - self._frame.t_host_ns) / 1e6 if self._frame else None
        self._status.show_status(snapshot.camera, age_ms)

    def save_picture(self, path: Path) -> None:
        """Save the displayed image as PNG; FileError if it cannot be written."""
        buffer = QBuffer()
        buffer.open(QIODevice.OpenModeFlag.WriteOnly)
        self._pictures.grab().save(buffer, "PNG")
        write_atomic(path, bytes(buffer.data().data()))

    def _lay_out(self) -> None:
        top = hbox(self._mode, (self._status.name, 1), spacing=SPACING_PX)
        freeze = tool_button(self._freeze)
        freeze.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        top.addWidget(freeze)
        vbox(
            top, (self._pictures, 1), self._status, on=self, margins=SPACING_PX, spacing=SPACING_PX
        )

    def _draw_icons(self) -> None:
        self._freeze.setIcon(icon("pause"))

    def _show_frame(self, frame: Frame, seen: Observation | None) -> None:
        if frame is not self._frame:
            self._pictures.show_frame(frame)
        self._frame = frame
        if seen is not None:
            self._pictures.show_hand(frame, seen)
            self._caption = _caption(seen)

    def _ask_where_to_save(self) -> None:
        name, _ = QFileDialog.getSaveFileName(
            self, tr("Save image"), "image.png", tr("PNG images (*.png)")
        )
        if name:
            try:
                self.save_picture(Path(name).with_suffix(".png"))
            except FileError as error:
                QMessageBox.warning(self, tr("Save image"), plain_message(str(error)))


class _Pictures(QWidget):
    """The two images, side by side."""

    def __init__(self) -> None:
        super().__init__()
        self._color = ImageView(tr("Colour image"), has_caption_beside=True)
        self._color.setObjectName("colour-image")
        self._depth = ImageView(
            tr("Depth image"),
            lambda depth: self._depth_colors.colorize(depth),
            has_caption_beside=True,
        )
        self._depth.setObjectName("depth-image")
        self._legend = DepthLegend()
        self._depth_side = QWidget()
        hbox(
            (self._depth, 1), self._legend, on=self._depth_side, margins=0, spacing=SPACING_PX // 2
        )
        hbox((self._color, 1), (self._depth_side, 1), on=self, margins=0, spacing=SPACING_PX)

    def begin(self, depth_colors: DepthColors) -> None:
        self._depth_colors = depth_colors
        self._legend.show_colors(depth_colors)
        for view in (self._color, self._depth):
            view.show_image(None)
            view.show_overlay(None)

    def set_mode(self, mode: Mode) -> None:
        self._color.setVisible(mode is not Mode.DEPTH)
        self._depth_side.setVisible(mode is not Mode.COLOR)

    def show_frame(self, frame: Frame) -> None:
        self._depth_colors.set_scale(frame.depth_scale_m)
        self._color.show_image(frame.color)
        self._depth.show_image(frame.depth)

    def show_hand(self, frame: Frame, seen: Observation) -> None:
        of_depth, of_color = overlays(frame, seen)
        self._depth.show_overlay(of_depth)
        self._color.show_overlay(of_color)

    def show_text(self, *, message: str, caption: str = "") -> None:
        is_in_depth = not self._color.has_image and not self._depth_side.isHidden()
        is_in_color = not self._color.isHidden() and not is_in_depth
        self._depth.show_text(message=message, caption="" if is_in_color else caption)
        if self._depth.has_image and not self._color.has_image:
            message = message or _NO_COLOR
        self._color.show_text(message=message, caption=caption if is_in_color else "")


class _Status(QWidget):
    """One line of numbers with fixed widths; the camera's name stands elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.name = ElidedLabel()
        self.name.setObjectName("camera-name")
        self._rate = NumberLabel(
            "camera-rate", "999.9 fps", tr("Frames per second over the last second")
        )
        self._age = NumberLabel(
            "camera-age", "9999.9 ms", tr("Time since the displayed frame arrived, in milliseconds")
        )
        self._dropped = NumberLabel(
            "camera-dropped",
            "99999",
            tr("Frames missing from the camera's own count since it started"),
        )
        hbox(
            self._rate,
            0,
            QLabel(tr("Age")),
            self._age,
            0,
            QLabel(tr("Dropped")),
            self._dropped,
            on=self,
            margins=0,
            spacing=SPACING_PX // 2,
        )
        self.show_status(CameraStatus(UNKNOWN), None)

    def show_status(self, camera: CameraStatus, age_ms: float | None) -> None:
        self.name.setText(camera.name)
        self._rate.setText(f"{camera.rate_hz:.1f} fps")
        self._age.setText(_age(age_ms))
        self._dropped.setText(str(camera.dropped))


def _age(age_ms: float | None) -> str:
    if age_ms is None:
        return UNKNOWN
    if age_ms < 1_000:
        return f"{age_ms:.1f} ms"
    return f"{age_ms / 1e3:.1f} s" if age_ms < 10_000 else f"{age_ms / 1e3:.0f} s"


def _caption(seen: Observation) -> str:
    """Return a caption for the hand."""
    if seen.has_changed:
        return sentence(seen.shape_text)
    if seen.is_over_limit and seen.rotation_rad is not None:
        return tr("Rotated by {:.1f}°: too far").format(
            np.degrees(np.linalg.norm(seen.rotation_rad))
        )
    return sentence(seen.problem)


class DepthColors:
    """Colours from `NEAREST_M` to `FARTHEST_M`, bright to dark; grey beyond the gate, holes black.

    Parameters
    ----------
    gate_m : (float, float)
        Range of depths in which a hand is looked for.
    """

    def __init__(self, gate_m: tuple[float, float]) -> None:
        self.gate_m = gate_m
        self._levels = _levels(gate_m)
        self._scale_m = 0.0
        self._level_of_depth = np.zeros(65536, np.uint8)

    def set_scale(self, depth_scale_m: float) -> None:
        """Set the size of a unit of depth in metres."""
        if depth_scale_m != self._scale_m:
            self._scale_m = depth_scale_m
            self._level_of_depth = _level(depth_scale_m * np.arange(65536.0))
            self._level_of_depth[0] = 0

    def colorize(self, depth: UInt16) -> UInt8:
        """Return (h, w, 3) RGB of a (h, w) depth image."""
        levels = cv2.LUT(depth, self._level_of_depth[None])
        return np.asarray(cv2.applyColorMap(levels, self._levels[:, None]), np.uint8)

    def ramp(self) -> UInt8:
        """Return (255, 3) RGB from the nearest to the farthest."""
        return self._levels[1:]


def _level(depth_m: Float64) -> UInt8:
    """Return depths as levels 1 to 255."""
    part = (depth_m - NEAREST_M) / (FARTHEST_M - NEAREST_M)
    return np.asarray(1.5 + 254.0 * np.clip(part, 0.0, 1.0 - 1e-9), np.uint8)


def _levels(gate_m: tuple[float, float]) -> UInt8:
    """Return (256, 3) RGB of all levels, holes first."""
    # The darkest fifth of the map is reserved for holes.
    steps = np.linspace(255.0, 50.0, 255).astype(np.uint8)
    ramp = cv2.applyColorMap(steps[:, None], cv2.COLORMAP_VIRIDIS)[:, 0, ::-1].astype(float)
    grey = ramp.mean(axis=1, keepdims=True)
    depth_m = np.linspace(NEAREST_M, FARTHEST_M, 255)[:, None]
    is_gated = (depth_m >= gate_m[0]) & (depth_m <= gate_m[1])
    ramp = np.where(is_gated, ramp, _GREY * grey + (1.0 - _GREY) * ramp)
    return np.vstack([_HOLE, ramp]).astype(np.uint8)


class DepthLegend(QWidget):
    """The scale, with the limits of the gate marked."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colors: DepthColors | None = None
        self.setObjectName("depth-legend")
        self.setAccessibleName(tr("Scale of depth"))
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        width_px = self.fontMetrics().horizontalAdvance("0.00 m")
        self.setFixedWidth(_BAR_PX + SPACING_PX + width_px)

    def show_colors(self, depth_colors: DepthColors) -> None:
        """Show the scale of some colours."""
        self._colors = depth_colors
        low_m, high_m = depth_colors.gate_m
        self.setToolTip(
            tr(
                "Depth in metres. A hand is looked for from {:.2f} to {:.2f} m (colour). "
                "Grey: nearer or farther. Black: not measured."
            ).format(low_m, high_m)
        )
        self.update()

    def paintEvent(self, _: QPaintEvent) -> None:
        """Draw the bar from near, at the top, to far, with its marks."""
        if self._colors is None:
            return
        painter = QPainter(self)
        line_px = self.fontMetrics().height()
        bar = QRectF(0, line_px / 2, _BAR_PX, self.height() - line_px)
        ramp = np.ascontiguousarray(self._colors.ramp())
        painter.drawImage(bar, QImage(ramp.data, 1, len(ramp), 3, QImage.Format.Format_RGB888))
        painter.setPen(QPen(self.palette().windowText().color(), 1))
        for depth_m in (NEAREST_M, *self._colors.gate_m, FARTHEST_M):
            part = (depth_m - NEAREST_M) / (FARTHEST_M - NEAREST_M)
            y = bar.top() + part * bar.height()
            painter.drawLine(QPointF(0, y), QPointF(_BAR_PX + SPACING_PX / 2, y))
            where = QRectF(_BAR_PX + SPACING_PX, y - line_px / 2, self.width(), line_px)
            painter.drawText(where, Qt.AlignmentFlag.AlignVCenter, f"{depth_m:.2f} m")
