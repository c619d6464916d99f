"""The program operates itself: a demonstration that calibrates, exports, and saves pictures."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QEvent, QObject, QRegularExpression, Qt, QTimer
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QDialog, QListWidget, QTabWidget, QWidget

from handcal.camera.settings import RealSenseSettings
from handcal.core.errors import FileError
from handcal.io.files import make_folder
from handcal.station.settings import StationSettings
from handcal.station.snapshot import Snapshot
from handcal_gui.app.manual import show_manual
from handcal_gui.app.menus import show_keys
from handcal_gui.app.preferences_dialog import PreferencesDialog
from handcal_gui.app.program import Program
from handcal_gui.calibrate.camera.panel import Mode
from handcal_gui.calibrate.control.live import CalibrationController
from handcal_gui.calibrate.guide.view import STEPS, WEARERS, Action, Step, WizardView
from handcal_gui.calibrate.guide.wizard import WizardPanel
from handcal_gui.calibrate.sections import TITLES
from handcal_gui.calibrate.start.camera_settings import CameraSettingsDialog
from handcal_gui.library.export_dialog import ExportDialog


class Demonstration(QObject):
    """Calibrates, exports, and ends the program.

    Parameters
    ----------
    program : Program
    output : Path
        Folder for the session and, beside it, the export.
    screenshots : Path or None
        Folder for screenshots of every step, panel and dialog; None to save none.

    Attributes
    ----------
    complaint : str or None
        The reason for a failure; None after success.
    """

    def __init__(self, program: Program, output: Path, screenshots: Path | None) -> None:
        super().__init__(program)
        self.complaint: str | None = "ended before the calibration was complete"
        self._program = program
        self._output = output.absolute()
        self._screenshots = Screenshots(program.window, screenshots) if screenshots else None
        self._tour = Tour(program, self._screenshots, self._fail) if self._screenshots else None
        self._has_toured = False
        self._autopilot = Autopilot(
            program.live, program.wizard_panel, self._look, self._export, self._fail
        )
        program.live.ended.connect(self._fail)

    def start(self, settings: StationSettings) -> None:
        """Start the demonstration."""
        station = replace(settings, sessions=str(self._output))

        def calibrate() -> None:
            self._program.start_calibration(station, "Demonstration")
            self._program.wizard_panel.hold(True)  # for pictures of every step

        if self._tour:
            self._tour.begin(self._tour.start_page(), calibrate)
        else:
            calibrate()

    def _look(self, view: WizardView) -> None:
        if self._screenshots is None or self._tour is None:
            return
        try:
            self._screenshots.save_step(view)
        except FileError as error:
            self._fail(str(error))
        if view.step is Step.SAVE and not self._has_toured:
            self._has_toured = True
            self._autopilot.pause()
            self._tour.begin(self._tour.panels(), self._autopilot.resume)

    def _export(self) -> None:
        self._program.live.ended.disconnect(self._fail)  # from now on the engine may end
        dialog = self._program.windows.export(self._output)
        if dialog is None:
            self._fail("there was nothing to export")
            return
        dialog.succeeded.connect(lambda _files: self._after_export(dialog))
        dialog.failed.connect(self._fail)
        if self._tour:
            self._tour.begin(self._tour.export(dialog), lambda: None)
        else:
            dialog.start()

    def _after_export(self, dialog: ExportDialog) -> None:
        if self._tour:
            self._tour.begin(self._tour.after_export(dialog), self._finish)
        else:
            self._finish()

    def _finish(self) -> None:
        self.complaint = None
        QApplication.quit()

    def _fail(self, why: str) -> None:
        self.complaint = why or self.complaint
        QApplication.exit(1)


_LOOK_S = 0.7
_MOST_ADDED = 4
"""Most times that more is measured, however often that is advised."""
_ADDS = Action.ANOTHER, Action.VERIFY_LEFT, Action.VERIFY_RIGHT
_PATIENCE_S = 120.0
_PATIENCE_STEPS = 600
"""Engine steps to wait for as well, for a busy machine; an idle one makes five a second or more."""


class Autopilot(QObject):
    """Presses the wizard's main button whenever it can be pressed, until the session is finished.

    Alignments and verifications are confirmed by the wearer, in the headset.

    Parameters
    ----------
    live : CalibrationController
    wizard_panel : WizardPanel
    look : callable
        Called with every view that lasts, before its button is pressed; may block, or pause the
        autopilot.
    finish : callable
        Called once the session is finished.
    fail : callable
        Called with the step and the reason if the wizard makes no progress.
    """

    def __init__(
        self,
        live: CalibrationController,
        wizard_panel: WizardPanel,
        look: Callable[[WizardView], object],
        finish: Callable[[], object],
        fail: Callable[[str], object],
    ) -> None:
        super().__init__(live)
        self._wizard_panel = wizard_panel
        self._look, self._finish, self._fail = look, finish, fail
        self._view: WizardView | None = None
        self._since_s = self._moved_s = time.monotonic()
        self._moved_at = self._added = 0
        self._is_paused = self._is_done = False
        live.polled.connect(self._watch)

    def pause(self) -> None:
        """Press no button until `resume`."""
        self._is_paused = True

    def resume(self) -> None:
        """Continue after a pause."""
        self._is_paused = False
        self._view = None

    def _watch(self, snapshot: Snapshot) -> None:
        view = self._wizard_panel.shown
        if view is None or self._is_paused or self._is_done:
            return
        now_s = time.monotonic()
        if self._view is None or (view.step, view.main) != (self._view.step, self._view.main):
            if self._view is None or view.step is not self._view.step:
                self._moved_s, self._moved_at = now_s, snapshot.number
            self._view, self._since_s = view, now_s
        steps = snapshot.number - self._moved_at
        if now_s - self._moved_s > _PATIENCE_S and steps > _PATIENCE_STEPS:
            self._is_done = True
            self._fail(self._complaint(view))
        elif now_s - self._since_s > _LOOK_S:
            self._act(view)

    def _act(self, view: WizardView) -> None:
        self._since_s = time.monotonic()
        self._look(view)
        if self._is_paused or not (view.main.is_enabled or view.main.action in WEARERS):
            return
        if view.main.action is Action.NEXT_WEARER:
            self._is_done = True
            self._finish()
        elif view.main.action in _ADDS and self._added == _MOST_ADDED:
            self._wizard_panel.bar.do(Action.NEXT)
        elif view.main.action not in WEARERS:
            self._added += view.main.action in _ADDS
            self._wizard_panel.press_main()

    @staticmethod
    def _complaint(view: WizardView) -> str:
        missing = [check.text for check in view.preconditions if not check.holds]
        why = f": {'; '.join(missing)}" if missing else ""
        return f"no progress at “{view.step.value}” for {_PATIENCE_S:.0f} s{why}"


class Screenshots:
    """Saves screenshots as PNG files in a folder.

    Parameters
    ----------
    window : QWidget
    folder : Path
        Created if needed.

    Raises
    ------
    FileError
        If the folder cannot be created.
    """

    def __init__(self, window: QWidget, folder: Path) -> None:
        self._window = window
        self._folder = make_folder(folder)
        self._seen: dict[Step, set[str]] = {}

    def save_step(self, view: WizardView) -> None:
        """Save the window the first time that a step shows a main button."""
        seen = self._seen.setdefault(view.step, set())
        label = view.main.label
        if label in seen:
            return
        again = f"-{label}" if seen else ""
        seen.add(label)
        name = f"step-{STEPS.index(view.step) + 1}-{view.step.value}{again}"
        self.save(name.lower().replace(" ", "-"))

    def save(self, name: str, widget: QWidget | None = None) -> None:
        """Save a widget, by default the window; raise FileError if it cannot be written."""
        # A view that is just changing would be pictured with the layout of the former one.
        QApplication.sendPostedEvents(None, QEvent.Type.LayoutRequest.value)
        path = self._folder / f"{name}.png"
        if not (widget or self._window).grab().save(str(path)):
            raise FileError(f"cannot write {path}")


_LOOK_MS = 600
"""Time until a change is visible, on a busy computer, too."""
_TURN_MS = 50
_PATIENCE_MS = 20_000
_STEPS = 6
_RAIL = QRegularExpression("Rail$")
"""Name of a list that chooses a window's page."""

