import numpy as np
import pytest
from PySide6.QtCore import QPointF
from PySide6.QtGui import QColor, QImage, QPainter
from pytestqt.qtbot import QtBot

from handcal_gui.calibrate.cloud.orbit import Direction, Orbit
from handcal_gui.calibrate.cloud.panel import Box, draw_box, draw_scale

SIZE = 400


def test_box_holds_its_points_in_steps_of_50_mm() -> None:
    box = Box.around(np.array([[-1.0, 0.0, 451.0], [99.0, 50.0, 549.0]]))
    assert box == Box((-50.0, 0.0, 450.0), (100.0, 100.0, 550.0))
    assert box.corners_mm.shape == (8, 3)


def test_box_stays_while_it_fits_nearly() -> None:
    box = Box((-50.0, 0.0, 0.0), (100.0, 50.0, 50.0))
    assert box.still_fits(box)
    assert box.still_fits(Box((0.0, 0.0, 0.0), (50.0, 50.0, 50.0)))
    assert not box.still_fits(Box((-100.0, 0.0, 0.0), (100.0, 50.0, 50.0)))
    assert not box.still_fits(Box((50.0, 0.0, 0.0), (100.0, 50.0, 50.0)))


def _drawn(orbit: Orbit, box: Box) -> np.ndarray:
    """Return (SIZE, SIZE) bool, where the box and its labels were drawn."""
    image = QImage(SIZE, SIZE, QImage.Format.Format_Grayscale8)
    image.fill(255)
    painter = QPainter(image)
    painter.setPen(QColor("black"))
    painter.translate(SIZE / 2, SIZE / 2)
    draw_box(painter, box, orbit)
    painter.end()
    pixels = np.frombuffer(image.constBits(), np.uint8).reshape(SIZE, image.bytesPerLine())
    return pixels[:, :SIZE] < 255


@pytest.mark.parametrize("direction", Direction)
def test_labels_stand_outside_the_box_and_within_the_picture(
    qtbot: QtBot, direction: Direction
) -> None:
    box = Box((-100.0, -150.0, 400.0), (100.0, 100.0, 550.0))
    orbit = Orbit().looking(direction).fitted(box.corners_mm, SIZE - 120.0, SIZE - 120.0)
    drawn = _drawn(orbit, box)
    corners = orbit.project(box.corners_mm)[:, :2] + SIZE / 2
    left, right = corners[:, 0].min(), corners[:, 0].max()
    bottom = corners[:, 1].max()
    rows, columns = np.nonzero(drawn)
    beside = (columns < left - 3) | (columns > right + 3)
    below = rows > bottom + 3
    assert np.count_nonzero(beside | below) > 50
    border = np.concatenate([drawn[0], drawn[-1], drawn[:, 0], drawn[:, -1]])
    assert not border.any()


def test_scale_is_as_long_as_it_says(qtbot: QtBot) -> None:
    image = QImage(SIZE, SIZE, QImage.Format.Format_Grayscale8)
    image.fill(255)
    painter = QPainter(image)
    draw_scale(painter, Orbit(px_per_mm=1.5), QPointF(390.0, 390.0))
    em = painter.fontMetrics().height()
    painter.end()
    pixels = np.frombuffer(image.constBits(), np.uint8).reshape(SIZE, image.bytesPerLine())
    length_px = np.count_nonzero(pixels[390, :SIZE] < 255)
    length_mm = length_px / 1.5
    assert min(abs(length_mm - step) for step in (20, 50, 100)) < 2.0
    assert length_px > 3 * em
