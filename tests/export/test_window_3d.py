"""The process with the 3D window: its picture, and every way in which it may fail."""

from __future__ import annotations

import os
import re
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from handcal.core.errors import CancelledError, FileError, HandcalError
from handcal.core.geometry import invert, project, transform
from handcal.core.progress import Progress
from handcal.export import window_3d
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.export.window_3d import inspect_session, make_scenes
from handcal.io.images import read_image
from handcal.io.resources import resource_path
from handcal.session.session import Session, SessionRecord


def test_every_alignment_has_a_scene_in_the_axes_of_its_first_eye(outcome: SessionOutcome) -> None:
    scenes = make_scenes(outcome)
    assert list(scenes) == [1, 3]
    for number, scene in scenes.items():
        alignment = outcome.record.alignments[number]
        T_E_W = alignment.T_E_W[alignment.eyes[0]]
        assert np.allclose(transform(invert(T_E_W), scene.cursor_m), alignment.cursor_m)
        assert np.allclose(transform(invert(T_E_W), scene.hand_m), alignment.hand_m)
        assert scene.residuals_m.keys() == set(alignment.eyes)
        assert all(len(m) == len(scene.hand_m) for m in scene.residuals_m.values())
        first = scene.eyes[alignment.eyes[0]]
        assert first.offline_m == pytest.approx(np.zeros(3))
        assert first.eye_m == pytest.approx(outcome.drawn[alignment.eyes[0]].shift_m)


def test_displays_and_eyes_stand_as_on_the_rig() -> None:
    outcome = load_outcome(Session.open(resource_path("example_session")))
    for number, scene in make_scenes(outcome).items():
        rig, offline_H_m = outcome.record.rig, {}
        for eye, placed in scene.eyes.items():
            display = rig.eyes[eye]
            offline_H_m[eye] = transform(invert(display.T_V_H), -display.t_C0_V_m[None])[0]
            if eye == outcome.record.alignments[number].eyes[0]:
                assert placed.display_m[:, 2] == pytest.approx(display.z_C0_S_m)
                right, bottom = display.width_px - 0.5, display.height_px - 0.5
                corners_px = [[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]]
                P = display.K @ display.H0 @ np.eye(3, 4)
                assert project(P, placed.display_m) == pytest.approx(np.array(corners_px))
        apart_m = np.linalg.norm(scene.eyes["left"].offline_m - scene.eyes["right"].offline_m)
        assert apart_m == pytest.approx(np.linalg.norm(offline_H_m["left"] - offline_H_m["right"]))


def test_a_session_without_alignments_has_no_scenes(empty: SessionRecord) -> None:
    assert make_scenes(load_outcome(empty)) == {}


needs_open3d = pytest.mark.skipif(find_spec("open3d") is None, reason="Open3D is not installed")
PROGRAMS = {
    "crashes": "kill -SEGV $$",
    "fails": "echo 'no memory left' >&2; exit 1",
    "opens no window": "exit 3",
    "is open": 'echo $$ > "$0.pid"; exec sleep 60',
}


@pytest.fixture
def program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> Path:
    """Let a program that behaves in a certain way stand in for the window's."""
    if sys.platform == "win32":
        pytest.skip("the stand-in is a shell script")
    path = tmp_path / "window"
    path.write_text(f"#!/bin/sh\n{PROGRAMS[request.param]}\n")
    path.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(path))
    monkeypatch.setattr(window_3d, "find_spec", lambda _name: True)
    monkeypatch.setattr(window_3d, "x_server_answers", lambda _display: True)
    monkeypatch.setenv("DISPLAY", ":1")
    return path


@needs_open3d
@pytest.mark.process
def test_a_picture_shows_hand_cursor_and_both_eyes(outcome: SessionOutcome, tmp_path: Path) -> None:
    path = tmp_path / "view.png"
    try:
        inspect_session(outcome, 1, path)
        with pytest.raises(FileError, match="cannot create the folder"):
            inspect_session(outcome, 1, path / "inside.png")
    except HandcalError as error:
        if "OpenGL" not in str(error):
            raise
        pytest.skip("OpenGL draws nothing here")
    image = read_image(path, 1)[..., ::-1].reshape(-1, 3).astype(int)
    for color in ((0, 115, 178), (214, 94, 0), (115, 115, 115)):  # the eyes, and the cursor
        near = np.abs(image - color).max(axis=1) < 12
        assert np.count_nonzero(near) > 300, color
    green = (image[:, 1] > image[:, 0] + 20) & (image[:, 1] > image[:, 2] + 20)
    assert np.count_nonzero(green) > 1000  # small residuals


@pytest.mark.process
@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("crashes", "crashed (status -11), perhaps in the graphics driver"),
        ("fails", "the 3D window failed: no memory left"),
        ("opens no window", "needs OpenGL 3.3 and a display"),
    ],
    indirect=["program"],
)
def test_a_failure_of_the_window_is_one_line(
    program: Path, message: str, outcome: SessionOutcome
) -> None:
    with pytest.raises(HandcalError, match=re.escape(message)) as raised:
        inspect_session(outcome)
    assert "\n" not in str(raised.value)


@pytest.mark.process
@pytest.mark.parametrize("program", ["is open"], indirect=True)
def test_cancelling_closes_the_window(program: Path, outcome: SessionOutcome) -> None:
    number = Path(f"{program}.pid")
    with pytest.raises(CancelledError):
        inspect_session(outcome, progress=Progress(is_cancelled=number.exists))
    with pytest.raises(ProcessLookupError):
        os.kill(int(number.read_text()), 0)


def test_what_cannot_be_shown_is_said_before_a_process_starts(
    outcome: SessionOutcome, empty: SessionRecord, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with pytest.raises(FileError, match="has no alignment 2: it has 1, 3"):
        inspect_session(outcome, 2)
    with pytest.raises(FileError, match="no alignment to show"):
        inspect_session(load_outcome(empty))
    monkeypatch.setattr(window_3d, "find_spec", lambda _name: True)
    with pytest.raises(FileError, match=r"must end in \.png"):
        inspect_session(outcome, 1, tmp_path / "view.jpg")
    monkeypatch.setattr(window_3d, "find_spec", lambda _name: None)
    with pytest.raises(HandcalError, match=r"pip install 'handcal\[3d\]'"):
        inspect_session(outcome)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have a screen")
@pytest.mark.parametrize("display", [None, ":93", "nowhere:0"])
def test_no_window_is_opened_where_nobody_would_see_it(
    display: str | None, outcome: SessionOutcome, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(window_3d, "find_spec", lambda _name: True)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    if display is not None:
        monkeypatch.setenv("DISPLAY", display)
    with pytest.raises(HandcalError, match="no display found"):
        inspect_session(outcome)
