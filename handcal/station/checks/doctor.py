"""Checks of the installation and the connected devices, with advice on each problem."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import shutil
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

from handcal.calibration.delay import ASSUMED_LATENCY_S
from handcal.camera.camera import Camera
from handcal.camera.sdk_devices import Device, devices_by_child, explain_absence
from handcal.core.errors import CancelledError, HandcalError, extra_advice
from handcal.core.progress import Progress
from handcal.core.types import CameraIdentity, Intrinsics, Rig
from handcal.hand.shipped import load_detector
from handcal.io.resources import resource_path
from handcal.io.x_display import x_server_answers
from handcal.link.pairing import KEY_VARIABLE, read_pairing_key
from handcal.link.server import HeadsetServer
from handcal.link.transport import UdpTransport
from handcal.rig.compare import compare_camera
from handcal.rig.rig_file import read_rig
from handcal.station.checks.headset import headset_problem, headset_state
from handcal.station.poses import STAMP_ADVICE, run_pose_delay

_PACKAGES = (
    "numpy",
    "scipy",
    "opencv-python-headless",
    "protobuf",
    "onnxruntime",
    "matplotlib",
    "PySide6-Essentials",
    "pyqtgraph",
)
CAMERA_EXTRAS = {"oak": ("depthai", "OAK-D"), "orbbec": ("pyorbbecsdk", "Orbbec camera")}
"""Extras that cameras need: the module of each, and the cameras."""
_SETTLE_S = 2.0
_POLL_S = 0.05
_LONGEST_STEP_MS = 1.0
_LEAST_FREE_BYTES = 500 * 2**20


class Health(Enum):
    """Severity of a finding."""

    GOOD = "ok"
    LIMITED = "note"
    BROKEN = "PROBLEM"


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of one check."""

    what: str
    health: Health
    """LIMITED if the simulator and recordings still work."""
    found: str
    advice: str = ""
    """Recommended action; empty if none."""


def examine(rig: Path | None = None) -> list[Finding]:
    """Check everything that a calibration needs; never raises.

    Parameters
    ----------
    rig : Path, optional
        Rig file with whose depth camera the connected cameras are compared.
    """
    return [
        _python(),
        _clock(),
        *_packages(),
        _examples(),
        _hand_detector(),
        _network(),
        _pairing(),
        *_rig(rig),
        *_cameras(rig),
        *_camera_extras(),
        _screen(),
        _disk(),
    ]


def examine_headset(
    server: HeadsetServer,
    rig: Rig | None,
    camera: Camera | None,
    patience_s: float,
    progress: Progress = Progress(),
) -> list[Finding]:
    """Wait for a headset and report on it; with a camera and a rig, also on its pose stamps.

    Never raises, except CancelledError.
    """
    end_s = time.monotonic() + patience_s
    while not server.connected and (left_s := end_s - time.monotonic()) > 0.0:
        progress.at(1.0 - left_s / patience_s, "Waiting for the headset")
        time.sleep(_POLL_S)
    settled_s = time.monotonic() + _SETTLE_S
    while server.connected and time.monotonic() < settled_s:
        progress.at(1.0, "Measuring the link")
        time.sleep(_POLL_S)
    device, link = server.device, server.statistics()
    problem = headset_problem(device, link, rig)
    if not link.connected:
        return [Finding("Headset", Health.BROKEN, "none connected", problem)]
    health = Health.LIMITED if problem else Health.GOOD
    found = [Finding("Headset", health, headset_state(device, link), problem)]
    if camera is None or rig is None:
        return found
    what = "Pose stamps"
    try:
        delay = run_pose_delay(server, camera, rig.T_H_D, ASSUMED_LATENCY_S, progress=progress)
    except CancelledError:
        raise
    except HandcalError as error:
        return [*found, Finding(what, Health.LIMITED, "not checked", str(error))]
    health, advice = (Health.BROKEN, STAMP_ADVICE) if delay.is_wrong else (Health.GOOD, "")
    return [*found, Finding(what, health, str(delay), advice)]


def _python() -> Finding:
    found = f"Python {platform.python_version()} on {platform.platform()}, {os.cpu_count()} cores"
    if (3, 11) <= sys.version_info[:2] <= (3, 13):
        return Finding("Python", Health.GOOD, found)
    return Finding("Python", Health.BROKEN, found, "use Python 3.11, 3.12 or 3.13")


def _clock() -> Finding:
    step_ms = 1e3 * time.get_clock_info("monotonic").resolution
    if step_ms < _LONGEST_STEP_MS:
        return Finding("Clock", Health.GOOD, f"steps of at most {_LONGEST_STEP_MS} ms")
    found = f"steps of {step_ms:.1f} ms, in which frames and head poses cannot be matched"
    return Finding("Clock", Health.LIMITED, found, "on Windows, use Python 3.13")


def _install_again() -> str:
    """Return the advice for a damaged installation, which depends on how handcal was installed."""
    if getattr(sys, "frozen", False):
        return "install the Debian package of handcal again"
    return {
        "linux": "run bash installer/run.sh, or pip install handcal",
        "win32": "run handcal's installer again, or pip install handcal",
    }.get(sys.platform, "pip install handcal")


def _packages() -> list[Finding]:
    findings = []
    for name in _PACKAGES:
        try:
            version = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            findings.append(Finding(name, Health.BROKEN, "not installed", _install_again()))
        else:
            findings.append(Finding(name, Health.GOOD, version))
    return findings


