"""The command line: what is wrong is one line, and the exit status tells."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from PySide6.QtCore import QEventLoop, QTimer
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import QApplication, QMessageBox, QWidget
from pytestqt.qtbot import QtBot

from handcal_gui.app import start
from handcal_gui.app.launch import close_on_signals
from tests.helpers import Patience, output_of

START_S = 40.0


def complaint(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    *words: str,
    code: int = 2,
) -> str:
    """Return the one line that the program ends with."""
    monkeypatch.setattr(sys, "argv", ["handcal-gui", *words])
    with pytest.raises(SystemExit) as ended:
        start.main()
    errors = capsys.readouterr().err
    assert ended.value.code == code
    assert errors.count("\n") == 1
    assert errors.startswith("handcal-gui: ")
    return errors


@contextmanager
def run(*words: str | Path) -> Iterator[subprocess.Popen[str]]:
    """Start the program; it ends with the block, whatever fails there."""
    environment = os.environ | {"QT_QPA_PLATFORM": "offscreen", "OMP_NUM_THREADS": "1"}
    environment["QT_LOGGING_RULES"] = "default.warning=false"  # what offscreen cannot do
    with subprocess.Popen(
        [sys.executable, "-m", "handcal_gui", *map(str, words)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["--seed", "-1"], "must be a whole number from 0 to 4294967295"),
        (["--seed", "one"], "must be a whole number from 0 to 4294967295"),
        (["--colour"], "unrecognized arguments: --colour"),
        (["--rig"], "expected one argument"),
        (["a", "b"], "unrecognized arguments: b"),
    ],
)
def test_wrong_arguments(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    what: str,
) -> None:
    assert what in complaint(capsys, monkeypatch, *words)


def test_without_a_console_as_on_windows_a_message_is_shown_in_a_box(
    qapp: QApplication, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[str] = []
    monkeypatch.setattr(QMessageBox, "critical", lambda *words: shown.append(words[2]))
    monkeypatch.setattr(qapp, "quit", lambda: None)
    monkeypatch.setattr(sys, "argv", ["handcal-gui", "--rig"])
    monkeypatch.setattr(sys, "stderr", None)
    with pytest.raises(SystemExit) as ended:
        start.main()
    assert ended.value.code == 2
    assert shown == ["argument --rig: expected one argument; see handcal-gui --help"]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux may be without a display")
def test_without_a_display(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"):
        monkeypatch.delenv(name, raising=False)
    assert "handcal demo" in complaint(capsys, monkeypatch, code=2)
    monkeypatch.setenv("DISPLAY", ":4711")
    assert "cannot connect to the X server at DISPLAY=:4711" in complaint(
        capsys, monkeypatch, code=2
    )


def test_help_tells_every_option(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["handcal-gui", "--help"])
    with pytest.raises(SystemExit) as ended:
        start.main()
    text = capsys.readouterr().out
    assert ended.value.code == 0
    for option in ("--source", "--rig", "--seed", "--autopilot", "--output", "--screenshots"):
        assert option in text


@pytest.mark.process
def test_pictures_that_cannot_be_saved_end_it_before_it_begins(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with run(
        "--screenshots", tmp_path / "file", "--preferences", tmp_path / "preferences.json"
    ) as process:
        _, errors = output_of(process, START_S)
    assert process.returncode == 2, errors
    assert errors.count("\n") == 1
    assert "file" in errors


@pytest.mark.process
@pytest.mark.skipif(shutil.which("localedef") is None, reason="a Turkish locale is made for it")
def test_it_starts_where_the_capital_of_i_has_a_dot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = tmp_path / "tr_TR.UTF-8"
    # Without Debian's package locales it fails, but leaves an empty folder.
    if subprocess.run(["localedef", "-i", "tr_TR", "-f", "UTF-8", made], check=False).returncode:
        pytest.skip("no definitions of locales, which Debian's package locales has")
    monkeypatch.setenv("LOCPATH", str(tmp_path))
    monkeypatch.setenv("LC_ALL", made.name)
    loaded = "import locale; print(locale.setlocale(locale.LC_ALL, ''))"
    found = subprocess.check_output([sys.executable, "-c", loaded], text=True)
    assert found.strip() == made.name  # a locale that cannot be loaded raises
    start_and_end(tmp_path)


@pytest.mark.process
def test_the_threads_of_numpy_are_set_before_it_is_imported() -> None:
    code = (
        "import os, sys; from handcal_gui.app import start; sys.argv = ['handcal-gui']; "
        "start._require_display = lambda: "
        "sys.exit(f\"{os.environ['OMP_NUM_THREADS']} {'numpy' in sys.modules}\"); start.main()"
    )
    environment = {name: text for name, text in os.environ.items() if name != "OMP_NUM_THREADS"}
    ended = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60.0
    )
    assert ended.stderr.strip() == "1 False"


def start_and_end(folder: Path) -> None:
    """Start the program, tell it to end, and expect that it ends well."""
    preferences = folder / "preferences.json"
    with run("--preferences", preferences, folder / "no session") as process:
        patience = Patience(START_S, process.pid)
        while process.poll() is None and not is_listening(process.pid):
            assert not patience.is_over()
            time.sleep(0.1)
        process.send_signal(signal.SIGTERM)
        _, errors = output_of(process, START_S)
    assert (process.returncode, errors) == (0, "")
    assert preferences.exists()  # the window's place is remembered


def is_listening(pid: int) -> bool:
    """Return whether a process has set its handler of SIGTERM."""
    status = Path(f"/proc/{pid}/status").read_text()
    (caught,) = (line.split()[1] for line in status.splitlines() if line.startswith("SigCgt"))
    return bool(int(caught, 16) & 1 << signal.SIGTERM - 1)


SIGNALS = [one for one in signal.Signals if one.name in {"SIGINT", "SIGTERM", "SIGHUP"}]


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_closes_a_window_in_which_nothing_happens(qtbot: QtBot, number: int) -> None:
    loop, closed = QEventLoop(), []

    class Window(QWidget):
        def closeEvent(self, _: QCloseEvent) -> None:
            closed.append(True)
            loop.quit()

    window = Window()
    qtbot.addWidget(window)
    window.show()
    before = [signal.getsignal(one) for one in SIGNALS]
    try:
        for one in SIGNALS:
            signal.signal(one, signal.default_int_handler if one == number else signal.SIG_IGN)
        close_on_signals(window, window.close)
        QTimer.singleShot(10_000, loop.quit)  # runs no Python code, which would handle the signal
        threading.Timer(0.05, signal.raise_signal, (number,)).start()
        loop.exec()
        assert closed == [True]
        others = [signal.getsignal(one) for one in SIGNALS if one != number]
        assert others == [signal.SIG_IGN] * len(others)  # as nohup and a shell's background have it
    finally:
        for one, handler in zip(SIGNALS, before, strict=True):
            signal.signal(one, handler)
