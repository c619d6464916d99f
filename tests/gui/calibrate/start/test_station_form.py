"""The form of the start page: its choices reach the settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtGui import QGuiApplication
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDialog,
    QDoubleSpinBox,
    QLineEdit,
    QSpinBox,
)
from pytestqt.qtbot import QtBot

from handcal.calibration.plan import PlanSettings
from handcal.camera.playback import PlaybackSettings
from handcal.camera.settings import HoloLens2Settings, RealSenseSettings
from handcal.hand.settings import SegmentSettings
from handcal.station.checks.doctor import Health
from handcal.station.settings import StationSettings
from handcal_gui.app.preferences import Preferences, PreferencesFile
from handcal_gui.calibrate.start.start_page import StartPage
from handcal_gui.widgets.path_field import PathField
from tests.gui.calibrate.start.conftest import (
    KEY,
    Inspector,
    button,
    choose,
    find,
)


def test_every_choice_reaches_the_settings(
    qtbot: QtBot, inspector: Inspector, open_page: Callable[..., StartPage], tmp_path: Path
) -> None:
    page = open_page()
    choose(page, "source", "recording")
    for field in page.findChildren(PathField):
        field.set_path(f"/{field.name}")
    for box in ("realTime", "loop"):
        assert find(page, QCheckBox, box).isChecked()
        find(page, QCheckBox, box).click()
    find(page, QLineEdit, "serial").setText(" 42 ")
    choose(page, "headset", "network")
    find(page, QLineEdit, "host").setText("192.168.1.2")
    find(page, QSpinBox, "port").setValue(50_002)
    find(page, QSpinBox, "seed").setValue(7)
    for name, value in (("guard", 12.0), ("gateNear", 0.2), ("gateFar", 0.3), ("loss", 5.0)):
        find(page, QDoubleSpinBox, name).setValue(value)
    choose(page, "method", "paper")
    choose(page, "roi", "depth")
    settings = page.new.settings
    calibration = settings.calibration
    assert settings == StationSettings(
        source="recording",
        recording="/Recording",
        playback=PlaybackSettings(real_time=False, loop=False),
        realsense=RealSenseSettings(serial="42"),
        headset="network",
        host="192.168.1.2",
        port=50_002,
        rig="/Rig file",
        seed=7,
        loss=0.05,
        sessions="/Session folder",
        calibration=calibration,
    )
    assert calibration.guard.limit_rad == pytest.approx(0.2094395)
    assert (calibration.segment.depth_min_m, calibration.segment.depth_max_m) == (0.2, 0.3)
    assert calibration.segment.roi == "depth"
    assert calibration.solve.method == "paper"
    qtbot.waitUntil(lambda: inspector.asked[-1] == (settings, KEY))
    assert inspector.folders[-1] == Path("/Session folder")
    page.show_preferences(Preferences(station=StationSettings()))
    assert page.new.settings == StationSettings()


def test_what_is_set_of_a_realsense_reaches_the_settings(
    qtbot: QtBot, open_page: Callable[..., StartPage]
) -> None:
    page = open_page(source="realsense", realsense=RealSenseSettings("42", preset="hand"))

    def answer(result: QDialog.DialogCode) -> RealSenseSettings:
        button(page, "editRealSense").click()
        dialog = find(page, QDialog, "cameraSettings")
        find(dialog, QCheckBox, "temporal").click()
        dialog.done(result)
        qtbot.waitUntil(lambda: page.findChild(QDialog, "cameraSettings") is None)
        return page.new.settings.realsense

    before = page.new.settings.realsense
    assert answer(QDialog.DialogCode.Rejected) == before
    chosen = answer(QDialog.DialogCode.Accepted)
    assert chosen == replace(before, temporal_filter=True)
    find(page, QLineEdit, "serial").setText("43")
    assert page.new.settings.realsense == replace(chosen, serial="43")


def test_the_address_of_a_hololens_reaches_the_settings(
    open_page: Callable[..., StartPage],
) -> None:
    chosen = HoloLens2Settings("192.168.1.7", divisor=5)
    page = open_page(source="hololens2", headset="network", hololens2=chosen)
    assert page.new.settings.hololens2 == chosen
    find(page, QLineEdit, "hololens2Host").setText(" hl.local ")
    assert page.new.settings.hololens2 == replace(chosen, host="hl.local")
    choose(page, "source", "orbbec")
    other = find(page, QLineEdit, "otherSerial")
    assert other.isVisible()
    other.setText("AB1")
    assert (page.new.settings.source, page.new.settings.serial) == ("orbbec", "AB1")


def test_the_gate_stays_open_and_neither_end_moves_the_other(
    open_page: Callable[..., StartPage],
) -> None:
    page = open_page()
    near, far = (find(page, QDoubleSpinBox, name) for name in ("gateNear", "gateFar"))
    for field, typed, gate_m in (
        (near, "0.95", (0.65, 0.7)),
        (far, "0.1", (0.65, 0.7)),
        (far, "0.95", (0.65, 0.95)),
        (near, "0.90", (0.9, 0.95)),
    ):
        field.selectAll()
        QTest.keyClicks(field.lineEdit(), typed)
        field.interpretText()  # as Return does
        segment = page.new.settings.calibration.segment
        assert (segment.depth_min_m, segment.depth_max_m) == pytest.approx(gate_m)
    page.new.show_settings(StationSettings())
    segment = page.new.settings.calibration.segment
    assert (segment.depth_min_m, segment.depth_max_m) == pytest.approx((0.35, 0.7))
    assert (near.maximum(), far.minimum()) == pytest.approx((0.65, 0.4))


def test_the_usual_gate_leaves_the_other_settings(
    qtbot: QtBot, inspector: Inspector, open_page: Callable[..., StartPage]
) -> None:
    page = open_page()
    choose(page, "roi", "right")
    inspector.healths["camera"] = Health.BROKEN
    find(page, QDoubleSpinBox, "gateFar").setValue(2.0)
    find(page, QDoubleSpinBox, "gateNear").setValue(1.5)
    fix = button(page, "cameraFix")
    qtbot.waitUntil(lambda: fix.text() == "Use the usual gate")
    fix.click()
    segment = page.new.settings.calibration.segment
    assert segment == SegmentSettings(roi="right")


def test_the_gate_follows_the_camera_unless_it_was_set(open_page: Callable[..., StartPage]) -> None:
    page = open_page()
    near, far = (find(page, QDoubleSpinBox, name) for name in ("gateNear", "gateFar"))
    choose(page, "source", "hololens2")
    assert (near.value(), far.value()) == (0.20, 0.70)
    assert page.new.settings.calibration.segment.depth_min_m == 0.20
    choose(page, "source", "realsense")
    assert near.value() == 0.35
    near.setValue(0.30)
    choose(page, "source", "hololens2")
    assert near.value() == 0.30


def test_the_pairing_key_is_hidden_until_asked_for(open_page: Callable[..., StartPage]) -> None:
    page = open_page(source="realsense", headset="network")
    shown = find(page, QLineEdit, "pairingKey")
    assert KEY not in shown.displayText()
    button(page, "showKey").click()
    assert shown.displayText() == KEY
    button(page, "copyKey").click()
    assert QGuiApplication.clipboard().text() == KEY
    page.new.set_pairing_key("another key of the same headset")
    assert shown.text() == "another key of the same headset"
    choose(page, "headset", "virtual")
    assert not shown.isVisible()


@pytest.mark.parametrize(
    "plan",
    [
        PlanSettings("recommended", is_automatic=True),
        PlanSettings("recommended", ("right",), is_automatic=True),
        PlanSettings("paper"),
    ],
)
def test_a_plan_is_shown_and_taken(open_page: Callable[..., StartPage], plan: PlanSettings) -> None:
    page = open_page(plan=plan)
    assert page.new.settings.plan == plan
    assert find(page, QComboBox, "usableEyes").isVisible() == (plan.name == "recommended")
    choose(page, "plan", "paper")
    assert page.new.settings.plan == PlanSettings("paper"), "the guide chooses the eyes"


def test_the_recommended_plan_is_proposed_and_remembered(tmp_path: Path) -> None:
    file = PreferencesFile(tmp_path / "preferences.json")
    file.save(Preferences())
    plan = file.load()[0].station.plan
    assert (plan.name, plan.is_automatic) == ("recommended", True)
