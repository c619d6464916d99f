from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QImage
from PySide6.QtWidgets import QComboBox, QFileDialog, QMessageBox, QToolButton
from pytestqt.qtbot import QtBot

from handcal.core.errors import FileError
from handcal.core.geometry import rigid
from handcal.hand.settings import SegmentSettings
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.camera.panel import CameraPanel, DepthLegend, Mode
from handcal_gui.widgets.image_view import ImageView
from tests.gui.conftest import NOW_NS, Shots
from tests.gui.helpers import child, show, text

Maker = Callable[..., Snapshot]


@pytest.fixture
def panel(qtbot: QtBot) -> CameraPanel:
    return show(qtbot, CameraPanel(), 380, 300)


def view(panel: CameraPanel, name: str) -> ImageView:
    return child(panel, ImageView, f"{name}-image")


def picture(panel: CameraPanel, name: str = "colour") -> QImage:
    return view(panel, name).grab().toImage()


def test_an_empty_panel_says_what_will_come(panel: CameraPanel) -> None:
    assert view(panel, "colour").message == "The camera's image will appear here."
    assert text(panel, "camera-age") == "–"


def test_it_tells_how_the_camera_does(panel: CameraPanel, snapshot: Maker) -> None:
    panel.show_snapshot(snapshot(camera={"rate_hz": 29.97, "dropped": 3}))
    assert text(panel, "camera-name") == "Simulated camera"
    assert text(panel, "camera-rate") == "30.0 fps"
    assert text(panel, "camera-age") == "42.0 ms"
    assert text(panel, "camera-dropped") == "3"


def test_the_numbers_change_five_times_a_second(panel: CameraPanel, snapshot: Maker) -> None:
    shown = []
    for i in range(8):
        panel.show_snapshot(snapshot(camera={"dropped": i}, t_host_ns=NOW_NS + i * 50_000_000))
        shown.append(text(panel, "camera-dropped"))
    assert shown == list("00004444")


@pytest.mark.parametrize(
    ("mode", "color", "depth"),
    [(Mode.COLOR, True, False), (Mode.DEPTH, False, True), (Mode.BOTH, True, True)],
)
def test_either_picture_or_both(
    panel: CameraPanel, snapshot: Maker, mode: Mode, color: bool, depth: bool
) -> None:
    panel.show_snapshot(snapshot())
    combo = panel.findChild(QComboBox)
    assert combo is not None
    combo.setCurrentText(mode)
    assert view(panel, "colour").isVisible() == color
    assert view(panel, "depth").isVisible() == depth


def test_the_hand_is_drawn_in_both_pictures(panel: CameraPanel, snapshot: Maker) -> None:
    panel.set_mode(Mode.BOTH)
    for name in ("colour", "depth"):
        panel.show_snapshot(snapshot(observation={"hand": None, "cloud": None}))
        without = picture(panel, name)
        panel.show_snapshot(snapshot())
        blue = picture(panel, name)
        panel.show_snapshot(snapshot(observation={"is_over_limit": True}))
        assert without != blue
        assert blue != picture(panel, name)


def test_a_turned_hand_is_called_so_in_words(panel: CameraPanel, snapshot: Maker) -> None:
    turned = {"is_over_limit": True, "rotation_rad": np.radians([0.0, 0.0, 12.34])}
    panel.show_snapshot(snapshot(observation=turned))
    for mode, captions in ((Mode.BOTH, (1, 0)), (Mode.DEPTH, (0, 1)), (Mode.COLOR, (1, 0))):
        panel.set_mode(mode)
        panel.show_snapshot(snapshot(observation=turned))
        shown = [view(panel, name).caption for name in ("colour", "depth")]
        assert shown == ["Rotated by 12.3°: too far" * count for count in captions], mode


def test_a_lost_hand_is_explained(panel: CameraPanel, snapshot: Maker) -> None:
    lost = {
        "hand": None,
        "cloud": None,
        "problem": "hand cut by the image border; move it toward the middle",
    }
    panel.show_snapshot(snapshot(observation=lost))
    assert (
        view(panel, "colour").caption == "Hand cut by the image border; move it toward the middle"
    )


def test_between_frames_the_hand_stays(panel: CameraPanel, snapshot: Maker) -> None:
    panel.show_snapshot(snapshot())
    before = picture(panel)
    panel.show_snapshot(snapshot(observation=None, number=2))
    assert picture(panel) == before


