from __future__ import annotations

import numpy as np
import pytest
from pytestqt.qtbot import QtBot
from scipy.spatial.transform import Rotation

from handcal.core.types import Float64
from handcal_gui.calibrate.rotation.panel import TurningHand

NEAREST = {"x": (0, 0, -1), "y": (0, 0, -1), "z": (0, -1, 0)}
"""Centre of the arrow: on the wearer's side, or at the top."""


def arrow_centre(picture: TurningHand) -> Float64:
    """Return the mean position, from the centre, of the pixels in the arrow's colour."""
    image = picture.grab().toImage()
    color = picture.palette().windowText().color()
    places = [
        (x, y)
        for x in range(image.width())
        for y in range(image.height())
        if image.pixelColor(x, y) == color
    ]
    assert len(places) > 100
    return np.array(np.mean(places, axis=0) - [image.width() / 2, image.height() / 2])


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("positive", [True, False])
def test_the_arrow_head_is_where_the_turn_moves_the_near_side(
    qtbot: QtBot, axis: str, positive: bool
) -> None:
    picture = TurningHand()
    qtbot.addWidget(picture)
    picture.resize(200, 200)
    picture.show_turn(axis, positive=positive)
    towards = arrow_centre(picture)
    picture.show_turn(axis, positive=not positive)
    towards = towards - arrow_centre(picture)
    vector = 0.1 * np.eye(3)["xyz".index(axis)] * (1 if positive else -1)
    near = np.array(NEAREST[axis], dtype=float)
    moved = Rotation.from_rotvec(vector).apply(near) - near
    assert towards @ moved[:2] > 0.0


def test_no_arrow_without_a_turn(qtbot: QtBot) -> None:
    picture = TurningHand()
    qtbot.addWidget(picture)
    picture.resize(200, 200)
    straight = picture.grab().toImage()
    picture.show_turn("y")
    assert picture.grab().toImage() != straight
    picture.show_turn("")
    assert picture.grab().toImage() == straight