def _examples() -> Finding:
    def read() -> str:
        return read_rig(resource_path("example_rig.yaml")).name

    return _try("Example rig", read, _install_again())


def _hand_detector() -> Finding:
    def load() -> str:
        return f"runs {load_detector().model.name}"

    advice = f"hands are found by depth alone; {_install_again()}"
    return _try("Hand detector", load, advice, Health.LIMITED)


def _network() -> Finding:
    def bind() -> str:
        transport = UdpTransport(("127.0.0.1", 0))
        port = transport.address[1]
        transport.close()
        return f"UDP works on the loopback interface (port {port})"

    advice = "allow UDP on the loopback interface in the firewall"
    if sys.platform == "win32":
        advice = "in Windows Security, allow handcal's Python in private networks (firewall)"
    return _try("Network", bind, advice)


def _pairing() -> Finding:
    def read() -> str:
        read_pairing_key()
        return f"set in {KEY_VARIABLE}"

    advice = "only handcal headset needs it; the desktop program has its own key"
    return _try("Pairing key", read, advice, Health.LIMITED)


def _rig(path: Path | None) -> list[Finding]:
    if path is None:
        return []
    return [_try("Rig file", lambda: read_rig(path).name, "choose another rig file")]


def _cameras(rig: Path | None) -> list[Finding]:
    try:
        devices = devices_by_child()
    except HandcalError as error:
        return [Finding("RealSense SDK", Health.LIMITED, str(error), "needed for real cameras")]
    if not devices:
        advice = "the simulator and recordings work without it"
        if sys.platform == "win32":
            advice += "; a plugged-in camera needs Settings, Privacy, Camera, desktop apps: on"
        return [Finding("Camera", Health.LIMITED, str(explain_absence()), advice)]
    return [with_rig(examine_camera(device), rig, device.identity) for device in devices]


def _camera_extras() -> list[Finding]:
    """Look for the libraries of the other cameras without importing them."""
    findings = []
    for extra, (module, camera) in CAMERA_EXTRAS.items():
        what = f"{camera} library"
        if importlib.util.find_spec(module) is None:
            advice = f"needed for an {camera}: {extra_advice(extra)}"
            findings.append(Finding(what, Health.LIMITED, f"{module} is not installed", advice))
        else:
            findings.append(Finding(what, Health.GOOD, f"{module} is installed"))
    return findings


def with_rig(
    finding: Finding,
    path: Path | None,
    identity: CameraIdentity,
    intrinsics: Intrinsics | None = None,
) -> Finding:
    """Return a camera's finding with its differences from the camera of a rig file, if given.

    A rig file that cannot be read leaves the finding as it is.
    """
    differences: tuple[str, ...] = ()
    if path is not None:
        with suppress(HandcalError):
            differences = compare_camera(read_rig(path), identity, intrinsics)
    if not differences:
        return finding
    found = f"{finding.found}; not the depth camera of the rig: {'; '.join(differences)}"
    advice = "choose the rig file of this camera, or calibrate its pose on the headset again"
    return replace(finding, health=Health.LIMITED, found=found, advice=advice)


def examine_camera(device: Device) -> Finding:
    """Return the identity of a device and problems of its connection."""
    found = f"{device.name}, serial {device.serial}, firmware {device.firmware}, USB {device.usb}"
    if device.temperature_c is not None:
        found += f", {device.temperature_c:.0f} °C"
    if device.is_slow:
        advice = "USB 2 is too slow for 1280x720, and gives less power: use a USB 3 port and cable"
        return Finding("Camera", Health.LIMITED, found, advice)
    if device.has_old_firmware:
        advice = f"update the firmware to {device.recommended_firmware} with RealSense Viewer"
        return Finding("Camera", Health.LIMITED, found, advice)
    return Finding("Camera", Health.GOOD, found)


def _screen() -> Finding:
    advice = "commands run without one; windows need one"
    if sys.platform != "linux" or os.environ.get("WAYLAND_DISPLAY"):
        return Finding("Screen", Health.GOOD, "available")
    display = os.environ.get("DISPLAY")
    if not display:
        return Finding("Screen", Health.LIMITED, "none", advice)
    if not x_server_answers(display):
        found = f"the X server at DISPLAY={display} does not answer"
        return Finding("Screen", Health.LIMITED, found, advice)
    return Finding("Screen", Health.GOOD, "available")


def _disk() -> Finding:
    try:
        return examine_disk(Path.cwd())
    except OSError as error:
        return Finding("Disk", Health.BROKEN, str(error), "run handcal in a folder that exists")


def examine_disk(folder: Path) -> Finding:
    """Check for enough disk space for a session; OSError if the folder does not exist."""
    free_bytes = shutil.disk_usage(folder).free
    found = f"{free_bytes / 2**30:.1f} GiB free here"
    if free_bytes < _LEAST_FREE_BYTES:
        least = f"{_LEAST_FREE_BYTES / 2**30:.1f} GiB"
        return Finding("Disk", Health.BROKEN, found, f"make room: {least} must be free")
    return Finding("Disk", Health.GOOD, found)


def _try(
    what: str, look: Callable[[], str], advice: str, otherwise: Health = Health.BROKEN
) -> Finding:
    try:
        return Finding(what, Health.GOOD, look())
    except HandcalError as error:
        return Finding(what, otherwise, str(error), advice)
