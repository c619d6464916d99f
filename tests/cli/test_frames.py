"""Commands that read frames: segment, replay and record."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.camera.folder import record_folder
from handcal.core.geometry import rigid
from handcal.core.types import Frame, Intrinsics
from handcal.sim.hand import make_hand
from handcal.sim.raster import draw_hand
from handcal.sim.sensor import SensorSettings, sense_depth

CAMERA = Intrinsics(640, 360, 502.5, 502.5, 319.5, 179.5)
SENSOR = SensorSettings()
WALL_M = 1.5


@pytest.fixture(scope="module")
def frame() -> Frame:
    image = draw_hand(make_hand(1), rigid([0.1, 0.1, 0.1], [0.0, 0.02, 0.5]), CAMERA)
    depth_m = np.full((CAMERA.height, CAMERA.width), WALL_M, np.float32)
    height, width = image.depth_m.shape
    box = slice(image.y0, image.y0 + height), slice(image.x0, image.x0 + width)
    depth_m[box] = np.minimum(image.depth_m, WALL_M)
    depth = sense_depth(depth_m, 2 * CAMERA.fx, np.random.default_rng(0), SENSOR)
    color = np.full((*depth.shape, 3), 90, np.uint8)
    return Frame(0, 0, 0, depth, SENSOR.depth_scale_m, CAMERA, color, CAMERA)


@pytest.fixture
def pictures(frame: Frame, tmp_path: Path) -> Path:
    """A folder with the frame as files."""
    assert frame.color is not None
    cv2.imwrite(str(tmp_path / "color.png"), frame.color)
    cv2.imwrite(str(tmp_path / "depth.png"), frame.depth)
    names = ("width", "height", "fx", "fy", "cx", "cy")
    values = {name: getattr(CAMERA, name) for name in names}
    (tmp_path / "camera.json").write_text(json.dumps(values | {"depth_scale": 1e-4}))
    return tmp_path


def segment_arguments(pictures: Path, output: object) -> list[object]:
    return [
        "segment", "--color", pictures / "color.png", "--depth", pictures / "depth.png",
        "--intrinsics", pictures / "camera.json", "--output", output,
        "--roi", "depth",  # the hand has no colour of its own here
    ]  # fmt: skip


def test_segment_writes_the_hand(
    handcal: Callable[..., None],
    pictures: Path,
    frame: Frame,
    capsys: pytest.CaptureFixture[str],
) -> None:
    output = pictures / "new" / "folder"
    handcal(*segment_arguments(pictures, output))
    names = {path.name for path in output.iterdir()}
    assert names == {"hand.ply", "contour.ply", "mask.png", "overlay.png", "hand.json"}
    mask = cv2.imread(str(output / "mask.png"), cv2.IMREAD_UNCHANGED)
    assert mask is not None
    assert mask.shape == frame.depth.shape
    assert set(np.unique(mask)) == {0, 255}
    near = (frame.depth > 0) & (frame.depth * SENSOR.depth_scale_m < 0.7)
    assert np.mean(near[mask > 0]) > 0.95
    told = json.loads((output / "hand.json").read_text())
    x0, y0, x1, y1 = told["box"]
    rows, columns = np.nonzero(mask)
    assert (x0, y0, x1 - 1, y1 - 1) == (columns.min(), rows.min(), columns.max(), rows.max())
    assert told["median_depth_m"] == pytest.approx(0.49, abs=0.02)
    assert f"{told['points']} points at" in capsys.readouterr().out


def test_the_gate_is_an_option_that_a_recording_keeps(
    handcal: Callable[..., None],
    fails: Callable[..., tuple[int, str]],
    pictures: Path,
    frame: Frame,
) -> None:
    code, error = fails(*segment_arguments(pictures, pictures / "out"), "--gate", 0.2, 0.4)
    assert (code, "too far, at" in error) == (1, True)
    code, error = fails(*segment_arguments(pictures, pictures / "out"), "--gate", 0.7, 0.2)
    assert (code, "--gate: NEAR_M, 0.7, must be less than FAR_M" in error) == (2, True)
    record_folder(pictures / "one", [frame, replace(frame, color=None, color_intrinsics=None)])
    kept, told = pictures / "kept", pictures / "replay.json"
    handcal("record", kept, "--source", pictures / "one", "--gate", 0.2, 0.4)
    for gate, problem in (((), "too far"), (("--gate", 0.3, 0.7), "")):
        handcal("replay", kept, "--roi", "depth", "--json", told, *gate)
        rows = json.loads(told.read_text())["frames"]
        assert [row["color"] for row in rows] == [True, False]
        assert all(problem in row["problem"] if problem else row["points"] for row in rows)
    code, error = fails(
        "record", pictures / "a.db3", "--source", pictures / "one", "--gate", 0.2, 0.4
    )
    assert (code, "cannot keep a depth gate" in error) == (1, True)


def test_replay_tells_every_frame(
    handcal: Callable[..., None],
    frame: Frame,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("pyrealsense2")
    from handcal.camera.sdk_recorder import record_db3

    frames = [
        Frame(20_000 + i, 33_333_333 * i, 0, frame.depth, frame.depth_scale_m, CAMERA)
        for i in range(2)
    ]
    record_db3(tmp_path / "two.db3", frames)
    handcal("replay", tmp_path / "two.db3", "--json", tmp_path / "replay.json")
    rows = json.loads((tmp_path / "replay.json").read_text())["frames"]
    assert [row["frame"] for row in rows] == [20_000, 20_001]
    assert rows[0]["turned_deg"] is None
    assert rows[1]["turned_deg"] < 1.0
    assert all(row["points"] > 3000 and not row["problem"] for row in rows)
    shown = capsys.readouterr().out
    assert "20001" in shown
    assert "2 of 2 frames show a hand." in shown


def test_record_converts_a_recording_and_tells_what_it_did(
    handcal: Callable[..., None],
    fails: Callable[..., tuple[int, str]],
    frame: Frame,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    frames = [
        Frame(i, 33_333_333 * i, 0, frame.depth, frame.depth_scale_m, CAMERA) for i in (1, 2, 4)
    ]
    record_folder(tmp_path / "three", frames)
    told = tmp_path / "record.json"
    handcal("record", tmp_path / "copy", "--source", tmp_path / "three", "--json", told)
    assert json.loads(told.read_text()) == {
        "frames": 3,
        "dropped": 1,
        "duration_s": pytest.approx(0.1),
        "stop_reason": "the recording played has ended",
    }
    assert "3 frames, 0.1 s, 1 dropped" in capsys.readouterr().out
    handcal("replay", tmp_path / "copy")
    assert "3 of 3 frames show a hand." in capsys.readouterr().out
    code, error = fails("record", tmp_path / "copy", "--source", tmp_path / "three")
    assert (code, "is not empty; choose a new folder" in error) == (1, True)
    code, error = fails("record", tmp_path / "copy.bag", "--source", tmp_path / "three")
    assert (code, "records only .db3 files" in error) == (1, True)


def test_record_sees_the_simulated_hand_until_it_is_interrupted(
    handcal: Callable[..., None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt() -> None:
        while not (tmp_path / "hand" / "frames.csv").exists():
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    stop = threading.Thread(target=interrupt, daemon=True)
    stop.start()
    handcal("record", tmp_path / "hand", "--source", "simulator", "--seconds", "600")
    stop.join()
    assert "ended: stopped" in capsys.readouterr().out
    handcal("replay", tmp_path / "hand")
    assert "frames show a hand." in capsys.readouterr().out
