from dataclasses import replace

import numpy as np
import pytest

from handcal.core.types import METHODS, Float64
from handcal.lab.study.noise import (
    ERRORS_MM,
    FLOOR,
    HANDS,
    QUICK_NOISE,
    SECTIONS,
    NoiseSettings,
    noise_study,
    noise_trial,
)
from handcal.lab.study.run import Case
from handcal.lab.study.store import StudyRow
from handcal.lab.study.trials import BEST_ITERATE

SETTINGS = replace(QUICK_NOISE, hands=1, depth_sigma_m=0.0)
QUIET = replace(SETTINGS, points=1000, linear_trials=0, paper_trials=0)


def errors_mm(section: str, value: float, settings: NoiseSettings) -> dict[str, Float64]:
    rows = noise_trial(settings, {"section": section, "value": value, "trial": 0})
    return {str(row["method"]): np.array([row[name] for name in ERRORS_MM]) for row in rows}


def lengths_mm(section: str, value: float, settings: NoiseSettings = SETTINGS) -> dict[str, float]:
    return {
        method: float(np.linalg.norm(error_mm))
        for method, error_mm in errors_mm(section, value, settings).items()
    }


def test_every_value_of_every_section_is_tried_as_often_as_the_settings_say() -> None:
    settings = NoiseSettings()
    study = noise_study(settings)
    assert len({tuple(case.items()) for case in study.cases}) == len(study.cases)
    for name, section in SECTIONS.items():
        trials = settings.shape_trials if name == HANDS else settings.trials
        for value in section.values(settings):
            assert study.cases.count({"section": name, "value": value, "trial": trials - 1}) == 1
            assert {"section": name, "value": value, "trial": trials} not in study.cases
    angles = {case["value"] for case in study.cases if case["section"] == "rotation"}
    assert angles == {*range(21), *range(0, 61, 5)}


def test_random_numbers_come_from_seed_and_case_alone() -> None:
    case: Case = {"section": "forearm", "value": 0.02, "trial": 1}
    rows = noise_trial(SETTINGS, case)
    noise_trial(SETTINGS, {**case, "trial": 0})
    assert noise_trial(SETTINGS, case) == rows
    assert noise_trial(replace(SETTINGS, seed=2), case) != rows


def test_a_straight_hand_of_the_papers_data_is_solved_by_all_but_icp() -> None:
    found = lengths_mm("rotation", 0.0)
    assert found.pop("icp") > 0.5
    assert set(found) == {FLOOR, "paper", BEST_ITERATE, "linear", "consistent"}
    assert max(found.values()) < 0.05


def test_a_hand_that_keeps_its_size_is_solved_by_the_one_that_knows() -> None:
    found = lengths_mm("rotation, size kept", 0.0)
    assert found["consistent"] < 0.05
    assert min(found["paper"], found["linear"]) > 0.5


def test_more_noise_is_a_larger_error() -> None:
    straight = replace(QUIET, angle_deg=0.0)
    quiet, loud = (lengths_mm("depth noise", sigma, straight) for sigma in (0.0, 0.02))
    assert quiet["consistent"] < 1.0 < loud["consistent"]
    assert quiet[FLOOR] == pytest.approx(0.0, abs=1e-6)


def test_a_wearer_is_solved_as_well_as_the_hand_is_put() -> None:
    steady, clumsy = (lengths_mm("wearer", scale, QUIET) for scale in (0.0, 4.0))
    assert FLOOR not in steady
    assert steady["consistent"] < 1.0
    assert clumsy["consistent"] > 3.0 * steady["consistent"]


def methods_of(rows: list[StudyRow]) -> set[object]:
    return {row["method"] for row in rows}


def test_slow_methods_solve_the_first_trials_and_no_hand_shapes() -> None:
    settings = replace(SETTINGS, trials=3, linear_trials=2, paper_trials=1)
    case: Case = {"section": "rotation", "value": 0.0}
    by_trial = [methods_of(noise_trial(settings, {**case, "trial": n})) for n in range(3)]
    usual = {FLOOR, *METHODS, BEST_ITERATE} - {"icp-open3d"}
    assert by_trial[0] == usual
    assert by_trial[1] == usual - {"paper", BEST_ITERATE}
    assert by_trial[2] == {FLOOR, "consistent", "icp"}
    shapes = noise_trial(settings, {"section": HANDS, "value": 1, "trial": 0})
    assert methods_of(shapes) == {FLOOR, "consistent", "icp"}
    assert {row["hand"] for row in shapes} == {1}
