"""The wheel: it carries what Help opens, and stays small."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from tests.helpers import ROOT

LARGEST_BYTES = 20 * 2**20


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (made,) = folder.glob("*.whl")
    return made


@pytest.mark.process
def test_it_carries_manual_protocol_examples_and_unity_package(wheel: Path) -> None:
    assert wheel.stat().st_size <= LARGEST_BYTES
    with zipfile.ZipFile(wheel) as archive:
        carried = {
            name.removeprefix("handcal/_resources/")
            for name in archive.namelist()
            if name.startswith("handcal/_resources/")
        }
    for pattern in ("docs/*.md", "docs/pictures/*", "examples/*.py", "docs/protocol_vectors.json"):
        wanted = {path.relative_to(ROOT).as_posix() for path in ROOT.glob(pattern)}
        assert wanted
        assert wanted <= carried
        assert any(name.endswith("/completions/handcal") for name in archive.namelist())
    tools = {name for name in carried if re.fullmatch(r"docs/.*\.(py|sh|js)", name)}
    assert tools == {"docs/drawings.py"}  # of the tutorial; the others are of use in a checkout
    layer = ROOT / "resources/openxr"  # sources, and what has been built of them
    assert {f"openxr/{path.name}" for path in layer.glob("*.*")} <= carried
    unity = ROOT / "resources/unity"
    scripts = {f"unity/{path.relative_to(unity).as_posix()}" for path in unity.rglob("*.cs")}
    assert scripts
    assert scripts <= carried
    assert {"THIRD-PARTY.md", "CONTRIBUTING.md", "handcal/link/handcal.proto"} <= carried


def test_the_version_is_the_same_everywhere() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    package = json.loads((ROOT / "resources/unity/com.handcal.headset/package.json").read_text())
    citation = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert citation is not None
    assert package["version"] == citation[1] == version
