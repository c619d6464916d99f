from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from handcal.calibration.states import State
from handcal.station.snapshot import Snapshot
from handcal_gui.calibrate.control.conditions import Conditions

Maker = Callable[..., Snapshot]
UNPLUGGED = {"camera": {"problem": "the camera was unplugged"}}


def after(snapshot: Snapshot, seconds: float) -> Snapshot:
    return replace(snapshot, t_host_ns=snapshot.t_host_ns + round(1e9 * seconds))


def watch(conditions: Conditions, snapshot: Snapshot, times_s: list[float]) -> list[str]:
    return [conditions.condition(after(snapshot, one)) for one in times_s]


def test_a_problem_that_passes_is_not_shown(snapshot: Maker) -> None:
    conditions = Conditions()
    fine, bad = snapshot(), snapshot(**UNPLUGGED)
    assert watch(conditions, fine, [0.0]) == [""]
    assert watch(conditions, bad, [1.0, 1.5]) == ["", ""]
    assert watch(conditions, fine, [1.6]) == [""]
    assert watch(conditions, bad, [2.0, 3.0]) == ["", "the camera was unplugged"]
    assert watch(conditions, fine, [3.1]) == [""]


def test_a_virtual_headset_that_ended_is_the_cause_of_all_else(snapshot: Maker) -> None:
    ended = replace(snapshot(**UNPLUGGED), link_problem="the virtual headset has ended.")
    for is_virtual, text in (
        (True, "the virtual headset has ended; press Restart headset in Link"),
        (False, "the camera was unplugged"),
    ):
        conditions = Conditions(is_virtual=is_virtual)
        assert watch(conditions, ended, [0.0, 5.0])[-1] == text


def test_what_the_headset_does_not_answer_leads_to_link(snapshot: Maker) -> None:
    silent = snapshot(not_applied="the headset did not answer")
    assert watch(Conditions(), silent, [0.0, 5.0])[-1] == "the headset did not answer; see Link"
    full = replace(silent, not_stored="the disk is full")
    assert watch(Conditions(), full, [0.0, 5.0])[-1] == "the disk is full"


def test_a_virtual_headset_that_connects_again_after_a_stall_is_no_problem(
    snapshot: Maker,
) -> None:
    notice = "headset Virtual headset asks to connect; Virtual headset is connected"
    again = replace(snapshot(link={"notice": notice}), link_problem=notice)
    for is_virtual, text in ((True, ""), (False, notice)):
        conditions = Conditions(is_virtual=is_virtual)
        assert watch(conditions, again, [0.0, 5.0])[-1] == text


def test_a_start_is_no_problem(snapshot: Maker) -> None:
    conditions = Conditions()
    silent = snapshot(
        camera={"problem": "nothing seen", "rate_hz": 0.0}, link={"pose_rate_hz": 0.0}
    )
    assert watch(conditions, silent, [0.0, 2.0, 3.9]) == ["", "", ""]
    assert watch(conditions, silent, [4.1]) == ["nothing seen"]


def test_a_slow_computer_is_named_once_until_it_is_fast_again(snapshot: Maker) -> None:
    conditions = Conditions()
    slow, fast = snapshot(camera={"rate_hz": 2.0}), snapshot(camera={"rate_hz": 30.0})
    assert watch(conditions, fast, [0.0]) == [""]
    assert watch(conditions, slow, [1.0, 3.0]) == ["", ""]
    texts = watch(conditions, slow, [4.0, 5.0, 6.0])
    assert conditions.is_slow
    assert texts[-1].startswith("images per second: 2, fewer than 8")
    assert texts[-1].endswith("or confirmations may be refused")
    slower = snapshot(camera={"rate_hz": 1.0})
    assert "images per second: 1, fewer than 8" in watch(conditions, slower, [7.0])[0]
    watch(conditions, fast, [8.0, 11.0])
    assert not conditions.is_slow
    assert watch(conditions, fast, [12.0]) == [""]


@pytest.mark.parametrize(
    ("is_usb", "dropped", "advice"),
    [
        (False, 0, "close other programs"),
        (True, 0, "plug the camera into a USB 3 port"),
        (True, 40, "close other programs"),
    ],
)
def test_advice_names_usb_only_for_a_camera_that_sends_few_frames(
    snapshot: Maker, is_usb: bool, dropped: int, advice: str
) -> None:
    conditions = Conditions(is_usb=is_usb)
    watch(conditions, snapshot(camera={"rate_hz": 2.0}), [0.0, 1.0])
    later = snapshot(camera={"rate_hz": 2.0, "dropped": dropped})
    assert watch(conditions, later, [4.0, 5.0])[-1].endswith(
        f"fewer than 8; {advice}, or confirmations may be refused"
    )


@pytest.mark.parametrize("rate_hz", [8.0, 15.0, 30.0])
def test_a_camera_that_is_fast_enough_is_not_named(snapshot: Maker, rate_hz: float) -> None:
    conditions = Conditions()
    seen = snapshot(camera={"rate_hz": rate_hz})
    assert watch(conditions, seen, [0.0, 5.0, 10.0]) == ["", "", ""]


def test_a_gap_in_the_poses_flashes_nowhere(snapshot: Maker) -> None:
    conditions = Conditions()
    fine = snapshot(State.SHOW_HAND)
    gap = snapshot(State.SHOW_HAND, observation={"hand": None, "problem": "a gap of 64 ms"})
    no_hand = snapshot(
        State.SHOW_HAND, observation={"hand": None, "cloud": None, "problem": "no hand"}
    )

    def problem(seen: Snapshot, seconds: float) -> str:
        calm = conditions.calm(after(seen, seconds)).observation
        assert calm is not None
        return calm.problem

    assert problem(fine, 0.0) == ""
    assert problem(gap, 0.1) == ""
    assert problem(fine, 0.2) == ""
    assert problem(gap, 0.3) == ""
    assert problem(gap, 1.2) == "a gap of 64 ms"
    assert problem(no_hand, 1.3) == "no hand"


def test_a_late_frame_does_not_take_the_hand_away(snapshot: Maker) -> None:
    conditions = Conditions()
    fine = snapshot(State.SHOW_HAND)
    late = replace(fine, observation=None)
    assert conditions.calm(fine).observation is fine.observation
    assert conditions.calm(after(late, 0.5)).observation is fine.observation
    unplugged = replace(snapshot(State.SHOW_HAND, **UNPLUGGED), observation=None)
    other_state = replace(snapshot(State.ALIGN), observation=None)
    for other in (after(late, 0.9), unplugged, other_state):
        assert conditions.calm(other).observation is None


def test_a_headset_that_sends_few_poses_is_named(snapshot: Maker) -> None:
    conditions = Conditions()
    assert watch(conditions, snapshot(), [0.0]) == [""]
    for rate_hz, start_s in ((2.0, 1.0), (0.0, 4.0)):
        few = snapshot(link={"pose_rate_hz": rate_hz})
        assert watch(conditions, few, [start_s, start_s + 0.5]) == ["", ""]
        said = watch(conditions, few, [start_s + 1.0])[0]
        assert said.startswith("The headset sends too few poses")
        assert watch(conditions, snapshot(link={"pose_rate_hz": 30.0}), [start_s + 2.0]) == [""]
