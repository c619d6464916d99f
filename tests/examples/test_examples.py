"""Every example, run from the repository's root as its reader would."""

from __future__ import annotations

import ast
import os
import re
import runpy
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import handcal
from handcal.core.geometry import rigid
from handcal.core.types import Intrinsics
from handcal.sim.ahat import AhatSettings, ahat_rays, sense_distance
from handcal.sim.hand import make_hand
from handcal.sim.render import World, render
from handcal.sim.room import make_room
from tests.camera.hl2ss_server import Hl2ssServer, ahat_payload, calibration_of, packet_of
from tests.helpers import ROOT, write_small_rig, write_thin_session

pytestmark = pytest.mark.process

EXAMPLES = ROOT / "examples"
ELSEWHERE = {"08_headset_client.py": "tests/link/test_headset_example.py"}
"""Run by a test of their own."""
WIDE = Intrinsics(480, 480, 230.0, 230.0, 239.5, 239.5)
HELD_UP = rigid([0.1, 0.1, 0.05], [0.0, 0.02, 0.5])


# What costs most is the frames.
SLOWLY = """
import runpy, sys
from handcal.sim.camera import CAMERA_FAULTS, SyntheticSettings
CAMERA_FAULTS[""] = SyntheticSettings(rate_hz=6.0)
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def run_apart(name: str, *words: object, code: int = 0, slowly: bool = False) -> str:
    """Run an example in a process of its own, on request before a slow simulated camera."""
    done = subprocess.run(
        [sys.executable, *(["-c", SLOWLY] if slowly else []), EXAMPLES / name, *map(str, words)],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8"},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert done.returncode == code, done.stderr
    return done.stdout if code == 0 else done.stderr


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run an example in this process, as most cost less than the start of another."""

    def run(name: str, *words: object) -> str:
        monkeypatch.chdir(ROOT)
        monkeypatch.setattr(sys, "argv", [name, *map(str, words)])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out

    return run


def numbers(pattern: str, text: str) -> list[float]:
    return [float(found) for found in re.findall(pattern, text)]


def test_a_session_is_solved() -> None:
    said = run_apart("01_solve_a_session.py")
    (left,) = re.findall("^left: φ = (.* mm); rms (.*) mm", said, re.MULTILINE)
    expected = [4.20, 1.14, -4.39, 0.96, 0.91, 2.54, 1.55]
    assert numbers(r"([+-]?[\d.]+)", " ".join(left)) == pytest.approx(expected, abs=0.05)
    assert "right: accept: The expected error" in said
    assert "Unity's projection, right eye:" in said


def test_a_simulated_frame_is_segmented(run: Callable[..., str], tmp_path: Path) -> None:
    said = run("02_segment_a_frame.py", "--output", tmp_path)
    assert "median depth 0.48" in said
    assert {"hand.ply", "mask.png", "overlay.png", "hand.json", "frame"} == {
        path.name for path in tmp_path.iterdir()
    } - {"contour.ply"}


def test_methods_are_compared(run: Callable[..., str], tmp_path: Path) -> None:
    said = run("03_compare_methods.py", "--session", write_thin_session(tmp_path))
    rows = [line.split() for line in said.splitlines()[2:]]
    assert [row[:2] for row in rows] == [
        [method, eye]
        for method in ("paper", "linear", "consistent", "icp")
        for eye in ("left", "right")
    ]
    assert [float(row[6]) for row in rows if row[0] == "consistent"] == [0.0, 0.0]


def test_wearers_are_simulated(run: Callable[..., str]) -> None:
    said = run("04_simulate_wearers.py", "--wearers", 3)
    before, after = numbers(r"error ([\d.]+)′ before", said), numbers(r"([\d.]+)′ after", said)
    assert len(before) == 3
    assert sum(after) < sum(before)


def test_a_rig_is_built(run: Callable[..., str], tmp_path: Path) -> None:
    said = run("05_build_a_rig.py", "--output", tmp_path, "--views", 8)
    assert "left display: good" in said
    assert "right display: good" in said
    assert all(arcmin < 10.0 for arcmin in numbers(r"elsewhere differs .* by ([\d.]+) ′", said))
    assert set(handcal.read_rig(tmp_path / "rig.yaml").origins) == {"T_H_D", "left", "right"}


