"""A command writes into its output and the configuration, and nowhere else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.geometry import rigid
from handcal.io.configuration import configuration_folder
from handcal.io.resources import resource_path
from handcal.link.pairing import KEY_VARIABLE, new_pairing_key
from handcal.sim.camera import SyntheticCamera
from handcal.sim.hand import make_hand
from handcal.sim.render import World
from handcal.sim.room import make_room
from handcal.sim.scene import SceneState
from tests.cli.test_surface import leaves
from tests.helpers import FOLDERS, SILENCERS, write_small_rig

pytestmark = pytest.mark.process

EXAMPLE = resource_path("example_session")


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


COMMANDS = {
    "demo": "--alignments 1 --output OUTPUT --rig SMALL",
    "segment": "PICTURE --output OUTPUT",
    "solve": "SESSION --json OUTPUT/solved.json",
    "export": "SESSION --output OUTPUT",
    "inspect": "SESSION --picture OUTPUT/view.png",
    "prior": ".",
    "openxr use": "SESSION",
    "openxr status": "",
    "openxr remove": "",
    "session check": "SESSION --json OUTPUT/checked.json",
    "session repair": "SESSION --output OUTPUT/repaired",
    "record": "OUTPUT/recording --source simulator --frames 2",
    "headset": "--port 49152 --duration-s 0.5",
    "rig board": "--pdf OUTPUT/board.pdf --png OUTPUT/board.png",
    "rig gray": "--display 200 100 --output OUTPUT/gray",
    "rig grid": "--png OUTPUT/grid.png",
    "rig check": "RIG --json OUTPUT/checked.json",
    "rig compare": "RIG RIG",
    "rig display-check": "--headset virtual --rig RIG --output OUTPUT/rig.yaml",
    "rig simulate": "OUTPUT/images --views 3",
    "evaluate cube net": "--pdf OUTPUT/net.pdf --cube OUTPUT/cube.json",
    "evaluate cube simulate": "OUTPUT/captures --poses 1",
    "evaluate users": "SESSION --output OUTPUT",
    "study noise": "--quick --workers 2 --output OUTPUT",
    "study methods": "--quick --workers 1 --output OUTPUT",
    "study procedures": "--wearers 2 --workers 1 --plan paper --output OUTPUT",
    "bench": "--quick --json OUTPUT/bench.json",
    "doctor": "",
    "devices": "",
    "support": "--output OUTPUT/support.zip",
    "run": "--headset virtual --camera simulator --rig SMALL --output OUTPUT",
}
SLOW = {
    "study noise", "study methods", "study procedures", "bench", "evaluate cube simulate",
    "rig simulate", "run",  # as demo
}  # fmt: skip
NEED_MORE = {
    "replay", "evaluate cube capture", "evaluate cube report", "evaluate detector",
    "study recorded", "rig take", "rig camera", "rig stereo", "rig convert", "rig display",
    "rig make", "rig depth", "rig accept", "evaluate segmentation", "evaluate cube track",
    "evaluate trials", "pair", "openxr install", "openxr client",
}  # fmt: skip
"""Commands whose input would have to be made first; they write as those above.

``openxr install`` also writes where OpenXR looks for layers: tests/export/test_openxr.py."""


def test_every_command_is_tried_or_named() -> None:
    assert {words for words, _ in leaves()} == COMMANDS.keys() | NEED_MORE


_DRIVER = """
import contextlib, io, json, sys
from handcal.cli.main import main
from handcal.sim.camera import CAMERA_FAULTS, SyntheticSettings

CAMERA_FAULTS[""] = SyntheticSettings(rate_hz=6.0)  # what costs most is the frames

for command, words in json.loads(sys.stdin.read()).items():
    sys.argv, code = ["handcal", *words], 0
    with contextlib.redirect_stderr(io.StringIO()) as said, contextlib.redirect_stdout(said):
        try:
            main()
        except SystemExit as end:
            code = end.code
    print(json.dumps([command, code, said.getvalue()]), flush=True)
