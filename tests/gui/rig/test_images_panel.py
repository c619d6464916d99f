from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QComboBox,
    QLabel,
    QPushButton,
)
from pytestqt.qtbot import QtBot

from handcal.camera.settings import RealSenseSettings
from handcal.rig.boards.board import Board
from handcal.rig.boards.views import WorstView
from handcal.rig.lens.fit import CalibrationVerdict
from handcal.rig.lens.uncertainty import ProjectionUncertainty
from handcal.sim.photographs import BOARD
from handcal_gui.rig.images_panel import ImagesPanel
from handcal_gui.rig.maps import CoverageMap, UncertaintyMap
from handcal_gui.rig.project import RigProject
from handcal_gui.rig.project_folder import ProjectFolder
from handcal_gui.rig.solve import SolvedPart
from handcal_gui.widgets.image_view import ImageView
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child, text
from tests.gui.rig.wizard_steps import cell, tick

PAGES = "setup-stereo", "setup-viewpoint", "setup-display", "setup-board"


@pytest.fixture
def project(photographs: Any, tmp_path: Path) -> RigProject:
    folder = ProjectFolder(tmp_path / "rig")
    folder.save(photographs.work)
    return RigProject(folder, RealSenseSettings())


@pytest.fixture
def panel(qtbot: QtBot, project: RigProject) -> Iterator[ImagesPanel]:
    panel = ImagesPanel(project, ("Depth camera", "Headset camera"), "Take some.", "setup-stereo")
    qtbot.addWidget(panel)
    panel.resize(1000, 420)
    panel.show()
    yield panel
    panel.stop()


@pytest.fixture
def full(qtbot: QtBot, panel: ImagesPanel, photographs: Any) -> ImagesPanel:
    look(panel, photographs)
    qtbot.waitUntil(lambda: not panel.bar.is_busy, timeout=20_000)
    return panel


def look(panel: ImagesPanel, photographs: Any, dropped: tuple[str, ...] = ()) -> None:
    stereo = photographs.work.stereo
    folders = stereo.depth_images, stereo.headset_images
    panel.look(folders, photographs.work.board, dropped)


def captions(panel: ImagesPanel) -> list[QLabel]:
    return panel.findChildren(QLabel, "shotCaption")


def test_an_image_is_shown_although_the_other_of_its_pair_cannot_be_read(
    qtbot: QtBot, panel: ImagesPanel, photographs: Any, tmp_path: Path
) -> None:
    (tmp_path / "depth-001.png").write_bytes(b"no image")
    panel.look((str(tmp_path), photographs.work.stereo.headset_images), photographs.work.board, ())
    depth, headset = panel.findChildren(ImageView)[:2]
    qtbot.waitUntil(lambda: headset.has_image and "depth-001.png" in depth.message)
    assert not depth.has_image
    assert headset.message == ""
    assert "depth-001.png" in cell(panel, 0, 4)


def test_what_was_found_is_listed(qtbot: QtBot, full: ImagesPanel) -> None:
    assert text(full, "count") == "8 of 9 used"
    assert cell(full, 0, 0) == "depth-001.png"
    assert all(int(count) > 8 for count in cell(full, 0, 1).split(" · "))
    assert cell(full, 8, 0) == "depth-099.png"
    assert cell(full, 8, 4) == f"⚠ {full.shots[8].problem[0].upper()}{full.shots[8].problem[1:]}"
    images = full.findChildren(ImageView)
    qtbot.waitUntil(lambda: all(image.has_image for image in images))
    first, second = captions(full)
    assert first.text().startswith("Depth camera: ")
    assert "corners" in second.text()


def test_a_dropped_pair_no_longer_counts(qtbot: QtBot, full: ImagesPanel) -> None:
    maps = full.findChildren(CoverageMap)
    before = [shown.caption for shown in maps]
    with qtbot.waitSignal(full.dropped_changed):
        for row in range(1, 8):
            tick(child(full, Table, "shots"), row, False)
    assert full.dropped_of(()) == tuple(f"depth-{n:03}.png" for n in range(2, 9))
    assert text(full, "count") == "1 of 9 used"
    assert [shown.caption for shown in maps] != before
    for row in range(1, 8):
        tick(child(full, Table, "shots"), row, True)
    assert [shown.caption for shown in maps] == before


def test_results_stand_beside_the_images(full: ImagesPanel) -> None:
    worst = WorstView("headset camera's of depth-002.png", 0.7, "it is blurred")
    verdict = CalibrationVerdict("good", "as told")
    residuals = {"depth-001.png": 0.25, "depth-002.png": 0.7}
    full.show_solved(SolvedPart(verdict, (), residuals, {"depth-001.png": 0.5}, worst))
    assert [cell(full, 0, column) for column in (2, 3)] == ["0.25", "29°"]
    assert cell(full, 1, 4) == "Worst: it is blurred"
    assert cell(full, 2, 2) == "–"
    assert cell(full, 8, 4), "why there is no board"


