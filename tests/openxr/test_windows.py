"""The layer for Windows, in a loader for Windows, under Wine."""

from __future__ import annotations

import os
import shutil
import subprocess
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handcal.export.openxr import LAYER
from handcal.export.outcome import SessionOutcome
from handcal.io.files import read_json, write_json
from tests.openxr.conftest import SOURCES, own_views, ran

COMPILER = "x86_64-w64-mingw32-gcc"
WINE = shutil.which("wine64", path=f"{os.environ['PATH']}:/usr/lib/wine")
XR = find_spec("xr")  # pyopenxr carries the loader

pytestmark = [
    pytest.mark.slow,
    pytest.mark.process,
    pytest.mark.skipif(
        not (WINE and XR and shutil.which(COMPILER)),
        reason="needs apt-get install wine64 gcc-mingw-w64-x86-64 and pip install pyopenxr",
    ),
]
KEY = r"HKLM\Software\Khronos\OpenXR\1"  # Wine's programs are elevated, and ignore HKCU


def test_an_application_for_windows_is_calibrated(
    built: Path, tmp_path: Path, outcome: SessionOutcome, calibration: dict[str, Any]
) -> None:
    assert WINE is not None
    assert XR is not None
    assert XR.origin is not None
    (loader,) = Path(XR.origin).parent.glob("library/windows_x86_64/openxr_loader.dll")
    headers = tmp_path / "headers"
    headers.mkdir()
    (headers / "openxr").symlink_to("/usr/include/openxr")
    for name, *kind in (("runtime.dll", "-shared"), ("app.exe",)):
        source = SOURCES / f"test/{Path(name).stem}.c"
        command = [COMPILER, "-Werror", f"-I{headers}", *kind, "-o", tmp_path / name, source]
        subprocess.run([str(word) for word in command], check=True)
    environment = os.environ | {"WINEPREFIX": str(tmp_path / "wine"), "WINEDEBUG": "-all"}

    def wine(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [WINE, *words], env=environment, capture_output=True, text=True, timeout=300, check=True
        )

    def windows(path: Path) -> str:
        return "Z:" + str(path).replace("/", "\\")

    runtime = {"library_path": windows(tmp_path / "runtime.dll"), "name": "test"}
    layer = {
        "name": LAYER,
        "library_path": windows(built / "handcal_openxr.dll"),
        "api_version": "1.0",
        "implementation_version": "1",
        "description": "test",
        "disable_environment": "HANDCAL_OPENXR_OFF",
    }
    for name, value in (("runtime", runtime), ("api_layer", layer)):
        write_json(tmp_path / f"{name}.json", {"file_format_version": "1.0.0", name: value})
    wine("reg", "add", KEY, "/v", "ActiveRuntime", "/d", windows(tmp_path / "runtime.json"))
    implicit = windows(tmp_path / "api_layer.json")
    wine("reg", "add", rf"{KEY}\ApiLayers\Implicit", "/v", implicit, "/t", "REG_DWORD", "/d", "0")
    (local,) = (tmp_path / "wine/drive_c/users").glob("*/AppData/Local")
    (local / "handcal").mkdir()
    write_json(local / "handcal/openxr.json", calibration)
    environment["TEST_VIEWS"] = " ".join(map(repr, own_views(outcome).ravel().tolist()))
    environment["TEST_RECORD"] = windows(tmp_path / "record.txt")
    done = wine(windows(tmp_path / "app.exe"), f"loader={windows(loader)}", "frames=50")
    text = done.stdout + (tmp_path / "record.txt").read_text()
    found = ran(done.returncode, "", text, read_json(local / "handcal/openxr-status.json"))
    assert found.status["state"] == "active"
    np.testing.assert_array_equal(found.got, found.own)
    for row in found.seen:
        wanted = [float(x) for x in calibration["views"][int(row[2])]["fov"].values()]
        np.testing.assert_allclose(row[10:], wanted, atol=1e-7)
    assert np.abs(found.seen[:, 7:10] - found.own[:, 6:9]).max() > 1e-3  # m
