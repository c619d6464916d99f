"""The command ``handcal-gui``: reads its arguments and shows a window immediately.

Heavy imports follow while that window is shown; the main window then replaces it.
"""

from __future__ import annotations

import argparse
import gc
import locale
import os
import re
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

from PySide6.QtCore import QSize
from PySide6.QtWidgets import QApplication, QHBoxLayout, QLabel, QWidget

from handcal.io.configuration import keep_font_list_in_configuration
from handcal.io.x_display import x_server_answers
from handcal_gui import FIRST_SIZE_PX
from handcal_gui.app.translation import tr

_EXPOSED_S = 0.3
"""Longest wait for the first window to be on the screen."""


def main() -> NoReturn:
    """Run the program; the exit status is 0, 1 if it fails, 2 for wrong arguments or no display."""
    # Before NumPy is imported: threads for its small matrices take turns with those of the window.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    arguments = _parser().parse_args()
    _require_display()
    keep_font_list_in_configuration()
    keep_window_quick()
    gc.disable()  # until everything is imported and made: none of that is garbage
    app = QApplication(sys.argv[:1])
    use_english_capitals()
    app.setApplicationName("handcal")
    app.setDesktopFileName("handcal")
    app.setStyle("Fusion")
    first = first_window(arguments.size)
    from handcal_gui.app.launch import LaunchError, launch

    try:
        launch(app, arguments, first)
    except LaunchError as error:
        _fail(str(error), error.code)
    sys.exit(0)


def keep_window_quick() -> None:
    """Make the window's thread wait at most 0.5 ms for the engine's thread instead of 5 ms."""
    sys.setswitchinterval(0.0005)


def use_english_capitals() -> None:
    """Make I the capital of i in C libraries, in place of the Turkish İ; call after Qt has started.

    PySide6 finds a property such as ``interval`` by the capital of its first letter.
    """
    for name in ("C.UTF-8", "C"):  # not every system has the first
        with suppress(locale.Error):
            locale.setlocale(locale.LC_CTYPE, name)
            return


def first_window(size: QSize | None) -> QWidget:
    """Show a message that the program is starting, where the main window will appear.

    Centred without `Qt.AlignmentFlag`: the first use of `Qt` makes all its enumerations, which took
    an eighth of the processor time until this window is shown.
    """
    window = QWidget()
    layout = QHBoxLayout(window)
    layout.addStretch()
    layout.addWidget(QLabel(tr("Starting handcal…")))
    layout.addStretch()
    window.setWindowTitle(tr("Starting…"))
    screen = QApplication.primaryScreen().availableSize()
    window.resize(size or screen.boundedTo(QSize(*FIRST_SIZE_PX)))
    window.show()
    # A window manager shows it a little later, and nothing is painted while the rest is imported.
    deadline_s = time.monotonic() + _EXPOSED_S
    while time.monotonic() < deadline_s:
        QApplication.processEvents()
        if window.windowHandle().isExposed():
            break
        time.sleep(0.002)
    QApplication.processEvents()
    return window


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        _fail(f"{message}; see {self.prog} --help", 2)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="handcal-gui",
        description="Calibrate an optical see-through headset with the wearer's bare hand.",
    )
    parser.add_argument("session", nargs="?", type=Path, help="a stored session to open")
    parser.add_argument(
        "--source",
        metavar="SOURCE",
        help="simulator, realsense, oak, orbbec, hololens2:HOST, or a recording",
    )
    parser.add_argument("--rig", type=Path, metavar="FILE", help="the rig file")
    parser.add_argument("--seed", type=_seed, metavar="N", help="seed of the simulated wearer")
    parser.add_argument(
        "--autopilot",
        action="store_true",
        help="calibrate the simulated wearer automatically, then exit",
    )
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("handcal-demonstration"),
        metavar="DIR",
        help="folder for the autopilot's session and export (default: %(default)s)",
    )
    parser.add_argument(
        "--screenshots",
        type=Path,
        metavar="DIR",
        help="run the autopilot and save screenshots of every step, panel and dialog",
    )
    parser.add_argument(
        "--size", type=_size, metavar="WxH", help="initial size of the window, such as 1280x800"
    )
    parser.add_argument(
        "--preferences",
        type=Path,
        metavar="FILE",
        help="preferences file to use instead of the user's",
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
    """Exit with a one-line message where Qt would abort."""
    others = {"WAYLAND_DISPLAY", "QT_QPA_PLATFORM"}
    if not sys.platform.startswith("linux") or others & set(os.environ):
        return
    display = os.environ.get("DISPLAY")
    if not display:
        _fail("no display found; `handcal demo` runs the same calibration without one", 2)
    if not x_server_answers(display):
        _fail(
            f"cannot connect to the X server at DISPLAY={display}; start it, or set DISPLAY to "
            "a server that accepts connections from you, or use `handcal demo`, which needs none",
            2,
        )


def _fail(message: str, code: int) -> NoReturn:
    line = " ".join(message.split())
    if sys.stderr is None:  # on Windows, a window has no console
        from PySide6.QtWidgets import QMessageBox

        app = QApplication.instance() or QApplication(sys.argv[:1])
        QMessageBox.critical(None, "handcal", line)
        app.quit()
    else:
        sys.stderr.write(f"handcal-gui: {line}\n")
    sys.exit(code)
