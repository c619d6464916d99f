"""Snapshots of a fast camera on their way to the panels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from handcal.calibration.states import State
from handcal.station.snapshot import Snapshot
from handcal_gui.app.preferences import PreferencesFile
from handcal_gui.app.program import Program
from handcal_gui.calibrate.guide.view import Action
from handcal_gui.calibrate.sections import TITLES
from handcal_gui.engine.engine_thread import EngineThread
from tests.gui.views import begun

MakeSnapshot = Callable[..., Snapshot]


class Stream:
    """A running calibration whose frames arrive at `rate_hz`, with all panels visible.

    Attributes
    ----------
    polled : list of Snapshot
        Snapshots shown by the guide.
    shown : dict of str to list of Snapshot
        Those shown by each panel.
    """

    def __init__(self, program: Program, snapshot: MakeSnapshot, patch: pytest.MonkeyPatch) -> None:
        self.polled: list[Snapshot] = []
        self.shown: dict[str, list[Snapshot]] = {name: [] for name in TITLES}
        self.rate_hz = 30
        self._make = snapshot
        self._now_ns = self._number = 0
        self._newest: Snapshot | None = None
        self._controller = program.live
        panels = program.window.panels
        for name, shown in self.shown.items():
            patch.setattr(getattr(panels, name), "show_snapshot", shown.append)
        engine = Mock(spec=EngineThread, newest=lambda: (self._newest, 0), submit=lambda *_: 0)
        patch.setattr(self._controller, "_engine", engine)
        self.is_visible = True
        for panel in (*panels.all(), program.wizard_panel.picture):
            patch.setattr(panel, "isVisible", lambda: self.is_visible)
        patch.setattr(
            "handcal_gui.calibrate.control.live.time",
            SimpleNamespace(monotonic_ns=lambda: self._now_ns),
        )
        self._controller.polled.connect(self.polled.append)
        patch.setattr(self._controller, "_timer", Mock(isActive=lambda: True))

    def be_slow(self) -> None:
        """Let the computer be slow, as after three seconds with few frames."""
        self._controller._conditions.is_slow = True

    def see(self, rotation_rad: float) -> Snapshot:
        """Let a frame with a hand so rotated arrive, and poll until the next could."""
        self._number += 1
        made = self._make()
        assert made.frame is not None
        frame = replace(made.frame, t_host_ns=self._now_ns)
        seen = {"rotation_rad": np.array([0.0, 0.0, rotation_rad])}
        self._newest = self._make(
            observation=seen, frame=frame, number=self._number, t_host_ns=self._now_ns
        )
        self.wait(1_000_000_000 // self.rate_hz)
        return self._newest

    def miss(self, seen: Snapshot) -> None:
        """Let the camera be late after a snapshot, and poll."""
        self._number += 1
        self._newest = replace(seen, observation=None, number=self._number)
        self.wait(1_000_000_000 // self.rate_hz)

    def wait(self, time_ns: int) -> None:
        """Poll for a while as the timer does, without a new frame."""
        for _ in range(4):
            self._controller._poll()
            self._now_ns += time_ns // 4


@pytest.fixture
def program(qtbot: QtBot, tmp_path: Path) -> Program:
    made = Program(PreferencesFile(tmp_path / "preferences.json"))
    qtbot.addWidget(made.window)
    return made


@pytest.fixture
def stream(program: Program, snapshot: MakeSnapshot, monkeypatch: pytest.MonkeyPatch) -> Stream:
    return Stream(program, snapshot, monkeypatch)


def test_on_a_slow_computer_panels_show_every_second_of_them(stream: Stream) -> None:
    stream.rate_hz = 60
    stream.be_slow()
    for _ in range(32):
        stream.see(0.0)
    counts = {name: len(shown) for name, shown in stream.shown.items()}
    assert len(stream.polled) == 16
    assert counts["camera"] == counts["results"] == 8
    assert {counts["cloud"], counts["wearer_view"]} <= {2, 3}
    assert counts["rotation"] == 16, "guidance comes first"


def test_thirty_frames_a_second_are_shown_and_the_last_by_every_panel(stream: Stream) -> None:
    for rate_hz, every in ((30, 1), (60, 2), (90, 3)):
        stream.rate_hz = rate_hz
        stream.polled.clear()
        moving = [stream.see(0.01 * i) for i in range(12)]
        assert stream.polled == moving[::every]
        assert stream.shown["rotation"][-len(stream.polled) :] == stream.polled, "as the guide"
        still = [stream.see(0.2) for _ in range(4 * every)]
        for name, shown in stream.shown.items():
            assert shown[-1] in still, name
        last = stream.see(0.3)
        stream.wait(100_000_000)
        assert stream.polled[-1] is last
        assert len(stream.polled) == len(set(map(id, stream.polled)))


def test_a_late_frame_is_shown_once_with_the_newest_hand(stream: Stream) -> None:
    seen = stream.see(0.1)
    stream.miss(seen)
    assert [one.observation for one in stream.polled] == [seen.observation, seen.observation]


def test_a_hidden_link_panel_keeps_its_history(stream: Stream) -> None:
    stream.is_visible = False
    stream.see(0.0)
    assert len(stream.shown["link"]) == 1
    assert not stream.shown["session"]


def test_a_failed_action_is_no_longer_told_at_the_next_step(
    program: Program, snapshot: MakeSnapshot
) -> None:
    guide, banner = program.wizard_panel, program.window.banner
    guide.start(begun())
    guide.show_snapshot(snapshot(State.ALIGN))
    program.live._on_command_failed(Action.CONFIRM, "the hand moves")
    assert banner.text == "Could not confirm: the hand moves"
    guide.show_snapshot(snapshot(State.ALIGN))
    assert banner.text
    guide.show_snapshot(snapshot(State.ALIGNED))  # confirmed in the headset
    assert banner.text == ""
    program.live._on_command_failed(Action.CONFIRM, "the hand moves")
    banner.show_message("another message")
    guide.show_snapshot(snapshot(State.ALIGN))
    assert banner.text == "another message"
