"""The dialog with the simulator's headset, and with a tracker that fails."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton
from pytestqt.qtbot import QtBot

from handcal.core.errors import CameraError
from handcal.core.progress import Progress
from handcal.link.pairing import Pairings
from handcal.station.user_test.cube import (
    CubeSight,
    CubeTracking,
    TrackingOrder,
    track_cube,
)
from handcal_gui.evaluate import devices
from handcal_gui.evaluate.devices import depth_camera, paired_headset
from handcal_gui.evaluate.entries import CubeEntries
from handcal_gui.evaluate.track_dialog import TrackDialog
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child, text

Make = Callable[..., TrackDialog]


@pytest.fixture
def make(qtbot: QtBot) -> Iterator[Make]:
    made: list[TrackDialog] = []

    def make_one(by: str, track: Any, problem: str = "") -> TrackDialog:
        made.append(TrackDialog(CubeEntries(tracked_by=by), None, track, lambda: problem))
        qtbot.addWidget(made[-1])
        made[-1].show()
        return made[-1]

    yield make_one
    for dialog in made:
        dialog.reject()


def test_the_simulated_cube_is_shown_with_its_pose_until_stopped(qtbot: QtBot, make: Make) -> None:
    sights: list[CubeSight] = []

    def track(order: TrackingOrder, *others: Any) -> CubeTracking:
        connect, camera, see, progress = others
        assert connect is None
        assert camera is None

        def both(sight: CubeSight) -> None:
            sights.append(sight)
            see(sight)

        return track_cube(order, connect, camera, both, progress)

    dialog = make("virtual", track)
    start, stop = child(dialog, QPushButton, "start"), child(dialog, QPushButton, "cancel")
    first, move = (child(dialog, QLabel, name) for name in ("trackStart", "trackMove"))
    assert first.isVisible()
    start.click()
    assert move.isVisible()
    assert not start.isEnabled()
    assert stop.text() == "S&top"
    table = child(dialog, Table, "pose-of-the-cube")
    qtbot.waitUntil(lambda: len(table.keys) == 3, timeout=60_000)
    view = child(dialog, ImageView)
    assert view.has_image
    assert view.message == ""
    doing = child(dialog, QLabel, "doing")
    assert doing.text() == "Tracking…"
    stop.click()
    qtbot.waitUntil(start.isEnabled, timeout=60_000)
    assert not table.isEnabled(), "the last pose is dimmed like the image"
    assert view.message == "Stopped"
    assert text(dialog, "trackFound") == "The cube is not tracked."
    sight = next(one for one in sights if one.T_D_T is not None and one.tracked is not None)
    assert sight.T_D_T is not None
    assert sight.corners_px is not None
    camera = sight.frame.color_intrinsics
    assert camera is not None
    middle_m = sight.T_D_T[:3, 3]
    middle_px = camera.fx * middle_m[:2] / middle_m[2] + [camera.cx, camera.cy]
    low_px, high_px = sight.corners_px.min(axis=0), sight.corners_px.max(axis=0)
    assert (low_px < middle_px).all()
    assert (middle_px < high_px).all()
    assert np.ptp(sight.corners_px, axis=0).max() < camera.width / 2


def test_without_a_paired_headset_only_other_cameras_can_start(make: Make) -> None:
    dialog = make("network", track_cube, "no headset is paired")
    assert not child(dialog, QPushButton, "start").isEnabled()
    assert text(dialog, "trackFound").startswith("No headset is paired. Or choose something else")
    chosen = child(dialog, QComboBox, "tracked_by")
    chosen.setCurrentIndex(chosen.findData("camera"))
    assert child(dialog, QPushButton, "start").isEnabled()
    assert not text(dialog, "trackFound")


def test_a_headset_is_paired_once_its_key_is_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "pairing.key"
    monkeypatch.setattr(devices, "pairing_file", lambda: file)
    assert devices.pairing_problem().startswith("no headset is paired; pair one with Connect a ")
    file.write_text("nonsense")
    assert str(file) in devices.pairing_problem()
    file.unlink()
    Pairings.read(file).open_key()
    assert not devices.pairing_problem()


def test_before_a_cube_is_seen_there_is_no_empty_table(make: Make) -> None:
    dialog = make("network", track_cube)
    assert not child(dialog, Table, "pose-of-the-cube").isVisible()
    assert "will be shown here" in child(dialog, ImageView).message


def test_the_failure_of_a_camera_is_shown_and_it_can_be_started_again(
    qtbot: QtBot, make: Make
) -> None:
    def fail(_order: TrackingOrder, connect: Any, camera: Any, *_: Any) -> CubeTracking:
        assert connect is paired_headset
        assert camera is depth_camera
        raise CameraError("no RealSense camera is connected")

    dialog = make("network", fail)
    child(dialog, QPushButton, "start").click()
    qtbot.waitUntil(
        lambda: "RealSense camera is connected" in text(dialog, "trackFound"), timeout=60_000
    )
    qtbot.waitUntil(child(dialog, QPushButton, "start").isEnabled, timeout=60_000)


def test_closing_stops_a_tracker_that_does_not_end_by_itself(qtbot: QtBot, make: Make) -> None:
    begun: list[bool] = []

    def forever(*given: Any) -> CubeTracking:
        progress: Progress = given[-1]
        begun.append(True)
        while not threading.Event().wait(0.01):
            progress.check()
        raise AssertionError

    dialog = make("camera", forever)
    child(dialog, QPushButton, "start").click()
    qtbot.waitUntil(lambda: bool(begun), timeout=60_000)
    dialog.reject()
    assert not dialog.isVisible()
    assert child(dialog, QPushButton, "start").isEnabled()
