"""Taking captures with a camera before which the tests put one thing after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QCheckBox, QComboBox, QLabel, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from handcal.core.errors import CameraError
from handcal.core.geometry import rigid
from handcal.core.types import Intrinsics, UInt8
from handcal.rig.cube import Cube, write_cube
from handcal.rig.displays.grid import Grid, draw_grid
from handcal.rig.example import example_rig
from handcal.rig.formats import write_intrinsics
from handcal.sim.boards import PictureSettings
from handcal.sim.cube import CubePainter
from handcal_gui.evaluate.capture_dialog import CaptureDialog
from handcal_gui.evaluate.entries import CubeEntries
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.live_cameras import LiveCameras
from handcal_gui.widgets.path_field import PathField
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child

Kind = TypeVar("Kind", bound=QWidget)
GRID_CAMERA = Intrinsics(634, 360, 900.0, 900.0, 316.5, 179.5, ())


@lru_cache(maxsize=1)
def cube_seen() -> UInt8:
    camera = Intrinsics(640, 360, 900.0, 900.0, 320.0, 180.0)
    pose = rigid([0, 0, 0.1], [0, 0, 0.45]) @ rigid([0.5, 0, 0]) @ rigid([0, 0.7, 0])
    painter = CubePainter(Cube(), camera, PictureSettings(samples=1))
    return np.repeat(painter.paint(pose, np.random.default_rng(1))[..., None], 3, axis=2)


def grid_seen() -> UInt8:
    display = example_rig().eyes["left"]
    grid = draw_grid(Grid(display.width_px, display.height_px))
    return np.repeat(grid[..., None], 3, axis=2)


class Technician:
    """Uses the dialog."""

    def __init__(self, qtbot: QtBot, entries: CubeEntries, camera: Any) -> None:
        self._wait = qtbot.waitUntil
        self.camera = camera
        self.dialog = CaptureDialog(
            entries, open_source=lambda _source, *_how: camera, list_cameras=lambda: [3]
        )
        qtbot.addWidget(self.dialog)
        self.dialog.show()
        self.list, self.live = (
            self._child(Table, "captures"),
            self._child(LiveCameras, "liveCameras"),
        )
        self.start_button = self._child(QPushButton, "startCameras")
        self.button = self._child(QPushButton, "takeImage")
        self.axes = self._child(QLabel, "axes")

    @property
    def said(self) -> str:
        return self._child(QLabel, "takenFound").text()

    @property
    def told(self) -> str:
        return self._child(QLabel, "instruction").text()

    def wait(self, condition: Callable[[], bool]) -> None:
        self._wait(condition, timeout=20_000)

    def wait_for_instruction(self, text: str) -> None:
        self.wait(lambda: self.told == text)

    def start(self) -> None:
        self.wait(self.start_button.isEnabled)
        self.start_button.click()
        self.wait(self.button.isEnabled)

    def put(self, scene: UInt8) -> None:
        """Put something before the camera, and wait until it is seen."""
        self.camera.image = scene
        self.wait(
            lambda: self.live.images is not None and np.array_equal(self.live.images[0], scene)
        )

    def press_space(self) -> None:
        focused = self.dialog.focusWidget()
        assert focused is not None
        QTest.keyClick(focused, Qt.Key.Key_Space)

    def close(self) -> None:
        self.dialog.reject()

    def _child(self, kind: type[Kind], name: str) -> Kind:
        found = self.dialog.findChild(kind, name)
        assert isinstance(found, kind)
        return found


@pytest.fixture
def entries(tmp_path: Path) -> CubeEntries:
    (tmp_path / "captures").mkdir()
    write_cube(tmp_path / "captures" / "cube.json", Cube())
    return CubeEntries(captures=str(tmp_path / "captures"), positions="centre", poses=1)


@pytest.fixture
def make(qtbot: QtBot, still_camera: Any) -> Iterator[Callable[[CubeEntries], Technician]]:
    made: list[Technician] = []

    def make_one(entries: CubeEntries) -> Technician:
        made.append(Technician(qtbot, entries, still_camera(grid_seen())))
        return made[-1]

    yield make_one
    for technician in made:
        technician.close()


def test_captures_are_taken_one_after_the_other(
    make: Callable[[CubeEntries], Technician], entries: CubeEntries
) -> None:
    technician = make(entries)
    folder = Path(entries.captures)
    technician.wait_for_instruction("Choose the camera, and press Show.")
    assert technician.said == "", "an instruction is no warning"
    assert (technician.start_button.isVisible(), technician.button.isVisible()) == (True, False)
    technician.wait(technician.start_button.isEnabled)
    technician.press_space()
    technician.wait(technician.button.isVisible)
    assert technician.said == ""
    assert technician.told == "centre: show the grid on the display, darken the room."
    technician.press_space()
    technician.wait_for_instruction("centre/pose-1: switch the display off.")
    assert technician.said.startswith("Taken: centre/grid.png, ")
    technician.put(cube_seen())
    technician.press_space()
    technician.wait_for_instruction("centre/pose-1: show the virtual cube, cover the real one.")
    assert technician.said == "Taken: centre/pose-1/real.png, 3 faces of the cube."
    technician.button.click()
    technician.wait_for_instruction("All captures have been taken.")
    assert not technician.button.isEnabled()
    assert sorted(path.name for path in folder.rglob("*.png")) == [
        "grid.png",
        "real.png",
        "virtual.png",
    ]
    assert technician.camera.is_open
    technician.close()
    assert not technician.camera.is_open


def test_what_is_taken_can_be_taken_again(
    make: Callable[[CubeEntries], Technician], entries: CubeEntries
) -> None:
    real = Path(entries.captures, "centre", "pose-1", "real.png")
    real.parent.mkdir(parents=True)
    real.write_bytes(b"earlier")
    technician = make(entries)
    technician.start()
    technician.put(cube_seen())
    assert technician.button.text() == "Take"
    technician.list.selectRow(1)
    assert technician.button.text() == "Take again"
    technician.press_space()
    technician.wait_for_instruction("centre/pose-1: show the virtual cube, cover the real one.")
    assert real.read_bytes() != b"earlier"
    assert technician.button.text() == "Take"


def test_an_image_in_which_nothing_is_seen_is_not_kept(
    make: Callable[[CubeEntries], Technician], entries: CubeEntries
) -> None:
    technician = make(replace(entries, with_grid=False))
    technician.start()
    technician.put(np.zeros((360, 640, 3), np.uint8))
    technician.button.click()
    told = "Not taken: the image is too dark: add light, or lengthen the exposure."
    technician.wait(lambda: technician.said == told)
    technician.wait(technician.button.isEnabled)
    assert technician.told == "centre/pose-1: switch the display off."
    assert not any(Path(entries.captures).rglob("*.png"))


def test_the_plan_can_be_changed_and_is_remembered(
    make: Callable[[CubeEntries], Technician], entries: CubeEntries
) -> None:
    technician = make(entries)
    technician.start()
    technician.wait_for_instruction("centre: show the grid on the display, darken the room.")
    technician.dialog.form.enter(positions="up,  down", poses=2, drawn="old, new", with_grid=False)
    technician.wait_for_instruction("up/pose-1: switch the display off.")
    assert len(technician.list.keys) == 2 * 2 * 3
    changed = replace(entries, positions="up,  down", poses=2, drawn="old, new", with_grid=False)
    assert technician.dialog.entries == changed
    technician.dialog.form.enter(positions="up/down")
    assert technician.told == "A name is of letters, digits, _ and -, not 'up/down'."
    assert technician.list.chosen == []
    technician.dialog.form.enter(positions="")
    assert technician.told == "Name a position of the camera, at least one."


def test_without_the_cube_none_can_be_taken(
    make: Callable[[CubeEntries], Technician], entries: CubeEntries
) -> None:
    technician = make(replace(entries, cube="nowhere/other.json"))
    technician.wait(lambda: "There is no nowhere/other.json" in technician.said)
    where = "Close this window to choose the files of the cube and the rig."
    assert technician.said.endswith(where)
    assert not technician.start_button.isEnabled()
    assert not technician.told


def test_a_failing_camera_is_reported_and_can_be_shown_again(
    make: Callable[[CubeEntries], Technician], entries: CubeEntries
) -> None:
    technician = make(entries)
    technician.start()
    technician.camera.failure = CameraError("it was unplugged")
    told = "It was unplugged. Press Show to open the camera again."
    technician.wait(lambda: technician.said == told)
    assert not technician.button.isEnabled()
    technician.start()


def test_captures_at_rest_are_taken_by_themselves_and_the_view_is_turned(
    make: Callable[[CubeEntries], Technician], entries: CubeEntries
) -> None:
    write_intrinsics(Path(entries.captures, "camera.json"), GRID_CAMERA, "json")
    technician = make(entries)
    technician.camera.image = cv2.resize(grid_seen(), (634, 360), interpolation=cv2.INTER_AREA)
    technician.start()
    axes, view = technician.axes, technician.live.findChild(ImageView)
    assert isinstance(view, ImageView)
    technician.wait(lambda: axes.text().endswith("capture the display's grid first."))
    by_itself = child(technician.dialog, QCheckBox, "byItself")
    by_itself.setChecked(True)
    technician.wait_for_instruction("centre/pose-1: switch the display off.")
    technician.wait(lambda: axes.text() == "Turned to the display's axes")
    assert not view.caption, "it would hide part of what is aligned"
    technician.wait(lambda: technician.said.startswith("Waiting: "))
    technician.camera.image = cube_seen()  # of another size than the intrinsics
    technician.wait_for_instruction("centre/pose-1: show the virtual cube, cover the real one.")
    assert "640×360" in axes.text()


def test_missing_intrinsics_are_named_with_what_to_do(
    make: Callable[[CubeEntries], Technician], entries: CubeEntries
) -> None:
    technician = make(entries)
    file = Path(entries.captures, "camera.json")
    technician.wait(lambda: f"there is no {file}" in technician.axes.text())
    assert technician.axes.text().endswith("choose the file under Camera intrinsics.")


def test_stored_images_which_do_not_wait_are_not_taken_by_themselves(
    make: Callable[[CubeEntries], Technician], entries: CubeEntries, tmp_path: Path
) -> None:
    technician = make(entries)
    technician.start()
    by_itself = child(technician.dialog, QCheckBox, "byItself")
    by_itself.setChecked(True)
    source = technician.live.findChild(QComboBox, "source")
    path = technician.live.findChild(PathField)
    assert isinstance(source, QComboBox)
    assert isinstance(path, PathField)
    source.setCurrentIndex(source.findText("Recording or video"))
    path.set_path(str(tmp_path))
    technician.start()
    assert (by_itself.isEnabled(), by_itself.isChecked()) == (False, False)
    assert by_itself.text() == "Not automatically: stored images do not wait"
    source.setCurrentIndex(0)
    technician.start()
    assert by_itself.isEnabled()


def test_the_large_view_shows_the_image_alone_until_escape(
    make: Callable[[CubeEntries], Technician], entries: CubeEntries
) -> None:
    technician = make(entries)
    technician.start()
    large = child(technician.dialog, QCheckBox, "largeView")
    large.setChecked(True)
    assert not technician.list.isVisible()
    assert not technician.dialog.form.isVisible()
    assert technician.live.isVisible()
    QTest.keyClick(technician.dialog, Qt.Key.Key_Escape)
    assert technician.dialog.isVisible()
    assert technician.list.isVisible()
