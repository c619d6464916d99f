from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QRect, QSize, Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QApplication,
    QComboBox,
    QLabel,
    QPushButton,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTreeWidget,
    QTreeWidgetItem,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.rig.boards.views import WorstView
from handcal.rig.lens.uncertainty import ProjectionUncertainty
from handcal.rig.verdict import CalibrationVerdict
from handcal_gui.app.theme import use_theme
from handcal_gui.rig.coverage_map import CoverageMap
from handcal_gui.rig.images_panel import ImagesPanel
from handcal_gui.rig.shot_list import ShotList
from handcal_gui.rig.shot_view import ShotView
from handcal_gui.rig.solve import SolvedPart
from handcal_gui.rig.uncertainty_map import UncertaintyMap
from handcal_gui.widgets.drawing import Drawing
from handcal_gui.widgets.image_view import ImageView
from tests.gui.helpers import child, height_px

PAGES = "setup-stereo", "setup-viewpoint", "setup-display", "setup-board"


@pytest.fixture
def panel(qtbot: QtBot) -> Iterator[ImagesPanel]:
    panel = ImagesPanel(("Depth camera", "Headset camera"), "Take some.", "setup-stereo")
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


def item(panel: ImagesPanel, row: int) -> QTreeWidgetItem:
    shots = panel.findChild(QTreeWidget, "shots")
    assert isinstance(shots, QTreeWidget)
    found = shots.topLevelItem(row)
    assert found is not None
    return found


def captions(panel: ImagesPanel) -> list[QLabel]:
    return panel.findChildren(QLabel, "shotCaption")


def text(panel: QWidget, name: str) -> str:
    label = panel.findChild(QLabel, name)
    assert isinstance(label, QLabel)
    return label.text()


def test_an_image_is_shown_although_the_other_of_its_pair_cannot_be_read(
    qtbot: QtBot, panel: ImagesPanel, photographs: Any, tmp_path: Path
) -> None:
    (tmp_path / "depth-001.png").write_bytes(b"no image")
    panel.look((str(tmp_path), photographs.work.stereo.headset_images), photographs.work.board, ())
    depth, headset = panel.findChildren(ImageView)[:2]
    qtbot.waitUntil(lambda: headset.has_image and "depth-001.png" in depth.message)
    assert not depth.has_image
    assert headset.message == ""
    for column in range(4):
        assert "depth-001.png" in item(panel, 0).toolTip(column), "the list may cut it"


def test_what_was_found_is_listed(qtbot: QtBot, full: ImagesPanel) -> None:
    assert text(full, "count") == "8 of 9 used"
    assert item(full, 0).text(0) == "depth-001.png"
    assert all(int(count) > 8 for count in item(full, 0).text(1).split(" · "))
    name, problem = item(full, 8).text(0).split("\n")
    assert name == "depth-099.png"
    assert problem == f"{full.shots[8].problem[0].upper()}{full.shots[8].problem[1:]}"
    images = full.findChildren(ImageView)
    qtbot.waitUntil(lambda: all(image.has_image for image in images))
    first, second = captions(full)
    assert first.text().startswith("Depth camera: ")
    assert "corners" in second.text()


def test_captions_are_whole_and_not_over_small_images(qtbot: QtBot, full: ImagesPanel) -> None:
    full.resize(735, 290)  # as in a window of 960x540
    qtbot.waitUntil(lambda: all(one.text() for one in captions(full)))
    QApplication.processEvents()
    for caption, image in zip(captions(full), full.findChildren(ImageView), strict=True):
        assert not image.caption
        assert caption.height() >= caption.heightForWidth(caption.width())
        assert not caption.geometry().intersects(image.geometry())


def test_in_a_small_window_the_image_is_wide_and_notes_are_whole(
    qtbot: QtBot, full: ImagesPanel
) -> None:
    full.resize(735, 290)  # as in a window of 960x540
    QApplication.processEvents()
    view, shots = child(full, ShotView), child(full, ShotList)
    assert view.width() > 230 > 0.7 * shots.width()
    plain, noted = (shots.visualItemRect(item(full, row)).height() for row in (7, 8))
    note = item(full, 8).text(0).partition("\n")[2]
    assert note
    assert noted >= plain + height_px(shots, note, shots.viewport().width() - 8)
    # It is drawn over all columns, and of its height nothing is left to the cells.
    shots.setCurrentItem(item(full, 0))
    row = shots.visualItemRect(item(full, 8))
    low = row.adjusted(0, plain, 0, 0)
    image = shots.viewport().grab(low).toImage()
    inked = {
        x
        for x in range(image.width())
        for y in range(image.height())
        if image.pixelColor(x, y).lightness() < 128
    }
    assert max(inked) > shots.columnWidth(0), "it was cut at its column"


