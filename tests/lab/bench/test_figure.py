import pytest

from handcal.lab.bench.trials import BenchFigure


@pytest.mark.parametrize(
    ("at_least", "at_most", "target", "met"),
    [
        (None, None, "", None),
        (30.0, None, "≥ 30", True),
        (30.5, None, "≥ 30.5", False),
        (None, 30.0, "≤ 30", True),
        (None, 29.0, "≤ 29", False),
        (2.4, 36.0, "≥ 2.4, ≤ 36", True),
        (2.4, 3.6, "≥ 2.4, ≤ 3.6", False),
    ],
)
def test_a_figure_is_judged_by_its_target(
    at_least: float | None, at_most: float | None, target: str, met: bool | None
) -> None:
    figure = BenchFigure("speed", 30.0, "mm", at_least, at_most)
    assert figure.to_json() == {
        "what": "speed",
        "value": 30.0,
        "unit": "mm",
        "target": target,
        "met": met,
    }


def test_what_could_not_be_measured_meets_no_target() -> None:
    assert BenchFigure("speed", float("nan"), "mm", at_most=1.0).to_json()["met"] is False
