"""The Windows setup under Wine: installed, registered, and removed without a trace.

Wine runs no Python of Windows here, so the environment itself is left out (/UNPACK).
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.helpers import ROOT

pytestmark = [
    pytest.mark.slow,
    pytest.mark.process,
    pytest.mark.skipif(
        not (shutil.which("wine") and shutil.which("makensis")),
        reason="needs apt-get install wine nsis",
    ),
]
LIMIT_S = 300.0
LARGEST_BYTES = 300 * 2**20
KEY = r"HKCU\Software\Microsoft\Windows\CurrentVersion\Uninstall\handcal"
PAYLOAD = {
    "uv.exe": "not a program",
    "requirements.txt": "",
    "requirements-open3d.txt": "open3d",
    "setup-environment.cmd": "",
    "handcal.ico": "",
    "licences/LICENSE": "the licence",
    "wheels/handcal-1.2.3-py3-none-any.whl": "a wheel",
}


def of_small_payload(folder: Path) -> Path:
    """Return a setup with small files in place of the wheels."""
    (folder / "handcal-open3d/licences/open3d").mkdir(parents=True)
    (folder / "handcal-open3d/open3d-1.0-py3-none-any.whl").write_text("a wheel")
    (folder / "handcal-open3d/licences/open3d/LICENSE").write_text("its licence")
    for name, text in PAYLOAD.items():
        (folder / "payload" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "payload" / name).write_text(text)
    icon = b"\0\0\1\0\1\0\1\1\0\0\1\0\x20\0\x30\0\0\0\x16\0\0\0"  # one pixel
    icon += b"\x28\0\0\0\1\0\0\0\2\0\0\0\1\0\x20\0" + bytes(24) + bytes(8)
    (folder / "payload/handcal.ico").write_bytes(icon)
    output = folder / "handcal-setup-1.2.3.exe"
    defined = {"VERSION": "1.2.3", "PAYLOAD": folder / "payload", "OUTPUT": output}
    script = ROOT / "installer/windows/handcal.nsi"
    words = [f"-D{name}={value}" for name, value in defined.items()]
    subprocess.run(["makensis", "-V2", "-WX", *words, script], check=True)
    return output


def built(_folder: Path) -> Path:
    """Return the setup that installer/build.sh has made."""
    found = sorted((ROOT / "dist").glob("handcal-setup-*.exe"))
    if not found:
        pytest.skip("needs bash installer/build.sh windows")
    assert found[-1].stat().st_size <= LARGEST_BYTES
    return found[-1]


class Wine:
    """A Windows of its own in a folder."""

    def __init__(self, prefix: Path) -> None:
        self.drive = prefix / "drive_c"
        self._environment = os.environ | {
            "WINEPREFIX": str(prefix), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml=",
        }  # fmt: skip
        self._environment.pop("DISPLAY", None)

    def run(self, *words: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["wine", *words], env=self._environment, capture_output=True, text=True,
            errors="replace", timeout=LIMIT_S, check=False,
        )  # fmt: skip

    def close(self) -> None:
        subprocess.run(["wineserver", "--kill"], env=self._environment, check=False)


@pytest.fixture
def wine(tmp_path: Path) -> Iterator[Wine]:
    made = Wine(tmp_path / "wine")
    yield made
    made.close()


@pytest.mark.parametrize("make", [of_small_payload, built])
def test_it_is_installed_and_removed(make: object, wine: Wine, tmp_path: Path) -> None:
    assert callable(make)
    setup = make(tmp_path)
    assert wine.run(setup, "/S", "/UNPACK", r"/D=C:\Jürgen").returncode == 0
    folder = wine.drive / "Jürgen"
    for name in ("uv.exe", "setup-environment.cmd", "uninstall.exe", "licences/LICENSE"):
        assert (folder / name).is_file()
    assert len(list(folder.glob("wheels/handcal-*.whl"))) == 1
    shortcuts = sorted(path.name for path in wine.drive.glob("users/*/AppData/**/handcal/*.lnk"))
    assert shortcuts == ["handcal commands.lnk", "handcal.lnk"]
    assert not (folder / "requirements-open3d.txt").exists()  # Open3D is not chosen by default
    assert not list(folder.glob("wheels/open3d-*.whl"))
    if (setup.parent / "handcal-open3d").exists():
        assert wine.run(setup, "/S", "/UNPACK", "/OPEN3D", r"/D=C:\Jürgen").returncode == 0
        assert (folder / "requirements-open3d.txt").is_file()
        assert (folder / "licences/open3d/LICENSE").is_file()
        assert len(list(folder.glob("wheels/open3d-*.whl"))) == 1
    told = wine.run("reg", "query", KEY).stdout
    assert "uninstall.exe" in told  # written in the code page of the console

    (folder / "my session.txt").write_text("of the user")
    # _?= makes it run in place, so that its end is that of the removal.
    removed = wine.run(folder / "uninstall.exe", "/S", r"_?=C:\Jürgen")
    assert removed.returncode == 0
    left = {path.name for path in folder.iterdir()}
    assert left <= {"my session.txt", "uninstall.exe"}  # which cannot delete itself in place
    assert "my session.txt" in left
    assert not list(wine.drive.glob("users/*/AppData/**/handcal/*.lnk"))
    assert wine.run("reg", "query", KEY).returncode != 0
