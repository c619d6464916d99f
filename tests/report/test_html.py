"""The HTML: whole, safe, and without the network."""

from __future__ import annotations

import csv
import io
from base64 import b64decode
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import pytest

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.report.document import Column, Report, Section, Table
from handcal.report.html import write_html

VOID = {"meta", "img"}
HOSTILE = '<script>alert("1")</script>{{ 7 * 7 }}&amp;\x00\u202e'


class Page(HTMLParser):
    """Collects a page's texts, attributes and elements, and checks that elements are closed."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.open: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts += [data.strip()] if data.strip() else []

    def values(self, tag: str, name: str) -> list[str]:
        return [value for one, two, value in self.attributes if (one, two) == (tag, name)]


@pytest.fixture
def page(tmp_path: Path, report: Report) -> Page:
    write_html(tmp_path / "report.html", report, Progress())
    return Page(tmp_path / "report.html")


def test_all_is_said_in_order(page: Page) -> None:
    assert page.open == []
    said = [text for text in page.texts if text != "raw numbers (CSV)"]
    first = said.index("1,000 alignments")
    assert said[first + 1 :] == [
        "The paper's method stays below 4 mm up to 9°.",
        *("Errors", "More"),
        *("Wearers", "3", "What was done."),
        *("Errors", "method", "mean, mm", "paper", "1.50", "In mm.", "Of one."),
        *("More", "Of two."),
        said[-1],
    ]
    assert said[-1].startswith("handcal ")


def test_figures_and_their_numbers_are_in_it(page: Page) -> None:
    for url in page.values("img", "src"):
        kind, content = url.split(",")
        assert kind == "data:image/svg+xml;base64"
        assert ElementTree.fromstring(b64decode(content)).tag.endswith("svg")
    assert page.values("img", "alt") == ["Of one.", "Of two."]
    assert page.values("a", "download") == ["one.csv", "two.csv"]
    for url in page.values("a", "href")[-2:]:
        rows = list(csv.DictReader(io.StringIO(b64decode(url.split(",")[1]).decode(), newline="")))
        assert [row["error_mm"] for row in rows] == ["1.5", ""]


def test_it_needs_nothing_else(page: Page) -> None:
    used = [value for _, name, value in page.attributes if name in ("src", "href")]
    assert used
    assert all(value.startswith(("#", "data:")) for value in used)
    assert not {"script", "link", "iframe"} & {tag for tag, _, _ in page.attributes}
    assert any("default-src 'none'" in value for value in page.values("meta", "content"))


def test_no_text_is_taken_for_html(tmp_path: Path) -> None:
    section = Section(HOSTILE, [HOSTILE, Table([Column(HOSTILE)], [[HOSTILE]], HOSTILE)])
    write_html(tmp_path / "x.html", Report(HOSTILE, HOSTILE, HOSTILE, [section]), Progress())
    page = Page(tmp_path / "x.html")
    shown = HOSTILE.replace("\x00", "\ufffd").replace("\u202e", "\ufffd")
    assert page.texts.count(shown) == 9  # title, subject, lead; contents, heading, and so on
    assert "script" not in {tag for tag, _, _ in page.attributes}


def test_lines_and_surrogates_are_kept_or_replaced(tmp_path: Path) -> None:
    report = Report("", "", "", [Section("", ["one\ntwo\u00a0\ud800"])])
    write_html(tmp_path / "x.html", report, Progress())
    assert "one\ntwo\u00a0\ufffd" in Page(tmp_path / "x.html").texts


def test_the_same_report_gives_the_same_bytes(tmp_path: Path, report: Report) -> None:
    for name in ("one", "two"):
        write_html(tmp_path / name, report, Progress())
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_a_link_in_place_of_the_figures_is_not_followed(tmp_path: Path, report: Report) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "figures").symlink_to(tmp_path / "mine")
    with pytest.raises(FileError, match="is a link"):
        write_html(tmp_path / "report.html", report, Progress())
    assert not any((tmp_path / "mine").iterdir())
