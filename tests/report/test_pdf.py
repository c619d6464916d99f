"""The PDF's pages: what is on which."""

from __future__ import annotations

from dataclasses import replace

from matplotlib.figure import Figure as Page

from handcal.core.progress import Progress
from handcal.report.document import Figure, Report, Section
from handcal.report.pdf import compose


def texts(page: Page) -> list[str]:
    return [text.get_text() for text in page.texts]


def test_all_is_said_in_order(report: Report) -> None:
    first, second = compose(report, Progress())
    assert texts(first)[:-2] == [
        "Noise study",
        "The paper's method stays below 4 mm up to 9°.",
        *("Wearers", "3", "What was done."),
        *("Errors", "method", "mean, mm", "paper", "1.50", "In mm.", "Of one."),
    ]
    assert texts(first)[-2:] == ["1,000 alignments", "1 / 2"]
    assert texts(second)[:-2] == ["More", "Of two."]
    assert [len(page.axes) for page in (first, second)] == [2, 2]


def test_a_heading_stays_with_its_text_and_figure(report: Report) -> None:
    figure = Figure("big", "", lambda _axes: None, [], height_mm=150.0)
    filler = replace(figure, name="filler", height_mm=100.0)
    sections = [Section("", [filler]), Section("Heading", ["What it shows.", figure])]
    first, second = compose(replace(report, sections=sections), Progress())
    assert "Heading" not in texts(first)
    assert texts(second)[:2] == ["Heading", "What it shows."]
    assert len(second.axes) == 1