@pytest.mark.flaky(reruns=1)  # the wearer lives in real time
def test_a_station_is_driven(tmp_path: Path) -> None:
    said = run_apart("06_drive_a_station.py", "--output", tmp_path, slowly=True)
    assert "consistent, 1 alignment: left φ = (" in said
    assert said.endswith("applied: True, finished: True\n")
    (folder,) = tmp_path.iterdir()
    assert len(handcal.open_session(folder).alignments) == 1


def test_a_figure_is_plotted(run: Callable[..., str], tmp_path: Path) -> None:
    run("07_plot_a_report_figure.py", "--output", tmp_path / "new/figure.png")
    assert (tmp_path / "new/figure.png").read_bytes().startswith(b"\x89PNG")


def test_a_hololens_shows_a_hand_in_the_world(run: Callable[..., str]) -> None:
    depth_m, _ = render(World(make_hand(1), make_room(1)), np.eye(4), HELD_UP, WIDE)
    images = sense_distance(
        depth_m, np.full_like(depth_m, 0.5), WIDE, np.random.default_rng(0), AhatSettings()
    )
    packet = packet_of(1, ahat_payload(*images), rigid(translation_m=[1.0, 2.0, 3.0]))
    with Hl2ssServer(calibration_of(ahat_rays(), np.eye(4)), lambda: packet) as server:
        said = run("10_hololens2.py", "127.0.0.1", "--port", server.port, "--frames", 2)
    assert said.count("camera at [1000. 2000. 3000.] mm; hand at [") == 2
    (x_mm, y_mm, z_mm) = numbers(r"(-?\d+)\.", said.rpartition("hand at [")[2])
    assert (x_mm, y_mm, z_mm) == pytest.approx((1000.0, 2000.0, 3490.0), abs=40.0)


@pytest.mark.parametrize(
    ("name", "words", "message"),
    [
        ("01_solve_a_session.py", ("--session", "MISSING"), "is not a session; choose the folder"),
        ("02_segment_a_frame.py", ("--frame", *3 * ["MISSING"]), "cannot read"),
        ("05_build_a_rig.py", ("--output", "FILE"), "cannot create the folder"),
        ("07_plot_a_report_figure.py", ("--session", "MISSING"), "is not a session; choose the"),
    ],
)
def test_a_wrong_path_is_one_line(
    name: str,
    words: tuple[str, ...],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "FILE").write_text("no folder")
    places = [str(tmp_path / word) if word[:2] != "--" else word for word in words]
    monkeypatch.setattr(sys, "argv", [name, *places])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    error = capsys.readouterr().err
    assert ended.value.code == 1
    assert message in error
    assert error.count("\n") == 1


def test_every_example_is_run_and_has_a_docstring_and_a_main() -> None:
    tested = Path(__file__).read_text(encoding="utf-8")
    names = sorted(path.name for path in EXAMPLES.glob("*.py"))
    assert len(names) == 10
    for name in names:
        if name in ELSEWHERE:
            assert name in (ROOT / ELSEWHERE[name]).read_text(encoding="utf-8")
        else:
            assert re.search(rf'run(_apart)?\(\s*"{name}"', tested)
        tree = ast.parse((EXAMPLES / name).read_text(encoding="utf-8"))
        assert ast.get_docstring(tree)
        assert any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body)


def test_a_calibration_is_followed_by_bridges(tmp_path: Path) -> None:
    pytest.importorskip("pylsl")
    pytest.importorskip("pyigtl")
    rig = write_small_rig(tmp_path / "rig.yaml")
    words = ("--sessions", tmp_path, "--rig", rig, "--port", 47947)
    said = run_apart("09_bridges.py", *words, slowly=True)
    assert '"event":"session"' in said
    events = re.findall(r'"event":"(\w+)"', said)
    assert events.count("confirmed") == 1
    assert events.count("solved") == 2
    assert events.index("confirmed") < events.index("solved")
    assert events[events.index("solved") :].count("applied") == 2
