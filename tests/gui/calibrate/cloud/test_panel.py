from collections.abc import Callable

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QColor, QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QCheckBox, QToolButton, QWidget
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.core.types import Alignment
from handcal.register.results import Results, residuals_reach_m
from handcal.station.snapshot import Snapshot
from handcal_gui.app.preferences import HIDDEN_LAYERS
from handcal_gui.app.theme import colors
from handcal_gui.calibrate.cloud.orbit import Direction
from handcal_gui.calibrate.cloud.panel import CloudPanel, CloudView
from handcal_gui.calibrate.parts.legend import LegendEntry
from handcal_gui.calibrate.parts.residual_scale import ResidualScale, residual_colors
from handcal_gui.calibrate.parts.splat import rgb
from tests.gui.helpers import child, show

MakeSnapshot = Callable[..., Snapshot]


@pytest.fixture
def panel(qtbot: QtBot) -> CloudPanel:
    return show(qtbot, CloudPanel(), 380, 300)


def _view(panel: CloudPanel) -> CloudView:
    view = panel.findChild(CloudView)
    assert view is not None
    view.setFocus()
    return view


def _legend(panel: CloudPanel) -> list[str]:
    return [entry.text for entry in panel.findChildren(LegendEntry)]


def _count(widget: QWidget, color: str) -> int:
    """Return how many pixels of a widget have nearly a colour, at most a third faded."""
    image = widget.grab().toImage().convertToFormat(QImage.Format.Format_RGBA8888)
    pixels = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.width(), 4)
    wanted, canvas = np.array(rgb(color), float), np.array(rgb(colors().canvas), float)
    faded = [wanted + part * (canvas - wanted) for part in np.linspace(0.0, 0.35, 8)]
    near = [np.abs(pixels[..., :3] - shade).max(axis=2) < 8 for shade in faded]
    return int(np.count_nonzero(np.any(near, axis=0)))


def test_empty_it_says_what_will_appear(panel: CloudPanel) -> None:
    assert "Hold a hand in front" in _view(panel).accessibleDescription()
    assert _legend(panel) == ["Cursor none", "Live hand none"]


def test_live_hand_alone_is_shown_from_the_camera(
    panel: CloudPanel, snapshot: MakeSnapshot
) -> None:
    now = snapshot(State.SHOW_HAND)
    panel.show_snapshot(now)
    assert now.observation is not None
    assert now.observation.hand is not None
    assert _legend(panel) == ["Cursor none", f"Live hand {len(now.observation.hand.points_W_m):,}"]
    assert "depth camera" in _view(panel).accessibleDescription()
    assert _count(panel, colors().live) > 500
    # Half a metre from the camera.
    assert _view(panel).orbit.centre_mm[2] == pytest.approx(500.0, abs=60.0)


def test_cursor_and_hand_are_shown_about_the_cursor(
    panel: CloudPanel, snapshot: MakeSnapshot
) -> None:
    panel.show_snapshot(snapshot())
    assert "cursor" in _view(panel).accessibleDescription()
    assert _count(panel, colors().cursor) > 500
    assert _count(panel, colors().live) > 100
    assert np.abs(_view(panel).orbit.centre_mm).max() < 60.0


def test_hand_beyond_the_guard_is_red_and_said_to_be(
    panel: CloudPanel, snapshot: MakeSnapshot
) -> None:
    panel.show_snapshot(snapshot(observation={"is_over_limit": True}))
    assert "rotated too far" in _view(panel).accessibleDescription()
    assert _count(panel, colors().red) > 100
    assert _count(_view(panel), colors().live) == 0


def test_lost_hand_leaves_the_cursor_and_the_reason(
    panel: CloudPanel, snapshot: MakeSnapshot
) -> None:
    panel.show_snapshot(snapshot(observation={"hand": None, "problem": "no hand in view"}))
    assert _view(panel).accessibleDescription() == "No hand in view"
    assert _legend(panel)[1] == "Live hand none"
    assert _count(panel, colors().cursor) > 500


def test_unplugged_camera_takes_the_hand_away(panel: CloudPanel, snapshot: MakeSnapshot) -> None:
    panel.show_snapshot(snapshot(State.SHOW_HAND))
    panel.show_snapshot(
        snapshot(State.SHOW_HAND, observation=None, camera={"problem": "the camera is gone"})
    )
    assert _view(panel).accessibleDescription() == "No image"
    assert _count(_view(panel), colors().live) == 0


