from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from handcal.camera.feed import CameraFeed
from handcal.core.errors import CameraEndError, CameraError
from handcal.core.types import Float32, Frame
from tests.camera.stand_ins import SILENT, UNPLUGGED, Scripted

REOPEN_S = 0.05


@pytest.fixture(autouse=True)
def _impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("handcal.camera.feed._READ_S", 0.01)
    monkeypatch.setattr("handcal.camera.feed._SILENT_S", 0.03)
    monkeypatch.setattr("handcal.camera.feed._REOPEN_S", REOPEN_S)


def opener(*scripts: Sequence[int | Exception]) -> tuple[Callable[[], Scripted], list[Scripted]]:
    """Return what opens one scripted camera after the other, and those opened."""
    waiting, opened = list(scripts), list[Scripted]()

    def open_camera() -> Scripted:
        if not waiting:
            raise CameraError("no camera is connected; plug one in")
        opened.append(Scripted(waiting.pop(0)))
        return opened[-1]

    return open_camera, opened


def read_frame(feed: CameraFeed, timeout_s: float = 5.0) -> Frame:
    deadline_s = time.monotonic() + timeout_s
    while time.monotonic() < deadline_s:
        if (frame := feed.read()) is not None:
            return frame
    raise AssertionError("no frame came")


def test_frames_come_and_gaps_in_their_count_are_dropped_frames() -> None:
    open_camera, opened = opener([1, 2, 5, 6])
    with CameraFeed(open_camera) as feed:
        frames = [feed.read() for _ in range(4)]
        status = feed.status
    assert [frame.index for frame in frames if frame is not None] == [1, 2, 5, 6]
    assert (status.name, status.problem, status.dropped) == ("Scripted camera", "", 2)
    assert status.rate_hz == pytest.approx(4.0)
    assert opened[0].is_closed


def test_a_camera_unplugged_and_plugged_in_again_goes_on() -> None:
    open_camera, opened = opener([7, UNPLUGGED], [1])
    with CameraFeed(open_camera) as feed:
        assert feed.read() is not None
        assert feed.read() is None
        assert feed.status.problem == str(UNPLUGGED)
        assert read_frame(feed).index == 1
        assert feed.status.problem == ""
        assert feed.status.dropped == 0  # counting starts again
    assert [camera.is_closed for camera in opened] == [True, True]


def test_it_says_why_no_camera_can_be_opened_and_keeps_trying() -> None:
    open_camera, _ = opener()
    attempts: list[float] = []

    def attempt() -> Scripted:
        attempts.append(time.monotonic())
        return open_camera()

    with CameraFeed(attempt) as feed:
        started_s = time.monotonic()
        while len(attempts) < 3:
            assert feed.read() is None
            assert feed.status.problem == "no camera is connected; plug one in"
            assert time.monotonic() - started_s < 5.0
    assert np.diff(attempts).min() > 0.9 * REOPEN_S


def test_only_a_camera_silent_for_a_while_has_a_problem() -> None:
    open_camera, _ = opener([1, SILENT, SILENT, SILENT, SILENT, SILENT, 2])
    with CameraFeed(open_camera) as feed:
        assert feed.read() is not None
        problems = []
        for _ in range(5):
            assert feed.read() is None
            problems.append(feed.status.problem)
        assert problems[0] == ""
        assert problems[-1] == str(SILENT)
        assert feed.read() is not None
        assert feed.status.problem == ""


def test_a_recording_that_has_ended_is_named_and_stays_so() -> None:
    open_camera, opened = opener([0, CameraEndError("the recording has ended")], [1])
    with CameraFeed(open_camera) as feed:
        assert feed.read() is not None
        for _ in range(8):
            assert feed.read() is None
            assert feed.status.problem == "the recording has ended"
    assert len(opened) == 1


def test_a_recording_without_a_frame_is_named_and_not_opened_all_the_time() -> None:
    open_camera, opened = opener(*[[CameraEndError("the recording has ended")]] * 3)
    with CameraFeed(open_camera) as feed:
        assert [feed.read() for _ in range(3)] == [None, None, None]
        assert feed.status.problem == "the recording has ended without a frame"
    assert len(opened) == 1


def test_a_camera_that_can_expose_for_the_hand_receives_its_region() -> None:
    told: list[object] = []

    class Exposing(Scripted):
        def expose_for(self, points_m: Float32 | None) -> None:
            told.append(points_m)

    hand = np.zeros((1, 3), np.float32)
    for camera in (Exposing([1]), Scripted([1])):
        feed = CameraFeed(lambda camera=camera: camera)  # type: ignore[misc]
        feed.expose_for(hand)  # not open yet
        read_frame(feed)
        feed.expose_for(hand)
        feed.expose_for(None)
    assert len(told) == 2
    assert told[0] is hand
