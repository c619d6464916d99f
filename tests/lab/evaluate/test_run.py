"""The evaluations that commands and window order, without either."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from handcal.core.display import TARGET_DEPTHS_M
from handcal.core.errors import CancelledError, FileError, HandcalError
from handcal.core.progress import Progress
from handcal.core.types import EYES, Rig
from handcal.io.files import make_folder
from handcal.io.images import write_png
from handcal.lab.evaluate.cube_test import run_cube_test
from handcal.lab.evaluate.user_test import run_user_test
from handcal.lab.settings import (
    CubeTestSettings,
    NoiseStudySettings,
    UserTestSettings,
    output_folder,
)
from handcal.lab.study.studies import run_noise_study
from handcal.rig.cube.cube import Cube
from handcal.rig.cube.cube_file import write_cube
from handcal.rig.example import example_rig
from handcal.rig.formats import write_intrinsics
from handcal.session.session import Session
from handcal.session.trial import make_trial
from handcal.sim.cube_captures import CaptureSettings
from handcal.sim.viewpoint import VIEWPOINT_CAMERA


@pytest.fixture
def sessions(tmp_path: Path) -> Path:
    """Return a folder of two wearers' sessions, each of one calibration."""
    rig = example_rig()
    for wearer, shift_m in (("a", 0.001), ("b", 0.002)):
        with Session.create(tmp_path / "sessions", rig, {}, wearer) as session:
            for eye in EYES:
                for depth_m in TARGET_DEPTHS_M:
                    given_m = np.array([shift_m, 0.0, 0.0])
                    session.save_trial(
                        make_trial(rig.eyes[eye], eye, depth_m, given_m, np.zeros(3))
                    )
    return tmp_path / "sessions"


def test_a_user_test_is_evaluated_and_written(sessions: Path, tmp_path: Path) -> None:
    told: list[tuple[str, float]] = []
    settings = UserTestSettings((str(sessions),), str(tmp_path / "results"))
    found = run_user_test(settings, Progress(lambda *one: told.append(one)))
    assert found.report.subject == "2 wearers, 2 sessions, 12 trials"
    assert found.result.total.trials == 12
    assert all(file.stat().st_size > 1000 for file in found.files)
    assert told[:2] == [("Reading sessions", 0.0), ("Reading sessions", 0.35)]
    assert told[-1] == ("Writing the report", 1.0)
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert output_folder(settings.output) == tmp_path / "results"  # its own report may be replaced


def test_results_never_go_into_a_study(sessions: Path, tmp_path: Path) -> None:
    (tmp_path / "study.json").write_text("{}")
    with pytest.raises(FileError, match="holds a study"):
        run_user_test(UserTestSettings((str(sessions),), str(tmp_path)))
    with pytest.raises(FileError, match="holds a study"):
        run_cube_test(CubeTestSettings(str(sessions), output=str(tmp_path)))


@pytest.mark.parametrize("name", ["report.html", "report.pdf"])
def test_files_of_the_users_are_never_replaced(sessions: Path, tmp_path: Path, name: str) -> None:
    settings = UserTestSettings((str(sessions),), str(tmp_path / "results"))
    own = make_folder(tmp_path / "results") / name
    own.write_text("<p>written with handcal")
    refused = pytest.raises(FileError, match=f"not of an evaluation, such as {name}; choose")
    with refused:
        run_user_test(settings)
    with refused:
        run_noise_study(NoiseStudySettings("quick", output=settings.output), Progress())
    assert own.read_text() == "<p>written with handcal"


def test_results_never_go_among_sessions(sessions: Path) -> None:
    (session, *_) = (path.parent for path in sessions.glob("*/journal.jsonl"))
    for output in (sessions, sessions / "results", session, session / "figures" / "new"):
        with pytest.raises(FileError, match="holds sessions, or lies among them"):
            run_user_test(UserTestSettings((str(sessions),), str(output)))


def test_an_evaluation_can_be_cancelled(sessions: Path, tmp_path: Path) -> None:
    settings = UserTestSettings((str(sessions),), str(tmp_path / "results"))
    with pytest.raises(CancelledError):
        run_user_test(settings, Progress(is_cancelled=lambda: True))
    assert not (tmp_path / "results").exists()


def test_a_cube_test_says_what_it_lacks(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"no .*cube\.json.* handcal evaluate cube net"):
        run_cube_test(CubeTestSettings(captures=str(tmp_path), output=str(tmp_path / "out")))


def test_a_cube_test_of_which_nothing_can_be_used_says_why(tmp_path: Path) -> None:
    write_cube(tmp_path / "cube.json", Cube())
    write_intrinsics(tmp_path / "camera.json", VIEWPOINT_CAMERA, "json")
    for number in range(1, 5):
        pose = tmp_path / "centre" / f"pose-{number}"
        pose.mkdir(parents=True)
        for name in ("real.png", "virtual.png"):
            write_png(pose / name, np.zeros((360, 640), np.uint8))
    with pytest.raises(HandcalError, match=r"no pair of captures .*pose-1/real\.png: ") as raised:
        run_cube_test(CubeTestSettings(captures=str(tmp_path), output=str(tmp_path / "out")))
    assert "pose-3" in str(raised.value)
    assert "pose-4" not in str(raised.value)


def test_a_cube_test_without_captures_renders_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    told: list[tuple[str, float]] = []
    asked: list[CaptureSettings] = []

    def render(folder: Path, rig: Rig, settings: CaptureSettings, progress: Progress) -> None:
        assert not any(folder.iterdir())
        asked.append(settings)
        progress.at(0.5, "Rendering centre, pose 1")
        raise FileError("no space left")

    monkeypatch.setattr("handcal.lab.evaluate.cube_test.write_captures", render)
    settings = CubeTestSettings(
        eye="right", seed=4, poses=2, alignments=3, output=str(tmp_path / "out")
    )
    with pytest.raises(FileError, match="no space left"):
        run_cube_test(settings, Progress(lambda *one: told.append(one)))
    assert asked == [CaptureSettings(seed=4, eye="right", poses=2, alignments=3)]
    ((what, share),) = told
    assert what == "Rendering centre, pose 1"
    assert share == pytest.approx(0.245)
