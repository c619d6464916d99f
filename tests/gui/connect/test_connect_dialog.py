"""Pairing and trying a headset: nothing is shown that the headset has not done."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QCheckBox,
    QInputDialog,
    QLabel,
    QMessageBox,
    QPushButton,
)
from pytestqt.qtbot import QtBot

from handcal.core.types import HeadsetIdentity, Rig
from handcal.link.client import HeadsetClient
from handcal.link.exchange import pair_by_code
from handcal.link.invitation import read_invitation
from handcal.link.pairing import Pairings
from handcal.link.server import HeadsetServer, PairingAttempts
from handcal_gui.connect.connect_dialog import ConnectDialog, QrCode
from handcal_gui.widgets.table import Table
from tests.gui.helpers import child, text

DEVICE = "00000000000000aa"
PATIENCE_MS = 10_000


@pytest.fixture
def pairings(tmp_path: Path) -> Pairings:
    return Pairings.read(tmp_path / "pairing.key")


@pytest.fixture
def dialog(qtbot: QtBot, pairings: Pairings, rig: Rig) -> Iterator[ConnectDialog]:
    server = HeadsetServer(pairings)
    dialog = ConnectDialog(server, rig, is_calibrating=False, announces=False)
    qtbot.addWidget(dialog)
    dialog.show()
    yield dialog
    dialog.stop()


@pytest.fixture
def connect(
    qtbot: QtBot, dialog: ConnectDialog
) -> Iterator[Callable[[], tuple[HeadsetClient, str]]]:
    """Return a function that pairs a headset by the QR code."""
    clients: list[HeadsetClient] = []

    def connect() -> tuple[HeadsetClient, str]:
        scanned = read_invitation(child(dialog, QrCode).accessibleDescription())
        identity = HeadsetIdentity(DEVICE, "Lab 9", "Runtime 3", "App 1.2", protocol=2)
        address = scanned.host, scanned.port
        key = pair_by_code(scanned, DEVICE)
        clients.append(HeadsetClient(address, key.encode(), identity))
        clients[0].wait_connected(5.0)
        qtbot.waitUntil(lambda: "Lab 9" in text(dialog, "headsetFound"), timeout=PATIENCE_MS)
        return clients[0], key

    yield connect
    for client in clients:
        client.close()


def eye_of_square(client: HeadsetClient) -> str:
    target = client.state().target
    return "" if target is None else target.eye


def test_nothing_is_ticked_before_a_headset_has_connected(dialog: ConnectDialog) -> None:
    assert text(dialog, "headsetFound").startswith("No headset is connected yet")
    assert child(dialog, QLabel, "headsetHealth").accessibleName() == "Note"
    assert not child(dialog, QPushButton, "square-left").isEnabled()
    assert not child(dialog, QCheckBox, "squareSeen-left").isEnabled()
    assert len(text(dialog, "digits").replace(" ", "")) == 8
    assert child(dialog, QrCode).accessibleDescription().startswith("HANDCAL://")


def test_enter_keeps_the_code_that_is_being_typed(dialog: ConnectDialog) -> None:
    code = text(dialog, "digits")
    focused = dialog.focusWidget()
    assert focused is child(dialog, QPushButton, "close")
    QTest.keyClick(focused, Qt.Key.Key_Return)
    assert not dialog.isVisible()
    assert text(dialog, "digits") == code


def test_digits_that_are_guessed_are_told_and_end(
    dialog: ConnectDialog, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried = PairingAttempts(7, "192.168.1.7")
    monkeypatch.setattr(HeadsetServer, "pairing_attempts", property(lambda _: tried))
    dialog.refresh()
    assert "7 attempts with other digits, the last from 192.168.1.7" in text(dialog, "attempts")
    assert child(dialog, QLabel, "digits").isEnabled()
    tried = PairingAttempts(100, "192.168.1.7", is_used_up=True)
    dialog.refresh()
    assert not child(dialog, QLabel, "digits").isEnabled()
    assert child(dialog, QrCode).isVisible()  # it is not ended by who guesses digits
    tried = PairingAttempts()
    dialog.invite()
    dialog.refresh()
    assert child(dialog, QLabel, "digits").isEnabled()
    assert text(dialog, "attempts") == ""


def test_a_headset_pairs_by_the_code_once(
    dialog: ConnectDialog, pairings: Pairings, connect: Callable[[], tuple[HeadsetClient, str]]
) -> None:
    _, key = connect()
    assert [(one.device_id, one.name, one.key) for one in pairings.all] == [(DEVICE, "Lab 9", key)]
    dialog.refresh()
    assert child(dialog, QrCode).accessibleDescription() == ""
    assert text(dialog, "digits") == ""
    assert "Paired" in text(dialog, "howToPair")
    found = text(dialog, "headsetFound")
    assert "Runtime 3" in found
    assert "App 1.2" in found
    assert "It sends no poses" in found
    assert f"{DEVICE}, connected" in child(dialog, Table, "pairedDevices").as_text()
    child(dialog, QPushButton, "invite").click()
    assert child(dialog, QrCode).accessibleDescription().startswith("HANDCAL://")


def test_the_square_is_acknowledged_before_it_can_be_seen(
    qtbot: QtBot,
    dialog: ConnectDialog,
    rig: Rig,
    connect: Callable[[], tuple[HeadsetClient, str]],
) -> None:
    client, _ = connect()
    dialog.refresh()
    child(dialog, QPushButton, "square-right").click()
    seen = child(dialog, QCheckBox, "squareSeen-right")
    qtbot.waitUntil(seen.isEnabled, timeout=PATIENCE_MS)
    assert text(dialog, "squareState-right") == "acknowledged by the headset"
    assert not seen.isChecked()
    target = client.state().target
    assert target is not None
    assert target.eye == "right"
    assert np.ptp(target.corners_V_m[:, 0]) == pytest.approx(0.08, abs=1e-6)
    assert set(client.state().projections) == {"right"}
    seen.setChecked(True)
    child(dialog, QPushButton, "square-left").click()
    qtbot.waitUntil(lambda: eye_of_square(client) == "left", timeout=PATIENCE_MS)
    assert seen.isChecked()  # the wearer's word stays
    client.close()
    qtbot.waitUntil(lambda: not seen.isChecked(), timeout=PATIENCE_MS)


def test_a_headset_is_renamed_and_revoked(
    qtbot: QtBot,
    dialog: ConnectDialog,
    pairings: Pairings,
    connect: Callable[[], tuple[HeadsetClient, str]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    client, _ = connect()
    dialog.refresh()
    table = child(dialog, Table, "pairedDevices")
    table.selectRow(0)
    for typed, said in (("Ward 3", ""), ("x" * 41, "at most 40 characters")):
        monkeypatch.setattr(QInputDialog, "getText", lambda *_, name=typed, **__: (name, True))
        child(dialog, QPushButton, "renameDevice").click()
        assert [one.name for one in pairings.all] == ["Ward 3"]
        assert said in text(dialog, "connectProblem")
        assert "Ward 3" in table.as_text()
        assert len(table.chosen) == 1
    monkeypatch.setattr(QMessageBox, "question", lambda *_: QMessageBox.StandardButton.No)
    child(dialog, QPushButton, "revokeDevice").click()
    assert pairings.all
    monkeypatch.setattr(QMessageBox, "question", lambda *_: QMessageBox.StandardButton.Yes)
    child(dialog, QPushButton, "revokeDevice").click()
    assert pairings.all == ()
    assert "appear here once" in text(dialog, "pairedDevices-empty")
    assert not child(dialog, QPushButton, "renameDevice").isEnabled()
    qtbot.waitUntil(lambda: not client.connected, timeout=PATIENCE_MS)
