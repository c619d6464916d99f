"""The program as its user has it: a real window on an X server, driven by keys."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.calibration.solve_again import solve_again, stored_solve_settings
from handcal.core.errors import FileError
from handcal.core.types import EYES, UInt8
from handcal.io.closable import Closable
from handcal.session.session import Session, SessionRecord
from handcal_gui.app.preferences import PREFERENCES_VERSION
from handcal_gui.calibrate.start.session_entries import find_sessions
from tests.helpers import ROOT, Patience, output_of, write_small_rig

ARTEFACTS = ROOT / "artefacts"
PATIENCE_S = 90.0
_BUTTON_PX = 24, 28
"""A place on the main button, from the lower right corner."""


@dataclass(frozen=True)
class Display:
    """An X server without a screen, which keeps its picture in a file."""

    name: str
    file: Path

    def picture(self) -> UInt8:
        """Return the screen's pixels, (height, width, 3) red, green and blue.

        The file is an X window dump: a header of big-endian words (X11/XWDFile.h) that begins with
        its own size, then the colours, then the pixels with blue first.
        """
        dump = self.file.read_bytes()
        words = np.frombuffer(dump, ">u4", 25)
        size, width, height, row_bytes, colors = (int(words[i]) for i in (0, 4, 5, 12, 19))
        pixels = np.frombuffer(dump, np.uint8, height * row_bytes, size + 12 * colors)
        return np.asarray(pixels.reshape(height, -1, 4)[:, :width, 2::-1])


@pytest.fixture(scope="module")
def display(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Display]:
    """Start an X server without a screen."""
    if shutil.which("Xvfb") is None or shutil.which("xdotool") is None:
        pytest.skip("Xvfb and xdotool are not installed")
    read, write = os.pipe()
    folder = tmp_path_factory.mktemp("screen")
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x800x24"]
    command += ["-nolisten", "tcp", "-fbdir", str(folder)]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as pipe:
        number = pipe.readline().strip()
    assert number
    yield Display(f":{number}", folder / "Xvfb_screen0")
    server.terminate()
    server.wait(10)


class Window(Closable):
    """A running program, and the technician's hands; killed if it is left running."""

    def __init__(self, display: Display, *arguments: str | Path) -> None:
        self._display = display
        self._environment = os.environ | {"DISPLAY": display.name, "QT_QPA_PLATFORM": "xcb"}
        self.pressed: list[str] = []
        command = [sys.executable, "-m", "handcal_gui", *map(str, arguments)]
        self.process = subprocess.Popen(
            command, env=self._environment, stderr=subprocess.PIPE, text=True
        )

    def find(self) -> None:
        """Wait for the window and give it the keyboard."""
        found = self._xdotool("search", "--sync", "--onlyvisible", "--name", "handcal")
        self._xdotool("windowfocus", "--sync", found.split()[0])

    def press(self, *keys: str) -> None:
        self.pressed.extend(keys)
        self._xdotool("key", *keys)

    def hold(self, key: str, seconds: float) -> None:
        """Keep a key down, which the X server repeats."""
        self._xdotool("keydown", key)
        time.sleep(seconds)
        self._xdotool("keyup", key)

    def type(self, text: str) -> None:
        self._xdotool("type", text)

    def shoot(self, name: str) -> None:
        """Keep a picture of the whole screen."""
        ARTEFACTS.mkdir(exist_ok=True)
        cv2.imwrite(str(ARTEFACTS / f"{name}.png"), self._display.picture()[..., ::-1])

    def offers(self) -> bool:
        """Return whether the main button, at the lower right of the screen, has its colour."""
        right_px, up_px = _BUTTON_PX
        seen = self._display.picture()[-up_px, -right_px].astype(int)
        return bool(seen.max() - seen.min() > 0.4 * seen.max())

    def end(self) -> tuple[int, str]:
        """Wait for the end; return the exit status and what was complained of."""
        _, errors = output_of(self.process, PATIENCE_S)
        return self.process.returncode, errors

    def end_well(self) -> None:
        """Wait for the end; a busy computer may make the link complain, and nothing else may."""
        code, errors = self.end()
        assert code == 0, errors
        assert all("handcal.link" in line for line in errors.splitlines()), errors

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()

    def _xdotool(self, *arguments: str) -> str:
        return subprocess.run(
            ["xdotool", *arguments],
            env=self._environment,
            check=True,
            capture_output=True,
            text=True,
            timeout=10 * PATIENCE_S,  # `search --sync` waits for a window
        ).stdout


