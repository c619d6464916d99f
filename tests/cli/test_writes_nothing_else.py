"""A command writes into its output and the configuration, and nowhere else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.geometry import rigid
from handcal.io.configuration import configuration_folder
from handcal.io.resources import resource_path
from handcal.sim.camera import SyntheticCamera
from handcal.sim.hand import make_hand
from handcal.sim.render import World
from handcal.sim.room import make_room
from handcal.sim.scene import SceneState
from tests.helpers import write_small_rig

pytestmark = pytest.mark.process

EXAMPLE = resource_path("example_session")
FOLDERS = {
    "HOME": "home",
    "XDG_CACHE_HOME": "cache",
    "XDG_CONFIG_HOME": "config",
    "XDG_DATA_HOME": "data",
    "XDG_STATE_HOME": "state",
}
# Their own telemetry is off where one of these is set, and pytest may run where it is.
SILENCERS = "CI", "ORT_DISABLE_TELEMETRY", "ORT_TELEMETRY_DISABLED", "ORT_RUNNING_UNIT_TESTS"


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The arguments of ``segment`` for one image of a simulated hand."""
    folder = tmp_path_factory.mktemp("picture")
    still = SceneState(0, np.eye(4), rigid([0.1, 0.1, 0.05], [0.0, 0.02, 0.5]))
    frame = SyntheticCamera(World(make_hand(1), make_room(1)), lambda: still, seed=1).read()
    assert frame.color is not None
    cv2.imwrite(str(folder / "color.png"), frame.color[..., ::-1])
    cv2.imwrite(str(folder / "depth.png"), frame.depth)
    names = ("width", "height", "fx", "fy", "cx", "cy")
    camera = {name: getattr(frame.depth_intrinsics, name) for name in names}
    camera["depth_scale"] = frame.depth_scale_m
    (folder / "camera.json").write_text(json.dumps(camera))
    files = {"--color": "color.png", "--depth": "depth.png", "--intrinsics": "camera.json"}
    return [word for option, name in files.items() for word in (option, str(folder / name))]


@pytest.mark.parametrize("command", ["segment", "demo", "solve", "export", "doctor"])
def test_a_command_writes_nothing_but_its_output(
    command: str, picture: list[str], tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    output = tmp_path / "output"
    rig = write_small_rig(tmp_path_factory.mktemp("rig") / "rig.yaml")
    words = {
        "segment": ["segment", *picture, "--output", str(output)],
        "demo": ["demo", "--alignments", "1", "--output", str(output), "--rig", str(rig)],
        "solve": ["solve", str(EXAMPLE)],
        "export": ["export", str(EXAMPLE), "--output", str(output)],
        "doctor": ["doctor"],
    }[command]
    environment = {name: value for name, value in os.environ.items() if name not in SILENCERS}
    environment.pop("MPLCONFIGDIR", None)
    environment |= {name: str(tmp_path / folder) for name, folder in FOLDERS.items()}
    for folder in (*FOLDERS.values(), "here"):
        (tmp_path / folder).mkdir()
    if path := environment.get("PYTHONPATH"):
        environment["PYTHONPATH"] = os.pathsep.join(
            str(Path(entry).absolute()) for entry in path.split(os.pathsep)
        )
    run = subprocess.run(
        [sys.executable, "-m", "handcal", *words],
        cwd=tmp_path / "here", env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert output.exists() == (command in ("segment", "demo", "export"))
    written = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    elsewhere = {name for name in written if not name.startswith(("output/", "config/handcal/"))}
    assert elsewhere == set()


def test_the_configuration_is_where_qt_keeps_it(monkeypatch: pytest.MonkeyPatch) -> None:
    core = pytest.importorskip("PySide6.QtCore")
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    name = core.QCoreApplication.applicationName()
    core.QCoreApplication.setApplicationName("handcal")
    kind = core.QStandardPaths.StandardLocation.AppConfigLocation
    found = Path(core.QStandardPaths.writableLocation(kind))
    core.QCoreApplication.setApplicationName(name)
    assert configuration_folder() == found
