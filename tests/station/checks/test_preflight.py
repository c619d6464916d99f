"""The check before a start: every part of a station that could not be opened is named."""

from __future__ import annotations

import os
import shutil
import socket
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import ifaddr  # noqa: F401 - at its first import it starts a process
import numpy as np
import pytest

from handcal.calibration.plan import PlanSettings
from handcal.camera import sdk_devices
from handcal.camera.folder import record_folder
from handcal.camera.playback import PlaybackSettings
from handcal.camera.sdk_devices import Device
from handcal.camera.settings import HoloLens2Settings, RealSenseSettings
from handcal.core.errors import LinkError
from handcal.core.types import CameraIdentity, Frame, Intrinsics
from handcal.hand.settings import SegmentSettings
from handcal.io.resources import resource_path
from handcal.link.pairing import new_pairing_key
from handcal.rig.example import example_rig
from handcal.rig.rig_file import write_rig
from handcal.station.checks import preflight
from handcal.station.checks.doctor import Finding, Health
from handcal.station.checks.preflight import PARTS, Part, check_station, is_ready
from handcal.station.settings import StationSettings, with_gate, with_source

KEY = new_pairing_key()
D415 = Device("Intel RealSense D415", "123", "5.16", "3.2")


@pytest.fixture
def settings(tmp_path: Path) -> StationSettings:
    return StationSettings(sessions=str(tmp_path), host="127.0.0.1", port=_free_port())


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        yield other.getsockname()[1]


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def find(part: Part, settings: StationSettings, key: str = KEY) -> Finding:
    findings = check_station(settings, key)
    assert {part: finding.what for part, finding in findings.items()} == PARTS
    for finding in findings.values():
        assert finding.found
        assert bool(finding.advice) is (finding.health is not Health.GOOD)
    broken = any(finding.health is Health.BROKEN for finding in findings.values())
    assert is_ready(findings) is not broken
    return findings[part]


def test_the_simulator_needs_nothing(settings: StationSettings) -> None:
    findings = check_station(settings, "")
    assert {finding.health for finding in findings.values()} == {Health.GOOD}
    assert is_ready(findings)
    assert "HoloLens 1" in findings["rig"].found


def test_a_realsense_is_found_or_missed(
    settings: StationSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    devices: list[Device] = []
    monkeypatch.setattr(preflight, "devices_by_child", lambda _: devices)
    live = replace(settings, source="realsense", headset="network")
    assert find("camera", live).health is Health.BROKEN
    assert "plug one into a USB 3 port" in find("camera", live).found
    devices.append(D415)
    assert find("camera", live).health is Health.GOOD
    assert "serial 123" in find("camera", live).found
    assert (
        "serial 9 is not connected"
        in find("camera", replace(live, realsense=RealSenseSettings(serial="9"))).found
    )
    devices[0] = replace(D415, usb="2.1")
    assert find("camera", live).health is Health.LIMITED


@pytest.mark.process
@pytest.mark.parametrize(
    ("module", "found"),
    [
        ("import os; os.abort()", "librealsense crashed"),
        ("raise ImportError", "no package exists for macOS"),
    ],
)
def test_an_sdk_that_crashes_or_is_missing_is_named(
    settings: StationSettings,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    module: str,
    found: str,
) -> None:
    (tmp_path / "pyrealsense2.py").write_text(module)
    path = [str(tmp_path), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, path)))
    monkeypatch.setattr(sdk_devices, "_LONGEST_LISTING_S", 600.0)
    finding = find("camera", replace(settings, source="realsense", headset="network"))
    assert finding.health is Health.BROKEN
    assert found in finding.found
    assert "simulator" in finding.advice


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("realsense", {"source": "realsense"}),
        ("simulator", {"source": "simulator"}),
        ("a/recording", {"source": "recording", "recording": "a/recording"}),
        ("oak", {"source": "oak"}),
        ("orbbec:AB1", {"source": "orbbec", "serial": "AB1"}),
        ("hololens2:hl", {"source": "hololens2", "hololens2": HoloLens2Settings("hl")}),
    ],
)
def test_a_source_names_the_camera(source: str, expected: dict[str, Any]) -> None:
    chosen = with_source(StationSettings(), source)
    assert chosen == replace(StationSettings(), calibration=chosen.calibration, **expected)
    usual_m = 0.20 if "hololens2" in source else 0.35
    assert with_gate(StationSettings(), (usual_m, 0.70)).calibration == chosen.calibration
    own = with_gate(StationSettings(), (0.30, 0.60))
    assert with_source(own, source).calibration == own.calibration