def test_snapshot_without_a_frame_changes_nothing(
    panel: CloudPanel, snapshot: MakeSnapshot
) -> None:
    panel.show_snapshot(snapshot())
    before = panel.grab().toImage()
    panel.show_snapshot(snapshot(observation=None))
    assert panel.grab().toImage() == before


def test_pairs_are_drawn_on_demand(panel: CloudPanel, snapshot: MakeSnapshot) -> None:
    checkbox = panel.findChild(QCheckBox, "cloud-pairs")
    assert checkbox is not None
    panel.show_snapshot(snapshot())
    assert _count(_view(panel), colors().good) == 0
    checkbox.click()
    panel.show_snapshot(snapshot())
    assert _count(_view(panel), colors().good) > 300
    checkbox.click()
    assert _count(_view(panel), colors().good) == 0


def test_finished_alignment_shows_residuals_on_a_scale(
    panel: CloudPanel, alignments: tuple[Alignment, ...], results: Results
) -> None:
    scale = panel.findChild(ResidualScale)
    assert scale is not None
    assert not scale.isVisible()
    residuals_m = results.alignments[1]["left"].residuals_m
    panel.show_alignment(alignments[0], residuals_m, residuals_reach_m(results))
    assert scale.isVisible()
    assert _legend(panel) == ["Cursor 600", "Hand 600"]
    assert _count(_view(panel), colors().live) == 0
    assert _count(_view(panel), colors().cursor) == 0, "the cursor would cover the residuals"


@pytest.mark.parametrize(
    ("layer", "key", "color"),
    [("cursor", Qt.Key.Key_C, "cursor"), ("hand", Qt.Key.Key_L, "live")],
)
def test_the_legend_hides_and_shows_each_cloud(
    panel: CloudPanel, snapshot: MakeSnapshot, layer: str, key: Qt.Key, color: str
) -> None:
    panel.show_snapshot(snapshot())
    box = panel.findChild(QWidget, f"legend-{layer}")
    assert box is not None
    switch = child(box, QCheckBox)
    for hide in (switch.click, lambda: QTest.keyClick(_view(panel), key)):
        assert _count(_view(panel), getattr(colors(), color)) > 100
        hide()
        assert not switch.isChecked()
        assert panel.hidden_layers == tuple(sorted((*HIDDEN_LAYERS, layer)))
        panel.show_snapshot(snapshot(number=2))
        assert _count(_view(panel), getattr(colors(), color)) == 0
        switch.click()
    assert panel.hidden_layers == HIDDEN_LAYERS


def test_with_all_points_hidden_it_says_how_to_show_them(
    panel: CloudPanel, snapshot: MakeSnapshot
) -> None:
    panel.show_snapshot(snapshot())
    panel.hide_layers(("cursor", "hand"))
    assert _view(panel).accessibleDescription() == (
        "All points are hidden. Switch cursor or hand on below."
    )
    panel.show_snapshot(snapshot(observation={"hand": None, "problem": "no hand in view"}))
    assert _view(panel).accessibleDescription() == "No hand in view"


def test_the_cursor_of_a_finished_alignment_is_shown_on_demand(
    panel: CloudPanel, alignments: tuple[Alignment, ...], results: Results, snapshot: MakeSnapshot
) -> None:
    panel.show_alignment(alignments[0], results.alignments[1]["left"].residuals_m, 0.002)
    QTest.keyClick(_view(panel), Qt.Key.Key_C)
    assert _count(_view(panel), colors().cursor) > 50
    assert panel.hidden_layers == ("pairs",)
    panel.hide_layers(("cursor",))
    assert _count(_view(panel), colors().cursor) > 50
    panel.show_snapshot(snapshot())
    assert _count(_view(panel), colors().cursor) == 0


