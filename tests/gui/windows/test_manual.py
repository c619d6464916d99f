"""The manual: pages, links, headings and pictures, from the folder of the program."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QUrl
from PySide6.QtGui import QImage, QTextDocument
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from handcal_gui.windows.manual import Manual
from tests.helpers import ROOT

PAGES = sorted((ROOT / "docs").glob("*.md"))
_LINK = re.compile(r"\]\(([^)\s]+)\)")


@pytest.fixture
def manual(qtbot: QtBot) -> Iterator[Manual]:
    parent = QWidget()
    qtbot.addWidget(parent)
    yield Manual(parent)
    assert parent


def heading_in_view(manual: Manual) -> str:
    return manual.textCursor().block().text()


def test_a_link_leads_to_the_heading_of_another_page_and_back(manual: Manual) -> None:
    manual.open("docs/index.md")
    assert "bare hand" in manual.toPlainText()
    manual.setSource(QUrl("protocol.md#what-the-headset-shows-and-when"))
    assert manual.source().fileName() == "protocol.md"
    assert heading_in_view(manual) == "What the headset shows, and when"
    assert manual.verticalScrollBar().value() > 0
    manual.backward()
    assert manual.source().fileName() == "index.md"


def test_a_picture_is_no_page_and_never_wider_than_the_window(manual: Manual) -> None:
    manual.open("docs/index.md")
    manual.setSource(QUrl("pictures/start.png"))
    assert manual.source().fileName() == "index.md"
    kind = QTextDocument.ResourceType.ImageResource.value
    picture = manual.loadResource(kind, QUrl("pictures/start.png"))
    assert isinstance(picture, QImage)
    assert 0 < picture.width() <= manual.width()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_link_of_a_page_leads_to_something_that_the_wheel_carries(page: Path) -> None:
    carried = ("docs/", "examples/", "handcal/link/handcal.proto", "CONTRIBUTING.md", "THIRD-")
    for link in _LINK.findall(page.read_text("utf-8")):
        if link.startswith(("http", "#")):
            continue
        target = (page.parent / link.partition("#")[0]).resolve()
        assert target.exists(), link
        assert target.relative_to(ROOT).as_posix().startswith(carried), link
