"""The events on the Lab Streaming Layer, received by pylsl."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from handcal.bridge.bridges import Bridge
from handcal.bridge.lsl import LslOutput, events
from handcal.calibration.states import State
from handcal.core.types import Alignment
from handcal.register.results import Results, SolveSettings, solve_session
from handcal.rig.example import example_rig
from handcal.session.journal import Event
from handcal.station.snapshot import Snapshot

pylsl = pytest.importorskip("pylsl")


@pytest.fixture(scope="module")
def results(simulated: Callable[..., Alignment]) -> Results:
    return solve_session([simulated(1)], example_rig(), SolveSettings())


def test_pylsl_receives_events_with_their_times(
    snapshot: Snapshot,
    later: Callable[..., Snapshot],
    results: Results,
    simulated: Callable[..., Alignment],
) -> None:
    with Bridge(LslOutput("handcal-of-the-tests"), pytest.fail) as bridge:
        (info,) = pylsl.resolve_byprop("source_id", "handcal-of-the-tests", 1, 10.0)
        assert (info.name(), info.type(), info.nominal_srate()) == ("handcal", "Markers", 0.0)
        inlet = pylsl.StreamInlet(info)
        inlet.open_stream(timeout=10.0)
        bridge(snapshot)
        bridge(later())  # nothing happened
        refused = Event(90, "", "refused", {})
        now = replace(
            later(
                state=State.SOLVED,
                refusal="no hand",
                results=results,
            ),
            record=replace(
                snapshot.record,
                events=(*snapshot.record.events, refused),
                alignments={1: simulated(1)},
            ),
        )
        bridge(now)
        received = [inlet.pull_sample(timeout=5.0) for _ in range(7)]
        inlet.close_stream()
    texts = [json.loads(sample[0]) for sample, _ in received]
    assert [text["event"] for text in texts] == [
        "session", "state", "state", "refused", "confirmed", "solved", "solved"
    ]  # fmt: skip
    assert texts[3] == {"event": "refused", "reason": "no hand"}
    assert texts[4] == {"event": "confirmed", "number": 1, "eyes": ["left", "right"]}
    assert texts[5]["phi_m"] == results.eyes["left"].shift_m.tolist()
    ahead_s = pylsl.local_clock() - time.monotonic()
    for (_, stamp_s), one in zip(received, [snapshot] * 2 + [now] * 5, strict=True):
        assert stamp_s - ahead_s == pytest.approx(one.t_host_ns * 1e-9, abs=1e-3)


def test_an_applied_shift_is_one_event(snapshot: Snapshot, later: Callable[..., Snapshot]) -> None:
    waiting, applied = later(is_applied=False), later()
    assert events(snapshot, waiting) == []
    told = events(waiting, applied)
    assert [(one["event"], one["eye"]) for one in told] == [
        ("applied", "left"),
        ("applied", "right"),
    ]
    assert np.allclose(np.array(told[0]["phi_m"]), [0.003, 0.001, 0.005])
    assert events(applied, later()) == []
    moved = later(applied_shift_m={"left": np.array([0.001, 0.0, 0.0]), "right": np.zeros(3)})
    assert [(one["event"], one["eye"]) for one in events(applied, moved)] == [("applied", "left")]