Walk = Iterator[int]
"""Actions in pieces; each yields the milliseconds to wait before the next."""


class Tour(QObject):
    """Operates the window and saves screenshots.

    Parameters
    ----------
    program : Program
    screenshots : Screenshots
    fail : callable
        Called with the reason if a screenshot could not be saved.
    """

    def __init__(
        self, program: Program, screenshots: Screenshots, fail: Callable[[str], object]
    ) -> None:
        super().__init__(program)
        self._program, self._fail = program, fail
        self._save = screenshots.save

    def begin(self, walk: Walk, then: Callable[[], object]) -> None:
        """Run a walk, then call `then`."""
        try:
            wait_ms = next(walk)
        except StopIteration:
            then()
        except FileError as error:
            self._fail(str(error))
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
            dialog.close()
        manual = show_manual(program.window, "docs/guide.md")
        manual.search.setText("target")
        yield _LOOK_MS
        self._save("manual", manual)
        manual.close()

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
        window.panels.trials.record_action.trigger()
        yield 2 * _LOOK_MS
        panel.reset_action.trigger()
        yield 2 * _LOOK_MS
        self._save("fine-tune-back", panel)


def _until(holds: Callable[[], bool]) -> Walk:
    """Wait for a condition, but not forever: a screenshot will show that it did not hold."""
    for _ in range(_PATIENCE_MS // _TURN_MS):
        if holds():
            return
        yield _TURN_MS


def _press(widget: QWidget, key: Qt.Key) -> None:
    for kind in (QEvent.Type.KeyPress, QEvent.Type.KeyRelease):
        QApplication.sendEvent(widget, QKeyEvent(kind, key, Qt.KeyboardModifier.NoModifier))