"""


@pytest.fixture
def small_rig(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(write_small_rig(tmp_path_factory.mktemp("rig") / "rig.yaml"))


def check(commands: set[str], picture: list[str], small_rig: str, tmp_path: Path) -> None:
    """Run commands one after the other in a process apart; each has a folder for its output."""
    rig = str(resource_path("example_rig.yaml"))
    inputs = {"SESSION": [str(EXAMPLE)], "RIG": [rig], "PICTURE": picture, "SMALL": [small_rig]}
    outputs = {name: tmp_path / "output" / name for name in sorted(commands)}
    words = {name: name.split() for name in outputs}
    for name, output in outputs.items():
        output.mkdir(parents=True)
        for word in COMMANDS[name].split():
            words[name] += inputs.get(word, [word.replace("OUTPUT", str(output))])
    run = run_apart([_DRIVER], tmp_path, "-c", json.dumps(words))
    assert run.returncode == 0, run.stderr
    ended = {name: (code, said) for name, code, said in map(json.loads, run.stdout.splitlines())}
    assert ended.keys() == commands
    assert {name: said for name, (code, said) in ended.items() if code} == {}
    for name, output in outputs.items():
        assert bool(list(output.iterdir())) == ("OUTPUT" in COMMANDS[name]), name


def test_commands_write_nothing_but_their_output(
    picture: list[str], small_rig: str, tmp_path: Path
) -> None:
    absent = {"inspect"} if find_spec("open3d") is None else set()
    check(COMMANDS.keys() - SLOW - absent, picture, small_rig, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("command", sorted(SLOW))
def test_a_slow_command_writes_nothing_but_its_output(
    command: str, picture: list[str], small_rig: str, tmp_path: Path
) -> None:
    check({command}, picture, small_rig, tmp_path)


@pytest.mark.slow
def test_the_window_writes_nothing_but_its_output(tmp_path: Path) -> None:
    pytest.importorskip("PySide6.QtWidgets")
    words = ["handcal_gui", "--autopilot", "--output", str(tmp_path / "output")]
    run = run_apart(words, tmp_path)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("module", ["handcal.hand.shipped", "handcal.train.export"])
def test_telemetry_is_off_before_onnxruntime_is_imported(module: str, tmp_path: Path) -> None:
    if module.startswith("handcal.train"):
        pytest.importorskip("torch")
        pytest.importorskip("onnx")
    code = (
        f"import os, runpy, sys\nimport {module}\n"
        "from handcal.hand.shipped import load_detector\nload_detector()\n"
        "assert os.environ['ORT_DISABLE_TELEMETRY'] == '1'"
    )
    assert run_apart([code], tmp_path, "-c").returncode == 0


def run_apart(
    words: list[str], tmp_path: Path, option: str = "-m", stdin: str | None = None
) -> subprocess.CompletedProcess[str]:
    """Run Python with folders of the user of its own; nothing may appear but output and config."""
    environment = {name: value for name, value in os.environ.items() if name not in SILENCERS}
    environment.pop("MPLCONFIGDIR", None)
    environment |= {name: str(tmp_path / folder) for name, folder in FOLDERS.items()}
    environment |= {"QT_QPA_PLATFORM": "offscreen", KEY_VARIABLE: new_pairing_key()}
    for folder in (*FOLDERS.values(), "here", "output"):
        (tmp_path / folder).mkdir(exist_ok=True)
    if path := environment.get("PYTHONPATH"):
        environment["PYTHONPATH"] = os.pathsep.join(
            str(Path(entry).absolute()) for entry in path.split(os.pathsep)
        )
    run = subprocess.run(
        [sys.executable, option, *words],
        input=stdin, cwd=tmp_path / "here", env=environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    written = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    elsewhere = {name for name in written if not name.startswith(("output/", "config/handcal/"))}
    assert elsewhere == set()
    return run


def test_the_configuration_is_where_qt_keeps_it(monkeypatch: pytest.MonkeyPatch) -> None:
    core = pytest.importorskip("PySide6.QtCore")
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    name = core.QCoreApplication.applicationName()
    core.QCoreApplication.setApplicationName("handcal")
    kind = core.QStandardPaths.StandardLocation.AppConfigLocation
    found = Path(core.QStandardPaths.writableLocation(kind))
    core.QCoreApplication.setApplicationName(name)
    assert configuration_folder() == found
