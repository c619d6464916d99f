from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from handcal.calibration.states import CalibrationSettings, State
from handcal.register.guard import GuardSettings, turn_advice
from handcal.session.journal import Event
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.rotation.panel import RotationDial, RotationPanel
from handcal_gui.widgets.plots import Plot
from tests.gui.helpers import child

Make = Callable[..., Snapshot]
TURNED = (
    "Your hand is turned by 14.0°, more than 9°. Tip your fingers away from you and confirm again."
)


@pytest.fixture
def panel(qtbot: QtBot) -> RotationPanel:
    panel = RotationPanel()
    qtbot.addWidget(panel)
    panel.resize(380, 300)
    return panel


def word(panel: RotationPanel) -> str:
    return child(panel, RotationDial, "rotation-dial").accessibleDescription()


def text(panel: RotationPanel, name: str) -> str:
    return child(panel, QLabel, f"rotation-{name}").text()


def history(panel: RotationPanel) -> tuple[Any, Any]:
    """Return times (s) and angles (°) of the plot's line."""
    _, angle_line = child(panel, Plot, "rotation-history").item.listDataItems()
    times_s, angles_deg = angle_line.getData()
    return times_s, angles_deg


def turned(snapshot: Make, rotation_deg: Any, t_s: float = 0.0) -> Snapshot:
    rotation_rad = np.radians(rotation_deg)
    is_over = bool(np.linalg.norm(rotation_rad) > np.radians(9.0))
    seen = {"rotation_rad": rotation_rad, "is_over_limit": is_over}
    return snapshot(observation=seen, t_host_ns=round(1e9 * t_s))


def test_before_a_cursor_it_says_what_it_will_show(panel: RotationPanel, snapshot: Make) -> None:
    panel.show_snapshot(snapshot(State.SHOW_HAND))
    assert text(panel, "advice").startswith("While the wearer aligns, ")
    assert word(panel) == ""


@pytest.mark.parametrize(
    ("rotation_deg", "expected"),
    [((0.5, 0.5, 0.5), "✓ Straight"), ((1, 8, 2), "✓ Within limit"), ((-9, 0, 4), "▲ Turn back")],
)
def test_the_word_says_whether_it_may_be_confirmed(
    panel: RotationPanel, snapshot: Make, rotation_deg: tuple[float, ...], expected: str
) -> None:
    panel.show_snapshot(turned(snapshot, rotation_deg))
    assert word(panel) == expected
    assert child(panel, RotationDial).is_over == expected.startswith("▲")


def limited(limit_deg: float) -> CalibrationSettings:
    return CalibrationSettings(guard=GuardSettings(limit_rad=float(np.radians(limit_deg))))


def test_a_strict_limit_is_reported_however_small(panel: RotationPanel, snapshot: Make) -> None:
    seen = {"rotation_rad": np.radians([0.0, 1.5, 0.0]), "is_over_limit": True}
    panel.show_snapshot(snapshot(observation=seen, settings=limited(1.0)))
    assert word(panel) == "▲ Turn back"


def test_a_change_of_shape_is_shown_beside_the_turn(panel: RotationPanel, snapshot: Make) -> None:
    changed = {
        "shape_change_m": 0.004,
        "shape_text": "thumb 9 mm further out than in the cursor",
        "has_changed": True,
        "is_over_limit": True,
    }
    panel.show_snapshot(snapshot(observation=changed | {"rotation_rad": np.radians([0, 4, 0])}))
    assert word(panel) == "▲ Shape differs"
    assert text(panel, "advice") == "Thumb 9 mm further out than in the cursor."
    panel.show_snapshot(snapshot(observation=changed | {"rotation_rad": np.radians([0, 14, 0])}))
    assert word(panel) == "▲ Turn back"
    assert text(panel, "advice").endswith("by 14°. Thumb 9 mm further out than in the cursor.")


def test_it_says_which_way_to_turn_and_how_far(panel: RotationPanel, snapshot: Make) -> None:
    rotation_deg = np.array([2.0, -1.0, 11.3])
    panel.show_snapshot(turned(snapshot, rotation_deg))
    assert text(panel, "advice") == f"{turn_advice(np.radians(rotation_deg)).text} by 11°."
    panel.show_snapshot(turned(snapshot, -rotation_deg))
    assert text(panel, "advice") == f"{turn_advice(np.radians(-rotation_deg)).text} by 11°."


def test_a_lost_hand_is_reported_and_leaves_a_gap(panel: RotationPanel, snapshot: Make) -> None:
    panel.show_snapshot(turned(snapshot, (0, 0, 12), 1.0))
    lost = {"hand": None, "rotation_rad": None, "problem": "the headset sends no poses"}
    panel.show_snapshot(snapshot(observation=lost, t_host_ns=2_000_000_000))
    assert word(panel) == "? Not placed", "the camera sees the hand"
    lost |= {"cloud": None, "problem": "no hand; raise it"}
    panel.show_snapshot(snapshot(observation=lost, t_host_ns=2_000_000_000))
    assert word(panel) == "? No hand"
    assert text(panel, "advice") == "No hand; raise it"
    assert np.isnan(history(panel)[1]).tolist() == [False, True]


