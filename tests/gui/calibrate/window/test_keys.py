"""Keys and the focus in the main window."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QAction, QKeyEvent, QKeySequence
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QApplication,
    QCheckBox,
    QComboBox,
    QDialog,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QTabWidget,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.calibration.verifying import VerifyingView
from handcal.link.nudges import NudgeSum
from handcal.station.snapshot import Snapshot
from handcal_gui.app.keys import keys_by_group
from handcal_gui.app.program import Program
from handcal_gui.calibrate.guide.action_bar import ActionBar
from handcal_gui.calibrate.guide.view import Action, ButtonSpec, Step, WizardView
from handcal_gui.calibrate.sections import TITLES
from handcal_gui.calibrate.window import MainWindow
from handcal_gui.engine.engine_thread import Command
from handcal_gui.widgets.table import Table
from tests.gui.calibrate.window.conftest import Maker, main_button, press, say
from tests.gui.views import begun


def test_keys_that_repeat_one_held_down_are_recognized(window: MainWindow) -> None:
    """Of an X server, which sends a release and a press with one time stamp for each."""
    bar = window.findChild(ActionBar)
    assert isinstance(bar, ActionBar)
    found = []
    for t_ms, is_repeat in ((10, False), (500, False), (530, False), (900, False), (940, True)):
        override, release = QEvent.Type.ShortcutOverride, QEvent.Type.KeyRelease
        no_modifier = Qt.KeyboardModifier.NoModifier
        for kind in (release, override) if t_ms in (500, 530) else (override, release):
            event = QKeyEvent(kind, Qt.Key.Key_Space, no_modifier, " ", is_repeat)
            event.setTimestamp(t_ms)
            bar.notice_key(event)
            if kind is override:
                found.append(bar.is_repeat)
    assert found == [False, True, True, False, True]


def test_help_lists_every_key_of_an_action(program: Program) -> None:
    groups = keys_by_group(program.window)
    rows = [row for group in groups.values() for row in group.rows]
    assert "Search all pages" not in dict(rows).values()  # the manual's
    listed = [key for keys, _ in rows for key in keys.split(", ")]
    for action in program.window.findChildren(QAction):
        for shortcut in action.shortcuts():
            assert shortcut.toString(QKeySequence.SequenceFormat.NativeText) in listed
    for group, keys, meaning in (
        ("File", "Ctrl+N", "Next wearer"),
        ("Window", "Space", "Press the large button, except from a text field"),
        ("Window", "Return on the start page", "Start the calibration, from one of its fields"),
        ("Window", "Alt+Left, Alt+Right", "In the manual: go back or forward"),
        ("Fine-tune", "Shift+S", "Reset to solved"),
        ("Trials", "E", "Next choice of the eye"),
        ("Guide", "Shift+Left", "Move the outline far left"),
        ("Camera", "M", "Next displayed image"),
        ("Guide", "F", "Freeze the camera's image"),
        ("Guide", "T", "Record trial"),
        ("Hand cloud", "+, =", "Zoom in"),
        ("Fine-tune", "1", "Step of 0.1 mm"),
    ):
        assert (keys, meaning) in groups[group].rows


def test_no_key_is_taken_twice(window: MainWindow) -> None:
    groups = keys_by_group(window)
    everywhere = [
        keys
        for group in ("Window", "Guide", "File", "Go to", "Help")
        for keys, _ in groups[group].rows
    ]
    assert {"Space", "Ctrl+N", "Ctrl+O", "Ctrl+E", "F1"} <= set(everywhere)
    for keys in (everywhere, *([keys for keys, _ in group.rows] for group in groups.values())):
        assert len(keys) == len(set(keys))


def focusable(window: MainWindow) -> Iterator[QWidget]:
    """Give every widget of the calibration page that can have the keyboard, tab after tab."""
    seen: set[QWidget] = set()
    for name in TITLES:
        window.go_to(name)
        tabs = getattr(window.panels, name).findChildren(QTabWidget)
        for i in range(max([1, *(tab.count() for tab in tabs)])):
            for tab in tabs:
                tab.setCurrentIndex(i)
            QApplication.processEvents()
            for widget in window.findChildren(QWidget):
                is_ready = widget.isVisible() and widget.isEnabled() and widget.window() is window
                if is_ready and widget.focusPolicy() != Qt.FocusPolicy.NoFocus:
                    if widget not in seen:
                        yield widget
                    seen.add(widget)


TEXT_FIELDS = (QLineEdit, QPlainTextEdit, QAbstractSpinBox)


def show_buttons(program: Program, snapshot: Snapshot, *, is_enabled: bool) -> list[object]:
    """Show a page with everything on it, ready for keys; return the list of what will be asked."""
    window = program.window
    window.show_page("live")
    window.activateWindow()
    window.panels.fine_tune.set_rig(snapshot.record.rig)
    for panel in window.panels.all():
        panel.show_snapshot(snapshot)
    discard = ButtonSpec(Action.REDO, "&Discard and repeat", discards="Deletes the last alignment")
    others = (
        discard,
        ButtonSpec(Action.ANOTHER, "&Add alignment"),
        ButtonSpec(Action.BACK, "&Back"),
    )
    main = ButtonSpec(Action.TAKE_STEP, "Solve", is_enabled)
    say(program, snapshot, WizardView(Step.SOLVE, "", (), main, others))
    asked: list[object] = []
    program.wizard_panel.bar.do = asked.append
    for table in window.findChildren(Table):
        table.selectRow(0)
    return asked


def watch_clicks(window: MainWindow) -> list[QAbstractButton]:
    """Return the list of the buttons, other than the main one, that will be pressed."""
    clicked: list[QAbstractButton] = []
    for button in window.findChildren(QAbstractButton):
        if button is not main_button(window):
            button.clicked.connect(lambda _checked=False, button=button: clicked.append(button))
    return clicked


@pytest.mark.parametrize("is_enabled", [True, False])
def test_space_presses_only_the_main_button_from_every_focus(
    qtbot: QtBot, program: Program, snapshot: Maker, is_enabled: bool
) -> None:
    window = program.window
    asked = show_buttons(program, snapshot(State.APPLIED), is_enabled=is_enabled)
    qtbot.waitActive(window)
    wrong: list[str] = []

    def submit(name: str, _command: Command) -> int:
        wrong.extend([name] * name.startswith("delete"))
        return 0

    window.panels.session.submit = submit
    clicked = watch_clicks(window)
    expected = [Action.TAKE_STEP] if is_enabled else []
    texts, kinds = 0, set()
    for widget in focusable(window):
        widget.setFocus()
        focused = window.focusWidget()
        assert focused is not None
        kinds.add(type(focused).__name__)
        is_text = isinstance(focused, TEXT_FIELDS) and not focused.isReadOnly()
        texts += is_text
        asked.clear()
        press(window, Qt.Key.Key_Space)
        assert asked == ([] if is_text else expected), focused
        if isinstance(focused, QPlainTextEdit) and is_text:
            assert focused.toPlainText().count(" ") == 1
        asked.clear()
        press(window, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
        assert asked == expected, focused
        assert not wrong
        assert not clicked
        assert QApplication.activePopupWidget() is None
    assert {"QComboBox", "QCheckBox", "QToolButton", "QPushButton"} <= kinds
    assert texts >= 4


def test_return_presses_the_button_or_opens_the_list_that_has_the_focus(
    qtbot: QtBot, program: Program, snapshot: Maker
) -> None:
    window = program.window
    asked = show_buttons(program, snapshot(State.APPLIED), is_enabled=True)
    qtbot.waitActive(window)
    clicked = watch_clicks(window)
    boxes = window.panels.cloud.findChildren(QCheckBox)
    add = window.findChild(QPushButton, "wizardOther1")
    assert isinstance(add, QPushButton)
    for button in (*boxes, add):
        button.setFocus()
        clicked.clear()
        press(window, Qt.Key.Key_Return)
        assert clicked == [button]
    assert asked == [Action.ANOTHER]
    plan = window.findChild(QComboBox, "wizardPlan")
    assert isinstance(plan, QComboBox)
    plan.setEnabled(True)
    plan.setFocus()
    press(window, Qt.Key.Key_Return)
    assert plan.view().isVisible()
    QTest.keyClick(plan.view(), Qt.Key.Key_Escape)


def test_tab_leads_to_nothing_that_discards_or_deletes(
    qtbot: QtBot, program: Program, snapshot: Maker
) -> None:
    window = program.window
    show_buttons(program, snapshot(State.APPLIED), is_enabled=True)
    qtbot.waitActive(window)
    reached: set[str] = set()
    for name in TITLES:
        window.go_to(name)
        if name == "session":
            window.panels.session.findChildren(Table)[0].setFocus()
        for _ in range(60):
            press(window, Qt.Key.Key_Tab)
            focused = window.focusWidget()
            if isinstance(focused, QAbstractButton):
                reached.add(focused.objectName() or focused.text())
    assert {"wizardOther1", "wizardOther2", "&Open folder", "Record trial"} <= reached
    assert not {"wizardMain", "wizardOther0", "Delete"} & reached


def test_keys_belong_to_other_pages_and_dialogs_as_usual(
    qtbot: QtBot, program: Program, snapshot: Maker
) -> None:
    window = program.window
    asked = show_buttons(program, snapshot(State.APPLIED), is_enabled=True)
    dialog = QDialog(window)
    box = QCheckBox("Really", dialog)
    dialog.open()
    dialog.activateWindow()
    qtbot.waitActive(dialog)
    box.setFocus()
    QTest.keyClick(dialog.windowHandle(), Qt.Key.Key_Space)
    assert box.isChecked()
    dialog.close()
    window.show_page("review")
    window.activateWindow()
    qtbot.waitActive(window)
    press(window, Qt.Key.Key_Space)
    press(window, Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    assert asked == []


def test_keys_move_the_outline_the_way_they_point_and_only_while_it_is_verified(
    qtbot: QtBot, program: Program, snapshot: Maker
) -> None:
    window, guide = program.window, program.wizard_panel
    window.show_page("live")
    window.activateWindow()
    qtbot.waitActive(window)
    moved: list[tuple[float, float, float]] = []
    guide.nudge = lambda *nudge: moved.append(nudge)
    keys = (Qt.Key.Key_Left, Qt.Key.Key_Right, Qt.Key.Key_Up, Qt.Key.Key_Down)
    guide.start(begun())
    guide.show_snapshot(snapshot(State.ALIGN))
    for key in keys:
        press(window, key)
    assert moved == []
    zero = (0.0, 0.0, 0.0)
    still = VerifyingView("left", NudgeSum(), zero, zero, can_undo=False)
    guide.show_snapshot(snapshot(State.VERIFY, procedure={"verifying": still}))
    for key in (*keys, Qt.Key.Key_Plus, Qt.Key.Key_Minus):
        press(window, key)
    press(window, Qt.Key.Key_Up, Qt.KeyboardModifier.ShiftModifier)
    assert moved == [
        (-1.0, 0.0, 0.0),
        (1.0, 0.0, 0.0),
        (0.0, -1.0, 0.0),
        (0.0, 1.0, 0.0),
        (0.0, 0.0, 0.002),
        (0.0, 0.0, -0.002),
        (0.0, -5.0, 0.0),
    ]
