"""The demonstration: a real run over a bad link with the headset in a process of its own."""

from __future__ import annotations

import contextlib
import io
import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from handcal.cli.main import main, parse
from handcal.cli.simulate import meanings
from handcal.cli.terminal import settings_of
from handcal.core.display import reprojection_arcmin
from handcal.core.geometry import rigid
from handcal.core.types import EYES, Eye, EyeDistance, VerdictName
from handcal.lab.demo import DemoSettings, measure_eye_distance
from handcal.register.benefit import DISTANCES_M
from handcal.register.prior import eye_position_m
from handcal.register.results import USED
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.rig.example import Z_E_S_M, example_rig
from handcal.session.session import Session
from handcal.sim.wearer import draw_eyes
from handcal.sim.wearer_settings import WearerSettings
from tests.helpers import slow_simulator, write_small_rig

SEED = 3

pytestmark = pytest.mark.process


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("demo")


@dataclass(frozen=True)
class Run:
    """A demonstration's exit code and what it printed."""

    code: object
    out: str
    err: str


def demonstrate(folder: Path, options: str) -> Run:
    """Run ``handcal demo`` in a folder, with a small and slow camera."""
    write_small_rig(folder / "rig.yaml")
    out, err, code = io.StringIO(), io.StringIO(), None
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        slow_simulator(patch)
        patch.chdir(folder)
        patch.setattr(sys, "argv", ["handcal", "demo", "--rig", "rig.yaml", *options.split()])
        try:
            main()
        except SystemExit as end:
            code = end.code
    return Run(code, out.getvalue(), err.getvalue())


@pytest.fixture(scope="module")
def run(folder: Path) -> Run:
    options = f"--seed {SEED} --eyes each --loss 0.3 --reorder 0.2 --eye-distance headset"
    return demonstrate(folder, f"{options} --output runs --json new/it.json")


@pytest.fixture(scope="module")
def result(run: Run, folder: Path) -> dict[str, Any]:
    assert run.code is None, run.err
    found: dict[str, Any] = json.loads((folder / "new" / "it.json").read_text())
    return found


@pytest.fixture(scope="module")
def session(result: dict[str, Any], folder: Path) -> Path:
    return folder / str(result["session"])


def test_every_promised_key_is_there(result: dict[str, Any]) -> None:
    assert result["seed"] == SEED
    assert set(result["eyes"]) == set(EYES)
    for eye in result["eyes"].values():
        for triple in ("shift_mm", "true_shift_mm", "sigma_mm"):
            assert np.shape(eye[triple]) == (3,)
        assert eye["verdict"] in ("accept", "repeat", "keep")
        assert eye["evidence"] == []
        assert eye["reason"]
        off_mm = np.subtract(eye["shift_mm"], eye["true_shift_mm"])
        assert eye["error_mm"] == pytest.approx(np.linalg.norm(off_mm))
        assert set(eye["depth"]) == {"before_m", "without_m", "after_m", "probability_better"}
        assert [one["distance_m"] for one in eye["by_distance"]] == list(DISTANCES_M)
    assert set(result["reprojection_arcmin"]) == {"before", "begun", "after", "drawn"}
    for name, arcmin in result["reprojection_arcmin"].items():
        of_eyes = [eye["reprojection_arcmin"][name] for eye in result["eyes"].values()]
        assert arcmin == pytest.approx(np.mean(of_eyes))
    assert result["plan"] == "paper"
    assert result["seconds"] > 0.0
    assert set(result["guard"]) == {"rejected", "accepted_deg"}
    assert set(result["link"]) == {"sent", "lost", "acked", "given_up", "projection_acked"}
    assert result["link"]["projection_acked"] == {"left": True, "right": True}
    assert result["alignments"] == 2
    assert set(result["timing_ms"]) == {"segment", "guard", "solve_both_eyes"}
    assert all(value > 0.0 for value in result["timing_ms"].values())


def test_the_result_is_as_good_as_it_says(result: dict[str, Any]) -> None:
    truth_m = draw_eyes(np.random.default_rng(SEED), WearerSettings())
    for name in EYES:
        eye = result["eyes"][name]
        np.testing.assert_allclose(eye["true_shift_mm"], 1e3 * truth_m[name])
        off_mm = np.abs(np.subtract(eye["shift_mm"], eye["true_shift_mm"]))
        assert (off_mm < 5.0 * np.array(eye["sigma_mm"])).all()
    error = result["reprojection_arcmin"]
    assert error["after"] < max(error["before"], 8.0)
    assert 0.0 <= result["guard"]["accepted_deg"] <= 9.0


