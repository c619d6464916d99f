"""Recording any camera: when it ends, and that what there is by then is kept."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from handcal.camera.record import Recorded, RecordSettings, record
from handcal.camera.recordings import open_recording
from handcal.core.errors import CameraEndError, CameraError, CameraTimeoutError
from handcal.core.progress import Progress
from handcal.core.types import Frame
from tests.camera.stand_ins import PALE, UNPLUGGED, Scripted

SETTINGS = RecordSettings()


@pytest.fixture(autouse=True)
def _impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("handcal.camera.record._SILENT_S", 0.1)
    monkeypatch.setattr("handcal.camera.record._FREE_BYTES", 0)


def run(
    script: Sequence[int | str | Exception],
    path: Path,
    settings: RecordSettings = SETTINGS,
    is_stopped: Callable[[], bool] = lambda: False,
) -> tuple[Recorded, list[Frame], list[float]]:
    """Record a script; return what is said of it, what plays back, and the shares reported."""
    shares: list[float] = []
    recorded = record(
        Scripted(script),
        path,
        settings,
        Progress(lambda _, share: shares.append(share), is_stopped),
    )
    with open_recording(path) as camera:
        frames = [camera.read() for _ in range(recorded.frames)]
        with pytest.raises(CameraEndError):
            camera.read()
    return recorded, frames, shares


@pytest.mark.parametrize("name", ["folder", "file.db3"])
@pytest.mark.parametrize("end", [CameraEndError("the recording has ended"), UNPLUGGED])
def test_what_is_recorded_plays_back(tmp_path: Path, name: str, end: CameraError) -> None:
    pytest.importorskip("pyrealsense2")
    recorded, frames, _ = run([1, 2, 4, 5, end], tmp_path / "new" / name)
    reason = str(end) if end is UNPLUGGED else "the recording played has ended"
    assert recorded == Recorded(4, 1, 0.4, reason)
    assert [frame.index for frame in frames] == [1, 2, 4, 5]
    assert [int(frame.depth[0, 0]) for frame in frames] == [1, 2, 4, 5]


def test_stopping_keeps_what_there_is(tmp_path: Path) -> None:
    answers = iter([False, False, False, True])
    recorded, frames, _ = run(range(1, 10), tmp_path / "a", is_stopped=lambda: next(answers))
    assert recorded.stop_reason == "stopped"
    assert [frame.index for frame in frames] == [1, 2, 3]


def test_it_ends_at_a_limit_and_reports_how_far_it_is(tmp_path: Path) -> None:
    limited = replace(SETTINGS, frames=4)
    recorded, _, shares = run(range(1, 10), tmp_path / "frames", limited)
    assert (recorded.frames, recorded.stop_reason) == (4, "as long as asked for")
    assert shares == pytest.approx([0.25, 0.5, 0.75, 1.0])
    recorded, _, shares = run(range(1, 10), tmp_path / "s", replace(SETTINGS, duration_s=0.5))
    assert recorded.frames == 6
    assert recorded.duration_s == pytest.approx(0.5)
    assert shares[-1] == 1.0


def test_it_ends_before_the_disk_is_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nearly_full = shutil.disk_usage(tmp_path)._replace(free=100)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: nearly_full)
    monkeypatch.setattr("handcal.camera.record._FREE_BYTES", 101)
    recorded, _, _ = run([1, 2, 3], tmp_path / "a")
    assert (recorded.frames, recorded.stop_reason) == (1, "the disk is nearly full")


def test_a_silent_camera_ends_a_recording_and_a_short_silence_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A busy machine takes a while for 0.05 s.
    monkeypatch.setattr("handcal.camera.record._SILENT_S", 2.0)
    recorded, frames, _ = run([1, CameraTimeoutError("none yet"), 2], tmp_path / "a")
    assert recorded.stop_reason == "no frame came"
    assert [frame.index for frame in frames] == [1, 2]


def test_it_begins_with_the_first_colour_if_there_is_any(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, frames, _ = run([PALE, PALE, 3, PALE, 5], tmp_path / "late")
    assert [(frame.index, frame.color is not None) for frame in frames] == [
        (3, True),
        (4, False),
        (5, True),
    ]
    monkeypatch.setattr("handcal.camera.record._LEAD_FRAMES", 2)
    _, frames, _ = run([PALE] * 4, tmp_path / "none")
    assert [frame.index for frame in frames] == [1, 2, 3, 4]


def test_nothing_at_all_is_an_error_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(CameraError, match="nothing was recorded: the camera was unplugged"):
        run([UNPLUGGED], tmp_path / "a")
    assert list(tmp_path.iterdir()) == []