def test_a_box_without_tick_is_seen_in_the_dark(qtbot: QtBot, full: ImagesPanel) -> None:
    use_theme("dark")
    try:
        shots = child(full, ShotList)
        item(full, 3).setCheckState(0, Qt.CheckState.Unchecked)
        QApplication.processEvents()
        row = shots.visualItemRect(item(full, 3))
        image = shots.viewport().grab(QRect(0, row.y(), 20, row.height())).toImage()
        lights = {image.pixelColor(x, row.height() // 2).lightness() for x in range(20)}
        assert max(lights) - min(lights) > 60
    finally:
        use_theme("light")


def test_the_sign_of_a_problem_is_as_large_as_elsewhere(qtbot: QtBot, full: ImagesPanel) -> None:
    shots = child(full, ShotList)
    option = QStyleOptionViewItem()
    delegate = shots.itemDelegate()
    assert isinstance(delegate, QStyledItemDelegate)
    delegate.initStyleOption(option, shots.model().index(8, 1))
    assert option.decorationSize == QSize(16, 16)


def test_a_dropped_pair_no_longer_counts(qtbot: QtBot, full: ImagesPanel) -> None:
    maps = full.findChildren(CoverageMap)
    before = [shown.caption for shown in maps]
    with qtbot.waitSignal(full.dropped_changed):
        for row in range(1, 8):
            item(full, row).setCheckState(0, Qt.CheckState.Unchecked)
    assert full.dropped_of(()) == tuple(f"depth-{n:03}.png" for n in range(2, 9))
    assert text(full, "count") == "1 of 9 used"
    assert [shown.caption for shown in maps] != before
    for row in range(1, 8):
        item(full, row).setCheckState(0, Qt.CheckState.Checked)
    assert [shown.caption for shown in maps] == before


def test_results_stand_beside_the_images(full: ImagesPanel) -> None:
    worst = WorstView("headset camera's of depth-002.png", 0.7, "it is blurred")
    verdict = CalibrationVerdict("good", "as told")
    residuals = {"depth-001.png": 0.25, "depth-002.png": 0.7}
    full.show_solved(SolvedPart(verdict, (), residuals, {"depth-001.png": 0.5}, worst))
    assert [item(full, 0).text(column) for column in (2, 3)] == ["0.25", "29°"]
    assert item(full, 1).text(0) == "depth-002.png\nWorst: it is blurred"
    assert item(full, 2).text(2) == "–"
    assert item(full, 8).text(0) != "depth-099.png"


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
    item(full, 0).setCheckState(0, Qt.CheckState.Unchecked)
    before = full.dropped_of(())
    assert before
    folders = photographs.work.stereo.headset_images, photographs.work.stereo.depth_images
    with qtbot.waitSignal(full.dropped_changed):
        full.look(folders, photographs.work.board, before)
    qtbot.waitUntil(lambda: not full.bar.is_busy, timeout=20_000)
    assert full.dropped_of(before) == ()


def test_the_set_up_shows_a_drawing(qtbot: QtBot, panel: ImagesPanel) -> None:
    drawing = panel.drawing
    qtbot.addWidget(drawing)
    drawing.resize(700, 300)
    drawing.show()
    image = drawing.grab().toImage()
    shades = {image.pixel(x, y) for x in range(0, image.width(), 3) for y in range(0, 200, 3)}
    assert len(shades) > 3


def test_a_low_panel_has_lower_maps(qtbot: QtBot, panel: ImagesPanel) -> None:
    maps = panel.findChildren(CoverageMap)
    high = [one.height() for one in maps]
    panel.resize(1000, 240)
    QApplication.processEvents()
    assert panel.height() == 240
    assert all(one.height() < whole for one, whole in zip(maps, high, strict=True))
    assert max(one.geometry().bottom() for one in maps) < panel.height()


@pytest.mark.parametrize("page", sorted(PAGES))
def test_every_step_has_a_drawing(qtbot: QtBot, page: str) -> None:
    drawing = Drawing(f"docs/pictures/{page}.svg")
    qtbot.addWidget(drawing)
    assert drawing.is_readable


def test_the_uncertainty_of_a_solved_camera_is_shown(qtbot: QtBot, panel: ImagesPanel) -> None:
    sigma_px = np.full((9, 12), 0.1)
    sigma_px[0, 0], sigma_px[0, 1] = 2.0, np.nan
    found = ProjectionUncertainty(sigma_px, 0.1, 0.9)
    panel.show_solved(
        SolvedPart(CalibrationVerdict("good", ""), (), {}, uncertainties=(found, None))
    )
    shown_map = panel.findChild(QComboBox, "map")
    assert isinstance(shown_map, QComboBox)
    shown_map.setCurrentIndex(1)
    maps = panel.findChildren(UncertaintyMap)
    assert [one.caption for one in maps] == ["Depth camera: ± 0.10, 0.90 px", "Headset camera: –"]
    assert all(one.isVisible() for one in maps)
    assert not any(one.isVisible() for one in panel.findChildren(CoverageMap))
    image = maps[0].grab().toImage()
    top = maps[0].height() - 96 + 4
    uncertain, known = (QColor(image.pixel(x, top)).lightness() for x in (6, 34))
    assert uncertain < known
