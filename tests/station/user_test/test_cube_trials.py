import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.core.errors import CameraEndError, FileError, HandcalError
from handcal.core.geometry import transform
from handcal.core.types import EYES, Eye, Float64, HeadsetIdentity, Intrinsics
from handcal.link.client import HeadsetClient
from handcal.link.server import HeadsetServer
from handcal.link.shapes import Shape
from handcal.register.results import SolveSettings, solve_session
from handcal.rig.cube import Cube, TrackedCube, cube_corners_m
from handcal.session.session import Session
from handcal.sim.cube_bench import CubeBench, simulated_wearer
from handcal.sim.hand import make_hand
from handcal.sim.overlay import overlay_by_eye
from handcal.sim.wearer import draw_eyes, draw_placement_error
from handcal.sim.wearer_settings import WearerSettings
from handcal.station.user_test import cube as user_test
from handcal.station.user_test.cube import (
    CubeTracker,
    StudyLeader,
    TrialSettings,
    calibrated_shifts_m,
    run_cube_tracking,
    run_user_trials,
)
from tests.helpers import ROOT, reprojection_error_px

TRUE_M: dict[Eye, Float64] = {
    "left": np.array([0.002, 0.001, 0.003]),
    "right": np.array([-0.004, -0.001, 0.0]),
}
CAMERA = Intrinsics(640, 360, 502.0, 502.0, 319.5, 179.5)
KEY = b"a key of the cube tests"


@pytest.fixture
def session(tmp_path: Path) -> Iterator[Session]:
    shutil.copytree(ROOT / "resources" / "example_session", tmp_path / "session")
    with Session(tmp_path / "session") as session:
        yield session


@pytest.fixture
def bench(session: Session) -> Iterator[tuple[HeadsetServer, HeadsetClient, CubeBench]]:
    rig = replace(Session.open(session.path).rig, depth_intrinsics=CAMERA)
    identity = HeadsetIdentity("0123456789abcdef", "Simulated headset", "simulator")
    with HeadsetServer(KEY) as server, HeadsetClient(server.address, KEY, identity) as client:
        server.wait_connected(10.0)
        with CubeBench(client, rig, Cube(), TRUE_M) as bench:
            yield server, client, bench


def tracker(session: Session, server: HeadsetServer, bench: CubeBench) -> CubeTracker:
    T_H_D = Session.open(session.path).rig.T_H_D
    return CubeTracker(bench, Cube(), T_H_D, server.pose_at_host_ns)


