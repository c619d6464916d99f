"""The list of sessions: its small pictures are explained."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QListWidget
from pytestqt.qtbot import QtBot

from handcal.session.library import EyeOutcome
from handcal_gui.calibrate.start.session_entries import Entry
from handcal_gui.calibrate.start.start_page import SessionList
from tests.gui.helpers import child, show


def test_pictures_are_explained_by_a_legend_a_tooltip_and_for_screen_readers(qtbot: QtBot) -> None:
    shown = show(qtbot, SessionList("Sessions", "Open"), 400, 300)
    legend = child(shown, QLabel, "legend")
    shown.show_entries([Entry(Path("a"), "Ada")])
    assert not legend.isVisible()
    nothing = EyeOutcome("accept", None, None, None)
    shown.show_entries([Entry(Path("a"), "Ada", eyes={"left": nothing})])
    assert not legend.isVisible()
    assert child(shown, QListWidget).item(0).icon().isNull()
    shown.show_entries([Entry(Path("a"), "a: damaged", is_enabled=False)])
    assert "a: damaged" in child(shown, QListWidget).item(0).toolTip()
    shown.show_entries([Entry(Path("a"), "Ada", eyes={"left": EyeOutcome("accept", 20, 5, None)})])
    assert legend.isVisible()
    assert "the left eye above the right one" in legend.toolTip()
    item = child(shown, QListWidget).item(0)
    for told in (item.toolTip(), item.data(Qt.ItemDataRole.AccessibleDescriptionRole)):
        assert "Left eye: 20.0′ before, 5.0′ after" in told
        assert legend.toolTip() in told


def test_a_new_session_is_selected_otherwise_the_one_before_stays(qtbot: QtBot) -> None:
    shown = show(qtbot, SessionList("Sessions", "Open"), 400, 300)
    entries = [Entry(Path(name), name) for name in ("newest", "new", "old")]
    box = child(shown, QListWidget)
    shown.show_entries(entries[1:])
    box.setCurrentRow(1)
    shown.show_entries(entries[1:])
    assert box.currentItem().text() == "old"
    shown.show_entries(entries)
    assert box.currentItem().text() == "newest"
