"""Pages on which everything fits, whatever is written on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Page
from matplotlib.font_manager import fontManager
from matplotlib.transforms import Bbox

from handcal.core.progress import Progress
from handcal.report import page as page_module
from handcal.report.document import Column, Figure, Report, Section
from handcal.report.page import CONTENT_MM, WIDTH_MM, Document, plain
from handcal.report.pdf import compose

LOREM = "When the wearer confirmed, the hand covered the cursor; $x_1$ is no formula. " * 12


def text_boxes(page: Page) -> list[Bbox]:
    """Return the places of a page's own texts, in pixels."""
    FigureCanvasAgg(page)
    with rc_context({"text.hinting": "none"}):  # as in a PDF
        return [text.get_window_extent() for text in page.texts if text.get_text().strip()]


def assert_in_order(page: Page) -> None:
    """Check that a page's texts lie between its margins and apart from one another."""
    width_px, height_px = page.bbox.size
    margin_px = width_px * (WIDTH_MM - CONTENT_MM) / 2.0 / WIDTH_MM
    boxes = text_boxes(page)
    for box in boxes:
        assert margin_px - 1.0 <= box.x0
        assert box.x1 <= width_px - margin_px + 1.0
        assert 0.0 < box.y0 < box.y1 < height_px
    for one, other in combinations(boxes, 2):
        overlap = Bbox.intersection(one, other)
        assert overlap is None or min(overlap.width, overlap.height) < 1.0


def lines(pages: list[Page]) -> list[str]:
    return [text.get_text() for page in pages for text in page.texts]


@pytest.mark.parametrize(
    "text",
    [LOREM, "x" * 10_000, "W" * 500, "i" * 2000, "a\nb\n\n\tc", "", "\u202e\x00abc", "🙂" * 99],
    ids=str.__len__,
)
def test_any_text_fits(text: str) -> None:
    document = Document(text)
    document.title(text)
    document.text(text)
    for page in document.finish():
        assert_in_order(page)


def test_no_word_is_lost_and_nothing_is_set_as_mathematics() -> None:
    document = Document("footer")
    document.text(LOREM)
    pages = document.finish()
    assert " ".join(lines(pages)[:-2]).split() == LOREM.split()
    assert not any(text.get_parse_math() for page in pages for text in page.texts)


def test_control_characters_are_replaced() -> None:
    assert plain("Zoë φ₁ ± 2′ \u00a0 عمر") == "Zoë φ₁ ± 2′ \u00a0 عمر"
    assert plain("a\nb\tc\x00d\u202ee") == "a b c\ufffdd\ufffde"


@pytest.fixture(params=["with", "without"])
def system_font(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Return a font of the system with letters that the report's font lacks, or none."""
    own = [font for font in fontManager.ttflist if font.name in ("DejaVu Sans", "STIXGeneral")]
    only = [font for font in own if request.param == "with" or font.name == "DejaVu Sans"]
    monkeypatch.setattr(fontManager, "ttflist", only)
    _forget_fonts()
    yield "STIXGeneral" if request.param == "with" else ""
    _forget_fonts()


def _forget_fonts() -> None:
    for cached in (page_module._family_of, page_module._plain_char, page_module._char_width_mm):
        cached.cache_clear()


def test_names_that_the_font_lacks_stay_different(system_font: str) -> None:
    names = "Ada ᶁ", "Ada ᶄ"
    document = Document("footer")
    document.title(names[0])
    document.table([Column("wearer")], [[name] for name in names])
    (page,) = document.finish()
    shown = {text.get_text(): text.get_fontfamily() for text in page.texts}
    assert len(shown) == 5
    for name in names:
        written = name if system_font else f"Ada [U+{ord(name[-1]):04X}]"
        assert system_font in ("", *shown[written])
    assert_in_order(page)


def test_a_tables_head_is_not_parted_from_its_first_row() -> None:
    for high_mm in np.arange(235.0, 262.0, 1.5):
        document = Document("footer")
        document.space(high_mm)
        document.table([Column("value")], [["1.5\n2.5\n3.5"]])
        pages = document.finish()
        shown = [set(lines([page])) & {"value", "1.5", "3.5"} for page in pages]
        assert shown[-1] == {"value", "1.5", "3.5"}
        assert not any(shown[:-1])


def test_a_long_table_goes_on_with_its_head_on_every_page() -> None:
    document = Document("footer")
    rows = [[str(number), LOREM[: number % 300], f"{number:.3f}"] for number in range(150)]
    document.table([Column("number"), Column("what", "left"), Column("value")], rows)
    pages = document.finish()
    assert len(pages) > 2
    for page in pages:
        assert_in_order(page)
        assert lines([page]).count("value") == 1
    assert [line for line in lines(pages) if line.isdigit()] == [str(n) for n in range(150)]


@pytest.mark.parametrize("cell", ["x" * 10_000, LOREM, ""])
def test_a_table_takes_any_cell(cell: str) -> None:
    document = Document("footer")
    columns = [Column("one"), Column("another", "left"), Column("third")]
    document.table(columns, [[cell, "2.41 ± 1.10", cell], ["1", cell, "3"]])
    for page in document.finish():
        assert_in_order(page)


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
