"""The start page: what a technician chooses, finds, and sets off."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QApplication,
    QFileDialog,
    QLabel,
    QListWidget,
    QWidget,
)
from pytestqt.qtbot import QtBot

from handcal.camera.settings import RealSenseSettings
from handcal.station.checks.doctor import Health
from handcal.station.checks.preflight import Part
from handcal.station.settings import StationSettings
from handcal_gui.app.preferences import Preferences
from handcal_gui.calibrate.start.session_entries import Entry, KnownSessions
from handcal_gui.calibrate.start.start_page import StartPage
from tests.gui.calibrate.start.conftest import (
    KEY,
    NETWORK,
    Inspector,
    button,
    choose,
    find,
    text,
    wearer,
)


def test_a_headset_that_is_awaited_can_be_connected(
    qtbot: QtBot, inspector: Inspector, open_page: Callable[..., StartPage]
) -> None:
    inspector.healths["headset"] = Health.LIMITED
    page = open_page(source="realsense", headset="network")
    qtbot.waitUntil(lambda: button(page, "headsetFix").text() == "Co&nnect…")
    asked: list[bool] = []
    page.new.form.connect_headset = lambda: asked.append(True)
    page.new.check()
    qtbot.waitUntil(lambda: len(inspector.asked) > 1)
    qtbot.wait(100)
    button(page, "headsetFix").click()
    assert asked == [True]


def test_typing_a_name_and_enter_starts(
    qtbot: QtBot, inspector: Inspector, open_page: Callable[..., StartPage]
) -> None:
    page = open_page()
    assert wearer(page).hasFocus() or page.focusWidget() is wearer(page).lineEdit()
    QTest.keyClicks(wearer(page), " Ada ")
    with qtbot.waitSignal(page.new.start_requested) as started:
        QTest.keyClick(wearer(page), Qt.Key.Key_Return)
    settings, name = started.args
    assert name == "Ada"
    assert settings == page.new.settings == inspector.asked[-1][0]
    assert threading.main_thread() not in inspector.threads


def test_a_former_name_is_offered_in_a_list_and_never_typed_in_by_itself(
    qtbot: QtBot, open_page: Callable[..., StartPage]
) -> None:
    page = open_page()
    page.new.show_wearers(["Ann", "Bob"])
    for typed, expected in ((" ", ""), ("A", "A"), ("n", "An")):
        field = wearer(page).lineEdit()
        assert field is not None
        QTest.keyClicks(field, typed)
        assert wearer(page).currentText() == expected
    qtbot.waitUntil(lambda: QApplication.activePopupWidget() is not None)
    offered = QApplication.activePopupWidget()
    assert offered is not None
    with qtbot.waitSignal(page.new.start_requested) as started:
        QTest.keyClick(offered, Qt.Key.Key_Return)
    assert started.args[1] == "An"


def test_keys_of_the_former_page_are_no_name_and_start_nothing(
    qtbot: QtBot, open_page: Callable[..., StartPage]
) -> None:
    page = open_page()
    for _ in range(2):
        QTest.keyClick(wearer(page), Qt.Key.Key_Space)
    assert wearer(page).currentText() == ""
    with qtbot.assertNotEmitted(page.new.start_requested, wait=100):
        QTest.keyClick(wearer(page), Qt.Key.Key_Return, Qt.KeyboardModifier.ControlModifier)
    QTest.keyClicks(wearer(page), "Ada B")
    assert wearer(page).currentText() == "Ada B"


def test_what_is_wrong_with_a_name_is_said_beside_it(
    qtbot: QtBot, open_page: Callable[..., StartPage]
) -> None:
    page = open_page()
    problem = find(page, QLabel, "wearerProblem")
    assert not problem.isVisible()
    wearer(page).setEditText("A\x07B")
    assert problem.isVisible()
    assert "must not contain line breaks or control characters." in problem.text()
    with qtbot.assertNotEmitted(page.new.start_requested, wait=100):
        QTest.keyClick(wearer(page), Qt.Key.Key_Return)
    wearer(page).setEditText("AB")
    assert not problem.isVisible()
    QTest.keyClicks(wearer(page), 99 * "C")
    assert text(page, "brief") == "At most 100 characters; the rest is cut off"


def test_fields_are_reached_by_letters(qtbot: QtBot, open_page: Callable[..., StartPage]) -> None:
    page = open_page()
    page.activateWindow()
    qtbot.waitActive(page)
    alt, reached = Qt.KeyboardModifier.AltModifier, set()
    for letter in "WPCDRS":
        QTest.keyClick(page.windowHandle(), Qt.Key[f"Key_{letter}"], alt)
        field = QApplication.focusWidget()
        assert field is not None
        reached.add(field.accessibleName())
    assert reached == {
        "Wearer's name or code",
        "Plan",
        "Camera",
        "Headset",
        "Rig file",
        "Session folder",
    }


def test_the_next_wearer_finds_everything_as_it_was(open_page: Callable[..., StartPage]) -> None:
    page = open_page(source="realsense", headset="network", port=50_001)
    QTest.keyClicks(wearer(page), "Ada")
    before = page.new.settings
    page.show_preferences(Preferences(station=before))
    assert page.new.settings == before
    assert before.port == 50_001
    assert wearer(page).currentText() == ""
    QTest.keyClicks(wearer(page), "B")
    page.new.show_wearers(["Ada", "Bea"])
    assert wearer(page).currentText() == "B"
    assert [wearer(page).itemText(i) for i in range(2)] == ["Ada", "Bea"]


def test_a_part_that_is_broken_prevents_the_start_until_it_is_fixed(
    qtbot: QtBot, inspector: Inspector, open_page: Callable[..., StartPage]
) -> None:
    inspector.healths["camera"] = Health.BROKEN
    page = open_page(source="realsense", headset="network")
    assert not button(page, "start").isEnabled()
    assert text(page, "startProblem") == "Fix first: Camera."
    assert text(page, "cameraFound") == "Found realsense. Do this."
    inspector.healths["camera"] = Health.GOOD
    button(page, "cameraFix").click()
    assert (page.new.settings.source, page.new.settings.headset) == ("simulator", "virtual")
    qtbot.waitUntil(button(page, "start").isEnabled)
    assert text(page, "cameraFound") == "Found simulator. Do this."
    assert text(page, "startProblem") == ""
    assert not button(page, "cameraFix").isVisible()


def test_a_page_that_checks_says_so_beside_the_grey_button(
    qtbot: QtBot, inspector: Inspector, open_page: Callable[..., StartPage]
) -> None:
    inspector.healths["camera"] = Health.BROKEN
    page = open_page()
    assert text(page, "startProblem") == "Fix first: Camera."
    inspector.healths["camera"] = Health.GOOD
    page.new.check()
    assert text(page, "startProblem") == "Fix first: Camera.", "until it is known to be fixed"
    qtbot.waitUntil(button(page, "start").isEnabled)
    page.new.check()
    assert text(page, "startProblem") == "", "it can be started meanwhile"
    with qtbot.waitSignal(page.new.start_requested):
        button(page, "start").click()
        assert text(page, "startProblem") == "Checking camera, headset and files…"
    assert text(page, "startProblem") == ""


def test_what_breaks_after_the_last_look_is_found_by_the_start(
    qtbot: QtBot, inspector: Inspector, open_page: Callable[..., StartPage]
) -> None:
    page = open_page()
    inspector.healths["sessions"] = Health.BROKEN
    with qtbot.assertNotEmitted(page.new.start_requested):
        button(page, "start").click()
        qtbot.waitUntil(lambda: "Session folder" in text(page, "startProblem"))
    inspector.healths["sessions"] = Health.GOOD
    with qtbot.assertNotEmitted(page.new.start_requested, wait=50):
        page.new.check()
        qtbot.waitUntil(button(page, "start").isEnabled)


@pytest.mark.parametrize(
    ("part", "health", "station", "fix", "mended"),
    [
        ("headset", Health.BROKEN, NETWORK, "virtual headset", {"headset": "virtual"}),
        ("headset", Health.LIMITED, {"source": "realsense"}, "network headset", NETWORK),
        ("rig", Health.BROKEN, {"rig": "/nowhere.yaml"}, "example", {"rig": ""}),
    ],
)
def test_one_click_mends(
    open_page: Callable[..., StartPage],
    inspector: Inspector,
    part: Part,
    health: Health,
    station: dict[str, str],
    fix: str,
    mended: dict[str, str],
) -> None:
    inspector.healths[part] = health
    page = open_page(**station)
    before = page.new.settings
    assert fix in button(page, f"{part}Fix").text().replace("&", "")
    button(page, f"{part}Fix").click()
    assert page.new.settings == replace(before, **mended)  # type: ignore[arg-type]


def test_unfinished_and_recent_sessions_are_offered(
    qtbot: QtBot, inspector: Inspector, open_page: Callable[..., StartPage], tmp_path: Path
) -> None:
    page = open_page()
    asked: list[Path] = []
    page.open_example = asked.append
    button(page, "example").click()
    assert asked == [Path(page.new.settings.sessions)]
    resume, opened = (find(page, QWidget, name) for name in ("resume", "open"))
    assert not resume.isVisible()
    assert not button(opened, "choose").isEnabled()
    inspector.offers = KnownSessions(
        (Entry(tmp_path / "bad", "damaged", is_enabled=False), Entry(tmp_path / "a", "Ada")),
        (Entry(tmp_path / "b", "Bea"),),
    )
    page.show_preferences(Preferences(station=page.new.settings))
    qtbot.waitUntil(resume.isVisible)
    unfinished = find(resume, QListWidget)
    assert [unfinished.item(i).text() for i in range(2)] == ["damaged", "Ada"]
    with qtbot.waitSignal(page.unfinished.chosen) as resumed:
        button(resume, "choose").click()
    assert resumed.args == [tmp_path / "a"]
    unfinished.setCurrentRow(0)
    with qtbot.assertNotEmitted(page.unfinished.chosen):
        unfinished.itemActivated.emit(unfinished.item(0))
    with qtbot.waitSignal(page.recent.chosen) as chosen:
        QTest.keyClick(find(opened, QListWidget), Qt.Key.Key_Return)
    assert chosen.args == [tmp_path / "b"]


def test_any_session_folder_can_be_opened(
    qtbot: QtBot, open_page: Callable[..., StartPage], monkeypatch: pytest.MonkeyPatch
) -> None:
    page = open_page()
    answers = iter(["/some/session", ""])
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: next(answers))
    with qtbot.waitSignal(page.recent.chosen) as opened:
        button(page, "browse").click()
    assert opened.args == [Path("/some/session")]
    with qtbot.assertNotEmitted(page.recent.chosen):
        page.browse()


def test_a_hidden_page_leaves_the_station_alone(
    qtbot: QtBot, inspector: Inspector, open_page: Callable[..., StartPage]
) -> None:
    page = open_page()
    page.hide()
    asked = len(inspector.asked)
    choose(page, "source", "realsense")
    qtbot.wait(400)
    assert len(inspector.asked) == asked


def test_a_check_that_breaks_down_is_reported_and_starts_nothing(
    qtbot: QtBot,
    inspector: Inspector,
    open_page: Callable[..., StartPage],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    page = open_page()
    monkeypatch.setattr(inspector, "healths", None)
    button(page, "start").click()
    qtbot.waitUntil(lambda: "unexpected error" in text(page, "startProblem"))
    monkeypatch.undo()
    with qtbot.assertNotEmitted(page.new.start_requested, wait=50):
        page.new.check()
        qtbot.waitUntil(button(page, "start").isEnabled)


def test_a_realsense_is_looked_for_less_often(
    open_page: Callable[..., StartPage], inspector: Inspector
) -> None:
    page = open_page(source="realsense", realsense=RealSenseSettings("42"))
    page.new.check()
    realsense_ms = page.new._again.interval()
    choose(page, "source", "simulator")
    page.new.check()
    assert page.new._again.interval() < realsense_ms
    assert not inspector.progress.is_cancelled()
    page.stop()
    assert inspector.progress.is_cancelled()  # a process that hangs is not waited for


def test_a_list_is_not_called_empty_before_it_was_looked_for(
    qtbot: QtBot, inspector: Inspector, tmp_path: Path
) -> None:
    settings = StationSettings(sessions=str(tmp_path))
    page = StartPage(Preferences(station=settings), KEY, inspector.check, inspector.find)
    qtbot.addWidget(page)
    assert text(page.recent, "empty") == "Looking for sessions…"
    page.show()
    qtbot.waitUntil(lambda: text(page.recent, "empty").startswith("No session yet"))
    page.stop()