def test_the_headset_s_eye_distance_was_used(
    run: Run, result: dict[str, Any], session: Path
) -> None:
    found = result["eye_distance"]
    assert found["used"]["source"] == "headset"
    # Given to the headset in millimetres.
    assert found["used"]["value_m"] == pytest.approx(_measure(SEED).value_m)
    assert EyeDistance(**found["used"]) == Session.open(session).facts.eye_distance
    assert "mm (headset)" in run.out
    errors_m = [_measure(seed).value_m - _true_m(seed) for seed in range(200)]
    assert np.std(errors_m) == pytest.approx(0.001, rel=0.15)
    assert np.mean(errors_m) == pytest.approx(0.0, abs=0.0003)


def _measure(seed: int) -> EyeDistance:
    return measure_eye_distance(seed, example_rig())


def _true_m(seed: int) -> float:
    left_m, right_m = (
        eye_position_m(example_rig().eyes[eye], shift_m)
        for eye, shift_m in draw_eyes(np.random.default_rng(seed), WearerSettings()).items()
    )
    return float(np.linalg.norm(right_m - left_m))


def test_the_link_was_bad_and_everything_arrived(result: dict[str, Any], session: Path) -> None:
    assert result["link"]["lost"] > 10  # their share depends on how busy the machine is
    events = [(event.name, event.data) for event in Session.open(session).events]
    assert [data["eyes"] for name, data in events if name == "applied"] == [
        ["left"],
        ["left", "right"],
    ]
    assert events[-1] == ("finished", {})
    name, link = events[-2]
    assert name == "link"
    assert (link["unacked"], link["failed"]) == (0, 0)
    # Cursor, prompt and projections of two alignments.
    assert link["acked"] == result["link"]["acked"] >= 7