def wait_for(what: str, condition: Callable[[], bool], window: Window) -> None:
    patience = Patience(PATIENCE_S, window.process.pid)
    while not condition():
        assert window.process.poll() is None, window.end()
        assert not patience.is_over(), f"{what} did not come"
        time.sleep(0.2)


@pytest.fixture
def preferences(tmp_path: Path) -> Path:
    path = tmp_path / "config" / "preferences.json"
    path.parent.mkdir()
    rig = write_small_rig(tmp_path / "rig.yaml")
    station = {"sessions": str(tmp_path / "sessions"), "seed": 1, "rig": str(rig)}
    export = {"formats": ["report", "csv"]}
    path.write_text(
        json.dumps(
            {
                "version": PREFERENCES_VERSION,
                "station": station,
                "export": export,
                "export_folder": str(tmp_path / "out"),
                "runs_itself": False,
            }
        )
    )
    return path


class Technician:
    """Works at a window, and reads in the newest session what has happened."""

    def __init__(self, window: Window, sessions: Path, preferences: Path) -> None:
        self._window, self._sessions, self._preferences = window, sessions, preferences

    def session(self) -> SessionRecord | None:
        """Return the newest session; None while there is none, or it is being created."""
        paths = sorted(self._sessions.glob("session-*"))
        with suppress(FileError):
            return Session.open(paths[-1]) if paths else None
        return None

    def count(self, name: str) -> int:
        """Return how many events of the newest session have a name."""
        session = self.session()
        return sum(event.name == name for event in session.events) if session else 0

    def start(self, wearer: str) -> None:
        self._window.type(wearer)
        self._window.shoot(f"real-1-start-{wearer}")
        self._window.press("Return")

        def is_shown() -> bool:
            session = self.session()
            known = self._preferences.read_text()  # from when the page is shown
            return session is not None and session.wearer == wearer and session.path.name in known

        wait_for(f"{wearer}'s session", is_shown, self._window)

    def wait_until(self, name: str, count: int = 1) -> None:
        wait_for(f"{name} {count}", lambda: self.count(name) >= count, self._window)

    def press_space_until(self, name: str, count: int = 1) -> None:
        """Press the space bar as one who watches the screen: no faster than it changes."""

        def tried() -> bool:
            if self.count(name) < count:
                self._window.press("space")
                time.sleep(0.8)
            return self.count(name) >= count

        wait_for(f"{name} {count}", tried, self._window)


@pytest.mark.slow  # tests/gui covers the keys, one that is held, and the resumption
def test_a_technician_calibrates_two_wearers_with_the_keyboard_alone(
    display: Display, tmp_path: Path, preferences: Path, headset_of: Callable[[int], int]
) -> None:
    """One calibration to its export; in the next the space bar is held, and the program killed."""
    sessions = tmp_path / "sessions"
    with Window(display, "--preferences", preferences) as window:
        technician = Technician(window, sessions, preferences)
        window.find()
        time.sleep(2.0)
        ada = calibrated_and_exported(window, technician)
        (report,) = (tmp_path / "out").glob("*/report.pdf")
        assert report.read_bytes().startswith(b"%PDF")
        window.press("ctrl+n")
        time.sleep(2.0)
        technician.start("Bob")
        hold_the_space_bar(window, technician)
        headset = headset_of(window.process.pid)
        window.process.kill()
    assert ada.wearer == "Ada"
    assert ada.is_finished
    assert {eye for alignment in ada.alignments.values() for eye in alignment.eyes} == set(EYES)
    assert "wearers" not in json.loads(preferences.read_text()), "names are only in the sessions"

    killed = technician.session()
    assert killed is not None
    assert not killed.is_finished
    assert len(killed.alignments) == 1
    (unfinished,) = find_sessions(sessions, ()).unfinished
    assert unfinished.is_enabled
    resume_and_quit(display, killed.path, preferences)
    resumed = technician.session()
    assert resumed is not None
    assert len(resumed.alignments) == 1
    patience = Patience(PATIENCE_S)
    while Path(f"/proc/{headset}").exists():  # the killed program's; it hears no PC any more
        assert not patience.is_over()
        time.sleep(0.2)


