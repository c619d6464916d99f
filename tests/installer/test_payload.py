"""The payload of the Windows setup, by the lock, and the licences of everything shipped."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from tests.helpers import ROOT

LOCK = ROOT / "installer/requirements-build.lock"
OPEN3D_LOCK = ROOT / "installer/requirements-open3d.lock"


@pytest.fixture
def written(tmp_path: Path) -> Path:
    script = ROOT / "installer/windows/requirements.py"
    subprocess.run([sys.executable, script, LOCK, OPEN3D_LOCK, tmp_path], check=True)
    return tmp_path


@pytest.fixture
def requirements(written: Path) -> dict[str, str]:
    text = "".join((written / name).read_text() for name in ("requirements.txt", "tools.txt"))
    blocks = re.findall(r"^([\w.-]+)==(\S+) \\\n((?: +--hash.*\n)+)", text, re.MULTILINE)
    assert len(blocks) == len(re.findall(r"^\S+==", text, re.MULTILINE))
    return {name: version for name, version, _ in blocks}


@pytest.mark.process
def test_the_setup_has_every_package_that_the_program_needs_and_no_tool(
    requirements: dict[str, str],
) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    for requirement in project["dependencies"]:
        name = re.split(r"[^\w.-]", requirement)[0].lower().replace("_", "-")
        assert name in requirements
    assert {"hatchling", "pyinstaller", "macholib", "pefile"}.isdisjoint(requirements)
    assert {"uv", "shiboken6", "flatbuffers"} <= set(requirements)


@pytest.mark.process
def test_open3d_adds_what_the_setup_has_not(written: Path, requirements: dict[str, str]) -> None:
    text = (written / "requirements-open3d.txt").read_text()
    added = set(re.findall(r"^([\w.-]+)==\S+ \\\n +--hash", text, re.MULTILINE))
    assert {"open3d", "dash", "werkzeug"} <= added
    assert added.isdisjoint(requirements)
    assert {"open3d-cpu", "numpy", "pexpect"}.isdisjoint(added)  # Linux; there already; Unix


def test_both_locks_have_the_same_versions() -> None:
    of_program, of_all = (
        set(re.findall(r"^([\w.-]+==\S+)", lock.read_text(), re.MULTILINE))
        for lock in (LOCK, OPEN3D_LOCK)
    )
    assert of_program < of_all


@pytest.mark.process
def test_of_two_versions_it_takes_that_of_its_python(requirements: dict[str, str]) -> None:
    (newer,) = re.findall(
        r"^numpy==(\S+) ; python_full_version >= ", LOCK.read_text(), re.MULTILINE
    )
    assert requirements["numpy"] == newer


def make_wheel(folder: Path, name: str, files: dict[str, str]) -> Path:
    wheel = folder / f"{name}-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for path, text in files.items():
            archive.writestr(path, text)
    return wheel


def test_licences_are_collected_from_wheels(tmp_path: Path) -> None:
    script = runpy.run_path(str(ROOT / "installer/licences.py"))
    wheel = make_wheel(
        tmp_path,
        "good",
        {
            "good-1.0.dist-info/licenses/LICENSE": "the licence",
            "good/vendor/COPYING.txt": "another",
            "good/licence.py": "code",
            "good-1.0.dist-info/licenses/parts/": "",
        },
    )
    script["collect"](tmp_path / "found", script["of_wheels"]([wheel]))
    found = {path.name: path.read_text() for path in (tmp_path / "found/good").iterdir()}
    assert found == {"LICENSE": "the licence", "good-vendor-COPYING.txt": "another"}
    assert (tmp_path / "found/LICENSE").read_text() == (ROOT / "LICENSE").read_text()
    assert "LGPL" in (tmp_path / "found/README.txt").read_text()


def test_a_package_without_a_licence_is_refused(tmp_path: Path) -> None:
    script = runpy.run_path(str(ROOT / "installer/licences.py"))
    wheel = make_wheel(tmp_path, "bad", {"bad/__init__.py": ""})
    with pytest.raises(SystemExit, match="no licence was found of bad"):
        script["collect"](tmp_path / "found", script["of_wheels"]([wheel]))
