"""A tour of the pages, panels and dialogs outside the wizard, saved as screenshots."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from PySide6.QtCore import QEvent, QObject, QRegularExpression, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QDialog, QListWidget, QPushButton, QTabWidget, QWidget

from handcal.camera.settings import RealSenseSettings
from handcal.core.errors import FileError
from handcal_gui.app.autopilot.screenshots import Screenshots
from handcal_gui.app.manual import show_manual
from handcal_gui.app.menus import show_keys
from handcal_gui.app.preferences_dialog import PreferencesDialog
from handcal_gui.app.program import Program
from handcal_gui.calibrate.camera.panel import Mode
from handcal_gui.calibrate.sections import TITLES
from handcal_gui.calibrate.start.camera_settings import CameraSettingsDialog
from handcal_gui.library.export_dialog import ExportDialog

_LOOK_MS = 600
"""Time until a change is visible, on a busy computer, too."""
_TURN_MS = 50
_APART_MS = 1_100
"""Least time between two presses of *Record trial* that the panel takes for two."""
_PATIENCE_MS = 20_000
_STEPS = 6
_RAIL = QRegularExpression("Rail$")
"""Name of a list that chooses a window's page."""
_OPENS_DIALOG = QRegularExpression("^(take|acceptRig|track)$")
"""Names of buttons that open a dialog without asking for a file."""

Walk = Iterator[int]
"""Actions in pieces; each yields the milliseconds to wait before the next."""


