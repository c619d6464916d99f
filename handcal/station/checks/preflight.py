"""Checks of a station's settings before it is opened."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from ipaddress import ip_address
from pathlib import Path
from typing import Literal, TypeAlias

from handcal.camera.hololens2 import identity_of
from handcal.camera.recording import check_recording
from handcal.camera.recordings import RECORDING_SUFFIXES, open_recording
from handcal.camera.ros import ros_recording
from handcal.camera.sdk_devices import choose_device, devices_by_child, librealsense
from handcal.core.errors import FileError, HandcalError, LinkError, extra_advice
from handcal.core.progress import Progress
from handcal.hand.settings import REACH_M
from handcal.io.files import require_writable
from handcal.link.server import LOOPBACK
from handcal.link.transport import Address, UdpTransport, reachable_address
from handcal.link.wire import MIN_PAIRING_KEY_BYTES
from handcal.rig.rig_file import read_rig
from handcal.station.checks.doctor import (
    CAMERA_EXTRAS,
    Finding,
    Health,
    examine_camera,
    examine_disk,
    with_rig,
)
from handcal.station.settings import StationSettings

_LEAST_GATE_M = 0.15
"""Least part of the depth gate within a wearer's reach: a hand, and room to move it."""
_HALF_HAND_M, _ROUNDING_M = 0.05, 1e-6
# `_look` adds the part's name.
_good, _limited, _broken = (partial(Finding, "", health) for health in Health)
Part: TypeAlias = Literal["camera", "headset", "rig", "sessions"]
PARTS: dict[Part, str] = {
    "camera": "Camera",
    "headset": "Headset",
    "rig": "Rig file",
    "sessions": "Session folder",
}


def check_station(
    settings: StationSettings, pairing_key: str, progress: Progress = Progress()
) -> dict[Part, Finding]:
    """Check each part of a station without opening it; never raises.

    Takes a few milliseconds; a RealSense is looked for by another process, which takes longer.

    Parameters
    ----------
    settings : StationSettings
    pairing_key : str
        For a network headset.
    progress : Progress
        If it is cancelled, that process ends, and the finding about the camera says so.
    """
    return {
        "camera": _look("camera", lambda: _camera(settings, progress), "or use the simulator"),
        "headset": _look("headset", lambda: _headset(settings, pairing_key), "choose another port"),
        "rig": _look("rig", lambda: _rig(settings), "choose another rig file"),
        "sessions": check_sessions(settings),
    }


def check_sessions(settings: StationSettings) -> Finding:
    """Check the session folder; never raises. Takes long only on a slow network drive."""
    return _look("sessions", lambda: _sessions(settings), "choose another folder")


def is_ready(findings: Mapping[Part, Finding]) -> bool:
    """Return whether a station with these findings can be opened."""
    return all(finding.health is not Health.BROKEN for finding in findings.values())


def gate_problem(settings: StationSettings) -> Finding | None:
    """Return why no hand can be calibrated within the depth gate, or None."""
    gate = settings.calibration.segment
    near_m, far_m = gate.reachable_m
    if far_m - near_m < _LEAST_GATE_M - _ROUNDING_M:
        return _broken(
            f"the depth gate, {gate.depth_min_m:.2f} to {gate.depth_max_m:.2f} m, leaves a hand "
            "too little room",
            f"include at least {_LEAST_GATE_M:.2f} m of a wearer's reach, which is "
            f"{REACH_M[0]:.2f} to {REACH_M[1]:.2f} m from the camera",
        )
    first_m = settings.plan.placement.nearest_m + _HALF_HAND_M
    if settings.plan.name == "recommended" and far_m < first_m - _ROUNDING_M:
        return _broken(
            f"the depth gate ends at {gate.depth_max_m:.2f} m, before the cursors of the "
            "recommended plan",
            f"end it at {first_m:.2f} m or farther, or choose the plan as in the paper",
        )
    return None


def _look(part: Part, look: Callable[[], Finding], advice: str) -> Finding:
    try:
        finding = look()
    except (HandcalError, OSError, ValueError) as error:  # ValueError: a null byte in a path
        why = (isinstance(error, OSError) and error.strerror) or str(error)
        finding = Finding("", Health.BROKEN, why, advice)
    return replace(finding, what=PARTS[part])


