from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtGui import QColor
from pytestqt.qtbot import QtBot

from handcal_gui.app import theme
from handcal_gui.calibrate.rotation.panel import RotationDial

LIMIT_RAD = float(np.radians(9.0))


@pytest.fixture
def dial(qtbot: QtBot) -> RotationDial:
    dial = RotationDial()
    qtbot.addWidget(dial)
    dial.resize(220, 200)
    return dial


def painted(dial: RotationDial, role: str) -> int:
    """Count pixels of a role's colour."""
    image, color = dial.grab().toImage(), QColor(getattr(theme.colors(), role))
    return sum(
        image.pixelColor(x, y) == color for x in range(image.width()) for y in range(image.height())
    )


@pytest.mark.parametrize(("angle_deg", "role", "other"), [(4, "live", "red"), (11, "red", "live")])
def test_colour_tells_the_side_of_the_limit(
    dial: RotationDial, angle_deg: float, role: str, other: str
) -> None:
    dial.show_angle(float(np.radians(angle_deg)), LIMIT_RAD, "a word")
    assert dial.is_over == (role == "red")
    assert painted(dial, role) > 500
    assert painted(dial, other) == 0


def test_the_arc_grows_with_the_angle_to_the_end_of_the_scale(dial: RotationDial) -> None:
    def arc(angle_deg: float) -> int:
        dial.show_angle(float(np.radians(angle_deg)), LIMIT_RAD, "")
        return painted(dial, "red")

    assert arc(10.0) + 200 < arc(17.0)
    assert arc(18.0) == pytest.approx(arc(88.0), rel=0.1)


def test_a_word_of_refusal_is_red_although_the_angle_is_within_the_limit(
    dial: RotationDial,
) -> None:
    dial.show_angle(0.5 * LIMIT_RAD, LIMIT_RAD, "▲ Shape differs", is_refused=True)
    assert painted(dial, "red") > 50
    assert painted(dial, "live") > 500, "the angle itself is fine"


def test_without_an_angle_there_is_no_verdict_in_colour(dial: RotationDial) -> None:
    dial.show_angle(None, LIMIT_RAD, "? No hand")
    assert not dial.is_over
    assert painted(dial, "red") == painted(dial, "live") == 0
    assert dial.accessibleDescription() == "? No hand"


def test_it_is_painted_only_if_it_looks_different(
    dial: RotationDial, monkeypatch: pytest.MonkeyPatch
) -> None:
    painted: list[object] = []
    monkeypatch.setattr("handcal_gui.calibrate.rotation.panel.update_in_turn", painted.append)
    for angle_deg, times in ((3.01, 1), (3.04, 1), (3.06, 2), (8.99, 3), (9.01, 4)):
        dial.show_angle(float(np.radians(angle_deg)), np.radians(9.0), "a word")
        assert len(painted) == times, angle_deg
    dial.show_angle(float(np.radians(9.01)), np.radians(9.0), "another word")
    assert len(painted) == 5
