from __future__ import annotations

import logging

import pytest
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QToolButton
from pytestqt.qtbot import QtBot

from handcal_gui.widgets.banner import Banner
from tests.gui.helpers import child


def test_a_message_stays_until_it_is_closed_and_hides_the_condition(qtbot: QtBot) -> None:
    banner = Banner()
    qtbot.addWidget(banner)
    close = child(banner, QToolButton, "bannerClose")
    assert banner.isHidden()
    banner.show_condition("no camera")
    assert (banner.text, banner.isHidden(), close.isHidden()) == ("no camera", False, True)
    banner.show_message("Could not solve")
    banner.show_condition("no headset")
    assert (banner.text, close.isHidden()) == ("Could not solve", False)
    close.click()
    assert (banner.text, close.isHidden()) == ("no headset", True)
    banner.show_condition("")
    assert (banner.text, banner.isHidden()) == ("", True)


def test_a_notice_ends_by_itself_and_closes_no_message(qtbot: QtBot) -> None:
    banner = Banner()
    qtbot.addWidget(banner)
    timer = child(banner, QTimer)
    banner.show_notice("opens soon")
    assert (banner.text, timer.isActive()) == ("opens soon", True)
    timer.timeout.emit()
    assert banner.isHidden()
    banner.show_notice("opens soon")
    banner.show_message("it failed")
    timer.timeout.emit()
    assert banner.text == "it failed"


def test_what_is_said_is_logged(qtbot: QtBot, caplog: pytest.LogCaptureFixture) -> None:
    banner = Banner()
    qtbot.addWidget(banner)
    with caplog.at_level(logging.INFO, "handcal_gui"):
        banner.show_condition("no camera")
        banner.show_condition("no camera")
        banner.show_message("Could not solve")
        banner.show_condition("")
    assert caplog.messages == ["no camera", "Could not solve", "the condition has ended"]