class Tour(QObject):
    """Operates the window and saves screenshots.

    Parameters
    ----------
    program : Program
    screenshots : Screenshots

    Attributes
    ----------
    failed : Signal(str)
        A screenshot could not be saved; the reason.
    """

    failed = Signal(str)

    def __init__(self, program: Program, screenshots: Screenshots) -> None:
        super().__init__(program)
        self._program = program
        self._save = screenshots.save
        self._opened: set[str] = set()

    def begin(self, walk: Walk, then: Callable[[], object]) -> None:
        """Run a walk, then call `then`."""
        try:
            wait_ms = next(walk)
        except StopIteration:
            then()
        except FileError as error:
            self.failed.emit(str(error))
        else:
            QTimer.singleShot(wait_ms, self, lambda: self.begin(walk, then))

    def start_page(self) -> Walk:
        """Save the start page once it has checked the station."""
        yield 2 * _LOOK_MS
        self._save("start")

    def panels(self) -> Walk:
        """Fine-tune φ, record trials, and save every panel and tab."""
        window = self._program.window
        yield from self._fine_tune()
        for name in TITLES:
            window.go_to(name)
            yield _LOOK_MS
            picture, panel = f"panel-{name.replace('_', '-')}", getattr(window.panels, name)
            self._save(picture, panel)
            for tabs in panel.findChildren(QTabWidget):
                for i in range(tabs.count()):
                    tabs.setCurrentIndex(i)
                    yield _LOOK_MS
                    title = tabs.tabText(i).split(" (")[0].lower()
                    self._save(f"{picture}-{title}", panel)
                tabs.setCurrentIndex(0)
        window.panels.camera.set_mode(Mode.BOTH)
        yield _LOOK_MS
        self._save("panel-camera-both", window.panels.camera)
        window.panels.camera.set_mode(Mode.COLOR)
        window.use_arrangement("station")
        yield _LOOK_MS
        self._save("station")
        window.use_arrangement("panels")

    def export(self, dialog: ExportDialog) -> Walk:
        """Start the export and save its progress; the dialog emits the result."""
        yield _LOOK_MS
        self._save("export", dialog)
        dialog.start()
        yield _LOOK_MS // 2
        self._save("export-runs", dialog)

    def after_export(self, dialog: ExportDialog) -> Walk:
        """Save the completed export, the session opened for review, and the preferences."""
        program = self._program
        self._save("export-done", dialog)
        dialog.stop()
        assert program.live.snapshot is not None
        program.open_session(program.live.snapshot.session_path)
        yield from _until(lambda: program.window.page == "review")
        yield _LOOK_MS
        self._save("review")
        preferences = PreferencesDialog(program.preferences, program.window)
        shown: dict[str, QDialog] = {
            "preferences": preferences,
            "keys": show_keys(program.window),
            "camera-settings": CameraSettingsDialog(RealSenseSettings(), program.window),
        }
        for name, one in shown.items():
            one.show()
            yield _LOOK_MS
            self._save(name, one)
            one.close()
        yield from self._dialogs()
        program.show_start()
        yield 2 * _LOOK_MS
        self._save("start-next-wearer")

    def _dialogs(self) -> Walk:
        """Save the dialogs and windows that the menus open, with each of their pages."""
        program = self._program
        assert program.windows.record is not None
        sessions = program.windows.record.path.absolute().parent
        opened: dict[str, Callable[[], QWidget | None]] = {
            "sessions": lambda: program.windows.show_library(sessions),
            "connect": program.windows.connect_headset,
            "rig": program.windows.calibrate_rig,
            "evaluate": program.windows.evaluate,
            "support": program.windows.make_support_bundle,
        }
        for name, open_dialog in opened.items():
            dialog = open_dialog()
            yield _LOOK_MS
            if dialog is None:  # without a network, no headset can be connected
                continue
            self._save(name, dialog)
            for rail in dialog.findChildren(QListWidget, _RAIL):
                for row in range(rail.count()):
                    rail.setCurrentRow(row)
                    yield _LOOK_MS
                    if row > 0:
                        self._save(f"{name}-{row + 1}", dialog)
                    yield from self._opened_by_buttons(name, dialog)
            dialog.close()
        manual = show_manual(program.window, "docs/guide.md")
        manual.search.setText("target")
        yield _LOOK_MS
        self._save("manual", manual)
        manual.close()

    def _opened_by_buttons(self, name: str, dialog: QWidget) -> Walk:
        """Save the dialogs that a page of a window opens, each once."""
        for button in dialog.findChildren(QPushButton, _OPENS_DIALOG):
            if not button.isVisible() or button.objectName() in self._opened:
                continue
            self._opened.add(button.objectName())
            button.click()
            yield _LOOK_MS
            if (opened := QApplication.activeModalWidget()) is not None:
                self._save(f"{name}-{button.objectName()}", opened)
                opened.close()
                yield _TURN_MS

    def _fine_tune(self) -> Walk:
        """Change φ, record trials with it, and reset it."""
        window, panel = self._program.window, self._program.window.panels.fine_tune
        window.go_to("fine_tune")
        yield _LOOK_MS
        for _ in range(_STEPS):
            _press(panel, Qt.Key.Key_Right)
            yield _TURN_MS
        self._save("fine-tune-moving", panel)
        yield 2 * _LOOK_MS
        self._save("fine-tune-moved", panel)
        self._save("window-fine-tune")
        yield from self._record_trial()
        yield _APART_MS
        self._record()  # for the other eye, whose φ is unchanged: the panel asks first
        self._save("window-trial-doubt")
        yield _APART_MS
        yield from self._record_trial()
        panel.reset_action.trigger()
        yield 2 * _LOOK_MS
        self._save("fine-tune-back", panel)

    def _record_trial(self) -> Walk:
        wanted = self._trials() + 1
        self._record()
        yield from _until(lambda: self._trials() == wanted)

    def _record(self) -> None:
        self._program.window.panels.trials.record_action.trigger()

    def _trials(self) -> int:
        snapshot = self._program.live.snapshot
        return len(snapshot.record.trials) if snapshot else 0


def _until(holds: Callable[[], bool]) -> Walk:
    """Wait for a condition, but not forever: a screenshot will show that it did not hold."""
    for _ in range(_PATIENCE_MS // _TURN_MS):
        if holds():
            return
        yield _TURN_MS


def _press(widget: QWidget, key: Qt.Key) -> None:
    for kind in (QEvent.Type.KeyPress, QEvent.Type.KeyRelease):
        QApplication.sendEvent(widget, QKeyEvent(kind, key, Qt.KeyboardModifier.NoModifier))
