"""The OpenXR layer, compiled, loaded by the system's loader and run on the test runtime."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handcal.core.conventions import opengl_transform, pose
from handcal.core.geometry import invert
from handcal.core.types import EYES, Float64, HeadsetIdentity, HeadsetView
from handcal.export import openxr
from handcal.export.openxr import install_layer
from handcal.export.outcome import SessionOutcome, load_outcome
from handcal.export.tools import openxr_values
from handcal.io.files import read_json, write_json
from handcal.io.resources import resource_path
from handcal.session.session import open_session
from tests.helpers import ROOT

SOURCES = ROOT / "resources/openxr"
REQUIRE = "HANDCAL_REQUIRE_OPENXR"
VALIDATION = "XR_APILAYER_LUNARG_core_validation"
_NEEDS = {
    "/usr/include/openxr/openxr.h": "libopenxr-dev",
    "/usr/lib/x86_64-linux-gnu/libopenxr_loader.so.1": "libopenxr-loader1",
    "/usr/lib/x86_64-linux-gnu/openxr/1/api_layers/libXrApiLayer_core_validation.so": (
        "openxr-layer-corevalidation"
    ),
}
OWN_ANGLES = {"left": (-0.26, 0.25, 0.15, -0.15), "right": (-0.25, 0.26, 0.14, -0.16)}
"""The runtime's own field of view: left, right, up and down."""


def compiled_or_skipped(folder: Path, name: str, *arguments: str) -> Path:
    """Compile a test program without a warning."""
    command = ["cc", "-std=gnu11", "-O2", "-Wall", "-Wextra", "-Werror", "-o", str(folder / name)]
    run = subprocess.run([*command, *arguments, "-lm"], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return folder / name


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the layer, as it is given to users, test runtime and application."""
    missing = [package for path, package in _NEEDS.items() if not Path(path).exists()]
    missing += ["gcc"] * (shutil.which("cc") is None)
    if missing:
        message = f"needs {', '.join(missing)}: apt-get install {' '.join(missing)}"
        (pytest.fail if os.environ.get(REQUIRE) else pytest.skip)(message)
    folder = tmp_path_factory.mktemp("openxr")
    command = ["bash", str(ROOT / "installer/openxr.sh"), str(folder)]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0
    assert run.stderr == ""  # no warning
    compiled_or_skipped(folder, "runtime.so", "-fPIC", "-shared", str(SOURCES / "test/runtime.c"))
    compiled_or_skipped(folder, "app", str(SOURCES / "test/app.c"))
    return folder


@pytest.fixture(scope="session")
def outcome() -> SessionOutcome:
    """Return the example's outcome, of a rig that knows the headset's own field of view."""
    record = open_session(resource_path("example_session"))
    views = {}
    for eye, display in record.rig.eyes.items():
        left, right, up, down = np.tan(OWN_ANGLES[eye])
        tangents = np.array([left, right, -up, -down])  # y down
        views[eye] = HeadsetView(display.T_V_H, tangents, display.width_px, display.height_px)
    rig = replace(record.rig, headset=HeadsetIdentity("0a", "Lab 2", views=views))
    return load_outcome(replace(record, rig=rig))


@pytest.fixture(scope="session")
def calibration(outcome: SessionOutcome) -> dict[str, Any]:
    return openxr_values(outcome)


def own_views(outcome: SessionOutcome, moved_m: tuple[float, float, float] = (0, 0, 0)) -> Float64:
    """Return the own views (2, 11) of the rig's headset, in VIEW `moved_m` from the rig's head."""
    rows = []
    for eye in EYES:
        one = pose(opengl_transform(invert(outcome.record.rig.eyes[eye].T_V_H)))
        rows.append([*one.quaternion_xyzw, *(one.position_m + moved_m), *OWN_ANGLES[eye]])
    return np.array(rows)


@dataclass(frozen=True)
class Ran:
    """The views of an application, and those that the runtime received; angles last in each row."""

    returncode: int
    errors: str
    seen: Float64
    """(n, 14); session, time, view, pose and field of view that the application was given."""
    heads: Float64
    """(n, 9); session, time and the head's pose."""
    own: Float64
    got: Float64
    """(n, 13); time, view, the runtime's own pose and field of view, and those received."""
    other: dict[str, list[list[float]]]
    status: Mapping[str, Any]
    """As the layer wrote it for the program; empty if it wrote nothing."""


Run = Callable[..., Ran]


def ran(returncode: int, errors: str, text: str, status: Mapping[str, Any]) -> Ran:
    """Read what application and runtime wrote; the application's locale may have decimal commas."""
    lines: dict[str, list[list[float]]] = {}
    for kind, *numbers in map(str.split, text.splitlines()):
        lines.setdefault(kind, []).append([float(one.replace(",", ".")) for one in numbers])
    seen, heads, received = (
        np.array(lines.pop(kind, [])).reshape(-1, width)
        for kind, width in (("view", 14), ("head", 9), ("received", 24))
    )
    own, got = received[:, :13], received[:, [0, 1, *range(13, 24)]]
    return Ran(returncode, errors, seen, heads, own, got, lines, status)


@pytest.fixture
def run(
    built: Path,
    tmp_path: Path,
    outcome: SessionOutcome,
    calibration: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
) -> Run:
    """Return a function that runs the application with the installed layer."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    monkeypatch.setattr(openxr, "_shipped_library", lambda: built / "libhandcal_openxr.so")
    manifest = read_json(install_layer())
    del manifest["api_layer"]["disable_environment"]
    for folder in (tmp_path / "explicit", tmp_path / "config/handcal"):
        folder.mkdir(parents=True)
    write_json(tmp_path / "explicit/handcal.json", manifest)  # to choose its place among others
    runtime = {"library_path": str(built / "runtime.so"), "name": "test"}
    write_json(tmp_path / "runtime.json", {"file_format_version": "1.0.0", "runtime": runtime})
    file = tmp_path / "config/handcal/openxr.json"

    def run_app(
        data: object = calibration,
        views: Float64 | None = None,
        program: Sequence[str] = (),
        **options: object,
    ) -> Ran:
        """Run with a calibration file (None: none); options in capitals are the environment."""
        file.unlink(missing_ok=True)
        if isinstance(data, bytes):
            file.write_bytes(data)
        elif callable(data):
            data(file)
        elif data is not None:
            write_json(file, data)
        record = tmp_path / "record.txt"
        status = tmp_path / "config/handcal/openxr-status.json"
        for old in (record, status):
            old.unlink(missing_ok=True)
        shown = own_views(outcome) if views is None else views
        environment = os.environ | {
            "XR_RUNTIME_JSON": str(tmp_path / "runtime.json"),
            "XR_API_LAYER_PATH": f"/usr/share/openxr/1/api_layers/explicit.d:{tmp_path}/explicit",
            "TEST_VIEWS": " ".join(map(repr, shown.ravel().tolist())),
            "TEST_RECORD": str(record),
            **{name: str(value) for name, value in options.items() if name.isupper()},
        }
        arguments = [f"{name}={value}" for name, value in options.items() if name.islower()]
        done = subprocess.run(
            [*(program or [str(built / "app")]), *arguments],
            env=environment,
            capture_output=True,
            text=True,
            timeout=60,
        )
        text = done.stdout + (record.read_text() if record.exists() else "")
        told = read_json(status) if status.exists() else {}
        return ran(done.returncode, done.stderr, text, told)

    return run_app
