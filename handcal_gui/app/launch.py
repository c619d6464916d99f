"""Run the program as the command line requests, once everything is imported."""

from __future__ import annotations

import argparse
import faulthandler
import gc
import logging
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from logging.handlers import RotatingFileHandler
from pathlib import Path
from types import TracebackType

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QApplication, QWidget

from handcal.camera.live import is_live
from handcal.core.errors import HandcalError
from handcal.io.files import make_folder
from handcal.io.resources import resource_path
from handcal.station.settings import StationSettings, with_source
from handcal_gui.app.autopilot import Demonstration
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.app.translation import tr
from handcal_gui.engine.garbage import collect_in_this_thread

_LOG_BYTES = 2**20
_TITLE_PX = 40
"""Height of a title bar and the edges, which a window manager adds only later."""


class LaunchError(Exception):
    """The program could not start or did not succeed; carries the exit status."""

    def __init__(self, why: object, code: int) -> None:
        super().__init__(str(why))
        self.code = code


def launch(app: QApplication, arguments: argparse.Namespace, first: QWidget) -> None:
    """Run the program until its window is closed.

    Parameters
    ----------
    app : QApplication
    arguments : Namespace
        Arguments of the command line.
    first : QWidget
        The window shown until the main window replaces it.

    Raises
    ------
    LaunchError
        If the program cannot start, or the autopilot fails.
    """
    app.setApplicationDisplayName("handcal")
    app.setWindowIcon(QIcon(str(resource_path("icons/handcal.svg"))))
    file = PreferencesFile(arguments.preferences)
    _log_to(file.path.with_name("handcal.log"))
    try:
        program = Program(file, remembers=not _is_demonstration(arguments))
    except HandcalError as error:
        raise LaunchError(error, 1) from error
    sys.excepthook = lambda *error: _report_error(program, *error)
    close_on_signals(program.window, program.end)
    if arguments.size:
        program.window.setWindowState(Qt.WindowState.WindowNoState)  # it was maximized when closed
        program.window.resize(arguments.size)
        program.window.show()
    elif program.window.height() < program.window.screen().availableSize().height() - _TITLE_PX:
        program.window.show()
    else:
        program.window.showMaximized()
    first.close()
    try:
        demonstration = _begin(program, arguments)
    except HandcalError as error:
        program.close()
        raise LaunchError(error, 2) from error
    gc.freeze()  # all of this stays; searching it for garbage held up the window by 0.1 s
    collect_in_this_thread(app)
    app.exec()
    program.close()
    if demonstration is not None and demonstration.complaint is not None:
        raise LaunchError(demonstration.complaint, 1)


def close_on_signals(window: QWidget, close: Callable[[], object]) -> None:
    """Have the signals that end a process close a window."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):  # Windows has no SIGHUP
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) != signal.SIG_IGN:  # as nohup has it
            # From the event loop, which may not run yet.
            signal.signal(number, lambda *_: QTimer.singleShot(0, close))
    awake = QTimer(window, interval=200)
    awake.timeout.connect(lambda: None)  # Python handles signals only while it runs
    awake.start()


def _begin(program: Program, arguments: argparse.Namespace) -> Demonstration | None:
    """Start what the arguments request."""
    settings = _station(program.preferences.station, arguments)
    if _is_demonstration(arguments):
        demonstration = Demonstration(program, arguments.output, arguments.screenshots)
        demonstration.start(settings)
        return demonstration
    program.use_for_one_run(settings)
    if arguments.session:
        program.open_session(arguments.session)
    return None


def _station(settings: StationSettings, arguments: argparse.Namespace) -> StationSettings:
    """Return the settings of the station, changed as the arguments request."""
    match arguments.source or ("simulator" if _is_demonstration(arguments) else None):
        case None:
            pass
        case "simulator":
            settings = replace(settings, source="simulator", headset="virtual")
        case "realsense":
            settings = replace(settings, source="realsense", headset="network")
        case live if is_live(live):
            settings = replace(with_source(settings, live), headset="network")
        case path:
            recording = str(Path(path).absolute())  # valid from any folder, if it is remembered
            settings = replace(settings, source="recording", recording=recording, headset="virtual")
    if arguments.rig:
        settings = replace(settings, rig=str(arguments.rig.absolute()))
    if arguments.seed is not None:
        settings = replace(settings, seed=arguments.seed)
    return settings


def _is_demonstration(arguments: argparse.Namespace) -> bool:
    return bool(arguments.autopilot or arguments.screenshots)


def _log_to(path: Path) -> None:
    """Log to a file what the window says, and to the terminal what failed unexpectedly.

    The file also gets where each thread was if a library crashes the program.
    """
    handlers: list[logging.Handler] = [logging.StreamHandler()]
    handlers[0].setLevel(logging.WARNING)
    with suppress(HandcalError, OSError):
        make_folder(path.parent)
        handlers.append(RotatingFileHandler(path, maxBytes=_LOG_BYTES, backupCount=1))
        faulthandler.enable(path.open("a"))  # its own: the handler's is closed as it rotates
    logging.basicConfig(
        level=logging.WARNING, format="%(asctime)s %(name)s: %(message)s", handlers=handlers
    )
    logging.getLogger("handcal_gui").setLevel(logging.INFO)
    logging.getLogger(__name__).info("started")


def _report_error(
    program: Program, kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Log and show an unexpected error; captured data is already on the disk."""
    logging.getLogger(__name__).error("unexpected error", exc_info=(kind, error, trace))
    program.window.banner.show_message(
        tr(
            "handcal hit an unexpected error ({}: {}). Everything captured is saved; restart the "
            "program if it no longer works, and report it with Help > Support bundle."
        ).format(kind.__name__, error)
    )