@pytest.mark.parametrize("entered", [Board(squares=(10, 7)), replace(BOARD, legacy=True)])
def test_another_board_in_the_images_is_named_once_and_taken_by_a_button(
    qtbot: QtBot, panel: ImagesPanel, project: RigProject, photographs: Any, entered: Board
) -> None:
    project.enter(board=replace(entered, square_m=BOARD.square_m, marker_m=BOARD.marker_m))

    def look_again() -> None:
        stereo = photographs.work.stereo
        folders = stereo.depth_images, stereo.headset_images
        panel.look(folders, project.inputs.board, ())

    look_again()
    panel.again.clicked.connect(look_again)
    offer = child(panel.search, QPushButton, "imagesFix")
    qtbot.waitUntil(lambda: not panel.bar.is_busy, timeout=20_000)
    assert panel.used == 0
    assert {cell(panel, row, 4) for row in range(8)} == {"⚠ Another board"}, "said once, below"
    assert ("10 × 7" in text(panel.search, "imagesFound")) == (entered.squares == (10, 7))
    offer.click()
    qtbot.waitUntil(lambda: not panel.bar.is_busy, timeout=20_000)
    assert project.inputs.board == BOARD
    assert panel.used == 8
    assert project.inputs.board_found


def test_search_again_needs_all_folders(
    panel: ImagesPanel, photographs: Any, tmp_path: Path
) -> None:
    again = child(panel.buttons, QPushButton, "again")
    for folders, can_search in (
        ((), False),
        ((str(tmp_path),), False),
        (2 * (str(tmp_path),), True),
    ):
        panel.look((*folders, "", "")[:2], photographs.work.board, ())
        assert again.isEnabled() == can_search
    assert again.text() == "Find the board &again"


def test_folders_are_looked_through_once(qtbot: QtBot, full: ImagesPanel, photographs: Any) -> None:
    shots = full.shots
    look(full, photographs)
    assert not full.bar.is_busy
    assert full.shots is shots
    full.forget()
    look(full, photographs, ("depth-004.png",))
    assert full.bar.is_busy
    qtbot.waitUntil(lambda: not full.bar.is_busy, timeout=20_000)
    assert full.dropped_of(()) == ("depth-004.png",)


def test_without_images_what_was_left_out_stays(panel: ImagesPanel) -> None:
    assert panel.dropped_of(("a.png",)) == ("a.png",)
    assert text(panel, "count") == "No images yet"


def test_the_reason_for_no_images_is_reported(
    qtbot: QtBot, panel: ImagesPanel, photographs: Any, tmp_path: Path
) -> None:
    panel.look((str(tmp_path), str(tmp_path)), photographs.work.board, ())
    qtbot.waitUntil(lambda: not panel.bar.is_busy)
    assert "No PNG, JPEG, TIFF, BMP or PGM" in text(panel.search, "imagesFound")
    panel.look((str(tmp_path), ""), photographs.work.board, ())
    assert not panel.bar.is_busy


def test_what_was_left_out_of_other_images_is_forgotten(
    qtbot: QtBot, full: ImagesPanel, photographs: Any
) -> None:
    tick(child(full, Table, "shots"), 0, False)
    before = full.dropped_of(())
    assert before
    folders = photographs.work.stereo.headset_images, photographs.work.stereo.depth_images
    with qtbot.waitSignal(full.dropped_changed):
        full.look(folders, photographs.work.board, before)
    qtbot.waitUntil(lambda: not full.bar.is_busy, timeout=20_000)
    assert full.dropped_of(before) == ()


def test_the_uncertainty_of_a_solved_camera_is_shown(qtbot: QtBot, panel: ImagesPanel) -> None:
    sigma_px = np.full((9, 12), 0.1)
    sigma_px[0, 0], sigma_px[0, 1] = 2.0, np.nan
    found = ProjectionUncertainty(sigma_px, 0.1, 0.9)
    panel.show_solved(
        SolvedPart(CalibrationVerdict("good", ""), (), {}, uncertainties=(found, None))
    )
    shown_map = child(panel, QComboBox, "map")
    shown_map.setCurrentIndex(1)
    maps = panel.findChildren(UncertaintyMap)
    assert [one.caption for one in maps] == ["Depth camera: ± 0.10, 0.90 px", "Headset camera: –"]
    assert all(one.isVisible() for one in maps)
    assert not any(one.isVisible() for one in panel.findChildren(CoverageMap))
    image = maps[0].grab().toImage()
    top = maps[0].height() - 96 + 4
    uncertain, known = (QColor(image.pixel(x, top)).lightness() for x in (6, 34))
    assert uncertain < known
