import json
import sys
from dataclasses import asdict, fields, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from handcal.cli.main import main
from handcal.core.types import EYES, DepthEdges, Eye
from handcal.lab.settings import ProcedureStudySettings
from handcal.lab.study.procedure_trial import ProcedureModel, lead_through
from handcal.lab.study.procedures import (
    ProcedureRow,
    ProcedureSettings,
    procedure_cases,
    procedure_rows,
    procedure_trial,
    sitting_trial,
)
from handcal.lab.study.run import Case
from handcal.lab.study.seeing import seen_with
from handcal.lab.study.store import StudyRow
from handcal.lab.study.wearers import draw_wearer
from handcal.register.placement import PlacementSettings
from handcal.register.sitting import LearnedSitting
from handcal.sim.hand import HandSettings, Side, make_hand
from handcal.sim.people import CONSTANT_ARCMIN, Variant, begin_sitting
from handcal.sim.sensor import SensorName, border_px
from handcal.sim.wearer_settings import WearerSettings

MODEL = ProcedureModel()
SETTINGS = ProcedureSettings(3, MODEL)
USUAL = WearerSettings()
ALIGNING_S = USUAL.reaction_s + USUAL.movement_s + USUAL.dwell_s
RAISING_S = 2.0 * USUAL.movement_s


def case(plan: str, scale: float = 0.05, variant: str = "plain") -> Case:
    return {"wearer": 2, "plan": plan, "variant": variant, "scale": scale}


@cache
def led(plan: str, variant: str = "plain") -> list[StudyRow]:
    """Return the rows of the usual wearer, led once by each plan and as each variant."""
    return procedure_trial(SETTINGS, case(plan, variant=variant))


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


def verifications(seconds: object) -> float:
    """Return how many verifications a plan of two alignments had, by its time."""
    return (float(str(seconds)) - RAISING_S - 2 * ALIGNING_S) / MODEL.verify_s


def test_a_wearer_without_errors_is_calibrated_by_the_plan_in_its_time() -> None:
    rows = led("recommended")
    assert [row["eye"] for row in rows] == ["left", "right"]
    for row in rows:
        assert float(row["before_arcmin"] or 0.0) > 3.0
        assert float(row["after_arcmin"] or 9.0) < 3.0
        # What could be an error of the sitting keeps the depth near the prior's.
        assert float(row["depth_after_mm"] or 9.0) < float(row["depth_before_mm"] or 0.0)
        assert row["verdict"] == "accept"
        # A drawing that fits at once is set aside, and verified once more.
        assert verifications(row["seconds"]) in (
            pytest.approx(2.0), pytest.approx(3.0), pytest.approx(4.0)
        )  # fmt: skip


def test_what_people_are_known_to_see_rightly_is_believed() -> None:
    exact = LearnedSitting((0.0,) * 3, (0.0,) * 9, 600)
    known = replace(SETTINGS, sittings={"plain": exact})
    learned, default = (
        [float(row["expected_arcmin"] or 0.0) for row in rows]
        for rows in (procedure_trial(known, case("recommended")), led("recommended"))
    )
    assert np.mean(learned) < 0.97 * np.mean(default)