@pytest.mark.slow  # tests/gui/app/program/test_plan.py presses the same keys, without the X server
@pytest.mark.parametrize("arrangement", ["panels", "station"])
def test_three_presses_lead_from_the_start_page_to_a_verified_result(
    display: Display,
    tmp_path: Path,
    preferences: Path,
    record_property: Callable[..., None],
    arrangement: str,
) -> None:
    """The recommended plan; each key is pressed once, when the button is offered."""
    known = json.loads(preferences.read_text())
    known["station"]["plan"] = {"name": "recommended", "is_automatic": True}
    preferences.write_text(json.dumps(known | {"runs_itself": True, "arrangement": arrangement}))
    with Window(display, "--preferences", preferences) as window:
        technician = Technician(window, tmp_path / "sessions", preferences)
        window.find()
        time.sleep(2.0)
        started_s = time.monotonic()
        technician.start("Ada")
        wait_for("Begin", window.offers, window)
        window.press("space")
        technician.wait_until("cursor_made")

        def is_over() -> bool:
            session = technician.session()
            is_verified = session is not None and set(session.facts.verified) == set(EYES)
            is_sent = is_verified and session is not None and session.events[-1].name == "applied"
            return is_sent and window.offers()

        wait_for("the end of the plan", is_over, window)
        record_property("seconds", round(time.monotonic() - started_s))
        window.shoot(f"real-8-{arrangement}")
        window.press("space")
        technician.wait_until("finished")
        window.shoot(f"real-9-{arrangement}")
        assert window.pressed == ["Return", "space", "space"]
        window.press("ctrl+q")
        window.end_well()
    session = technician.session()
    assert session is not None
    assert session.facts.plan == "recommended"
    results = solve_again(session, stored_solve_settings(session))
    assert results is not None
    assert {one.name for one in results.verdicts.values()} == {"accept"}


def calibrated_and_exported(window: Window, technician: Technician) -> SessionRecord:
    technician.start("Ada")
    for eye in (1, 2):
        technician.press_space_until("cursor_made", eye)
        window.shoot(f"real-2-align-{eye}")
        technician.wait_until("alignment_saved", eye)  # the wearer confirms in the headset
        technician.press_space_until("applied", eye)
        window.shoot(f"real-3-applied-{eye}")
    for _ in (1, 2):
        time.sleep(2.0)
        window.press("alt+s")  # skip the check
    time.sleep(2.0)
    window.press("alt+i")  # keep it as it is, if more alignments are advised
    technician.press_space_until("finished")
    session = technician.session()
    assert session is not None
    window.press("ctrl+e")
    time.sleep(1.5)
    window.shoot("real-4-export")
    window.press("Return")
    out = session.path.parents[1] / "out"
    wait_for("the report", lambda: any(out.glob("*/report.pdf")), window)
    time.sleep(1.0)
    window.shoot("real-5-exported")
    window.press("Escape")
    time.sleep(0.5)
    window.find()  # without a window manager, nobody gives the keyboard back
    return session


def hold_the_space_bar(window: Window, technician: Technician) -> None:
    """Align one eye, and check that a space bar held down presses once and deletes nothing."""
    for key in ("alt+y", "Down", "Escape", "Tab"):  # into the list of eyes, and on
        window.press(key)
        time.sleep(0.3)
    technician.press_space_until("cursor_made")
    technician.wait_until("alignment_saved")
    time.sleep(2.0)  # until the button says so
    window.hold("space", 3.0)
    technician.wait_until("solved")
    time.sleep(2.0)
    window.shoot("real-6-held")
    assert not technician.count("applied")  # the next that the button offered
    technician.press_space_until("applied")
    assert not technician.count("alignment_deleted")


def resume_and_quit(display: Display, session: Path, preferences: Path) -> None:
    with Window(display, session, "--preferences", preferences) as window:
        window.find()
        time.sleep(2.0)

        def is_resumed() -> bool:
            window.press("alt+r")
            time.sleep(1.0)
            return not find_sessions(session.parent, ()).unfinished[0].is_enabled

        wait_for("the session in use again", is_resumed, window)
        window.shoot("real-7-resumed")
        window.press("ctrl+q")
        window.end_well()


def test_the_autopilot_says_where_it_got_stuck(display: Display, tmp_path: Path) -> None:
    rig = tmp_path / "rig.yaml"
    rig.write_text("%YAML:1.0\n")
    with Window(
        display,
        *("--autopilot", "--rig", rig, "--output", tmp_path / "result"),
        *("--preferences", tmp_path / "preferences.json"),
    ) as window:
        code, errors = window.end()
    assert code == 1
    assert errors.count("\n") == 1
    assert "rig" in errors
