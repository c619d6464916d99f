"""Sessions of the library: checked, repaired, named, deleted and restored."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QInputDialog, QLabel, QPushButton
from pytestqt.qtbot import QtBot

from handcal.session.library import delete_session
from handcal.session.session import Session
from handcal_gui.library.window import LibraryWindow
from tests.gui.helpers import child, text
from tests.gui.library.conftest import (
    PATIENCE_MS,
    activate,
    answer_name,
    choose,
    press,
    rows,
    table,
    wait_for,
    wearers,
)


def state(window: LibraryWindow, wearer: str) -> str:
    return next(row["State"] for row in rows(window) if row["Wearer"] == wearer)


def test_check_names_the_damage_and_repair_copies_the_rest(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    choose(window, "Ada", "Bea", "Cid")
    press(window, "checkSessions")
    wait_for(qtbot, window, "✓ 3 sessions sound, every file read.")
    damaged = text(window, "message").splitlines()[1]
    assert damaged.startswith("× Cid, ")
    assert ": alignments/1.npz" in damaged
    assert text(window, "message").endswith("; select it alone, and Repair copies what is sound")
    choose(window, "Cid")
    press(window, "checkSessions")
    wait_for(qtbot, window, "× Cid, ")  # not first that none is sound
    press(window, "repairSession")
    wait_for(qtbot, window, "Cid, ")
    wait_for(qtbot, window, " repaired: a copy with 0 alignments")
    qtbot.waitUntil(lambda: len(rows(window)) == 5, timeout=PATIENCE_MS)
    assert (folder / "cid-repaired").is_dir()
    assert not Session.open(folder / "cid-repaired").damaged
    states = [row["State"] for row in rows(window)]
    assert states.count("Unfinished, repaired copy") == 1
    original = table(window).model().index(states.index("Damaged, has a copy"), 0)
    assert "Repaired in cid-repaired" in original.data(Qt.ItemDataRole.ToolTipRole)
    assert [entry.path.name for entry in window.chosen] == ["cid-repaired"]


def test_only_a_damaged_session_is_repaired(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    repair = child(window, QPushButton, "repairSession")
    for wearer, is_damaged in (("Cid", True), ("Bea", False)):
        choose(window, wearer)
        assert repair.isEnabled() is is_damaged
    file = folder / "bea" / "alignments" / "1.npz"
    sound = file.read_bytes()
    file.write_bytes(b"nonsense")  # the library does not read again what has the same journal
    press(window, "checkSessions")
    wait_for(qtbot, window, "Repair copies what is sound")
    qtbot.waitUntil(repair.isEnabled, timeout=PATIENCE_MS)
    qtbot.waitUntil(lambda: state(window, "Bea") == "Damaged: 1 part", timeout=PATIENCE_MS)
    file.write_bytes(sound)
    press(window, "repairSession")
    wait_for(qtbot, window, " is sound: there is nothing to repair.")
    assert text(window, "message").startswith("Bea, ")
    assert not (folder / "bea-repaired").exists()
    press(window, "checkSessions")
    wait_for(qtbot, window, "✓ 1 session sound")
    qtbot.waitUntil(child(window, QPushButton, "checkSessions").isEnabled, timeout=PATIENCE_MS)
    qtbot.waitUntil(lambda: not repair.isEnabled(), timeout=PATIENCE_MS)
    assert state(window, "Bea") == "Finished"


def test_what_was_deleted_together_is_restored_together_even_after_a_restart(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    assert child(window, QPushButton, "restoreSession").isHidden()
    choose(window, "Bea")
    table(window).setFocus()
    QTest.keyClick(table(window), Qt.Key.Key_Delete)
    qtbot.waitUntil(lambda: "Bea" not in wearers(window), timeout=PATIENCE_MS)
    assert not (folder / "bea").exists()
    qtbot.waitUntil(child(window, QPushButton, "deleteSessions").isEnabled, timeout=PATIENCE_MS)
    choose(window, "Ada")
    press(window, "deleteSessions")
    wait_for(qtbot, window, "2 sessions deleted.")
    qtbot.waitUntil(lambda: wearers(window) == ["Cid"], timeout=PATIENCE_MS)
    again = LibraryWindow(folder)
    qtbot.addWidget(again)
    again.show()
    tip = child(again, QPushButton, "restoreSession").toolTip
    restore = child(again, QPushButton, "restoreSession")

    def restore_next(told: str, left: set[str]) -> None:
        qtbot.waitUntil(lambda: f"Last deleted: {told}" in tip(), timeout=PATIENCE_MS)
        qtbot.waitUntil(restore.isEnabled, timeout=PATIENCE_MS)
        restore.click()
        qtbot.waitUntil(lambda: {*wearers(again)} == left, timeout=PATIENCE_MS)

    restore_next("2 sessions (Ctrl+Z)", {"Ada", "Cid"})
    restore_next("Bea, ", {"Ada", "Bea", "Cid"})
    qtbot.waitUntil(restore.isHidden, timeout=PATIENCE_MS)
    again.stop()


def test_an_open_session_stays(qtbot: QtBot, window: LibraryWindow, folder: Path) -> None:
    choose(window, "Bea")
    with Session(folder / "bea"):
        press(window, "deleteSessions")
        wait_for(qtbot, window, "0 sessions deleted.\nBea, ")
        assert text(window, "message").endswith(" is running in this window. Finish it first.")
        assert "process" not in text(window, "message")
        (folder / "bea" / "lock").write_text("1")  # as if another program held it
        qtbot.waitUntil(child(window, QPushButton, "deleteSessions").isEnabled)
        press(window, "deleteSessions")
        wait_for(qtbot, window, " is open in another program. Close it there, then try again.")
    assert (folder / "bea").is_dir()


def test_one_that_is_gone_does_not_keep_the_others_from_being_deleted(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    choose(window, "Bea", "Cid")
    delete_session(folder / "bea")  # by another program
    press(window, "deleteSessions")
    wait_for(qtbot, window, "1 session deleted.\n× bea: ")
    assert "is no longer there" in text(window, "message")
    qtbot.waitUntil(lambda: wearers(window) == ["Ada", "Ada"], timeout=PATIENCE_MS)


def test_a_name_is_corrected_and_brought_back(
    qtbot: QtBot, window: LibraryWindow, folder: Path
) -> None:
    choose(window, "Ada")
    assert answer_name(qtbot, window, "ada") == ["Ada", "Bea", "Cid"]
    qtbot.waitUntil(lambda: wearers(window) == ["Cid", "Bea", "ada", "ada"], timeout=PATIENCE_MS)
    wait_for(qtbot, window, "Name corrected in 2 sessions.")
    assert [entry.wearer for entry in window.chosen] == ["ada", "ada"]
    activate(qtbot, window)
    QTest.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    qtbot.waitUntil(lambda: wearers(window) == ["Cid", "Bea", "Ada", "Ada"], timeout=PATIENCE_MS)
    assert Session.open(folder / "ada-1").wearer == "Ada"
    qtbot.waitUntil(child(window, QPushButton, "correctName").isEnabled, timeout=PATIENCE_MS)
    assert child(window, QPushButton, "restoreSession").isHidden()
    assert answer_name(qtbot, window, "Eve")[:2] == ["Ada", "ada"]  # former names are offered


def test_changes_are_undone_one_after_the_other(qtbot: QtBot, window: LibraryWindow) -> None:
    choose(window, "Bea")
    answer_name(qtbot, window, "Eve")
    qtbot.waitUntil(lambda: "Eve" in wearers(window), timeout=PATIENCE_MS)
    undo = child(window, QPushButton, "restoreSession")
    both = ["Ada", "Ada"]

    def wait_until_left(left: list[str]) -> None:
        qtbot.waitUntil(lambda: sorted(wearers(window)) == left, timeout=PATIENCE_MS)

    for deleted, left in ((["Ada"], ["Cid", "Eve"]), (["Eve", "Cid"], [])):
        choose(window, *deleted)
        press(window, "deleteSessions")
        wait_until_left(left)
        qtbot.waitUntil(undo.isEnabled, timeout=PATIENCE_MS)
    for left in (["Cid", "Eve"], [*both, "Cid", "Eve"], [*both, "Bea", "Cid"]):
        undo.click()
        wait_until_left(left)
        qtbot.waitUntil(lambda: undo.isEnabled() or undo.isHidden(), timeout=PATIENCE_MS)
    assert undo.isHidden()


def test_an_emptied_name_is_said_to_be_removed(qtbot: QtBot, window: LibraryWindow) -> None:
    choose(window, "Bea")
    answer_name(qtbot, window, " ")
    wait_for(qtbot, window, "Name removed from 1 session.")
    qtbot.waitUntil(lambda: window.chosen[0].wearer == "", timeout=PATIENCE_MS)
    press(window, "restoreSession")
    wait_for(qtbot, window, "Name corrected in 1 session.")


def test_a_name_that_is_too_long_is_said_to_be_cut_off(window: LibraryWindow) -> None:
    window._ask_name()
    dialog = child(window, QInputDialog)
    field = child(dialog, QComboBox).lineEdit()
    assert field is not None
    field.setText(100 * "a")
    assert not dialog.findChildren(QLabel, "brief")
    QTest.keyClicks(field, "b")
    assert text(dialog, "brief") == "At most 100 characters; the rest is cut off"
    dialog.reject()


def test_a_name_is_no_markup(qtbot: QtBot, window: LibraryWindow) -> None:
    choose(window, "Bea")
    answer_name(qtbot, window, "<b>Bea")
    qtbot.waitUntil(lambda: window.chosen[0].wearer == "<b>Bea", timeout=PATIENCE_MS)
    row = wearers(window).index("<b>Bea")
    cell = table(window).model().index(row, 0)
    assert "&lt;b&gt;Bea" in cell.data(Qt.ItemDataRole.ToolTipRole)
    window._changes = [{window.chosen[0].path: "<b>Bea"}]
    window._refresh()
    assert "Name before: &lt;b&gt;Bea" in child(window, QPushButton, "restoreSession").toolTip()
    [told] = [one for one in window.findChildren(QLabel) if one.text() == "Name before: <b>Bea"]
    assert told.textFormat() == Qt.TextFormat.PlainText
    assert "&lt;b&gt;Bea" in told.toolTip()


def test_an_open_session_keeps_its_name(qtbot: QtBot, window: LibraryWindow, folder: Path) -> None:
    choose(window, "Bea")
    with Session(folder / "bea"):
        answer_name(qtbot, window, "Eve")
        wait_for(qtbot, window, "Name corrected in 0 sessions.\nBea, ")
        qtbot.waitUntil(child(window, QPushButton, "restoreSession").isHidden, timeout=PATIENCE_MS)
        choose(window, "Bea", "Cid")
        answer_name(qtbot, window, "Eve")
        wait_for(qtbot, window, "Name corrected in 1 session.\nBea, ")
        assert "is running in this window" in text(window, "message")
    qtbot.waitUntil(lambda: wearers(window)[:2] == ["Eve", "Bea"], timeout=PATIENCE_MS)
    press(window, "restoreSession")  # only Cid's name was corrected
    wait_for(qtbot, window, "Name corrected in 1 session.")
    qtbot.waitUntil(lambda: wearers(window)[0] == "Cid", timeout=PATIENCE_MS)
