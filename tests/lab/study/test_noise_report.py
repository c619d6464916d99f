from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from handcal.lab.study.noise import ERRORS_MM, HANDS, QUICK_NOISE
from handcal.lab.study.noise_report import LINE_MM, noise_report
from handcal.lab.study.store import StudyRow
from handcal.report.document import Report, Table
from handcal.report.statistics import mean_interval

ANGLES = 0.0, 5.0, 9.0, 10.0, 20.0
SETTINGS = replace(QUICK_NOISE, coarse_deg=(0.0, 5.0, 10.0, 20.0), fine_deg=(0.0, 5.0, 9.0))
SLOPES_MM = {"paper": 0.4, "consistent": 0.2, "icp": 4.0, "linear": 1.0}


def made(section: str, value: float, method: str, trial: int, error_1_mm: float) -> StudyRow:
    return {
        "section": section,
        "value": value,
        "trial": trial,
        "hand": trial % 3,
        "method": method,
        "iterations": 1,
        **dict(zip(ERRORS_MM, (error_1_mm, 0.0, 0.0), strict=True)),
    }


@pytest.fixture(scope="module")
def rows() -> list[StudyRow]:
    """Return errors along φ1, as large as the rotation says, beside ± 0.1 mm."""
    turned = [
        made("rotation", angle, method, trial, slope * angle + sign * 0.1 * (angle > 0))
        for angle in ANGLES
        for method, slope in SLOPES_MM.items()
        for trial, sign in enumerate((-1.0, 1.0, 0.0, -1.0, 1.0, 0.0))
    ]
    shapes = [
        {**made(HANDS, hand, "consistent", trial, -2.0 - trial), "hand": hand}
        for hand in range(2)
        for trial in range(3)
    ]
    return [*turned, *shapes]


@pytest.fixture(scope="module")
def report(rows: list[StudyRow]) -> Report:
    return noise_report(SETTINGS, rows)


def table(report: Report, title: str) -> list[list[str]]:
    (section,) = [section for section in report.sections if section.title == title]
    (found,) = [item for item in section.items if isinstance(item, Table)]
    return [list(row) for row in found.rows]


def test_the_lead_says_how_far_each_method_keeps_the_line(report: Report) -> None:
    # Slopes of 0.4 and 0.2 mm a degree; the mean of three components is a third of the only one.
    assert "within 4 mm up to 10°" in report.lead
    assert "components up to 20° (published: up to 9°)" in report.lead
    assert "default up to 20°, and up to 20°" in report.lead


@pytest.mark.parametrize(
    ("errors_mm", "reach"), [((5.0, 5.0), "at no rotation"), ((3.0, 5.0), "only at 0°")]
)
def test_a_failure_at_0_differs_from_one_at_the_next_angle(
    errors_mm: tuple[float, float], reach: str
) -> None:
    errors = zip((0.0, 5.0), errors_mm, strict=True)
    rows = [made("rotation", angle, method, 0, mm) for angle, mm in errors for method in SLOPES_MM]
    report = noise_report(SETTINGS, rows)
    assert f"within 4 mm {reach}, and" in report.lead
    found = {row[0]: row[2] for row in table(report, "The paper's findings and these")}
    assert found["paper: |Δφ| within 4 mm"] == reach


def test_icp_is_set_beside_the_paper(report: Report) -> None:
    rows = {row[0]: row[1:] for row in table(report, "The paper's findings and these")}
    assert rows["|Δφ| of icp over that of paper, at 9°"] == ["above 1", "10.0"]
    assert rows["paper: |Δφ| within 4 mm"] == ["up to 9°", "up to 10°"]


def test_tables_give_means_with_their_intervals(report: Report) -> None:
    by_angle = {row[0]: row for row in table(report, "Rotation")}
    expected = mean_interval([3.5, 3.7, 3.6], range(3))
    assert by_angle["9"][2] == f"3.6 ({expected.low:.1f}–{expected.high:.1f})"
    assert by_angle["0"][1] == "0.0 (0.0–0.0)"


def test_figures_hold_the_numbers_that_they_show(report: Report) -> None:
    figures = {figure.name: figure for figure in report.figures}
    assert set(figures) == {"rotation", "rotation-components", "hand-shape"}
    (row,) = [
        row
        for row in figures["rotation"].rows
        if (row["value"], row["method"]) == (9.0, "consistent")
    ]
    assert row["length_mean_mm"] == pytest.approx(1.8)
    assert row["error_2_mean_mm"] == 0.0
    assert (row["trials"], row["people"]) == (6, 3)


def test_figures_are_drawn_with_the_line(report: Report) -> None:
    for figure in report.figures:
        canvas = Canvas()
        axes = [canvas.add_subplot(1, figure.columns, n + 1) for n in range(figure.columns)]
        figure.draw(axes)
        for ax in axes:
            lines = [np.asarray(line.get_ydata(), dtype=float) for line in ax.get_lines()]
            assert any(np.array_equal(line, [LINE_MM, LINE_MM]) for line in lines)
            assert len(lines) > 1
    left, right = (
        {line.get_label() for line in ax.get_lines()} for ax in _drawn(report, "rotation")
    )
    assert "icp" in left
    assert "icp" not in right
    assert "consistent" in right


def _drawn(report: Report, name: str) -> list[Axes]:
    (figure,) = [figure for figure in report.figures if figure.name == name]
    axes = [Canvas().add_subplot() for _ in range(figure.columns)]
    figure.draw(axes)
    return axes


def test_a_single_alignment_has_no_interval() -> None:
    rows = [made("rotation", 5.0, method, 0, 1.0) for method in SLOPES_MM]
    report = noise_report(SETTINGS, rows)
    assert table(report, "Rotation") == [["5", "1.0", "1.0", "1.0", "1.0"]]
    assert report.figures[0].rows[0]["length_low_mm"] is None