@pytest.mark.parametrize(("side", "usable"), [("left", EYES), ("right", ("right",))])
def test_a_left_hand_and_one_usable_eye_are_led_through_the_whole_plan(
    side: Side, usable: tuple[Eye, ...]
) -> None:
    rng = np.random.default_rng(5)
    wearer = draw_wearer(rng, 3, USUAL)
    edges = DepthEdges(border_px(0.0), 0.2, "measured")
    wearer = replace(
        wearer,
        hand=make_hand(3, HandSettings(side=side)),
        rig=replace(wearer.rig, depth_edges=edges),
    )
    found = lead_through(
        rng,
        wearer,
        seen_with("exact", 0.0),
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


def errors(row: StudyRow) -> tuple[float, float]:
    """Return the errors of an eye before and after, in arcminutes."""
    return float(row["before_arcmin"] or 0.0), float(row["after_arcmin"] or 99.0)


def test_who_never_moves_the_drawing_verifies_nothing() -> None:
    """Each eye is asked twice: at first, and after the drawing was set aside."""
    rows = led("recommended", "fits-at-once")
    for row, unverified in zip(rows, led("recommended-unverified"), strict=True):
        assert row["verdict"] == "repeat"
        assert verifications(row["seconds"]) == pytest.approx(4.0)
        before, after = errors(row)
        assert after < 0.5 * before
        assert unverified["alignments"] == 3


def test_a_hand_that_opens_under_the_cursor_still_calibrates() -> None:
    for row in led("recommended", "opens"):
        before, after = errors(row)
        assert after < 0.5 * before


def test_edges_that_a_depth_check_found_cost_little_and_unknown_ones_are_not_believed() -> None:
    known, unmeasured, fat = (
        led("recommended", variant) for variant in ("known-fat-2mm", "unmeasured", "fat-2mm")
    )
    for one, other, wrong in zip(known, unmeasured, fat, strict=True):
        before, after = errors(one)
        assert after < 0.3 * before
        assert one["verdict"] == "accept"
        assert errors(other)[1] < 0.5 * before
        # An outline 2 mm too wide that nobody has measured is no reason to accept.
        assert errors(wrong)[1] > after
        assert wrong["verdict"] != "accept"


@pytest.mark.parametrize(
    ("variant", "at_most"),
    [
        ("constant-size", 8.0),
        pytest.param("constant-direction", 2 * CONSTANT_ARCMIN, marks=pytest.mark.slow),
    ],
)
def test_what_people_always_see_wrongly_stays_in_part(variant: Variant, at_most: float) -> None:
    plain = led("recommended")
    for row, right in zip(led("recommended", variant), plain, strict=True):
        assert errors(right)[1] < errors(row)[1] < at_most


@pytest.mark.parametrize("sensor", ["ahat", pytest.param("exact", marks=pytest.mark.slow)])
def test_other_cameras_have_their_own_edges(sensor: SensorName) -> None:
    other = replace(SETTINGS, model=replace(MODEL, sensor=sensor))
    for row in procedure_trial(other, case("recommended")):
        before, after = errors(row)
        assert after < 0.6 * before


def test_sittings_of_one_person_have_their_eyes_in_common_and_differ() -> None:
    rows = [
        procedure_row
        for sitting in (0, 1)
        for procedure_row in sitting_trial(
            SETTINGS, {"person": 3, "sitting": sitting, "variant": "plain", "scale": 1.0}
        )
    ]
    assert [row["person"] for row in rows] == [3, 3]
    observed = [json.loads(str(row["observed"])) for row in rows]
    for one in observed:
        for H, seen_m, covariance_m2 in one:
            assert np.shape(H) == (3, 12)
            assert np.shape(seen_m) == (3,)
            assert np.linalg.eigvalsh(covariance_m2)[0] > 0.0
    first, second = (np.array(one[0][1]) for one in observed)
    assert 0.0 < np.linalg.norm(first - second) < 0.01


def test_without_verification_the_plan_takes_three_alignments() -> None:
    (left, _) = led("recommended-unverified")
    assert left["alignments"] == 3
    assert left["seconds"] == pytest.approx(RAISING_S + 3 * ALIGNING_S)


def test_the_papers_plan_is_one_alignment() -> None:
    (left, _) = led("paper")
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


@pytest.mark.parametrize(
    "wrong",
    [ProcedureStudySettings(plans=("spaam-3",)), ProcedureStudySettings(variants=("fast",))],
)
def test_unknown_plans_and_variants_are_refused(wrong: ProcedureStudySettings) -> None:
    with pytest.raises(ValueError, match="unknown"):
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