def test_without_a_new_frame_nothing_changes(panel: RotationPanel, snapshot: Make) -> None:
    panel.show_snapshot(turned(snapshot, (0, 0, 12)))
    panel.show_snapshot(snapshot(observation=None))
    assert word(panel) == "▲ Turn back"
    assert len(history(panel)[0]) == 1


def test_the_history_is_of_the_last_ten_seconds(panel: RotationPanel, snapshot: Make) -> None:
    for t_s in range(15):
        panel.show_snapshot(turned(snapshot, (0, 0, t_s), float(t_s)))
    times_s, angles_deg = history(panel)
    np.testing.assert_allclose(times_s, np.arange(-10, 1), atol=1e-6)
    np.testing.assert_allclose(angles_deg, np.arange(4, 15))


def test_the_history_ends_at_the_angle_shown(panel: RotationPanel, snapshot: Make) -> None:
    for t_s, angle_deg, ends_deg in ((1.0, 5.0, 5.0), (1.03, 5.2, 5.0), (1.06, 5.4, 5.4)):
        panel.show_snapshot(turned(snapshot, (0, 0, angle_deg), t_s))
        assert history(panel)[1][-1] == pytest.approx(ends_deg), "redrawn only if it has moved"
    panel.show_snapshot(turned(snapshot, (0, 0, 5.5), 1.3))
    assert history(panel)[1][-1] == pytest.approx(5.5)


def test_what_is_beyond_the_scale_is_drawn_at_its_end(panel: RotationPanel, snapshot: Make) -> None:
    panel.show_snapshot(turned(snapshot, (0, 0, 40)))
    assert history(panel)[1].tolist() == pytest.approx([18.0])


def test_another_cursor_begins_another_history(panel: RotationPanel, snapshot: Make) -> None:
    panel.show_snapshot(turned(snapshot, (0, 0, 5)))
    panel.show_snapshot(snapshot(State.SHOW_HAND))
    assert history(panel)[0] is None or not len(history(panel)[0])


def test_after_the_alignment_it_asks_for_nothing(panel: RotationPanel, snapshot: Make) -> None:
    aligning = turned(snapshot, (0, 0, 5))
    panel.show_snapshot(aligning)
    assert len(history(panel)[0]) == 1
    panel.show_snapshot(snapshot(State.ALIGNED, procedure={"cursor": aligning.procedure.cursor}))
    assert history(panel)[0] is None  # it would no longer be of the last ten seconds
    assert text(panel, "advice") == "The alignment is confirmed."
    assert word(panel) == ""


def test_without_an_image_nothing_is_asked_of_the_hand(
    panel: RotationPanel, snapshot: Make
) -> None:
    panel.show_snapshot(snapshot(observation=None, camera={"problem": "the camera is gone"}))
    why = "The camera gives no image; the message below the guide says why."
    assert text(panel, "advice") == why


def test_refusals_are_counted_and_the_last_one_told(panel: RotationPanel, snapshot: Make) -> None:
    panel.show_snapshot(snapshot())
    assert text(panel, "refusals") == "No confirmation refused."
    record = snapshot().record
    refused = [Event(90 + number, "", "refused", {}) for number in range(2)]
    counted = replace(record, events=(*record.events, *refused))
    turned = {"refusal": "Your hand is turned."}
    panel.show_snapshot(snapshot(procedure=turned, record=counted))
    assert text(panel, "refusals") == "2 confirmations refused. Your hand is turned."
    panel.show_snapshot(snapshot(procedure={"refusal": "the headset draws something else."}))
    assert text(panel, "refusals") == "1 confirmation refused. The headset draws something else."
    over = {"refusal": TURNED, "refused_for": "your hand was turned by 18.6°"}
    panel.show_snapshot(snapshot(procedure=over))
    assert text(panel, "refusals") == "1 confirmation refused. Your hand was turned by 18.6°."
    events = [replace(refused[0], data={"reason": why}) for why in ("turned", "moved")]
    confirmed = replace(record, events=(*record.events, *events))
    panel.show_snapshot(snapshot(State.ALIGNED, record=confirmed))
    assert text(panel, "refusals") == "2 confirmations refused. Last: moved too fast."


def test_the_limit_is_the_procedures(panel: RotationPanel, snapshot: Make) -> None:
    panel.show_snapshot(snapshot(settings=limited(5.0)))
    limit_line, _ = child(panel, Plot).item.listDataItems()
    np.testing.assert_allclose(limit_line.getData()[1], [5.0, 5.0])


def test_the_history_has_no_numbers_before_there_is_a_limit(
    panel: RotationPanel, snapshot: Make
) -> None:
    axis = child(panel, Plot, "rotation-history").item.getAxis("left")
    assert axis._tickLevels == [[]], "pyqtgraph's own would overlap"
    panel.show_snapshot(snapshot())
    assert len(axis._tickLevels[0]) == 1
