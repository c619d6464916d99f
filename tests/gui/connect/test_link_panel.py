from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QLabel, QLineEdit, QPushButton
from pytestqt.qtbot import QtBot

from handcal.station.snapshot import Snapshot
from handcal_gui.connect.link_panel import LinkPanel
from handcal_gui.widgets.number_label import UNKNOWN
from handcal_gui.widgets.table import Table
from tests.gui.conftest import NOW_NS
from tests.gui.helpers import button, child, show, text

Maker = Callable[..., Snapshot]
KEY = "a pairing key of the tests"


@pytest.fixture
def panel(qtbot: QtBot) -> LinkPanel:
    return show(qtbot, LinkPanel(), 430, 470)


def numbers(panel: LinkPanel) -> dict[str, list[str]]:
    """Return the numbers by their names: to and from the headset."""
    lines = child(panel, Table).as_text().splitlines()[1:]
    return {name: cells for name, *cells in (line.split("\t") for line in lines)}


def later(snapshot: Maker, seconds: float, **link: Any) -> Snapshot:
    return snapshot(t_host_ns=NOW_NS + round(1e9 * seconds), link=link)


def test_an_empty_panel_says_how_to_begin(panel: LinkPanel) -> None:
    assert text(panel, "link-state") == "Not connected. Open a session on the start page."
    assert not numbers(panel)
    assert not button(panel, QPushButton, "Show key").isVisible()


def test_it_shows_if_the_headset_is_connected_and_the_problem(
    panel: LinkPanel, snapshot: Maker
) -> None:
    panel.show_snapshot(snapshot())
    assert text(panel, "link-state") == "Connected"
    lost = {"connected": False}
    panel.show_snapshot(
        snapshot(t_host_ns=NOW_NS + 10**10, link=lost, link_problem="Switch it on.")
    )
    assert text(panel, "link-state") == "Switch it on."
    shown = numbers(panel)
    past = {shown[name][-1] for name in ("Latency", "Poses", "Clock", "Clock drift")}
    assert past == {UNKNOWN}


def test_it_tells_how_the_link_does(panel: LinkPanel, snapshot: Maker) -> None:
    panel.show_snapshot(
        snapshot(link={"clock_offset_ms": -5000.1234, "unacked": 2, "failed": 1, "resent": 7})
    )
    assert numbers(panel) == {
        "Data": [UNKNOWN, UNKNOWN],  # one reading gives no rate
        "Lost": [UNKNOWN, UNKNOWN],
        "Latency": ["", "2.4 ms"],
        "Poses": ["", "60.0 Hz"],
        "Resent": ["7", ""],
        "In flight": ["2", ""],
        "Failed": ["1", ""],
        "Clock": ["−5.000 s ± 0.3 ms"],
        "Clock drift": ["−12 ± 3 ppm"],
        "Rejected": ["", "0"],
    }


def test_what_is_not_known_is_a_dash(panel: LinkPanel, snapshot: Maker) -> None:
    unknown = dict.fromkeys(["latency_ms", "clock_offset_ms", "clock_drift_ppm"])
    panel.show_snapshot(snapshot(link=unknown))
    shown = numbers(panel)
    assert {shown[name][-1] for name in ("Latency", "Clock", "Clock drift")} == {UNKNOWN}


def test_losses_and_rates_are_of_the_last_seconds(panel: LinkPanel, snapshot: Maker) -> None:
    for tenth in range(0, 101, 5):  # 1 % lost in all, 4 % in the last two seconds
        lost = 0 if tenth <= 80 else tenth - 80
        counts = {"sent": 25 * tenth, "lost": lost, "received": 30 * tenth, "lost_inbound": 0}
        data = {"bytes_sent": 2_000 * tenth, "bytes_received": 500 * tenth}
        panel.show_snapshot(later(snapshot, tenth / 10, **counts, **data))
    assert numbers(panel)["Lost"] == ["4.0 %", "0.0 %"]
    assert numbers(panel)["Data"] == ["20.0 kB/s", "5.0 kB/s"]


def test_only_reasons_that_occurred_are_listed(panel: LinkPanel, snapshot: Maker) -> None:
    panel.show_snapshot(snapshot(link={"rejected": {"unpaired": 12, "wrong_session": 3}}))
    shown = numbers(panel)
    assert shown["Rejected"] == ["", "15"]
    reasons = {name: cells for name, cells in shown.items() if name.startswith("Rejected, ")}
    assert reasons == {"Rejected, unpaired": ["", "12"], "Rejected, wrong session": ["", "3"]}


def test_the_key_is_hidden_until_asked_for_and_copied_unseen(panel: LinkPanel) -> None:
    panel.show_pairing("192.168.1.5:50123", KEY)
    key = child(panel, QLineEdit, "pairingKey")
    assert child(panel, QLabel, "pairing-address").text() == "192.168.1.5:50123"
    assert key.displayText() != KEY
    button(panel, QPushButton, "Copy").click()
    assert QGuiApplication.clipboard().text() == KEY
    button(panel, QPushButton, "Show key").click()
    assert key.displayText() == KEY
    panel.show_pairing("192.168.1.5:50124", "another key of the tests")
    assert key.displayText() != "another key of the tests"


def test_only_a_virtual_headset_can_be_restarted(panel: LinkPanel) -> None:
    panel.show_pairing("192.168.1.5:50123", KEY)
    assert not panel.restart_headset.isVisible()
    panel.show_pairing("127.0.0.1:50123", KEY, is_virtual=True)
    assert panel.restart_headset.isVisible()


def test_another_link_starts_again(panel: LinkPanel, snapshot: Maker) -> None:
    panel.show_snapshot(later(snapshot, 0.0, sent=1000, bytes_sent=1_000_000))
    panel.show_pairing("127.0.0.1:50123", KEY)
    panel.show_snapshot(later(snapshot, 0.1, sent=10, bytes_sent=100))
    assert numbers(panel)["Data"][0] == UNKNOWN
