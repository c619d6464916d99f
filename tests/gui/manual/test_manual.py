"""The manual: pages, links, headings and pictures, from the folder of the program."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt, QUrl
from PySide6.QtGui import QImage, QTextDocument
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QPushButton, QToolButton, QWidget
from pytestqt.qtbot import QtBot

from handcal_gui.app.theme import SPACING_PX, use_theme
from handcal_gui.manual import page
from handcal_gui.manual.excerpts import Excerpts, excerpt, pattern_of
from handcal_gui.manual.window import Manual, find_lines, read_lines
from tests.gui.helpers import child, letters
from tests.helpers import ROOT

PAGES = sorted((ROOT / "docs").glob("*.md"))
_WORD = re.compile(r"\w+")
_LINK = re.compile(r"\]\(([^)\s]+)\)")


@pytest.fixture
def manual(qtbot: QtBot) -> Iterator[Manual]:
    parent = QWidget()
    qtbot.addWidget(parent)
    yield Manual(parent)
    assert parent


@pytest.fixture
def dark(qtbot: QtBot) -> Iterator[None]:
    use_theme("dark")
    yield
    use_theme("system")


def heading_in_view(manual: Manual) -> str:
    return manual.page.textCursor().block().text()


def test_a_link_leads_to_the_heading_of_another_page_and_back(manual: Manual) -> None:
    manual.open("docs/index.md")
    assert "bare hand" in manual.page.toPlainText()
    manual.page.setSource(QUrl("protocol.md#what-the-headset-shows-and-when"))
    assert manual.page.source().fileName() == "protocol.md"
    assert heading_in_view(manual) == "What the headset shows, and when"
    assert manual.page.verticalScrollBar().value() > 0
    manual.page.backward()
    assert manual.page.source().fileName() == "index.md"


def test_keys_and_buttons_lead_back_and_forward_after_a_link_and_a_search(
    qtbot: QtBot, manual: Manual
) -> None:
    alt = Qt.KeyboardModifier.AltModifier
    with qtbot.waitActive(manual):
        manual.open("docs/guide.md")
    back, forward = (
        one
        for one in manual.findChildren(QToolButton)
        if one.accessibleName() in ("Back", "Forward")
    )
    tips = [one.toolTip() for one in (back, forward)]
    assert tips == ["Back (Alt+Left)", "Forward (Alt+Right)"]
    assert not back.isEnabled()
    assert not forward.isEnabled()
    manual.page.setSource(manual.page.source().resolved(QUrl("guide.md#calibrate")))
    before_px = manual.page.verticalScrollBar().value()
    assert before_px > 0
    manual.search.setText("target")
    QTest.keyClick(manual.search, Qt.Key.Key_Return)
    for _ in range(2):  # to further lines of the same page
        QTest.keyClick(manual.search, Qt.Key.Key_Return)
    assert manual.page.source().fileName() == "guide.md"
    hit_px = manual.page.verticalScrollBar().value()
    assert hit_px != before_px
    for _ in range(3):
        QTest.keyClick(manual.search, Qt.Key.Key_Left, alt)
    assert manual.page.verticalScrollBar().value() == before_px
    assert manual.page.extraSelections(), "the words are still searched for"
    back.click()
    assert manual.page.verticalScrollBar().value() == 0
    assert not back.isEnabled()
    for _ in range(4):
        QTest.keyClick(manual.page, Qt.Key.Key_Right, alt)
    assert manual.page.verticalScrollBar().value() == hit_px
    assert not forward.isEnabled()
    manual.page.setSource(QUrl("export.md"))
    assert manual.page.extraSelections()
    QTest.keyClick(manual.page, Qt.Key.Key_Left, alt)
    assert manual.page.source().fileName() == "guide.md"
    assert manual.page.extraSelections()


def test_a_button_closes_it_where_the_search_has_words(manual: Manual) -> None:
    manual.open("docs/guide.md")
    manual.resize(960, 510)
    manual.search.setText("nosuchword")
    QApplication.processEvents()
    close = child(manual, QPushButton, "manualClose")
    assert letters(manual) == ["o", "c"]
    assert manual.search.width() > 300
    close.click()
    assert not manual.isVisible()


def test_a_picture_is_no_page_and_never_wider_than_the_window(manual: Manual) -> None:
    manual.open("docs/index.md")
    manual.page.setSource(QUrl("pictures/start.png"))
    assert manual.page.source().fileName() == "index.md"
    kind = QTextDocument.ResourceType.ImageResource.value
    picture = manual.page.loadResource(kind, QUrl("pictures/start.png"))
    assert isinstance(picture, QImage)
    assert 0 < picture.width() <= manual.width()


def test_in_dark_themes_no_picture_glares(manual: Manual, dark: None) -> None:
    manual.open("docs/tutorial.md")
    kind = QTextDocument.ResourceType.ImageResource.value

    def lightness(name: str) -> tuple[int, int]:
        """Return the lightness of most of a picture and that of its edge."""
        picture = manual.page.loadResource(kind, QUrl(f"pictures/{name}"))
        assert isinstance(picture, QImage)
        inside = [picture.pixelColor(x, 20).lightness() for x in range(5, picture.width() - 5, 9)]
        return int(np.median(inside)), picture.pixelColor(0, 0).lightness()

    missing = manual.page.loadResource(kind, QUrl("pictures/none.png"))
    assert isinstance(missing, QImage)
    assert missing.isNull()
    ground = manual.page.palette().base().color().lightness()
    assert lightness("setup-stereo.svg") == (ground, ground)
    dimmed, edge = lightness("start.png")
    assert ground < edge < dimmed < 200
    use_theme("light")
    assert lightness("setup-stereo.svg")[0] == 255
    assert lightness("start.png")[0] > 230


def test_a_search_lists_lines_of_all_pages_and_return_goes_from_one_to_the_next(
    manual: Manual,
) -> None:
    manual.open("docs/index.md")
    assert not manual.found.isVisible()
    QTest.keyClick(manual.page, Qt.Key.Key_F, Qt.KeyboardModifier.ControlModifier)
    QTest.keyClicks(manual.search, "projection SKEW")
    rows = range(manual.found.topLevelItemCount())
    lines = [line for row in rows if (line := manual.found.topLevelItem(row))]
    assert {"Export", "Architecture"} <= {line.text(0) for line in lines}
    assert all({"projection", "skew"} <= set(_WORD.findall(line.text(2).lower())) for line in lines)
    for line in lines[:2]:
        QTest.keyClick(manual.search, Qt.Key.Key_Return)
        assert manual.found.currentItem() is line
        assert line.text(0) in manual.page.toPlainText()
        assert manual.page.textCursor().block().text() in line.text(2)
    QTest.keyClick(manual.search, Qt.Key.Key_Escape)
    assert not manual.search.text()
    assert not manual.found.isVisible()
    QTest.keyClicks(manual.search, "nosuchword")
    assert not manual.found.isVisible()
    assert any("Nothing found" in label.text() for label in manual.findChildren(QLabel))
    QTest.keyClick(manual.search, Qt.Key.Key_Escape)
    assert manual.isVisible()
    QTest.keyClick(manual.search, Qt.Key.Key_Escape)
    assert not manual.isVisible()


def test_the_contents_list_every_page_and_open_its_sections_by_keys(
    qtbot: QtBot, manual: Manual
) -> None:
    with qtbot.waitActive(manual):
        manual.open("docs/guide.md")
    rows = range(manual.contents.topLevelItemCount())
    pages = {item.text(0): item for row in rows if (item := manual.contents.topLevelItem(row))}
    titles = list(pages)
    assert titles[:2] == ["handcal", "Installing, by platform"]  # as in the first page's table
    assert len(titles) == len(PAGES)
    guide = pages["User guide"]
    assert manual.contents.currentItem() is guide
    assert guide.isExpanded()
    manual.page.setSource(manual.page.source().resolved(QUrl("export.md")))  # as a link does
    assert manual.contents.currentItem() is pages["Export"]
    assert not guide.isExpanded()
    QTest.keyClick(manual.page, Qt.Key.Key_C, Qt.KeyboardModifier.AltModifier)
    assert manual.contents.hasFocus()
    QTest.keyClick(manual.contents, Qt.Key.Key_Up)
    assert manual.page.source().fileName() == "export.md"  # until Return is pressed
    QTest.keyClick(manual.contents, Qt.Key.Key_Return)
    assert manual.page.source().fileName() == "commands.md"
    assert manual.page.hasFocus()
    section = guide.child(2)
    assert section is not None
    manual.contents.setCurrentItem(section)
    QTest.keyClick(manual.contents, Qt.Key.Key_Return)
    assert manual.page.source().fileName() == "guide.md"
    assert heading_in_view(manual) == section.text(0) == "Calibrate"
    assert manual.contents.currentItem() is section
    manual.open("THIRD-PARTY.md")
    assert manual.contents.currentItem() is None


def test_a_small_window_shows_the_contents_beside_pages_that_fit(
    qtbot: QtBot, manual: Manual
) -> None:
    manual.resize(700, 482)
    manual.open("docs/guide.md")
    qtbot.waitUntil(lambda: not manual.page.horizontalScrollBar().isVisible())
    assert manual.contents.width() > 150
    assert manual.page.width() > 400


def test_pictures_have_the_width_of_the_window(qtbot: QtBot, manual: Manual) -> None:
    def pictures_px() -> list[float]:
        return [shown_px for _, shown_px in manual.page._pictures.values()]

    manual.resize(1300, 700)
    manual.open("docs/guide.md")
    qtbot.waitUntil(lambda: manual.page.width() > 800)
    wide_px = pictures_px()
    manual.page.setSource(QUrl("guide.md#calibrate"))  # of the same page: nothing is loaded
    marked = manual.page.textCursor().position()
    assert marked > 0
    manual.resize(700, 482)
    qtbot.waitUntil(lambda: manual.page.width() < 600)
    qtbot.waitUntil(lambda: manual.page.horizontalScrollBar().maximum() == 0)
    room_px = manual.page.width()
    qtbot.waitUntil(lambda: max(pictures_px()) < room_px)
    qtbot.waitUntil(lambda: not manual.page._fit_soon.isActive())  # the last one is done, too
    manual.resize(1300, 700)
    qtbot.waitUntil(lambda: pictures_px() == wide_px)
    assert max(wide_px) > room_px
    assert manual.page.textCursor().position() == marked


def test_a_heading_stays_at_the_top_while_pictures_are_laid_out(
    qtbot: QtBot, manual: Manual
) -> None:
    manual.resize(1300, 700)
    manual.open("docs/guide.md#sessions")

    def top() -> str:
        return manual.page.cursorForPosition(QPoint(10, 10)).block().text()

    before = manual.page.document().size().height()
    qtbot.waitUntil(lambda: manual.page.document().size().height() != before)
    qtbot.waitUntil(lambda: top() == "Sessions")
    manual.page.verticalScrollBar().setValue(0)
    manual.resize(1000, 700)
    QTest.qWait(300)
    assert manual.page.verticalScrollBar().value() == 0, "it was scrolled since"


def test_the_titles_are_shown_whole(manual: Manual) -> None:
    manual.resize(1000, 400)
    manual.open("docs/commands.md")
    contents = manual.contents
    assert contents.verticalScrollBar().isVisible()
    for row in range(contents.topLevelItemCount()):
        item = contents.topLevelItem(row)
        assert item is not None
        title_px = contents.fontMetrics().horizontalAdvance(item.text(0))
        left_px = contents.visualItemRect(item).x()
        assert left_px + title_px <= contents.viewport().width(), item.text(0)


def test_it_opens_over_the_middle_of_its_parent(manual: Manual) -> None:
    above = manual.parentWidget()
    assert above is not None
    above.setGeometry(200, 150, 500, 400)
    above.show()
    manual.resize(400, 300)
    manual.open("docs/guide.md")
    off = manual.geometry().center() - above.geometry().center()
    assert off.manhattanLength() <= 2 * SPACING_PX  # the frames


def test_a_search_finds_the_guide_before_pages_for_developers(manual: Manual) -> None:
    manual.open("docs/index.md")
    manual.search.setText("headset slipped")
    rows = range(manual.found.topLevelItemCount())
    titles = [line.text(0) for row in rows if (line := manual.found.topLevelItem(row))]
    assert titles[0] == "User guide"
    assert "Architecture" in titles
    QTest.keyClick(manual.search, Qt.Key.Key_Return)
    assert manual.page.source().fileName() == "guide.md"


def test_a_row_of_a_table_is_one_line_under_its_heading(tmp_path: Path) -> None:
    text = "# Page\n\n## Keys\n\n| key | does |\n|---|---|\n| **F1** | shows *keys* |\n"
    (tmp_path / "page.md").write_text(text)
    lines = read_lines(tmp_path)
    rows = [(line.title, line.section, line.text) for line in find_lines(lines, "f1 keys")]
    assert rows == [("Page", "Keys", "F1 · shows keys")]
    assert find_lines(lines, "key")[0].text == "Keys"  # headings come first
    assert find_lines(lines, "  ") == []
    (tmp_path / "page.md").write_text("# Page\n\n![Start](start.png)\n")
    assert not find_lines(read_lines(tmp_path), "full size"), "nobody looks for those links"


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


def test_functions_are_named_with_where_they_are_described(manual: Manual) -> None:
    manual.open("docs/api.md")
    text = manual.page.toPlainText()
    assert "handcal.solve, described by help(handcal.solve) in Python" in text
    assert ":::" not in text


def test_it_opens_on_a_small_screen(qtbot: QtBot, manual: Manual) -> None:
    available = manual.screen().availableGeometry()
    manual.resize(2 * available.width(), 2 * available.height())
    manual.open("docs/guide.md")
    qtbot.waitUntil(lambda: available.contains(manual.frameGeometry()))


def test_no_page_and_no_section_of_a_line_found_is_cut(manual: Manual) -> None:
    manual.open("docs/index.md")
    manual.resize(960, 510)
    manual.search.setText("handcal")
    QApplication.processEvents()
    rows = [manual.found.topLevelItem(i) for i in range(manual.found.topLevelItemCount())]
    assert len(rows) == 200
    assert any("\n" in row.text(1) for row in rows if row)  # of a heading with many commands
    width_px = [manual.found.columnWidth(column) for column in range(3)]
    metrics = manual.found.fontMetrics()
    for row in filter(None, rows):
        for column in (0, 1):
            lines_px = map(metrics.horizontalAdvance, row.text(column).splitlines())
            assert max(lines_px) < width_px[column]
        height_px = manual.found.visualItemRect(row).height()
        assert height_px >= metrics.lineSpacing() * len(row.text(1).splitlines())
    assert sum(width_px[:2]) < 0.65 * manual.found.viewport().width()  # the rest is the line's


def test_a_line_found_begins_shortly_before_the_word_searched_for() -> None:
    text = "For each eye the result shows the error before and after, and the lab's target."
    assert excerpt(text, pattern_of("TARGET")) == "… and after, and the lab's target."
    assert excerpt("The target is far", pattern_of("target")) == "The target is far"
    assert excerpt(text, pattern_of("  ")) == text


def test_a_word_searched_for_is_bold_in_sight_and_marked_and_selected_in_the_page(
    qtbot: QtBot, manual: Manual
) -> None:
    def ink(row: int) -> float:
        line = manual.found.topLevelItem(row)
        assert line is not None
        place = manual.found.visualItemRect(line)
        place.setLeft(manual.found.columnViewportPosition(2) + 4)
        image = manual.found.viewport().grab(place).toImage()
        pixels = [(x, y) for x in range(image.width()) for y in range(image.height())]
        return sum(255 - image.pixelColor(x, y).lightness() for x, y in pixels)

    manual.resize(960, 510)
    manual.open("docs/index.md")
    manual.search.setText("target")
    qtbot.waitUntil(lambda: manual.page.source().fileName() == "guide.md")
    assert manual.found.currentIndex().row() == 0
    cursor = manual.page.textCursor()
    assert cursor.selectedText() == "target"
    assert manual.page.viewport().rect().contains(manual.page.cursorRect())
    marked = [one.cursor.selectedText() for one in manual.page.extraSelections()]
    assert len(marked) > 5
    assert {word.lower() for word in marked} == {"target"}
    line = manual.found.topLevelItem(2)
    assert line is not None
    with_bold = ink(2)
    delegate = manual.found.itemDelegateForColumn(2)
    assert isinstance(delegate, Excerpts)
    line.setText(2, excerpt(line.text(2), delegate.words))
    delegate.words = None
    assert ink(2) < with_bold
    use_theme("dark")
    assert len(manual.page.extraSelections()) == len(marked), "the page was loaded again"
    use_theme("light")
    manual.search.clear()
    assert not manual.page.extraSelections()


def test_a_picture_has_the_pixels_of_the_screen_and_opens_at_full_size_by_keys(
    manual: Manual, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[Path] = []
    monkeypatch.setattr(page, "open_path", lambda _, path: opened.append(path))
    monkeypatch.setattr(manual.page, "devicePixelRatioF", lambda: 2.0)
    manual.resize(960, 510)
    manual.open("docs/guide.md")
    kind = QTextDocument.ResourceType.ImageResource.value
    for name in ("start.png", "setup-stereo.svg"):
        picture = manual.page.loadResource(kind, QUrl(f"pictures/{name}"))
        assert isinstance(picture, QImage)
        assert picture.deviceIndependentSize().width() < manual.page.width()
        assert picture.width() > 1.8 * picture.deviceIndependentSize().width()
    for _ in range(2):  # to the link to the platforms' page first
        QTest.keyClick(manual.page, Qt.Key.Key_Tab)
    QTest.keyClick(manual.page, Qt.Key.Key_Return)
    assert [path.name for path in opened] == ["start.png"]
    assert manual.page.source().fileName() == "guide.md"
