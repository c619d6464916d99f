"""The command line as its user meets it: results, exit codes and one line for every error."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from importlib.abc import InspectLoader
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from handcal.cli.main import purpose
from handcal.cli.output import console
from handcal.core.progress import Progress
from handcal.core.types import Alignment
from handcal.io.resources import resource_path
from handcal.lab.bench import run as bench
from handcal.lab.bench.trials import QUICK
from handcal.link.pairing import KEY_VARIABLE
from handcal.rig.example import example_rig
from handcal.session.session import Session
from handcal.station.checks import doctor
from handcal.station.checks.doctor import Finding, Health
from tests.helpers import write_small_rig

# A shell that starts tests in the background has SIGINT ignored, and so would the program.
INTERRUPTIBLE = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from handcal.cli.main import main
from handcal.sim.camera import CAMERA_FAULTS, SyntheticSettings

CAMERA_FAULTS[""] = SyntheticSettings(rate_hz=6.0)  # what costs most is the frames
main()
"""


def test_bench_shows_and_saves_its_figures(
    handcal: Callable[..., None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    figure = {
        "what": "solve",
        "value": 12.3,
        "unit": "ms",
        "target": "≤ 100",
        "met": True,
    }

    def pretend(settings: object, progress: Progress, only: str) -> dict[str, Any]:
        progress.at(0.5, "speed")
        return {"figures": [figure], "quick": settings == QUICK and not only}

    monkeypatch.setattr(bench, "run_bench", pretend)
    handcal("bench", "--quick", "--json", tmp_path / "bench.json")
    assert json.loads((tmp_path / "bench.json").read_text()) == {"figures": [figure], "quick": True}
    shown = capsys.readouterr().out
    assert "50 % speed" in shown
    assert "12.3 ms" in shown


def test_doctor_fails_only_for_what_must_be_mended(
    handcal: Callable[..., None],
    fails: Callable[..., tuple[int, str]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    note = Finding("Camera", Health.LIMITED, "none connected", "plug one in")
    monkeypatch.setattr(doctor, "examine", lambda _rig: [note])
    handcal("doctor")
    assert capsys.readouterr().out == "note     Camera: none connected\n         → plug one in\n"
    problem = Finding("scipy", Health.BROKEN, "not installed", "install it")
    monkeypatch.setattr(doctor, "examine", lambda _rig: [note, problem])
    assert fails("doctor") == (1, "handcal: fix the problems listed above and try again\n")


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        (
            "demo --seed -1",
            "'-1' is not a whole number from 0 to 4294967295; see handcal demo --help",
        ),
        ("demo --loss nan", "'nan' is not a number from 0.0 to 1.0"),
        (
            "demo --eyes three",
            "invalid choice: 'three' (choose from both, each, left, right)",
        ),
        ("segment --color a.png", "required: --depth, --intrinsics, --output"),
        ("headset --port 0", "'0' is not a whole number from 1 to 65535"),
        ("headset", "give --port and a pairing key, or --pair"),
        ("bench --json", "expected one argument"),
        ("bench --only foo", "unknown part 'foo'; choose from speed, peers"),
        ("demo --slipped", "--slipped needs --from SESSION"),
        ("rig board", "no output given"),
        ("rig board --pdf b.pdf --squares 30 30", "too few for 30×30 squares"),
        ("rig board --dictionary FOO --png b.png", "unknown dictionary FOO"),
        ("rig board --marker-mm 30 --png b.png", "0.3 to 0.95 of the squares' side"),
        ("rig make --output x.yaml", "give either --stereo or --factory"),
        ("rig make --factory foo --output x.yaml", "a headset is hololens2:HOST, not foo"),
        ("rig stereo --depth a --headset b --format ros", "ROS camera_info has no pose"),
        ("rig display-check --rig a --output b --viewpoint c", "'c' is not a whole number"),
        ("study procedures --plan foo", "unknown plan 'foo'"),
        ("evaluate cube net --side-mm 5 --pdf x.pdf", "between 10 mm and 1 m"),
        ("evaluate cube capture x --positions a a", "a is named twice"),
        ("evaluate detector", "no photographs to measure"),
        ("evaluate trials x --headset virtual --camera foo", "go together"),
        ("doctor --json it", "unrecognized arguments"),
    ],
)
def test_misuse_is_one_line_and_exit_code_2(
    fails: Callable[..., tuple[int, str]], line: str, problem: str
) -> None:
    code, error = fails(*line.split())
    assert code == 2
    # Python 3.11 quotes the choices, 3.13 does not.
    choices = re.compile(r"\(choose from .*\)")
    assert problem in choices.sub(lambda found: found[0].replace("'", ""), error)


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("segment --color a --depth b --intrinsics c --output d", "cannot read c: No such file"),
        ("solve nowhere", "nowhere is not a session"),
        ("bench --json one_session", "cannot write one_session: it is a folder"),
        ("bench --json one_session/journal.jsonl/a", "journal.jsonl (Not a directory)"),
        ("inspect nowhere --picture one_session", "cannot write one_session: it is a folder"),
        ("evaluate detector one_session", "cannot read one_session/annotations.json"),
        ("prior one_session", "one_session is one session; choose the folder above"),
        ("replay text.txt", "text.txt is not a recording"),
        ("demo --rig text.txt --output out", "text.txt"),
        ("demo --output text.txt", "cannot create the folder text.txt: File exists"),
        ("headset --port 5000", "no pairing key"),
        ("headset --port 5000 --key-file none", "cannot read none"),
        ("support --output out.zip --sessions nowhere", "nowhere is not a folder, so that"),
        (f"solve {'n' * 300}", f"cannot read {'n' * 300}: File name too long"),
        ("headset --port 5000 --key-file text.txt", "has 6 bytes; use at least"),
    ],
)
def test_failure_is_one_line_and_exit_code_1(
    fails: Callable[..., tuple[int, str]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    line: str,
    problem: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv(KEY_VARIABLE, raising=False)
    (tmp_path / "text.txt").write_text("text\n!")
    (tmp_path / "one_session").mkdir()
    (tmp_path / "one_session/journal.jsonl").touch()
    code, error = fails(*line.split())
    assert code == 1
    assert problem in error


def test_a_session_that_cannot_be_solved_says_why(
    fails: Callable[..., tuple[int, str]], tmp_path: Path, alignment: Alignment
) -> None:
    def stored(name: str, *alignments: Alignment, **settings: object) -> Path:
        with Session.create(tmp_path, example_rig(), settings, name=name) as session:
            for each in alignments:
                session.save_alignment(each)
        return session.path

    assert "empty holds no alignment to solve" in fails("solve", stored("empty"))[1]
    few = replace(alignment, cursor_m=alignment.cursor_m[:40], cursor_is_cut=np.zeros(40, bool))
    said = fails("solve", stored("few", few))[1]
    assert "few holds no alignment to solve; " in said
    assert "alignments/1.npz: cursor_m has 40 points" in said
    odd = stored("odd", alignment, calibration={"solve": {"method": "guess"}})
    assert "calibration.solve.method must be one of paper, linear" in fails("solve", odd)[1]


def test_a_session_is_checked_and_repaired(
    handcal: Callable[..., None],
    fails: Callable[..., tuple[int, str]],
    tmp_path: Path,
    simulated: Callable[..., Alignment],
    capsys: pytest.CaptureFixture[str],
) -> None:
    def check(path: Path) -> tuple[int, dict[str, Any]]:
        with pytest.raises(SystemExit) as ended:
            handcal("session", "check", path, "--json", tmp_path / "check.json")
        return int(str(ended.value)), json.loads((tmp_path / "check.json").read_text())

    with Session.create(tmp_path, example_rig(), {}, name="one") as session:
        session.save_alignment(simulated(1))
        session.save_alignment(simulated(2))
    assert check(session.path) == (0, {"state": "sound", "damaged": []})
    (session.path / "alignments/1.npz").write_bytes(b"nothing")
    what, instead = "its checksum is not the journal's", "alignment 1 was left out"
    damaged = {"file": "alignments/1.npz", "line": None, "what": what, "instead": instead}
    assert check(session.path) == (1, {"state": "damaged", "damaged": [damaged]})
    assert f"alignments/1.npz: {what}; {instead}" in capsys.readouterr().out
    code, found = check(tmp_path)
    assert (code, found["state"]) == (2, "none")
    assert capsys.readouterr().out.startswith(f"{tmp_path} is not a session")
    assert "is not a session" in found["damaged"][0]["what"]

    handcal("session", "repair", session.path, "--output", tmp_path / "two")
    assert f"{tmp_path / 'two'}: 1 alignments, 0 trials" in capsys.readouterr().out
    assert check(tmp_path / "two") == (0, {"state": "sound", "damaged": []})
    assert fails("session", "repair", session.path, "--output", tmp_path / "two")[0] == 1
    handcal("export", session.path, "--format", "zip", "--output", tmp_path / "out")
    assert "Left out: the session is damaged: alignments/1.npz" in capsys.readouterr().out


def test_several_sessions_are_exported_together(
    handcal: Callable[..., None],
    fails: Callable[..., tuple[int, str]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    example = resource_path("example_session")
    paths = [shutil.copytree(example, tmp_path / "in" / name) for name in ("a", "b")]
    output = tmp_path / "out"
    handcal("export", *paths, "--output", output, "--format", "csv")
    assert "1 wearer was calibrated (2 sessions, 4 eyes)" in capsys.readouterr().out
    assert sorted(path.name for path in output.iterdir() if path.is_file()) == [
        "parameters.csv",
        "summary.csv",
        "trials.csv",
    ]
    with Session.create(tmp_path, example_rig(), {}, name="empty") as session:
        pass
    code, error = fails("export", *paths, session.path, "--output", output, "--format", "csv")
    assert code == 1
    assert "not exported: empty: it has no alignments" in error
    both = "--format", "northstar", "--into", tmp_path / "config.json"
    assert fails("export", *paths, "--output", output, *both)[0] == 2


@pytest.mark.process
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="writes to /dev/full")
@pytest.mark.parametrize("argument", ["doctor", "--help"])
def test_an_output_that_cannot_be_written_is_one_line(argument: str) -> None:
    with Path("/dev/full").open("wb", buffering=0) as full:
        ended = subprocess.run(
            [sys.executable, "-m", "handcal", argument],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert ended.returncode == 1
    assert ended.stderr == "handcal: cannot write the output: No space left on device\n"


@pytest.mark.process
@pytest.mark.parametrize("name", ["-", "/dev/stdout"])
def test_results_can_be_piped_with_nothing_else(name: str) -> None:
    words = "-m handcal solve --json"
    ended = subprocess.run(
        [sys.executable, *words.split(), name, resource_path("example_session")],
        capture_output=True,
        check=True,
        text=True,
    )
    assert set(json.loads(ended.stdout)["eyes"]) == {"left", "right"}
    assert "φ, mm" in ended.stderr


@pytest.mark.parametrize("width", [20, 40, 80])
def test_a_table_is_whole_at_every_width(
    handcal: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    width: int,
) -> None:
    monkeypatch.setattr(console, "width", width)
    handcal("solve", resource_path("example_session"))
    shown = capsys.readouterr().out
    assert "left    4.2 -4.4 0.9   1.1 1.0 2.5      1.55      97 %      Good" in shown
    assert "…" not in shown


@pytest.mark.process
def test_an_output_without_greek_letters_as_a_file_of_windows_gets_question_marks() -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "handcal", "solve", resource_path("example_session")],
        env=os.environ | {"PYTHONIOENCODING": "cp1252"},
        capture_output=True,
        check=True,
    )
    assert b"?, mm" in ended.stdout
    assert ended.stderr == b""


@pytest.mark.process
def test_opencv_adds_no_line_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "text.txt").write_text("text")
    ended = subprocess.run(
        [sys.executable, "-m", "handcal", "rig", "take", "text.txt", "--output", "out"],
        cwd=tmp_path,
        env={name: value for name, value in os.environ.items() if name != "OPENCV_LOG_LEVEL"}
        | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 1
    assert ended.stderr.startswith("handcal: text.txt ")
    assert ended.stderr.count("\n") == 1


@pytest.mark.process
@pytest.mark.skipif(sys.platform != "linux", reason="looks for the child in /proc")
def test_an_interrupted_demo_leaves_no_headset_and_a_readable_session(tmp_path: Path) -> None:
    rig, runs = write_small_rig(tmp_path / "rig.yaml"), tmp_path / "runs"
    with subprocess.Popen(
        [sys.executable, "-c", INTERRUPTIBLE, "demo", "--rig", rig, "--output", runs],
        env=os.environ | {"OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        try:
            while "wearer aligns" not in process.stdout.readline():
                assert process.poll() is None, process.stderr.read()
            children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            assert len(children) == 1
            os.killpg(process.pid, signal.SIGINT)  # as a terminal does: the headset gets it, too
            assert process.wait(20.0) == 130
            (path,) = runs.iterdir()
            said = f"handcal: cancelled; what was recorded is in {path}\n"
            assert process.stderr.read() == said
        finally:
            process.kill()
    assert not Path("/proc", children[0]).exists()
    record = Session.open(path)
    assert [event.name for event in record.events] == [
        "created", "facts_saved", "facts_saved", "cursor_made",
    ]  # fmt: skip
    assert record.facts.headset is not None
    assert record.torn_bytes == 0
    with Session(path) as session:
        session.record("opened_again")


@pytest.mark.process
@pytest.mark.parametrize(("text", "hint"), [("5000", "; enter 0.0002"), ("-1", "; see")])
def test_a_depth_scale_in_units_per_metre_is_explained(text: str, hint: str) -> None:
    command = "-m handcal segment --color a --depth b --intrinsics c --output d --depth-scale"
    ran = subprocess.run(
        [sys.executable, *command.split(), text], capture_output=True, text=True, check=False
    )
    assert f"{text!r} is not a number from 1e-06 to 0.1{hint}" in ran.stderr


def test_a_packaged_programs_loader_tells_the_purposes(monkeypatch: pytest.MonkeyPatch) -> None:
    """PyInstaller's loader has `get_code`, but is none of Python's classes."""

    def packaged(name: str) -> SimpleNamespace:
        real = find_spec(name)
        assert real is not None
        loader = cast(InspectLoader, real.loader)
        return SimpleNamespace(name=name, loader=SimpleNamespace(get_code=loader.get_code))

    monkeypatch.setattr("handcal.cli.main.find_spec", packaged)
    assert "calibrat" in purpose("demo", "simulate").lower()
