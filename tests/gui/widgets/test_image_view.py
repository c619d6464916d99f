from __future__ import annotations

import numpy as np
from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPainter
from pytestqt.qtbot import QtBot

from handcal.core.types import UInt8, UInt16
from handcal_gui.widgets.image_view import ImageView

RED = QColor(255, 0, 0)


def red(width: int, height: int) -> UInt8:
    return np.broadcast_to(np.array([255, 0, 0], np.uint8), (height, width, 3)).copy()


def shown(view: ImageView, width: int, height: int) -> QImage:
    view.resize(width, height)
    return view.grab().toImage()


def test_an_image_keeps_its_shape_in_the_middle(qtbot: QtBot) -> None:
    view = ImageView("Test picture")
    qtbot.addWidget(view)
    view.show_image(red(320, 180))
    picture = shown(view, 400, 400)
    ground = view.palette().window().color()
    top, bottom = 200 - 225 // 2, 200 + 225 // 2
    for x in (1, 200, 398):
        assert picture.pixelColor(x, top + 2) == picture.pixelColor(x, bottom - 2) == RED
        assert picture.pixelColor(x, top - 3) == picture.pixelColor(x, bottom + 3) == ground
    assert shown(view, 400, 100).pixelColor(20, 50) == ground


def test_rgb_is_not_bgr_and_grey_is_grey(qtbot: QtBot) -> None:
    view = ImageView("Test picture")
    qtbot.addWidget(view)
    view.show_image(np.full((180, 320, 3), (10, 20, 200), np.uint8))
    assert shown(view, 160, 90).pixelColor(80, 45) == QColor(10, 20, 200)
    view.show_image(np.full((180, 320), 77, np.uint8))
    assert shown(view, 160, 90).pixelColor(80, 45) == QColor(77, 77, 77)


def test_the_overlay_is_drawn_in_the_image_s_pixels(qtbot: QtBot) -> None:
    def mark(painter: QPainter) -> None:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
        painter.fillRect(QRectF(9.5, 19.5, 1.0, 1.0), Qt.GlobalColor.blue)  # pixel (10, 20)

    view = ImageView("Test picture")
    qtbot.addWidget(view)
    view.show_image(red(40, 30))
    view.show_overlay(mark)
    picture = shown(view, 400, 300)
    blue = {(x // 10, y // 10) for x in range(400) for y in range(300)
            if picture.pixelColor(x, y) == QColor(0, 0, 255)}  # fmt: skip
    assert blue == {(10, 20)}
    view.show_overlay(None)
    assert shown(view, 400, 300).pixelColor(105, 205) == RED


def test_the_overlay_ends_with_the_image(qtbot: QtBot) -> None:
    view = ImageView("Test picture")
    qtbot.addWidget(view)
    view.show_image(red(40, 30))
    view.show_overlay(lambda painter: painter.fillRect(-99, -99, 999, 999, Qt.GlobalColor.blue))
    picture = shown(view, 400, 200)
    assert picture.pixelColor(5, 100) == view.palette().window().color()
    assert picture.pixelColor(200, 100) == QColor(0, 0, 255)


def test_another_kind_of_image_is_coloured_at_the_size_shown(qtbot: QtBot) -> None:
    sizes = []

    def colorize(depth: UInt16) -> UInt8:
        sizes.append(depth.shape)
        return np.where(depth[..., None] == 1234, [[[0, 255, 0]]], 0).astype(np.uint8)

    view = ImageView("Test picture", colorize)
    qtbot.addWidget(view)
    view.show_image(np.full((720, 1280), 1234, np.uint16))
    picture = shown(view, 320, 180)
    assert picture.pixelColor(160, 90) == QColor(0, 255, 0)
    assert sizes == [(180, 320)]
    shown(view, 320, 180)
    assert len(sizes) == 1, "a second look at one image costs nothing"
