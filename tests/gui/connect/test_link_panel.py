from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pyqtgraph as pg
import pytest
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import (
    QLabel,
    QLineEdit,
    QPushButton,
)
from pytestqt.qtbot import QtBot

from handcal.link.wire import Rejection
from handcal.station.snapshot import Snapshot
from handcal_gui.connect.link_panel import LinkPanel
from handcal_gui.connect.link_table import REJECTIONS
from handcal_gui.widgets.number_label import UNKNOWN, NumberLabel
from handcal_gui.widgets.plots import Plot
from tests.gui.conftest import NOW_NS
from tests.gui.helpers import button, child, show

Maker = Callable[..., Snapshot]
KEY = "a pairing key of the tests"


@pytest.fixture
def panel(qtbot: QtBot) -> LinkPanel:
    return show(qtbot, LinkPanel(), 430, 470)


def text(panel: LinkPanel, name: str) -> str:
    return child(panel, QLabel, f"link-{name}").text()


def later(snapshot: Maker, seconds: float, **link: Any) -> Snapshot:
    return snapshot(t_host_ns=NOW_NS + round(1e9 * seconds), link=link)


def test_an_empty_panel_says_how_to_begin(panel: LinkPanel) -> None:
    assert text(panel, "state") == "Not connected. Open a session on the start page."
    assert {label.text() for label in panel.findChildren(NumberLabel) if label.isVisible()} == {"–"}
    assert not button(panel, QPushButton, "Show key").isVisible()


def test_it_shows_if_the_headset_is_connected_and_the_problem(
    panel: LinkPanel, snapshot: Maker
) -> None:
    panel.show_snapshot(snapshot())
    assert text(panel, "state") == "Connected"
    there = panel.grab().toImage()
    lost = {"connected": False}
    panel.show_snapshot(
        snapshot(t_host_ns=NOW_NS + 10**10, link=lost, link_problem="Switch it on.")
    )
    assert text(panel, "state") == "Switch it on."
    past = ("latency-2", "poses-2", "clock-3", "clock-drift-3")
    assert {text(panel, number) for number in past} == {UNKNOWN}
    assert panel.grab().toImage() != there


def test_it_tells_how_the_link_does(panel: LinkPanel, snapshot: Maker) -> None:
    panel.show_snapshot(
        snapshot(link={"clock_offset_ms": -5000.1234, "unacked": 2, "failed": 1, "resent": 7})
    )
    assert text(panel, "latency-2") == "2.4 ms"
    assert text(panel, "poses-2") == "60.0 Hz"
    assert text(panel, "clock-3") == "−5.000 s ± 0.3 ms"
    assert text(panel, "clock-drift-3") == "−12 ± 3 ppm"
    assert text(panel, "in-flight-1") == "2"
    assert text(panel, "failed-1") == "1"
    assert text(panel, "resent-1") == "7"
    assert text(panel, "lost-1") == text(panel, "data-1") == "–", "one reading gives no rate"


def test_what_is_not_known_is_a_dash(panel: LinkPanel, snapshot: Maker) -> None:
    unknown = dict.fromkeys(
        [
            "latency_ms",
            "clock_offset_ms",
            "clock_drift_ppm",
            "clock_drift_uncertainty_ppm",
            "clock_uncertainty_ms",
        ]
    )
    panel.show_snapshot(snapshot(link=unknown))
    for name in ("latency-2", "clock-3", "clock-drift-3"):
        assert text(panel, name) == "–"


def test_losses_and_rates_are_of_the_last_seconds(panel: LinkPanel, snapshot: Maker) -> None:
    for tenth in range(0, 101, 5):  # 1 % lost in all, 4 % in the last two seconds
        lost = 0 if tenth <= 80 else tenth - 80
        counts = {"sent": 25 * tenth, "lost": lost, "received": 30 * tenth, "lost_inbound": 0}
        data = {"bytes_sent": 2_000 * tenth, "bytes_received": 500 * tenth}
        panel.show_snapshot(later(snapshot, tenth / 10, **counts, **data))
    assert text(panel, "lost-1") == "4.0 %"
    assert text(panel, "lost-2") == "0.0 %"
    assert text(panel, "data-1") == "20.0 kB/s"
    assert text(panel, "data-2") == "5.0 kB/s"


def test_only_reasons_that_occurred_are_listed_and_explained(
    panel: LinkPanel, snapshot: Maker
) -> None:
    panel.show_snapshot(snapshot(link={"rejected": {"unpaired": 12, "wrong_session": 3}}))
    assert text(panel, "rejected-2") == "15"
    for reason in Rejection:
        label = panel.findChild(NumberLabel, f"link-{reason.replace('_', '-')}-2")
        assert label is not None
        assert label.isVisible() == (reason in ("unpaired", "wrong_session"))
        assert label.toolTip() == REJECTIONS[reason]
    assert text(panel, "unpaired-2") == "12"


def test_the_history_is_of_half_a_minute(panel: LinkPanel, snapshot: Maker) -> None:
    for second in range(40):
        panel.show_snapshot(later(snapshot, second, latency_ms=float(second)))
    plot = panel.findChild(Plot, "latency-history")
    assert plot is not None
    (line,) = (item for item in plot.item.items if isinstance(item, pg.PlotDataItem))
    times_s, latencies_ms = line.getData()
    assert times_s[0] == pytest.approx(-30.0)
    assert list(latencies_ms) == [float(second) for second in range(9, 40)]
    assert plot.item.viewRange()[1] == pytest.approx([0.0, 50.0])


def test_the_key_is_hidden_until_asked_for(panel: LinkPanel) -> None:
    panel.show_pairing("192.168.1.5:50123", KEY)
    key = panel.findChild(QLineEdit, "pairingKey")
    address = panel.findChild(QLabel, "pairing-address")
    assert key is not None
    assert address is not None
    assert address.text() == "192.168.1.5:50123"
    assert key.displayText() != KEY
    button(panel, QPushButton, "Show key").click()
    assert key.displayText() == KEY
    panel.show_pairing("192.168.1.5:50124", "another key of the tests")
    assert key.displayText() != "another key of the tests"


def test_the_key_can_be_copied_unseen(panel: LinkPanel) -> None:
    panel.show_pairing("192.168.1.5:50123", KEY)
    button(panel, QPushButton, "Copy").click()
    assert QGuiApplication.clipboard().text() == KEY


def test_a_new_key_is_asked_for(panel: LinkPanel, qtbot: QtBot) -> None:
    panel.show_pairing("192.168.1.5:50123", KEY)
    with qtbot.waitSignal(panel.new_key_requested):
        button(panel, QPushButton, "New key…").click()


def test_only_a_virtual_headset_can_be_restarted(panel: LinkPanel, qtbot: QtBot) -> None:
    restart = button(panel, QPushButton, "Restart headset")
    panel.show_pairing("192.168.1.5:50123", KEY)
    assert not restart.isVisible()
    panel.show_pairing("127.0.0.1:50123", KEY, is_virtual=True)
    assert restart.isVisible()
    with qtbot.waitSignal(panel.restart_headset_requested):
        restart.click()


def test_another_link_starts_again(panel: LinkPanel, snapshot: Maker) -> None:
    panel.show_snapshot(later(snapshot, 0.0, sent=1000, bytes_sent=1_000_000))
    panel.show_pairing("127.0.0.1:50123", KEY)
    panel.show_snapshot(later(snapshot, 0.1, sent=10, bytes_sent=100))
    assert text(panel, "data-1") == "–"