def _camera(settings: StationSettings, progress: Progress) -> Finding:
    if (problem := gate_problem(settings)) is not None:
        return problem
    match settings.source:
        case "realsense":
            device = choose_device(devices_by_child(progress), settings.realsense.serial)
            return with_rig(examine_camera(device), _chosen_rig(settings), device.identity)
        case "hololens2":
            return _hololens2(settings)
        case "oak" | "orbbec" as kind:
            library, name = CAMERA_EXTRAS[kind]
            if find_spec(library) is None:
                what = f"the library of the {name}, {library}, is missing"
                return _broken(what, extra_advice(kind))
            which = f"{name} {settings.serial}".rstrip()
            return _limited(f"{which}, not tried yet", "it is opened when you start")
        case "recording":
            return _recording(settings)
        case "simulator":
            return _good("simulated; no hardware is needed")


def _chosen_rig(settings: StationSettings) -> Path | None:
    """Return the rig file; None for the shipped example, which is of no real camera."""
    return settings.rig_path if settings.rig else None


def _hololens2(settings: StationSettings) -> Finding:
    if not settings.hololens2.host:
        return _broken("no HoloLens 2 is chosen", "enter its address, as its settings show it")
    identity = identity_of(settings.hololens2)
    name = identity.model or "RealSense on the HoloLens 2"
    found = _limited(
        f"{name} at {settings.hololens2.host}, not tried yet",
        "start hl2ss on it; it is opened when you start",
    )
    return with_rig(found, _chosen_rig(settings), identity)


def _recording(settings: StationSettings) -> Finding:
    name = settings.recording
    kinds = f"a {' or '.join(RECORDING_SUFFIXES)} file, or a folder that handcal or ROS 2 recorded"
    if not name:
        return _broken("no recording is chosen", f"choose {kinds}")
    path = Path(name)
    how = "played in a loop" if settings.playback.loop else "played once"
    if path.is_dir() or ros_recording(path) is not None:
        with open_recording(path) as camera:
            found = _good(f"{camera.name}, {how}")
            rig, intrinsics = _chosen_rig(settings), camera.depth_intrinsics
            return with_rig(found, rig, camera.identity, intrinsics)
    if not path.is_file():
        return _broken(f"there is no recording {path}", f"choose {kinds}")
    if path.suffix not in RECORDING_SUFFIXES:
        return _broken(f"{path.name} is not a recording", f"choose {kinds}")
    librealsense()
    check_recording(path)
    return _good(f"{path.stat().st_size / 2**20:,.1f} MiB, {how}")


def _headset(settings: StationSettings, pairing_key: str) -> Finding:
    if settings.headset == "network":
        return _network_headset(settings, pairing_key)
    _require_free(LOOPBACK)
    if settings.source != "simulator":
        return _limited(
            "the virtual headset cannot see a real hand",
            "suitable only for viewing the camera image; to calibrate, use a network headset",
        )
    return _good("virtual, with a simulated wearer; started on this computer")


def _network_headset(settings: StationSettings, pairing_key: str) -> Finding:
    if settings.source == "simulator":
        return _broken(
            "the simulator's wearer wears the virtual headset", "use the virtual headset"
        )
    if len(pairing_key.encode()) < MIN_PAIRING_KEY_BYTES:
        return _broken("the pairing key is too short", "make a new one")
    try:
        address = ip_address(settings.host)
    except ValueError:
        advice = "enter it in numbers; 0.0.0.0 or :: listens on all networks"
        return _broken(f"{settings.host!r} is not an address", advice)
    if not 1 <= settings.port <= 65535:
        return _broken(f"{settings.port} is not a valid port", "choose one from 1 to 65535")
    try:
        _require_free((settings.host, settings.port))
    except LinkError as error:  # which says itself what to do
        return _broken(error.what, error.advice)
    try:
        host, port = reachable_address((str(address), settings.port))
    except LinkError:
        return _limited("this computer has no network", "connect it to the headset's network")
    return _limited(
        f"not connected yet; it can connect to {host}, UDP port {port}",
        "pair and try it with Connect, or let it connect after the start",
    )


def _require_free(address: Address) -> None:
    """Raise LinkError if the address cannot be bound."""
    UdpTransport(address).close()


def _rig(settings: StationSettings) -> Finding:
    name = read_rig(settings.rig_path).name
    if not settings.rig and settings.headset == "network":
        return _limited(name, "choose the file of this headset's own offline calibration")
    return _good(name)


def _sessions(settings: StationSettings) -> Finding:
    if not settings.sessions:
        return _broken("no folder is chosen", "choose one")
    if str(settings.sessions_path).startswith("~"):
        return _broken(f"{settings.sessions_path.parts[0]} is no user's folder", "choose another")
    folder = settings.sessions_path.absolute()
    there = next(path for path in (folder, *folder.parents) if path.exists())
    try:
        require_writable(folder)
    except FileError as error:
        return _broken(error.what, error.advice)
    disk = examine_disk(there)
    return disk if there == folder else replace(disk, found=f"{disk.found}; will be created")
