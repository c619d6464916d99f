"""A large view of a shot with the detected corners."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QPainter, QPen
from PySide6.QtWidgets import QWidget

from handcal.core.errors import FileError
from handcal.core.types import UInt8
from handcal.rig.boards.board import BoardView
from handcal.rig.boards.views import BoardImage
from handcal_gui.app.theme import SPACING_PX, colors
from handcal_gui.app.translation import tr
from handcal_gui.engine.latest_job import LatestJob
from handcal_gui.rig.shots import Shot, read_color
from handcal_gui.widgets.fields import paragraph
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.layouts import vbox

_ARM = 0.006  # of a corner's cross, relative to the image's width


class ShotView(QWidget):
    """Shows one image, or the two of a pair, one above the other.

    Parameters
    ----------
    titles : sequence of str
        Camera of each image.
    """

    def __init__(self, titles: tuple[str, ...], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._titles = titles
        self._shot: Shot | None = None
        self._images = tuple(ImageView(title) for title in titles)
        # Above the images, as over the maps: on small ones, they would hide what they are about.
        self._captions = tuple(paragraph("shotCaption") for _ in titles)
        self._read = LatestJob(_read, self)
        self._read.answered.connect(self._show_images)
        parts = zip(self._captions, self._images, strict=True)
        pairs = [
            (vbox(caption, (image, 1), spacing=SPACING_PX // 2), 1) for caption, image in parts
        ]
        vbox(*pairs, on=self, margins=0, spacing=SPACING_PX)
        self.setMinimumWidth(30 * SPACING_PX)
        self.show_shot(None)

    def show_shot(self, shot: Shot | None) -> None:
        """Load and show a shot; None clears the view."""
        self._shot = shot
        if shot is None:
            self._show_message(tr("The selected image will appear here"))
        else:
            self._read.ask(shot.files)

    def stop(self) -> None:
        """Wait for background work to end."""
        self._read.stop()

    def _show_images(self, files: tuple[Path, ...], images: tuple[UInt8 | str, ...]) -> None:
        if self._shot is None or files != self._shot.files:
            return
        texts = zip(self._captions, self._titles, strict=True)
        parts = zip(self._images, texts, self._shot.views, images, strict=True)
        for shown, (caption, title), view, image in parts:
            found = view.found
            shown.show_image(None if isinstance(image, str) else image)
            shown.show_overlay(None if found is None else partial(_draw_corners, found))
            shown.show_text(message=image if isinstance(image, str) else "")
            caption.setText(f"{title}: {_caption(view)}")

    def _show_message(self, message: str) -> None:
        for caption, shown in zip(self._captions, self._images, strict=True):
            caption.clear()
            shown.show_image(None)
            shown.show_overlay(None)
            shown.show_text(message=message)


def _read(files: tuple[Path, ...]) -> tuple[UInt8 | str, ...]:
    return tuple(_read_one(file) for file in files)


def _read_one(file: Path) -> UInt8 | str:
    """Return an image, or why it cannot be read: the other of a pair is shown nevertheless."""
    try:
        return read_color(file)
    except FileError as error:
        return str(error)


def _caption(view: BoardImage) -> str:
    if view.found is None:
        return view.problem
    blur_px = view.found.blur_px
    return tr("{} corners; edges {:.1f} px wide").format(len(view.found.ids), blur_px)


def _draw_corners(found: BoardView, painter: QPainter) -> None:
    """Draw a cross at every corner, and a circle around the board's first."""
    arm_px = _ARM * found.size[0]
    for width, color in ((4.0, "#ffffff"), (2.0, colors().red)):
        pen = QPen(QColor(color), width * painter.device().devicePixelRatio())
        pen.setCosmetic(True)
        painter.setPen(pen)
        for x, y in found.pixels.tolist():
            painter.drawLine(QPointF(x - arm_px, y), QPointF(x + arm_px, y))
            painter.drawLine(QPointF(x, y - arm_px), QPointF(x, y + arm_px))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawEllipse(QPointF(*found.pixels[0].tolist()), 2.5 * arm_px, 2.5 * arm_px)