def test_a_recording_must_be_there(settings: StationSettings, tmp_path: Path) -> None:
    played = replace(settings, source="recording")
    assert find("camera", played).found == "no recording is chosen"
    text, path = tmp_path / "hand.txt", tmp_path / "hand.db3"
    text.touch()
    finding = find("camera", replace(played, recording=str(text)))
    assert finding.found == "hand.txt is not a recording"
    assert ".db3 or .bag file, or a folder" in finding.advice
    with_path = replace(played, recording=str(path))
    assert find("camera", with_path).found == f"there is no recording {path}"
    pytest.importorskip("pyrealsense2")
    path.write_bytes(bytes(2**21))
    assert find("camera", with_path).found.startswith(f"{path} is not a recording")
    path.write_bytes(b"SQLite format 3".ljust(2**21, b"\0"))
    assert find("camera", with_path).found == "2.0 MiB, played in a loop"
    assert find("camera", replace(played, recording="\0.db3")).health is Health.BROKEN


def test_a_recorded_folder_needs_no_sdk(
    settings: StationSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyrealsense2", None)
    played = replace(settings, source="recording", recording=str(tmp_path))
    assert "recording.json" in find("camera", played).found
    assert find("camera", played).health is Health.BROKEN
    camera = Intrinsics(4, 3, 5.0, 5.0, 1.5, 1.0)
    record_folder(tmp_path / "hand", [Frame(1, 1, 0, np.ones((3, 4), np.uint16), 1e-3, camera)])
    finding = find("camera", replace(played, recording=str(tmp_path / "hand")))
    assert finding.found == "Recording hand, played in a loop"
    assert finding.health is Health.GOOD
    once = replace(played, recording=str(tmp_path / "hand"), playback=PlaybackSettings())
    assert find("camera", once).found == "Recording hand, played once"


def test_another_camera_than_the_rig_s_is_reported(
    settings: StationSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = replace(example_rig(), depth_camera=D415.identity)
    write_rig(tmp_path / "rig.yaml", rig)
    monkeypatch.setattr(preflight, "devices_by_child", lambda _: [D415])
    live = replace(settings, source="realsense", headset="network", rig=str(tmp_path / "rig.yaml"))
    assert find("camera", live).health is Health.GOOD
    write_rig(tmp_path / "rig.yaml", replace(rig, depth_camera=CameraIdentity("", "456")))
    assert find("camera", live).health is Health.LIMITED
    assert "another serial number: 123, not 456" in find("camera", live).found
    assert find("camera", replace(live, rig="")).health is Health.GOOD
    (tmp_path / "rig.yaml").write_text("")
    assert find("camera", live).health is Health.GOOD  # the rig's own finding names it
    assert find("rig", live).health is Health.BROKEN

    lens = replace(rig.depth_intrinsics, fx=0.96 * rig.depth_intrinsics.fx)
    depth = np.ones((lens.height, lens.width), np.uint16)
    record_folder(tmp_path / "hand", [Frame(1, 1, 0, depth, 1e-3, lens)], D415.identity)
    write_rig(tmp_path / "rig.yaml", rig)
    played = replace(live, source="recording", recording=str(tmp_path / "hand"))
    assert "the rig: focal length 4.0 % shorter" in find("camera", played).found


LIVE: dict[str, Any] = {"source": "realsense", "headset": "network"}
HOLOLENS: dict[str, Any] = {"source": "hololens2", "headset": "network"}


@pytest.mark.parametrize(
    ("part", "changes", "health", "said"),
    [
        ("camera", LIVE | {"source": "oak"}, Health.BROKEN, "pip install 'handcal[oak]'"),
        ("camera", LIVE | {"source": "orbbec", "serial": "AB1"}, Health.LIMITED, "camera AB1"),
        ("camera", HOLOLENS, Health.BROKEN, "no HoloLens 2 is chosen"),
        (
            "camera",
            HOLOLENS | {"hololens2": HoloLens2Settings("10.0.0.7")},
            Health.LIMITED,
            "AHAT at 10.0.0.7",
        ),
        (
            "camera",
            HOLOLENS | {"hololens2": HoloLens2Settings("hl", realsense_rig="rig.yaml")},
            Health.LIMITED,
            "RealSense on the HoloLens 2 at hl",
        ),
        ("headset", {"source": "recording"}, Health.LIMITED, "cannot see a real hand"),
        ("headset", {"headset": "network"}, Health.BROKEN, "simulator"),
        ("headset", LIVE | {"host": "pc"}, Health.BROKEN, "'pc' is not an address"),
        ("headset", LIVE | {"port": 70_000}, Health.BROKEN, "70000"),
        ("headset", LIVE, Health.LIMITED, "not connected yet"),
        ("rig", {"source": "recording"}, Health.GOOD, ""),
        ("rig", LIVE, Health.LIMITED, "this headset's own"),
        ("rig", LIVE | {"rig": str(resource_path("example_rig.yaml"))}, Health.GOOD, ""),
    ],
)
def test_each_part_says_what_it_lacks(
    settings: StationSettings,
    monkeypatch: pytest.MonkeyPatch,
    part: Part,
    changes: dict[str, Any],
    health: Health,
    said: str,
) -> None:
    monkeypatch.setattr(preflight, "devices_by_child", lambda _: [])
    monkeypatch.setattr(preflight, "find_spec", {"pyorbbecsdk": object()}.get)
    finding = find(part, replace(settings, **changes))
    assert finding.health is health
    assert said in f"{finding.found}; {finding.advice}"


def test_a_network_headset_cannot_be_waited_for(
    settings: StationSettings, taken_port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preflight, "devices_by_child", lambda _: [])
    live = replace(settings, **LIVE)
    assert find("headset", live, key="short").found == "the pairing key is too short"
    everywhere = replace(live, host="0.0.0.0")
    monkeypatch.setattr(preflight, "reachable_address", lambda bound: ("192.168.1.20", bound[1]))
    assert "192.168.1.20" in find("headset", everywhere).found

    def fail(_: object) -> None:
        raise LinkError("cannot reach")

    monkeypatch.setattr(preflight, "reachable_address", fail)
    assert find("headset", everywhere).health is Health.LIMITED
    assert "cannot listen" in find("headset", replace(live, port=taken_port)).found
    elsewhere = find("headset", replace(live, host="192.0.2.1"))
    assert (elsewhere.health, "no such address" in elsewhere.found) == (Health.BROKEN, True)


def test_an_unfit_rig_is_named(settings: StationSettings, tmp_path: Path) -> None:
    absent = find("rig", replace(settings, rig=str(tmp_path / "absent.yaml")))
    assert absent.health is Health.BROKEN
    assert "cannot read" in absent.found
    bad = tmp_path / "bad.yaml"
    bad.write_text(resource_path("example_rig.yaml").read_text().replace("T_H_D", "T_D_H"))
    assert "T_H_D must be a 4×4" in find("rig", replace(settings, rig=str(bad))).found


def test_the_session_folder_must_take_a_session(
    settings: StationSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert find("sessions", replace(settings, sessions="")).found == "no folder is chosen"
    new = replace(settings, sessions=str(tmp_path / "new" / "folder"))
    assert find("sessions", new).health is Health.GOOD
    assert "will be created" in find("sessions", new).found
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "new").touch()
    assert find("sessions", new).found == f"{tmp_path / 'new'} is a file"
    long = replace(settings, sessions=str(tmp_path / ("n" * 300)))
    assert find("sessions", long).found == "File name too long"
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert "cannot write to" in find("sessions", settings).found
    monkeypatch.undo()
    full = shutil.disk_usage(tmp_path)._replace(free=100 * 2**20)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: full)
    assert find("sessions", settings).health is Health.BROKEN


def _with_gate(settings: StationSettings, near_m: float, far_m: float) -> StationSettings:
    segment = SegmentSettings(depth_min_m=near_m, depth_max_m=far_m)
    return replace(settings, calibration=replace(settings.calibration, segment=segment))


def test_a_depth_gate_without_room_for_a_hand_is_refused(settings: StationSettings) -> None:
    for near_m, far_m in ((0.90, 0.95), (0.10, 0.30), (0.40, 0.50), (0.65, 2.0)):
        found = find("camera", _with_gate(settings, near_m, far_m))
        assert found.health is Health.BROKEN
        assert f"{near_m:.2f} to {far_m:.2f} m, leaves a hand too little room" in found.found
    assert find("camera", _with_gate(settings, 0.6, 2.0)).health is Health.GOOD
    near = _with_gate(settings, 0.20, 0.40)
    assert find("camera", near).health is Health.GOOD
    planned = replace(near, plan=PlanSettings("recommended"))
    assert "before the cursors of the recommended plan" in find("camera", planned).found


def test_a_folder_of_the_user_is_the_same_checked_and_used(
    settings: StationSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    mine = replace(settings, sessions="~/mine", rig="~/rig.yaml")
    assert (mine.sessions_path, mine.rig_path) == (tmp_path / "mine", tmp_path / "rig.yaml")
    assert "will be created" in find("sessions", mine).found
    nobody = replace(settings, sessions="~nosuchuser/mine")
    assert nobody.sessions_path == Path("~nosuchuser/mine")
    assert find("sessions", nobody).found == "~nosuchuser is no user's folder"


@pytest.mark.skipif(not Path("/proc").exists(), reason="Linux has it")
def test_a_folder_that_is_on_no_disk_is_refused(
    settings: StationSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: True)  # as for root
    found = find("sessions", replace(settings, sessions="/proc/x"))
    assert (found.health, found.found) == (Health.BROKEN, "nothing can be stored in /proc")