def test_colour_from_another_camera_has_the_hand_elsewhere(
    panel: CameraPanel, snapshot: Maker, shots: Shots
) -> None:
    panel.show_snapshot(snapshot())
    before = picture(panel)
    beside = replace(shots.frame, T_C_D=rigid(translation_m=[0.05, 0.0, 0.0]))
    panel.show_snapshot(snapshot(frame=beside))
    assert picture(panel) != before


def test_a_camera_without_colour_says_so(panel: CameraPanel, snapshot: Maker, shots: Shots) -> None:
    depth_only = replace(shots.frame, color=None, color_intrinsics=None)
    panel.show_snapshot(snapshot(frame=depth_only))
    assert view(panel, "colour").message == "This camera has no colour image."
    assert not view(panel, "depth").message


def test_an_unplugged_camera_leaves_its_last_picture_dimmed(
    panel: CameraPanel, snapshot: Maker
) -> None:
    panel.show_snapshot(snapshot())
    before = picture(panel)
    problem = "The camera was unplugged: plug it in again"
    panel.show_snapshot(
        snapshot(
            frame=None,
            observation=None,
            camera={"problem": problem, "rate_hz": 0.0},
            t_host_ns=NOW_NS + 20_000_000_000,
        )
    )
    assert view(panel, "colour").message == "No image"
    assert text(panel, "camera-age") == "20 s"
    dimmed = picture(panel)
    assert dimmed != before
    panel.show_snapshot(snapshot(number=3))
    assert picture(panel) == before


def test_f_freezes_the_picture_but_not_the_numbers(
    panel: CameraPanel, snapshot: Maker, shots: Shots
) -> None:
    panel.show_snapshot(snapshot())
    freeze = panel.findChild(QToolButton)
    assert freeze is not None
    freeze.click()
    panel.show_snapshot(snapshot(number=2))
    before = picture(panel)
    assert view(panel, "colour").caption == "Frozen"
    black = replace(shots.frame, color=np.zeros_like(shots.frame.color))
    later = {"frame": black, "t_host_ns": NOW_NS + 1_000_000_000, "camera": {"dropped": 7}}
    panel.show_snapshot(snapshot(number=3, **later))
    assert picture(panel) == before
    assert text(panel, "camera-dropped") == "7"
    assert text(panel, "camera-age") == "1.0 s", "the age is that of the frame shown"
    assert freeze.defaultAction().shortcut().toString() == "F"
    freeze.click()
    panel.show_snapshot(snapshot(number=4, **later))
    assert picture(panel) != before


def test_another_session_begins_without_a_picture_and_with_its_own_gate(
    panel: CameraPanel, snapshot: Maker
) -> None:
    panel.set_mode(Mode.DEPTH)
    empty = picture(panel, "depth")
    panel.show_snapshot(snapshot())
    hand_in_gate = picture(panel, "depth")
    panel.begin(SegmentSettings(depth_min_m=0.6, depth_max_m=0.9))
    assert picture(panel, "depth") == empty
    legend = panel.findChild(DepthLegend)
    assert legend is not None
    assert "0.60 to 0.90 m" in legend.toolTip()
    panel.show_snapshot(snapshot())
    assert picture(panel, "depth") != hand_in_gate


def test_a_picture_can_be_saved(panel: CameraPanel, snapshot: Maker, tmp_path: Path) -> None:
    panel.show_snapshot(snapshot())
    panel.save_picture(tmp_path / "hand.png")
    saved = QImage(str(tmp_path / "hand.png"))
    assert saved.size() == view(panel, "colour").size()
    assert saved.convertToFormat(QImage.Format.Format_RGB32) == picture(panel).convertToFormat(
        QImage.Format.Format_RGB32
    )
    with pytest.raises(FileError, match="nowhere"):
        panel.save_picture(tmp_path / "nowhere" / "hand.png")


def test_saving_asks_where_and_says_what_failed(
    panel: CameraPanel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    monkeypatch.setattr(QMessageBox, "warning", lambda *texts: told.append(texts[-1]))
    save = next(action for action in panel.findChildren(QAction) if "Save" in action.text())
    for name in ("", str(tmp_path / "hand"), str(tmp_path / "nowhere" / "hand.png")):
        monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_, name=name: (name, ""))
        save.trigger()
    assert [path.name for path in tmp_path.iterdir()] == ["hand.png"]
    assert len(told) == 1
    assert "nowhere" in told[0]


def test_all_can_be_reached_by_keyboard(panel: CameraPanel) -> None:
    for kind in (QComboBox, QToolButton):
        widget = panel.findChild(kind)
        assert widget is not None
        assert widget.focusPolicy() & Qt.FocusPolicy.TabFocus