def test_the_tracked_cube_is_drawn_where_it_is(
    session: Session,
    bench: tuple[HeadsetServer, HeadsetClient, CubeBench],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    server, client, room = bench
    cube, drawn = tracker(session, server, room), list[Shape | None]()
    seen: list[TrackedCube] = []
    step = cube.step

    def look_and_step() -> TrackedCube | None:
        drawn.append(client.state().shape)
        if len(seen) >= 12 and seen[-1].frames >= 30 and drawn[-1] is not None:
            raise CameraEndError("enough")
        tracked = step()
        if tracked is not None:
            seen.append(tracked)
        return tracked

    monkeypatch.setattr(cube, "step", look_and_step)
    found = run_cube_tracking(cube, server, 120.0)
    assert len(found.tracked) > 5
    error_m = np.linalg.norm(found.tracked[-1].T_W_T[:3, 3] - room.T_W_T[:3, 3])
    assert error_m < 0.0015
    assert drawn[-1] is not None
    true_m = transform(room.T_W_T, cube_corners_m(Cube()))
    np.testing.assert_allclose(drawn[-1].corners_W_m, true_m, atol=0.003)


def test_the_trials_measure_the_true_error(
    session: Session,
    bench: tuple[HeadsetServer, HeadsetClient, CubeBench],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    server, client, room = bench
    before = len(Session.open(session.path).trials)
    monkeypatch.setattr(user_test, "TARGET_DEPTHS_M", (0.4, 0.6))
    prompts: list[tuple[str, tuple[Eye, ...]]] = []

    def adjust(eye: Eye, shift_m: Float64, draw: Callable[[Float64], None]) -> Float64:
        draw(shift_m)  # acknowledged, and so is the prompt before it
        prompts.append((client.state().prompt, client.state().eyes))
        return room.adjust(eye, shift_m, draw)

    made = run_user_trials(
        session, server, tracker(session, server, room), StudyLeader(room.place, adjust)
    )
    assert [eyes for _, eyes in prompts] == [("left",), ("right",)] * 2
    assert prompts[0][0].startswith("Close your right eye. Say where")
    record = Session.open(session.path)
    assert len(record.trials) == before + 4
    assert [trial.eye for trial in made] == ["left", "right"] * 2
    for trial in made:
        assert np.ptp(trial.corners_E_m[:, 2]) > 0.005  # a face of the turned cube
        true_px = reprojection_error_px(
            record.rig.eyes[trial.eye],
            trial.calibrated_shift_m,
            TRUE_M[trial.eye],
            trial.corners_E_m,
        )
        np.testing.assert_allclose(trial.error_px.mean(), true_px.mean(), rtol=0.25, atol=2.0)


def test_a_cube_elsewhere_and_an_unsolved_session_are_refused(
    session: Session,
    bench: tuple[HeadsetServer, HeadsetClient, CubeBench],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    server, _, room = bench
    monkeypatch.setattr(user_test, "TARGET_DEPTHS_M", (0.6,))
    impatient = TrialSettings(patience_s=0.5)
    cube = tracker(session, server, room)
    monkeypatch.setattr(cube, "step", lambda: TrackedCube(0, room.T_W_T, True, 9))
    elsewhere = StudyLeader(lambda _: room.place(0.45), room.adjust)
    with pytest.raises(HandcalError, match=r"0\.\d+ m from the eyes; put it down there"):
        run_user_trials(session, server, cube, elsewhere, impatient)
    rig = Session.open(session.path).rig
    with (
        Session.create(session.path.parent, rig, {}) as empty,
        pytest.raises(FileError, match="left eye is not solved"),
    ):
        run_user_trials(empty, server, cube, elsewhere, impatient)


def test_trials_of_an_eye_that_keeps_the_offline_calibration_judge_that() -> None:
    record = Session.open(ROOT / "resources" / "example_session")
    assert record.results is not None
    eyes = record.results["eyes"]
    kept = {**record.results, "eyes": {**eyes, "left": {**eyes["left"], "verdict": "keep"}}}
    shifts_m = calibrated_shifts_m(replace(record, results=kept), EYES)
    np.testing.assert_array_equal(shifts_m["left"], np.zeros(3))
    np.testing.assert_array_equal(shifts_m["right"], eyes["right"]["shift_m"])


@pytest.mark.campaign
def test_the_published_procedure_finds_the_true_error(
    session: Session,
    monkeypatch: pytest.MonkeyPatch,
    record_testsuite_property: Callable[[str, float], None],
) -> None:
    """Three wearers, ten calibrations each, left eye: 360 corners, seeds 1 to 3.

    The two means are in the file of ``--junit-xml``.
    """
    rig = replace(Session.open(session.path).rig, depth_intrinsics=CAMERA)
    found_px, true_px = [], []
    for seed in (1, 2, 3):
        rng, hand, usual = np.random.default_rng([seed, 7]), make_hand(seed), WearerSettings()
        with simulated_wearer(rig, Cube(), seed) as (server, room):
            true_m = draw_eyes(np.random.default_rng(seed), usual)
            for _ in range(10):
                alignment = overlay_by_eye(
                    rng,
                    hand,
                    rig,
                    true_m,
                    5000,
                    0.001,
                    placement_error=draw_placement_error(rng, usual),
                )
                solved = solve_session([alignment], rig, SolveSettings()).eyes["left"].shift_m
                monkeypatch.setattr(
                    user_test, "calibrated_shifts_m", lambda *_, solved=solved: {"left": solved}
                )
                for trial in run_user_trials(
                    session,
                    server,
                    CubeTracker(room, Cube(), rig.T_H_D, server.pose_at_host_ns),
                    StudyLeader(room.place, room.adjust),
                    TrialSettings(eyes=("left",)),
                ):
                    found_px.append(trial.error_px)
                    true_px.append(
                        reprojection_error_px(
                            rig.eyes["left"], solved, true_m["left"], trial.corners_E_m
                        )
                    )
    assert np.size(found_px) == 360
    record_testsuite_property("found_px", float(np.mean(found_px)))
    record_testsuite_property("true_px", float(np.mean(true_px)))
    assert np.mean(found_px) == pytest.approx(np.mean(true_px), rel=0.1)
