import json
from typing import Any

import pytest

from handcal.core.progress import Progress
from handcal.lab.bench.run import bench_table, run_bench
from handcal.lab.bench.trials import QUICK


@pytest.fixture(scope="module")
def told() -> list[tuple[str, float]]:
    return []


@pytest.fixture(scope="module")
def results(told: list[tuple[str, float]]) -> dict[str, Any]:
    return run_bench(QUICK, Progress(lambda *progress: told.append(progress)))


def _value(results: dict[str, Any], what: str) -> float:
    (value,) = [figure["value"] for figure in results["figures"] if what in figure["what"]]
    assert isinstance(value, float)
    return value


def test_every_part_tells_its_progress_to_the_end(
    results: dict[str, Any], told: list[tuple[str, float]]
) -> None:
    assert list(dict.fromkeys(name for name, _ in told)) == list(results["details"])
    for part in results["details"]:
        fractions = [fraction for name, fraction in told if name == part]
        assert fractions == sorted(fractions)
        assert (fractions[0], fractions[-1]) == (0.0, 1.0)


def test_the_table_has_a_row_for_every_figure(results: dict[str, Any]) -> None:
    rows = bench_table(results)
    json.dumps(results, allow_nan=False)
    assert len({what for what, *_ in rows}) == len(results["figures"]) == len(rows)
    assert all((target == "") == (met == "") for _, _, target, met in rows)


def test_the_paper_misses_the_hands_depth_over_the_displays(results: dict[str, Any]) -> None:
    # A hand 0.5 to 0.6 m away, a display at 2 m.
    assert 25.0 < _value(results, "paper misses") < 31.0
    assert _value(results, "bias at φ3") < 1.0


def test_a_straight_hand_is_solved_by_every_method_that_knows_how_the_data_are_made(
    results: dict[str, Any],
) -> None:
    means_mm = {
        (row["data"], row["method"]): row["mean_mm"]
        for row in results["details"]["paper_simulation"]
        if row["angle_deg"] == 0.0
    }
    for method in ("paper", "linear", "consistent", "floor for paper's data"):
        assert means_mm["paper's data", method] < 0.1
    for method in ("consistent", "floor for honest data"):
        assert means_mm["honest data", method] < 0.1
    assert means_mm["honest data", "linear"] > 0.2
