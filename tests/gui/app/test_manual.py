"""The manual: pages, links, headings, pictures and search, from the folder of the program."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QImage, QTextDocument
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from handcal.core.errors import FileError
from handcal_gui.app import manual as manual_module
from handcal_gui.app.manual import Manual, show_manual
from tests.helpers import ROOT

PAGES = sorted((ROOT / "docs").glob("*.md"))
_LINK = re.compile(r"\]\(([^)\s]+)\)")


@pytest.fixture
def manual(qtbot: QtBot) -> Iterator[Manual]:
    window = QWidget()
    qtbot.addWidget(window)
    yield show_manual(window, "docs/index.md")
    assert window


def shown(manual: Manual) -> str:
    return manual.page.source().fileName()


def test_a_link_leads_to_the_heading_of_another_page_and_back(manual: Manual) -> None:
    manual.page.anchorClicked.emit(QUrl("protocol.md#what-the-headset-shows-and-when"))
    assert shown(manual) == "protocol.md"
    assert manual.page.textCursor().block().text() == "What the headset shows, and when"
    assert manual.page.verticalScrollBar().value() > 0
    QTest.keyClick(manual, Qt.Key.Key_Left, Qt.KeyboardModifier.AltModifier)
    assert shown(manual) == "index.md"


def test_the_contents_list_all_pages_in_reading_order_and_open_them(manual: Manual) -> None:
    titles = [manual.contents.item(row).text() for row in range(manual.contents.count())]
    assert titles[:2] == ["handcal", "Installing, by platform"]  # as in the first page's table
    assert len(titles) == len(PAGES)
    manual.contents.setCurrentRow(titles.index("Export"))
    assert shown(manual) == "export.md"
    manual.page.anchorClicked.emit(QUrl("guide.md"))
    assert manual.contents.currentItem().text() == "User guide"


def test_a_search_lists_the_pages_with_all_words_and_goes_from_place_to_place(
    manual: Manual,
) -> None:
    manual.search.setText("skew")
    rows = [manual.contents.item(row) for row in range(manual.contents.count())]
    listed = [row for row in rows if not row.isHidden()]
    assert {"Export", "Architecture"} <= {row.text() for row in listed}
    assert len(listed) < len(rows)
    seen = set()
    for _ in range(20):
        QTest.keyClick(manual.search, Qt.Key.Key_Return)
        assert manual.page.textCursor().selectedText().lower() == "skew"
        seen.add(manual.contents.currentItem().text())
    assert seen == {row.text() for row in listed}
    assert manual.isVisible()


def test_a_picture_fits_the_page_and_opens_in_the_systems_program(
    manual: Manual, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = QTextDocument.ResourceType.ImageResource.value
    for name in ("start.png", "setup-stereo.svg"):
        picture = manual.page.loadResource(kind, QUrl(f"pictures/{name}"))
        assert isinstance(picture, QImage)
        assert 0 < picture.width() <= manual.page.width()
    opened: list[Path] = []
    monkeypatch.setattr(manual_module, "open_path", lambda _, path: opened.append(path))
    manual.page.anchorClicked.emit(QUrl("pictures/start.png"))
    assert [path.name for path in opened] == ["start.png"]
    assert shown(manual) == "index.md"


def test_one_manual_shows_every_page_asked_for_and_a_missing_one_is_an_error(
    manual: Manual,
) -> None:
    window = manual.parentWidget()
    assert window is not None
    assert show_manual(window, "docs/guide.md#calibrate") is manual
    assert manual.page.textCursor().block().text() == "Calibrate"
    with pytest.raises(FileError):
        show_manual(window, "docs/none.md")


@pytest.mark.parametrize("name", ["guide.md", "rig-guide.md"])
def test_the_guides_are_for_technicians(name: str) -> None:
    text = (ROOT / "docs" / name).read_text("utf-8")
    for of_a_developer in (".venv/", "bash ", "python ", "OpenGL and"):
        assert of_a_developer not in text


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_link_of_a_page_leads_to_something_that_the_wheel_carries(page: Path) -> None:
    carried = ("docs/", "examples/", "handcal/link/handcal.proto", "CONTRIBUTING.md", "THIRD-")
    for link in _LINK.findall(page.read_text("utf-8")):
        if link.startswith(("http", "#")):
            continue
        target = (page.parent / link.partition("#")[0]).resolve()
        assert target.exists(), link
        assert target.relative_to(ROOT).as_posix().startswith(carried), link
