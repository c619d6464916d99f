"""The wizard from the first image to a rig file in use, with rendered photographs."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QLabel,
    QLineEdit,
    QListWidget,
    QPushButton,
    QSpinBox,
)
from pytestqt.qtbot import QtBot

from handcal.core.types import Origin
from handcal.rig.boards.board import Board
from handcal.rig.example import example_rig
from handcal.rig.formats import write_intrinsics
from handcal.rig.rig_file import read_rig
from handcal_gui.app.theme import colors, icon
from handcal_gui.rig.project_folder import ProjectFolder
from handcal_gui.rig.take_dialog import TakeDialog
from handcal_gui.rig.wizard import RigWizard
from handcal_gui.widgets.fields import MainButton
from handcal_gui.widgets.table import Table
from tests.gui.helpers import letters
from tests.gui.rig.wizard_steps import (
    BOARDS,
    LEFT,
    RESULT,
    RIGHT,
    STEREO,
    VIEWPOINT,
    child,
    findings,
    marks,
    page_of,
    show_tab,
    solve,
    tick,
    wait,
)


def test_a_rig_is_calibrated_saved_and_used(
    qtbot: QtBot, wizard: RigWizard, choose: Callable[[Path], None], folder: Path, tmp_path: Path
) -> None:
    undone = "not done yet"
    assert marks(wizard) == [undone] * 6
    assert "added to the rig" in solve(qtbot, wizard, STEREO)
    assert "displays will be calibrated with it" in solve(qtbot, wizard, VIEWPOINT)
    assert "added to the rig" in solve(qtbot, wizard, LEFT)
    assert undone not in marks(wizard)[:RIGHT]
    assert marks(wizard)[VIEWPOINT] == "needs more views"  # eight of them
    assert marks(wizard)[RIGHT:] == [undone, undone]
    wizard.show_step(RESULT)
    child(wizard, QLineEdit, "rigName").setText("Our headset")
    use = child(wizard, QPushButton, "useRig")
    assert not use.isEnabled()
    choose(tmp_path / "ours.yaml")
    child(wizard, QPushButton, "saveRig").click()
    assert use.isEnabled()
    rig, truth = read_rig(tmp_path / "ours.yaml"), example_rig()
    assert rig.name == "Our headset"
    assert set(rig.origins) == {"T_H_D", "left"}
    assert np.linalg.norm(rig.T_H_D[:3, 3] - truth.T_H_D[:3, 3]) < 0.0005
    assert np.linalg.norm(rig.eyes["left"].t_C0_V_m - truth.eyes["left"].t_C0_V_m) < 0.005
    np.testing.assert_array_equal(rig.eyes["right"].K, truth.eyes["right"].K)
    # Nothing of it is lost by closing.
    wizard.accept()
    again = RigWizard(ProjectFolder(folder))
    qtbot.addWidget(again)
    assert marks(again) == marks(wizard)
    assert again.project.rig.name == "Our headset"
    assert again.project.inputs == wizard.project.inputs


def test_an_image_is_dropped_and_taken_in_again(
    qtbot: QtBot, wizard: RigWizard, folder: Path
) -> None:
    assert "8 pairs" in solve(qtbot, wizard, STEREO)
    shots = child(wizard, Table, "shots")
    tick(shots, 1, False)
    assert "7 pairs" in solve(qtbot, wizard, STEREO)
    assert wizard.project.rig.origins["T_H_D"].views == 7
    wizard.accept()
    assert ProjectFolder(folder).load()[0].stereo.dropped == ("depth-002.png",)
    wizard.show()
    tick(shots, 1, True)
    assert "8 pairs" in solve(qtbot, wizard, STEREO)


def test_a_failed_step_is_crossed_in_the_rail(qtbot: QtBot, wizard: RigWizard) -> None:
    def sign() -> QImage:
        rail: QListWidget = child(wizard, QListWidget, "rigRail")
        return rail.item(STEREO).icon().pixmap(16).toImage()

    undone, entries = sign(), wizard.project.inputs.stereo
    page = page_of(wizard, STEREO)
    page.form.enter(headset_images=entries.depth_images)
    solve(qtbot, wizard, STEREO)
    assert "images are the same" in marks(wizard)[STEREO]
    wizard.show_step(BOARDS)
    assert sign() == icon("cross", colors().red).pixmap(16).toImage()
    page.form.enter(headset_images=entries.headset_images)
    assert sign() == undone, "it failed with other inputs"


def test_what_is_wrong_with_images_is_named(
    qtbot: QtBot, wizard: RigWizard, photographs: Any, folder: Path
) -> None:
    depth = str(photographs.folder / "depth")
    solve(qtbot, wizard, VIEWPOINT)
    for step, fields, said in (
        (STEREO, {"depth_images": depth, "headset_images": depth}, "images are the same"),
        (RIGHT, asdict(photographs.work.left), "left and right exchanged"),
    ):
        page = page_of(wizard, step)
        page.form.enter(**{name: value for name, value in fields.items() if "dropped" not in name})
        assert said in solve(qtbot, wizard, step)
    assert not wizard.project.rig.origins


def test_another_board_is_searched_for_again(qtbot: QtBot, wizard: RigWizard) -> None:
    wizard.show_step(VIEWPOINT)
    wait(qtbot, wizard)
    page = page_of(wizard)
    assert all(not shot.problem for shot in page.panels[0].shots)
    wizard.project.enter(board=Board(squares=(5, 4), square_m=0.03))
    wizard.show_step(BOARDS)
    wizard.show_step(VIEWPOINT)
    wait(qtbot, wizard)
    assert all(shot.problem for shot in page.panels[0].shots)
    assert "found in no image" in child(wizard, QLabel, "verdictFound").text()
    assert len(child(wizard, Table, "shots").keys) == 8


def test_the_grid_is_saved(
    wizard: RigWizard, choose: Callable[[Path], None], tmp_path: Path
) -> None:
    wizard.show_step(LEFT)
    choose(tmp_path / "grid.png")
    child(wizard, QPushButton, "saveGrid").click()
    data = (tmp_path / "grid.png").read_bytes()
    assert (int.from_bytes(data[16:20]), int.from_bytes(data[20:24])) == (1268, 720)
    assert "show it unscaled" in child(wizard, QLabel, "verdictFound").text().lower()


def test_nothing_is_ticked_before_it_is_done(wizard: RigWizard) -> None:
    assert marks(wizard) == ["not done yet"] * 6
    wizard.show_step(RESULT)
    found = child(wizard, QLabel, "savedRigFound").text()
    parts = "left display, right display, depth camera's pose"
    assert found.startswith(f"3 not calibrated by handcal: {parts}; 6 not known or not made; ")
    told = {item: sign for item, (_, sign) in findings(wizard).items()}
    assert told["Depth camera"] == "Not known"
    assert told["Left: display"] == ""
    assert "Good" not in told.values()


def test_another_board_and_a_changed_rig_lose_their_ticks(
    qtbot: QtBot, wizard: RigWizard, tmp_path: Path
) -> None:
    wizard.show_step(STEREO)
    wait(qtbot, wizard)
    assert marks(wizard)[BOARDS] == "good", "it is in the images"
    wizard.project.enter(board=Board(squares=(5, 4), square_m=0.03))
    wizard.project.save_rig_as(tmp_path / "ours.yaml")
    assert marks(wizard)[BOARDS] == "not done yet"
    assert marks(wizard)[RESULT] == "saved"
    wizard.project.use_rig(replace(wizard.project.rig, name="another"))
    assert marks(wizard)[RESULT] == "not done yet"


def test_origins_in_the_initial_rig_do_not_tick_the_board(wizard: RigWizard) -> None:
    origin = Origin("as told", "now", 3, 0.1, "good", "as told", ("a",), np.eye(1))
    wizard.project.use_rig(replace(wizard.project.rig, origins={"left": origin}))
    assert marks(wizard)[BOARDS] == "not done yet"


def test_intrinsics_that_nobody_judged_are_not_ticked(
    wizard: RigWizard, photographs: Any, tmp_path: Path
) -> None:
    given = tmp_path / "camera.yaml"
    write_intrinsics(given, photographs.viewpoint, "opencv")
    page = page_of(wizard, VIEWPOINT)
    page.form.enter(images="", intrinsics=str(given))
    wizard.project.camera_solved()
    assert "not judged" in marks(wizard)[VIEWPOINT]
    given.write_text("%YAML:1.0\n")
    wizard.project.camera_solved()
    assert marks(wizard)[VIEWPOINT] == "the file cannot be read"
    assert child(wizard, QLabel, "verdictHealth").accessibleName() == "Problem"


def test_a_file_is_checked_when_it_is_chosen(
    qtbot: QtBot, wizard: RigWizard, photographs: Any, tmp_path: Path
) -> None:
    wizard.show_step(STEREO)
    page, file = page_of(wizard), tmp_path / "camera.json"
    wait(qtbot, wizard)
    assert page.main.isEnabled()
    write_intrinsics(file, photographs.viewpoint, "json")
    values = json.loads(file.read_text())
    file.write_text(json.dumps(values | {"fx": values["fx"] / 100}))
    for chosen, said in ((file, "but must lie between"), (tmp_path / "gone.json", "Cannot read")):
        page.form.enter(depth_intrinsics=str(chosen))
        wait(qtbot, wizard)
        assert not page.main.isEnabled()
        assert said in child(wizard, QLabel, "verdictFound").text()
        page.form.enter(depth_intrinsics="")
        wait(qtbot, wizard)
        assert page.main.isEnabled()


def test_back_and_next_lead_through_the_steps(wizard: RigWizard) -> None:
    back, forth = (child(wizard, QPushButton, name) for name in ("rigBack", "rigNext"))
    assert not back.isEnabled()
    for step in range(1, 6):
        forth.click()
        assert wizard.step == step
    assert not forth.isEnabled()
    back.click()
    assert wizard.step == RIGHT


def test_a_name_being_typed_is_kept_when_another_step_is_shown(wizard: RigWizard) -> None:
    wizard.show_step(RESULT)
    child(wizard, QLineEdit, "rigName").setText("Our headset")
    wizard.show_step(BOARDS)
    wizard.show_step(RESULT)
    assert child(wizard, QLineEdit, "rigName").text() == "Our headset"
    assert wizard.project.rig.name == "Our headset"


def test_a_grid_that_has_no_room_is_reported(qtbot: QtBot, wizard: RigWizard) -> None:
    wizard.show_step(LEFT)
    wait(qtbot, wizard)
    show_tab(wizard, "Inputs")
    square = child(wizard, QSpinBox, "square_px")
    square.setValue(700)
    assert "no room" in child(wizard, QLabel, "imagesFound").text()
    show_tab(wizard, "Set-up")
    page = page_of(wizard)
    for name in ("saveGrid", "take"):
        button = page.panels[0].buttons.findChild(QPushButton, name)
        assert isinstance(button, QPushButton)
        button.click()
    assert wizard.findChild(TakeDialog) is None
    square.setValue(80)
    wait(qtbot, wizard)
    show_tab(wizard, "Grid on the display (3 of 3 used)")
    assert "3 of 3 used" in child(wizard, QLabel, "count").text()


def test_without_images_nothing_is_solved_and_the_reason_is_in_sight(
    qtbot: QtBot, choose: Callable[[Path], None], tmp_path: Path
) -> None:
    wizard = RigWizard(ProjectFolder(tmp_path / "empty"))
    qtbot.addWidget(wizard)
    wizard.show()
    for step, reason in (
        (STEREO, "take pairs of images"),
        (VIEWPOINT, "take images of the board"),
        (LEFT, "intrinsics are missing"),
    ):
        wizard.show_step(step)
        assert not child(wizard, QPushButton, "solve").isEnabled()
        assert reason in child(wizard, QLabel, "verdictFound").text()
    choose(tmp_path / "grid.png")
    child(wizard, QPushButton, "saveGrid").click()
    said = child(wizard, QLabel, "verdictFound").text()
    assert "Show it unscaled. The viewpoint camera's intrinsics are missing" in said
    wizard.accept()


def test_without_the_poses_of_the_board_nothing_is_solved(qtbot: QtBot, wizard: RigWizard) -> None:
    solve(qtbot, wizard, VIEWPOINT)
    wizard.show_step(LEFT)
    wait(qtbot, wizard)
    page = page_of(wizard)
    tracked = wizard.project.inputs.left.tracked
    page.form.enter(tracked="")
    assert not child(wizard, QPushButton, "solve").isEnabled()
    assert "choose the file of the poses" in child(wizard, QLabel, "verdictFound").text()
    page.form.enter(tracked=str(wizard.project.folder.viewpoint))
    assert "choose the file of tracked poses" in solve(qtbot, wizard, LEFT)
    page.form.enter(tracked=tracked)
    assert child(wizard, QLabel, "verdictFound").text() == "Not solved yet."
    assert child(wizard, QPushButton, "solve").isEnabled()


def test_without_a_ticked_image_nothing_is_solved(qtbot: QtBot, wizard: RigWizard) -> None:
    assert "added" in solve(qtbot, wizard, STEREO)
    shots = child(wizard, Table, "shots")
    for row in range(len(shots.keys)):
        tick(shots, row, False)
    assert not child(wizard, QPushButton, "solve").isEnabled()
    assert "tick an image" in child(wizard, QLabel, "verdictFound").text()


def test_each_step_has_one_main_button_which_its_key_presses(
    qtbot: QtBot, wizard: RigWizard
) -> None:
    pressed: list[int] = []
    for step in range(6):
        wizard.show_step(step)
        wait(qtbot, wizard)
        (main,) = (one for one in wizard.findChildren(MainButton) if one.isVisible())
        buttons = [one for one in wizard.findChildren(QPushButton) if one.isVisible()]
        assert [one for one in buttons if one.isDefault()] == [main]
        found = letters(wizard, is_shown=True)
        assert len(found) == len(set(found)) >= (13 if step == 0 else 4)
        (key,) = (one for one in wizard.findChildren(QLabel, "mainKey") if one.isVisible())
        assert key.text() == "Ctrl+Return"
        main.clicked.disconnect()
        main.clicked.connect(lambda *_, step=step: pressed.append(step))
        main.setEnabled(True)
        QTest.keyClick(wizard, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    assert pressed == list(range(6))
