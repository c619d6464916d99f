"""The Unity package: it compiles against Unity's interface, and its files belong together."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

from handcal import __version__
from tests.headset.conftest import PACKAGE, Ask
from tests.helpers import ROOT

SAMPLE = PACKAGE / "Samples~/Calibration"
WINDOWS = (
    "HANDCAL_OPENXR_TIME;HANDCAL_MSFT_QR;"
    "UNITY_WSA;ENABLE_LEGACY_INPUT_MANAGER;UNITY_2020_2_OR_NEWER"
)
ANDROID = "UNITY_ANDROID"
EDITOR = "UNITY_EDITOR;UNITY_2020_2_OR_NEWER"
_GUID = re.compile(r"^guid: ([0-9a-f]{32})$", re.MULTILINE)


@pytest.mark.process
@pytest.mark.parametrize("defines", [WINDOWS, ANDROID, EDITOR])
def test_components_and_samples_compile_against_unity(
    compiled: Callable[..., Path], tmp_path: Path, defines: str
) -> None:
    link = compiled("Handcal.Link.dll", PACKAGE / "Runtime/Link")
    unity = compiled("UnityEngine.dll", ROOT / "tests/headset/stubs")
    uses = [f"-r:{link}", f"-r:{unity}", f"-define:{defines}"]
    inside = ("Runtime", "Runtime/MixedReality", "Runtime/OpenXR", "Editor")
    parts = [*(PACKAGE / one for one in inside), SAMPLE]
    sources = sorted(source for part in parts for source in part.glob("*.cs"))
    command = ["mcs", "-langversion:7", "-warn:4", "-warnaserror", "-target:library", *uses]
    command += [f"-out:{tmp_path / 'package.dll'}", *map(str, sources)]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr


def test_every_file_has_a_guid_of_its_own() -> None:
    files = [path for path in PACKAGE.rglob("*") if _is_asset(path)]
    guids = [_guid(path) for path in files]
    assert len(files) > 30
    assert len(set(guids)) == len(guids)
    for meta in PACKAGE.rglob("*.meta"):
        assert meta.with_suffix("").exists(), f"{meta} is of no file"


def test_the_scene_holds_what_it_refers_to() -> None:
    scene = (SAMPLE / "Calibration.unity").read_text()
    objects = set(re.findall(r"^--- !u!\d+ &(\d+)$", scene, re.MULTILINE))
    own = set(re.findall(r"\{fileID: (\d+)\}", scene)) - {"0"}
    assert own == objects
    scripts = {
        _guid(path): path.stem for path in [*PACKAGE.rglob("Runtime/*.cs"), *SAMPLE.glob("*.cs")]
    }
    used = {
        scripts[guid]: fields
        for guid, fields in re.findall(r"guid: (\w+), type: 3\}\n((?:  .*\n)*)", scene)
    }
    assert sorted(used) == ["FollowHead", "HandcalHeadset", "PairByTyping"]
    source = (PACKAGE / "Runtime/HandcalHeadset.cs").read_text()
    serialized = re.findall(r"^  ([a-z]\w+): ?", used["HandcalHeadset"], re.MULTILINE)
    public = re.findall(
        r"^        public (?:string|float|bool) (\w+)(?: =|;)", source, re.MULTILINE
    )
    assert serialized[1:] == public  # after m_Name


def test_the_manifest() -> None:
    manifest = json.loads((PACKAGE / "package.json").read_text())
    assert manifest["name"] == PACKAGE.name
    assert manifest["version"] == __version__
    # Unity's own module of XRDisplaySubsystem; a project may lack it.
    assert set(manifest["dependencies"]) == {"com.unity.modules.xr"}
    for sample in manifest["samples"]:
        assert (PACKAGE / sample["path"]).is_dir()
    link = json.loads((PACKAGE / "Runtime/Link/Handcal.Link.asmdef").read_text())
    assert link["noEngineReferences"] is True
    runtime = json.loads((PACKAGE / "Runtime/Handcal.Headset.asmdef").read_text())
    assert runtime["references"] == [link["name"]]


@pytest.mark.process
def test_a_build_keeps_what_is_made_by_name(ask: Ask) -> None:
    link = ElementTree.parse(PACKAGE / "Editor/link.xml")
    kept = {one.get("fullname") for one in link.iter("type")}
    assert set(ask("made").split()) == kept


def test_nothing_waits_for_another_thread() -> None:
    """Unity's main thread draws; all that takes its time is on a thread of its own."""
    for path in PACKAGE.rglob("*.cs"):
        assert not re.search(r"thread\.Join|\.(Wait|WaitOne|WaitAll|Result)", path.read_text()), (
            path
        )


def test_the_link_uses_neither_unity_nor_packages() -> None:
    for path in (PACKAGE / "Runtime/Link").glob("*.cs"):
        used = re.findall(r"^using ([\w.]+);", path.read_text(), re.MULTILINE)
        assert all(name.split(".")[0] == "System" for name in used), path


def _is_asset(path: Path) -> bool:
    inside = path.relative_to(PACKAGE).parts
    return path.suffix != ".meta" and inside[0] != "Documentation~" and inside != ("Samples~",)


def _guid(path: Path) -> str:
    (guid,) = _GUID.findall(path.with_name(f"{path.name}.meta").read_text())
    return str(guid)