def test_the_session_is_solved_again_to_the_last_bit(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    again = tmp_path / "again.json"
    before = {path: path.read_bytes() for path in session.rglob("*") if path.is_file()}
    monkeypatch.setattr(sys, "argv", ["handcal", "solve", str(session), "--json", str(again)])
    main()
    assert again.read_bytes() == (session / "results.json").read_bytes()
    assert {path: path.read_bytes() for path in session.rglob("*") if path.is_file()} == before


def test_the_reprojection_error_is_that_of_the_true_eyes() -> None:
    rig = example_rig()
    still_m: dict[Eye, np.ndarray] = {eye: np.zeros(3) for eye in EYES}
    aside_m: dict[Eye, np.ndarray] = {eye: np.array([0.004, 0.0, 0.0]) for eye in EYES}
    assert reprojection_arcmin(rig, aside_m, aside_m) == pytest.approx(0.0, abs=1e-9)
    # An eye 4 mm aside sees a target at depth z off by 4 mm (1/z - 1/2 m), in radians.
    expected = [np.arctan(0.004 * (1.0 / z - 1.0 / Z_E_S_M)) for z in (0.4, 0.5, 0.6)]
    expected_arcmin = 60.0 * np.degrees(np.mean(expected))
    assert reprojection_arcmin(rig, still_m, aside_m) == pytest.approx(expected_arcmin, rel=0.02)


def test_a_wrong_rig_is_judged_by_the_true_eyes() -> None:
    worn = example_rig()
    # The rig takes C0 for 1 mm aside of where it is: eyes and target are told from there.
    aside_m = np.array([0.001, 0.0, 0.0])
    eyes = {
        eye: replace(display, t_C0_V_m=display.t_C0_V_m + aside_m)
        for eye, display in worn.eyes.items()
    }
    rig = replace(worn, eyes=eyes)
    true_m: dict[Eye, np.ndarray] = {eye: np.array([0.002, -0.001, 0.003]) for eye in EYES}
    same_m: dict[Eye, np.ndarray] = {eye: shift_m + aside_m for eye, shift_m in true_m.items()}
    # The same eye, but the display is taken for 1 mm aside as well: 1 mm at 2 m, 1.7 arcmin.
    assert reprojection_arcmin(rig, same_m, true_m, worn) == pytest.approx(1.72, rel=0.02)
    # A target tracked 1 mm aside is drawn aside.
    T_H_D = rigid(None, aside_m) @ worn.T_H_D
    expected = 60.0 * np.degrees(np.mean([0.001 / z for z in (0.4, 0.5, 0.6)]))
    moved = reprojection_arcmin(replace(worn, T_H_D=T_H_D), true_m, true_m, worn)
    assert moved == pytest.approx(expected, rel=0.02)


def test_every_option_reaches_the_demonstration() -> None:
    line = (
        "demo --seed 7 --plan recommended --alignments 2 --eyes each --no-verify --from a "
        "--slipped --hand left --loss 0.1 --reorder 0.2 --worn-rig b --fault late-camera "
        "--sensor ahat --fatten-px 2 --known-fat --eye-distance ruler"
    )
    expected = DemoSettings(
        *(7, "recommended", 2, "each", False, "a", True, "left", 0.1, 0.2, "b", "late-camera"),
        *("ahat", 2.0, True, "ruler"),
    )
    assert settings_of(DemoSettings, parse(line.split())) == expected
    assert settings_of(DemoSettings, parse(["demo"])) == DemoSettings()


@pytest.mark.parametrize("verdict", get_args(VerdictName))
@pytest.mark.parametrize(
    "settings",
    [
        DemoSettings(seed=5),
        DemoSettings(plan="recommended"),
        DemoSettings(plan="recommended", eye_distance="ruler"),
        DemoSettings(fault="frozen-camera"),
    ],
    ids=lambda settings: f"{settings.plan}-{settings.eye_distance}{settings.fault}",
)
def test_each_verdict_says_whether_it_is_drawn_and_what_to_try(
    verdict: VerdictName, settings: DemoSettings
) -> None:
    (said,) = meanings({"left": verdict, "right": verdict}, settings, "results/one")
    assert said.startswith(f"Both eyes, {VERDICT_WORDS[verdict]}: ")
    assert ("headset draws with this result" in said) == (verdict in USED)
    _, command = said.rsplit(": handcal ", 1)
    tried = parse(command.split())
    if verdict == "accept":
        assert [str(one) for one in tried.session] == ["results/one"]
    elif verdict == "repeat":
        assert (tried.plan, tried.eye_distance) != (settings.plan, settings.eye_distance) or (
            tried.seed != settings.seed
        )
    assert not getattr(tried, "fault", None)


def test_eyes_with_different_verdicts_are_told_apart() -> None:
    said = meanings({"left": "keep", "right": "accept"}, DemoSettings(), "results/one")
    assert [one.partition(":")[0] for one in said] == [
        "The left eye, No better than before",
        "The right eye, Good",
    ]


@pytest.mark.parametrize(
    "fault",
    [
        "stale-headset",
        # tests/station/test_station.py has both, without a process
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("frozen-camera", "other-camera")),
    ],
)
def test_a_fault_is_named_and_never_accepted(fault: str, tmp_path: Path) -> None:
    run = demonstrate(tmp_path, f"--seed {SEED} --fault {fault} --output runs --json it.json")
    assert run.code == 3, run.err
    result = json.loads((tmp_path / "it.json").read_text())
    for eye in result["eyes"].values():
        assert (eye["verdict"], eye["evidence"]) == ("contradicted", [fault])
        assert eye["reason"] in run.out.replace("\n", " ")
    assert "Both eyes, Contradicted: " in run.out


@pytest.mark.slow
def test_the_recommended_plan_leads_itself_and_serves_a_wearer_who_comes_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two real runs: the plan to its end, then the same wearer with a headset that has slipped."""

    def demo(name: str, *options: str) -> dict[str, Any]:
        output, file = tmp_path / name, tmp_path / f"{name}.json"
        files = ["--output", str(output), "--json", str(file)]
        plan = ["--seed", "12", "--plan", "recommended", *options]
        monkeypatch.setattr(sys, "argv", ["handcal", "demo", *plan, *files])
        main()
        found: dict[str, Any] = json.loads(file.read_text())
        return found

    first = demo("first")
    assert first["alignments"] >= 2
    assert all(one["verified"] for one in first["eyes"].values())
    error = first["reprojection_arcmin"]
    assert error["after"] < error["before"]
    facts = Session.open(Path(first["session"])).facts
    assert facts.plan == "recommended"
    assert set(facts.verified) == set(EYES)
    again = demo("again", "--from", first["session"], "--slipped")
    error = again["reprojection_arcmin"]
    assert error["begun"] != pytest.approx(error["before"])
    assert error["after"] < error["begun"]
    assert Session.open(Path(again["session"])).facts.former == Path(first["session"]).name
