"""Calibrations without a window: of the simulated wearer, and by a headset on the network."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handcal.camera.record import RecordSettings, record
from handcal.core.errors import CancelledError, HandcalError
from handcal.core.geometry import rigid
from handcal.core.progress import Progress
from handcal.core.types import HeadsetIdentity
from handcal.link.client import HeadsetClient
from handcal.link.pairing import Pairing, Pairings
from handcal.rig.rig_file import read_rig
from handcal.session.session import Session
from handcal.sim.camera import SyntheticCamera
from handcal.sim.hand import make_hand
from handcal.sim.render import World
from handcal.sim.room import make_room
from handcal.sim.scene import SceneState
from handcal.station.run import RunSettings, run_calibration
from handcal.station.settings import StationSettings
from tests.helpers import slow_simulator, write_small_rig

KEY = "a pairing key of the tests"
DEVICE = "00000000000000aa"
PORT = 47931
PATIENCE_S = 400.0  # a machine at load 20 needs over 60 s for one alignment

pytestmark = pytest.mark.process


@pytest.fixture
def station(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> StationSettings:
    slow_simulator(monkeypatch)
    rig = write_small_rig(tmp_path / "rig.yaml")
    return StationSettings(rig=str(rig), sessions=str(tmp_path / "sessions"), seed=3)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hand at rest; the camera's noise differs from frame to frame."""
    held_up = rigid([0.1, 0.1, 0.05], [0.0, 0.02, 0.5])
    world = World(make_hand(1), make_room(1))
    folder = tmp_path_factory.mktemp("recording")
    intrinsics = read_rig(write_small_rig(folder / "rig.yaml")).depth_intrinsics
    camera = SyntheticCamera(
        world,
        lambda: SceneState(time.monotonic_ns(), np.eye(4), held_up),
        depth_intrinsics=intrinsics,
        seed=1,
    )
    record(camera, folder / "frames", RecordSettings(frames=30))
    return folder / "frames"


@contextmanager
def headset(port: int) -> Iterator[None]:
    """Run a headset at rest, whose wearer confirms every cursor again and again."""
    is_over = threading.Event()
    identity = HeadsetIdentity(DEVICE, "Lab 9", "test", "app 1")

    def show() -> None:
        with HeadsetClient(("127.0.0.1", port), KEY.encode(), identity) as client:
            count = 0
            while not is_over.wait(1 / 60):
                now_ns = time.monotonic_ns()
                client.send_pose(np.eye(4), now_ns)
                state, count = client.state(), count + 1
                if state.cursor_W_m is not None and count % 30 == 0:
                    client.confirm(now_ns, state)

    thread = threading.Thread(target=show)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()


def test_a_network_headset_is_calibrated(station: StationSettings, recording: Path) -> None:
    station = replace(
        station,
        source="recording",
        recording=str(recording),
        headset="network",
        host="127.0.0.1",
        port=PORT,
    )
    said: list[str] = []
    progress = Progress(lambda what, _: said.append(what))
    with headset(PORT):
        result = run_calibration(
            RunSettings(station, "Ada", eyes="each", patience_s=PATIENCE_S),
            progress,
            Pairings((Pairing(KEY),)),
        )
    assert result["headset"] == {
        "device_id": DEVICE, "name": "Lab 9", "runtime": "test", "app": "app 1"
    }  # fmt: skip
    assert result["alignments"] == 2
    assert all(eye["projection_acked"] for eye in result["eyes"].values())
    assert result["link"]["failed"] == 0
    record = Session.open(Path(result["session"]))
    assert record.wearer == "Ada"
    assert [one.eyes for one in record.alignments.values()] == [("left",), ("right",)]
    assert "the right eye: the wearer aligns the hand with the cursor and confirms" in said
    json.dumps(result, allow_nan=False)


def test_the_virtual_headset_is_calibrated(station: StationSettings) -> None:
    result = run_calibration(RunSettings(replace(station, loss=0.3), patience_s=PATIENCE_S))
    assert result["headset"]["name"] == "Virtual headset"
    assert set(result["eyes"]) == {"left", "right"}
    assert all(eye["projection_acked"] for eye in result["eyes"].values())


def test_the_recommended_plan_leads_itself(station: StationSettings) -> None:
    said: list[str] = []
    settings = RunSettings(station, plan="recommended", eyes="right", patience_s=PATIENCE_S)
    result = run_calibration(settings, Progress(lambda what, _: said.append(what)))
    assert result["plan"] == "recommended"
    assert result["alignments"] >= 1
    assert all(eye["projection_acked"] for eye in result["eyes"].values())
    assert len(set(said)) > 4


def test_a_missing_headset_is_named_and_the_session_kept(
    station: StationSettings, recording: Path
) -> None:
    station = replace(
        station, source="recording", recording=str(recording), headset="network", port=PORT + 1
    )
    pairings = Pairings((Pairing(KEY),))
    with pytest.raises(HandcalError, match=r"no headset connected within 0\.2 s: .*UDP port 47932"):
        run_calibration(RunSettings(station, patience_s=0.2), pairings=pairings)
    (session,) = Path(station.sessions).iterdir()
    assert not Session.open(session).alignments
    with pytest.raises(HandcalError, match="no headset is paired"):
        run_calibration(RunSettings(station), pairings=Pairings(()))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"rig": "absent.yaml"}, "rig file: cannot read"),
        ({"source": "recording", "recording": "absent.db3"}, "camera: there is no recording"),
        ({"headset": "network"}, "headset: the simulator's wearer wears the virtual headset"),
    ],
)
def test_what_is_not_ready_is_named_before_a_session_is_made(
    station: StationSettings, change: dict[str, str], problem: str
) -> None:
    with pytest.raises(HandcalError, match=problem):
        run_calibration(
            RunSettings(replace(station, **change)),  # type: ignore[arg-type]
            pairings=Pairings((Pairing(KEY),)),
        )
    assert not Path(station.sessions).exists()


def test_a_run_is_cancelled(station: StationSettings) -> None:
    with pytest.raises(CancelledError):
        run_calibration(RunSettings(station), Progress(is_cancelled=lambda: True))
