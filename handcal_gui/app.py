"""The command ``handcal-gui``: its arguments, and what becomes of them."""

from __future__ import annotations

import argparse
import logging
import os
import re
import signal
import sys
from contextlib import suppress
from dataclasses import replace
from logging.handlers import RotatingFileHandler
from pathlib import Path
from types import TracebackType
from typing import NoReturn

from PySide6.QtCore import QSize, QTimer
from PySide6.QtGui import QIcon
from PySide6.QtWidgets import QApplication

from handcal.errors import HandcalError
from handcal.files import make_folder
from handcal.resources import resource_path
from handcal.station_settings import StationSettings
from handcal_gui.demonstration.demonstration import Demonstration
from handcal_gui.preferences import PreferencesFile
from handcal_gui.program import Program

_LOG_BYTES = 2**20


def main() -> NoReturn:
    """Run the program; the exit status is 0, 1 if the autopilot fails, 2 for wrong arguments."""
    arguments = _parser().parse_args()
    _require_display()
    app = QApplication(sys.argv[:1])
    app.setApplicationName("handcal")
    app.setApplicationDisplayName("handcal")
    app.setDesktopFileName("handcal")
    app.setStyle("Fusion")
    app.setWindowIcon(QIcon(str(resource_path("icons/handcal.svg"))))
    file = PreferencesFile(arguments.preferences)
    _log_to(file.path.with_name("handcal.log"))
    try:
        program = Program(file, remembers=not _is_demonstration(arguments))
    except HandcalError as error:
        _fail(str(error), 1)
    sys.excepthook = lambda *error: _tell(program, *error)
    for number in (signal.SIGINT, signal.SIGTERM):
        # By the event loop, which may have yet to begin.
        signal.signal(number, lambda *_: QTimer.singleShot(0, program.window.close))
    awake = QTimer()  # lets Python see the signal
    awake.start(200)
    if arguments.size:
        program.window.resize(arguments.size)
    program.window.show()
    try:
        demonstration = _begin(program, arguments)
    except HandcalError as error:
        program.close()
        _fail(str(error), 2)
    app.exec()
    program.close()
    if demonstration is not None and demonstration.complaint is not None:
        _fail(demonstration.complaint, 1)
    sys.exit(0)


def _begin(program: Program, arguments: argparse.Namespace) -> Demonstration | None:
    """Do at once what the arguments ask for."""
    settings = _station(program.preferences.station, arguments)
    if _is_demonstration(arguments):
        demonstration = Demonstration(program, arguments.output, arguments.screenshots)
        demonstration.start(settings)
        return demonstration
    if arguments.session:
        program.open_session(arguments.session)
    else:
        program.start.show_preferences(replace(program.preferences, station=settings))
    return None


def _station(settings: StationSettings, arguments: argparse.Namespace) -> StationSettings:
    """Return the station that the arguments ask for."""
    match arguments.source or ("simulator" if _is_demonstration(arguments) else None):
        case None:
            pass
        case "simulator":
            settings = replace(settings, source="simulator", headset="virtual")
        case "realsense":
            settings = replace(settings, source="realsense", headset="network")
        case path:
            recording = str(Path(path).absolute())  # remembered, to be found from any folder
            settings = replace(settings, source="recording", recording=recording, headset="virtual")
    if arguments.rig:
        settings = replace(settings, rig=str(arguments.rig.absolute()))
    if arguments.seed is not None:
        settings = replace(settings, seed=arguments.seed)
    return settings


def _is_demonstration(arguments: argparse.Namespace) -> bool:
    return bool(arguments.autopilot or arguments.screenshots)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        _fail(f"{message}; see {self.prog} --help", 2)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="handcal-gui",
        description="Calibrate an optical see-through headset with the wearer's bare hand.",
    )
    parser.add_argument("session", nargs="?", type=Path, help="a stored session to look at")
    parser.add_argument(
        "--source",
        metavar="SOURCE",
        help="simulator, realsense, or a recording: a .db3 or .bag file, or a folder",
    )
    parser.add_argument("--rig", type=Path, metavar="FILE", help="the rig file")
    parser.add_argument("--seed", type=_seed, metavar="N", help="of the simulated wearer")
    parser.add_argument(
        "--autopilot", action="store_true", help="calibrate the simulated wearer by itself, and end"
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("handcal-demonstration"),
        metavar="DIR",
        help="where the autopilot's session and export go (default: %(default)s)",
    )
    parser.add_argument(
        "--screenshots",
        type=Path,
        metavar="DIR",
        help="save a picture of every step, panel and dialog on the way, as the autopilot goes",
    )
    parser.add_argument(
        "--size", type=_size, metavar="WxH", help="of the window at first, such as 1280x800"
    )
    parser.add_argument(
        "--preferences", type=Path, metavar="FILE", help="remember things in FILE, not for the user"
    )
    return parser


def _seed(text: str) -> int:
    if not text.isdecimal() or int(text) >= 2**32:
        raise argparse.ArgumentTypeError(f"must be a whole number from 0 to {2**32 - 1}")
    return int(text)


def _size(text: str) -> QSize:
    found = re.fullmatch(r"(\d{3,4})x(\d{3,4})", text)
    if not found:
        raise argparse.ArgumentTypeError("must be like 1280x800")
    return QSize(int(found[1]), int(found[2]))


def _require_display() -> None:
    """End with one line where Qt would abort."""
    wanted = {"DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"}
    if sys.platform.startswith("linux") and not wanted & set(os.environ):
        _fail("there is no display; `handcal demo` does the same without one", 2)


def _log_to(path: Path) -> None:
    handlers: list[logging.Handler] = [logging.StreamHandler()]
    with suppress(HandcalError, OSError):
        make_folder(path.parent)
        handlers.append(RotatingFileHandler(path, maxBytes=_LOG_BYTES, backupCount=1))
    logging.basicConfig(
        level=logging.WARNING, format="%(asctime)s %(name)s: %(message)s", handlers=handlers
    )


def _tell(
    program: Program, kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Log an error that nobody expected, and say so; what was captured is on the disk already."""
    logging.getLogger(__name__).error("broke down", exc_info=(kind, error, trace))
    program.window.banner.show_message(
        f"handcal broke down ({kind.__name__}: {error}). Everything captured is saved; "
        "restart the program if it does not go on."
    )


def _fail(message: str, code: int) -> NoReturn:
    sys.stderr.write(f"handcal-gui: {' '.join(message.split())}\n")
    sys.exit(code)
