import json
import sys
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import pytest

from handcal.cli.main import main
from handcal.core.errors import HandcalError
from handcal.core.types import EYES, Eye
from handcal.lab.settings import ProcedureStudySettings
from handcal.lab.study.procedure_trial import ProcedureModel, lead_through
from handcal.lab.study.procedures import (
    ProcedureRow,
    ProcedureSettings,
    procedure_cases,
    procedure_rows,
    procedure_trial,
)
from handcal.lab.study.run import Case
from handcal.lab.study.store import StudyRow
from handcal.lab.study.wearers import draw_wearer
from handcal.register.placement import PlacementSettings
from handcal.sim.hand import HandSettings, Side, make_hand
from handcal.sim.people import begin_sitting
from handcal.sim.wearer_settings import WearerSettings

MODEL = ProcedureModel(points=500)
SETTINGS = ProcedureSettings(3, MODEL)
USUAL = WearerSettings()
ALIGNING_S = USUAL.reaction_s + USUAL.movement_s + USUAL.dwell_s
RAISING_S = 2.0 * USUAL.movement_s


def case(plan: str, scale: float = 0.05, variant: str = "plain") -> Case:
    return {"wearer": 2, "plan": plan, "variant": variant, "scale": scale}


def made(error_arcmin: float, **changes: float | str | None) -> StudyRow:
    row: StudyRow = {
        **case("recommended", 1.33),
        "eye": "left",
        "before_arcmin": 10.0,
        "after_arcmin": error_arcmin,
        "seconds": 12.0,
        "verdict": "accept",
        "expected_arcmin": 0.5 * error_arcmin,
        "depth_before_mm": 2.0,
        "depth_after_mm": 0.25 * error_arcmin,
    }
    return row | changes


def test_a_wearer_without_errors_is_calibrated_by_the_plan_in_its_time() -> None:
    rows = procedure_trial(SETTINGS, case("recommended"))
    assert [row["eye"] for row in rows] == ["left", "right"]
    for row in rows:
        assert float(row["before_arcmin"] or 0.0) > 3.0
        assert float(row["after_arcmin"] or 9.0) < 2.0
        assert float(row["depth_after_mm"] or 9.0) < 1.0
        assert row["verdict"] == "accept"
        assert row["seconds"] == pytest.approx(RAISING_S + 2 * ALIGNING_S + 2 * MODEL.verify_s)


@pytest.mark.parametrize(("side", "usable"), [("left", EYES), ("right", ("right",))])
def test_a_left_hand_and_one_usable_eye_are_led_through_the_whole_plan(
    side: Side, usable: tuple[Eye, ...]
) -> None:
    rng = np.random.default_rng(5)
    wearer = draw_wearer(rng, 3, USUAL)
    wearer = replace(wearer, hand=make_hand(3, HandSettings(side=side)))
    found = lead_through(
        rng,
        wearer,
        begin_sitting(rng, USUAL, "plain", 0.05),
        MODEL,
        "recommended",
        verify=True,
        placement=PlacementSettings(),
        usable_eyes=usable,
    )
    assert set(found.results.eyes) == set(found.results.fused.verified) == set(usable)
    for eye in EYES:
        before_m = np.linalg.norm(wearer.true_shift_m[eye])
        error_m = np.linalg.norm(found.shift_m[eye] - wearer.true_shift_m[eye])
        assert error_m < 0.5 * before_m if eye in usable else not found.shift_m[eye].any()


def test_without_verification_the_plan_takes_three_alignments() -> None:
    (left, _) = procedure_trial(SETTINGS, case("recommended-unverified"))
    assert left["alignments"] == 3
    assert left["seconds"] == pytest.approx(RAISING_S + 3 * ALIGNING_S)


def test_the_papers_plan_is_one_alignment() -> None:
    (left, _) = procedure_trial(SETTINGS, case("paper"))
    assert left["alignments"] == 1
    assert left["seconds"] == pytest.approx(RAISING_S + ALIGNING_S)


def test_spaam_without_errors_is_exact_and_has_no_verdict() -> None:
    for row in procedure_trial(SETTINGS, case("spaam-25", 0.0)):
        assert float(row["after_arcmin"] or 0.0) < 1e-3
        assert row["verdict"] is None
        assert row["seconds"] == pytest.approx(50 * ALIGNING_S)


def test_the_figures_of_known_rows() -> None:
    rows = [made(2.0), made(4.0, seconds=14.0), made(12.0), made(6.0, verdict="repeat")]
    (found,) = procedure_rows(rows)
    assert found.after_arcmin == 6.0
    assert found.seconds == 12.5
    assert found.worse_share == 0.25
    assert (found.accepted_share, found.accepted_worse_share) == (0.75, 0.25)
    assert (found.depth_before_mm, found.depth_after_mm) == (2.0, 1.5)
    assert found.depth_worse_share == 0.25
    assert found.expected_actual_correlation == pytest.approx(1.0)
    assert found.expected_over_actual == pytest.approx(0.5)
    assert found.after_p95_arcmin == pytest.approx(np.quantile([2.0, 4.0, 12.0, 6.0], 0.95))


def test_what_has_no_verdict_has_no_share() -> None:
    rows = [made(2.0, verdict=None, expected_arcmin=None, plan="spaam-25")] * 2
    (found,) = procedure_rows(rows)
    assert found.accepted_share is None
    assert found.expected_over_actual is found.depth_after_mm is None


@pytest.mark.parametrize(
    "wrong",
    [ProcedureStudySettings(plans=("spaam-3",)), ProcedureStudySettings(variants=("fast",))],
)
def test_unknown_plans_and_variants_are_refused(wrong: ProcedureStudySettings) -> None:
    with pytest.raises(HandcalError, match="unknown"):
        procedure_cases(wrong)


def test_the_command_writes_a_row_of_each_plan_and_scale(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "rows.json"
    arguments = "study procedures --wearers 2 --seed 4 --plan paper spaam-25 --scale 1.33 2.5"
    words = ["handcal", *arguments.split(), "--workers", "1", "--json", str(file)]
    monkeypatch.setattr(sys, "argv", words)
    main()
    rows = json.loads(file.read_text())["rows"]
    assert [(row["plan"], row["scale"]) for row in rows] == [
        ("paper", 1.33), ("paper", 2.5), ("spaam-25", 1.33), ("spaam-25", 2.5),
    ]  # fmt: skip
    assert set(rows[0]) == {one.name for one in fields(ProcedureRow)}
    assert rows[0]["before_arcmin"] == rows[1]["before_arcmin"] == rows[2]["before_arcmin"]
    assert asdict(ProcedureRow(**rows[0])) == rows[0]
