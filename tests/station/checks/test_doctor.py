"""The doctor: whatever is broken is named, with what to do."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import shutil
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from handcal.camera.sdk_devices import Device, explain_absence
from handcal.core.errors import CameraError, FileError, LinkError
from handcal.link.pairing import KEY_VARIABLE
from handcal.station.checks import doctor
from handcal.station.checks.doctor import Finding, Health, examine


def fail_with(error: Exception) -> object:
    def fail(*_: object) -> object:
        raise error

    return fail


@pytest.fixture(autouse=True)
def quick_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Spare each test the trial of both models, and the process that lists cameras."""
    monkeypatch.setattr(doctor, "load_detector", lambda: SimpleNamespace(model=Path("some.onnx")))
    monkeypatch.setattr(doctor, "devices_by_child", tuple)


def of(what: str, rig: Path | None = None) -> Finding:
    findings = [finding for finding in examine(rig) if finding.what == what]
    assert len(findings) == 1
    assert bool(findings[0].advice) is (findings[0].health is not Health.GOOD)
    return findings[0]


def test_on_this_machine_nothing_is_broken_and_every_note_has_advice() -> None:
    findings = examine()
    assert {finding.health for finding in findings} <= {Health.GOOD, Health.LIMITED}
    for finding in findings:
        assert finding.found
        assert bool(finding.advice) is (finding.health is not Health.GOOD)
    assert {"Python", "numpy", "Example rig", "Network", "Disk"} <= {f.what for f in findings}


def test_an_unfit_python(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "sys", SimpleNamespace(version_info=(3, 10), platform="linux"))
    assert of("Python").health is Health.BROKEN
    assert "3.11" in of("Python").advice


def test_a_missing_package(monkeypatch: pytest.MonkeyPatch) -> None:
    error = importlib.metadata.PackageNotFoundError("scipy")
    monkeypatch.setattr(importlib.metadata, "version", fail_with(error))
    assert of("scipy") == Finding(
        "scipy", Health.BROKEN, "not installed", "run bash installer/run.sh, or pip install handcal"
    )


def test_a_clock_as_that_of_windows_before_python_3_13(monkeypatch: pytest.MonkeyPatch) -> None:
    assert of("Clock").health is Health.GOOD
    clock = SimpleNamespace(resolution=0.015625)
    monkeypatch.setattr(time, "get_clock_info", lambda _: clock)
    assert "15.6 ms" in of("Clock").found
    assert "3.13" in of("Clock").advice


def test_a_missing_hand_detector_leaves_the_depth(monkeypatch: pytest.MonkeyPatch) -> None:
    assert of("Hand detector") == Finding("Hand detector", Health.GOOD, "runs some.onnx")
    monkeypatch.setattr(doctor, "load_detector", fail_with(FileError("no model")))
    assert of("Hand detector") == Finding(
        "Hand detector",
        Health.LIMITED,
        "no model",
        "hands are found by depth alone; run bash installer/run.sh, or pip install handcal",
    )


def test_a_damaged_rig_and_a_blocked_network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "read_rig", fail_with(FileError("rig.yaml is damaged")))
    monkeypatch.setattr(doctor, "UdpTransport", fail_with(LinkError("no socket may be bound")))
    assert of("Example rig").found == "rig.yaml is damaged"
    assert of("Example rig").health is of("Network").health is Health.BROKEN
    assert of("Network").found == "no socket may be bound"
    assert "firewall" in of("Network").advice


@pytest.mark.parametrize(
    ("key", "found", "health"),
    [
        (None, "no pairing key", Health.LIMITED),
        ("short", "5 bytes", Health.LIMITED),
        ("a key that is long enough", "set in HANDCAL_PAIRING_KEY", Health.GOOD),
    ],
)
def test_the_pairing_key(
    monkeypatch: pytest.MonkeyPatch, key: str | None, found: str, health: Health
) -> None:
    monkeypatch.delenv(KEY_VARIABLE, raising=False)
    if key is not None:
        monkeypatch.setenv(KEY_VARIABLE, key)
    assert found in of("Pairing key").found
    assert of("Pairing key").health is health
    assert key is None or key not in of("Pairing key").found  # which others may read


@pytest.mark.parametrize(
    ("devices", "found", "health"),
    [
        ([], "no RealSense camera is connected", Health.LIMITED),
        ([Device("D415", "123", "5.9.1", "3.2", "5.16.0")], "firmware 5.9.1", Health.LIMITED),
        ([Device("D415", "123", "5.16", "3.2", "5.9.1", 41.3)], ", 41 °C", Health.GOOD),
        ([Device("D415", "123", "5.16", "3.2")], "D415, serial 123", Health.GOOD),
        ([Device("D415", "123", "5.16", "2.1")], "USB 2.1", Health.LIMITED),
    ],
)
def test_the_camera(
    monkeypatch: pytest.MonkeyPatch, devices: list[Device], found: str, health: Health
) -> None:
    monkeypatch.setattr(doctor, "devices_by_child", lambda: devices)
    monkeypatch.setattr(doctor, "explain_absence", lambda: explain_absence(Path("nowhere")))
    assert found in of("Camera").found
    assert of("Camera").health is health


def test_a_missing_camera_sdk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "devices_by_child", fail_with(CameraError("no SDK")))
    assert of("RealSense SDK").found == "no SDK"
    assert of("RealSense SDK").health is Health.LIMITED


@pytest.mark.parametrize(
    ("what", "module", "extra"),
    [("OAK-D library", "depthai", "oak"), ("Orbbec camera library", "pyorbbecsdk", "orbbec")],
)
def test_the_libraries_of_other_cameras(
    what: str, module: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = {module}
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name in here or None)
    assert of(what) == Finding(what, Health.GOOD, f"{module} is installed")
    here.clear()
    assert of(what).health is Health.LIMITED
    assert of(what).found == f"{module} is not installed"
    assert f"'handcal[{extra}]'" in of(what).advice


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have always a screen")
def test_the_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    assert of("Screen").health is Health.LIMITED
    monkeypatch.setenv("DISPLAY", ":0")
    for answers, health in ((True, Health.GOOD), (False, Health.LIMITED)):
        monkeypatch.setattr(doctor, "x_server_answers", lambda _, answers=answers: answers)
        assert of("Screen").health is health
    assert of("Screen").found == "the X server at DISPLAY=:0 does not answer"


def test_the_disk(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    full = shutil.disk_usage(tmp_path)._replace(free=100 * 2**20)
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "disk_usage", lambda _: full)
        assert of("Disk").found == "0.1 GiB free here"
        assert of("Disk").health is Health.BROKEN
    monkeypatch.chdir(tmp_path)
    tmp_path.rmdir()
    assert of("Disk").health is Health.BROKEN
    assert "folder that exists" in of("Disk").advice