def test_an_outlier_is_a_cross_in_the_view_and_in_its_key(qtbot: QtBot) -> None:
    view, scale = show(qtbot, CloudView(), 300, 300), show(qtbot, ResidualScale(), 300, 20)
    cube_mm = (80.0 * (np.indices((2, 2, 2)).reshape(3, -1).T - 0.5)).astype(np.float64)
    view.show_points(cube_mm, np.zeros((8, 3), np.uint8), "mm", np.zeros((1, 3)))
    view.look(Direction.FRONT)
    for widget in (view, scale):
        shown = widget.grab().toImage()
        is_cross = np.array(
            [
                [shown.pixelColor(x, y) == QColor(colors().muted) for x in range(shown.width())]
                for y in range(shown.height())
            ]
        )
        places = np.argwhere(is_cross)
        rows, columns = (places - places.mean(axis=0)).T
        assert rows.max() >= 2
        assert np.abs(np.abs(rows) - np.abs(columns)).max() <= 1.5  # on both diagonals only


def test_the_colours_of_residuals_follow_the_data(results: Results) -> None:
    reach_m = residuals_reach_m(results)
    residuals_m = np.concatenate(
        [one.residuals_m for eyes in results.alignments.values() for one in eyes.values()]
    )
    assert 0.97 < (residuals_m[~np.isnan(residuals_m)] < reach_m).mean() < 0.99
    none, half, most, beyond = residual_colors(
        reach_m * np.array([0.0, 0.5, 1.0, 3.0]), reach_m
    ).tolist()
    assert none != half != most
    assert most == beyond


@pytest.mark.parametrize(
    ("name", "key", "yaw_deg", "pitch_deg"),
    [
        ("front", Qt.Key.Key_1, 0.0, 0.0),
        ("side", Qt.Key.Key_2, 90.0, 0.0),
        ("top", Qt.Key.Key_3, 0.0, 90.0),
    ],
)
def test_buttons_and_keys_look_from_a_side(
    panel: CloudPanel, name: str, key: Qt.Key, yaw_deg: float, pitch_deg: float
) -> None:
    view, button = _view(panel), panel.findChild(QToolButton, f"cloud-{name}")
    assert button is not None
    for look in (button.click, lambda: QTest.keyClick(view, key)):
        QTest.keyClick(view, Qt.Key.Key_R)
        assert view.orbit.yaw_rad not in (0.0, np.radians(90.0))
        look()
        assert np.degrees([view.orbit.yaw_rad, view.orbit.pitch_rad]) == pytest.approx(
            [yaw_deg, pitch_deg]
        )


def test_mouse_turns_moves_and_goes_back(panel: CloudPanel, snapshot: MakeSnapshot) -> None:
    view = _view(panel)
    panel.show_snapshot(snapshot())
    panel.grab()
    start = view.orbit

    def drag(button: Qt.MouseButton) -> None:
        QTest.mousePress(view, button, pos=QPoint(100, 100))
        QTest.mouseMove(view, QPoint(130, 110))
        QTest.mouseRelease(view, button, pos=QPoint(130, 110))

    drag(Qt.MouseButton.LeftButton)
    assert view.orbit.yaw_rad == pytest.approx(start.yaw_rad - 0.3)
    assert view.orbit.pitch_rad == pytest.approx(start.pitch_rad + 0.1)
    before = view.orbit
    drag(Qt.MouseButton.RightButton)
    assert view.orbit.centre_mm != before.centre_mm
    QTest.keyClick(view, Qt.Key.Key_Plus)
    assert view.orbit.px_per_mm == pytest.approx(1.2 * before.px_per_mm)
    panel.grab()  # a chosen size is kept
    assert view.orbit.px_per_mm == pytest.approx(1.2 * before.px_per_mm)
    QTest.mouseDClick(view, Qt.MouseButton.LeftButton)
    panel.grab()
    assert view.orbit == start


def test_a_low_view_gives_the_room_of_the_labels_to_the_cloud(qtbot: QtBot) -> None:
    side_mm = np.linspace(-50.0, 50.0, 5)
    cube_mm = np.stack(np.meshgrid(side_mm, side_mm, side_mm), axis=-1).reshape(-1, 3)
    view = show(qtbot, CloudView(), 345, 120)
    view.show_points(cube_mm, np.zeros((len(cube_mm), 3), np.uint8), "mm")
    view.grab()
    assert np.ptp(view.orbit.project(cube_mm)[:, 1]) > 0.5 * view.height()
