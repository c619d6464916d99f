"""The display check over the real link, of simulated headsets that obey and that do not."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from handcal.calibration.sight import Evidence
from handcal.core.errors import CancelledError, HandcalError
from handcal.core.progress import Progress
from handcal.core.types import DisplayCheck, Eye, HeadsetIdentity
from handcal.link.client import HeadsetClient
from handcal.link.server import HeadsetServer
from handcal.rig.displays.display_check import Probe
from handcal.rig.example import example_rig
from handcal.rig.findings import display_finding, report_rig
from handcal.rig.rig_file import read_rig, write_rig
from handcal.sim.display import DISPLAY_MODES, DisplayMode, SimulatedDisplay
from handcal.station.checks.display_check import (
    Answer,
    Show,
    by_camera,
    by_wearer,
    run_display_check,
)
from tests.helpers import eventually

KEY = b"a pairing key of the tests"
RIG = example_rig()
CAUSES: Mapping[DisplayMode, str] = {
    "no-override": "has no effect",
    "one-for-both": "single-pass rendering",
    "depth": "depth reprojection",
    "infinity": "focus plane at another distance",
    "image-plane": "submit the runtime's own view",
}


@contextmanager
def headset() -> Iterator[tuple[HeadsetServer, HeadsetClient]]:
    identity = HeadsetIdentity("c" * 16, "Lab 9", "runtime 1", "app 3")
    with HeadsetServer(KEY) as server, HeadsetClient(server.address, KEY, identity) as client:
        server.wait_connected(5.0)
        eventually(lambda: server.device is not None)
        yield server, client


@pytest.mark.parametrize("mode", DISPLAY_MODES)
def test_a_camera_finds_what_a_headset_does(mode: DisplayMode, tmp_path: Path) -> None:
    with headset() as (server, client):
        camera = SimulatedDisplay(client, RIG, mode)
        observe = by_camera(camera, camera.place, settle_s=0.0)
        check = run_display_check(server, RIG, observe, "camera")
        eventually(lambda: client.state().target is None)
        drawn = client.state().drawn
    assert (check.runtime, check.app, check.device_id) == ("runtime 1", "app 3", "c" * 16)
    assert set(drawn) == {"left", "right"}
    assert all(one.P_offline is not None for one in drawn.values())
    problems = {eye: text for eye, text in check.problems.items() if text}
    if mode == "obeys":
        assert problems == {}
    else:
        # The left eye has its own projection even if it serves both.
        assert set(problems) == ({"right"} if mode == "one-for-both" else {"left", "right"})
        assert all(CAUSES[mode] in text for text in problems.values())
    rig = replace(RIG, display_check=check)
    write_rig(tmp_path / "rig.yaml", rig)
    stored = read_rig(tmp_path / "rig.yaml")
    assert stored.display_check == check
    finding = display_finding(check)
    assert finding in report_rig(stored)
    assert finding.is_fine == (mode == "obeys")
    names = [one.name for one in Evidence(stored).contradictions]
    assert names == ([] if mode == "obeys" else ["disobeying-display"])


def test_a_wearer_is_asked_after_every_probe() -> None:
    asked: list[tuple[Eye, Probe]] = []

    def ask(eye: Eye, probe: Probe, show: Show) -> Answer:
        show(probe)
        asked.append((eye, probe))
        return "none" if probe == "other eye" else "part" if probe == "eye shift" else "whole"

    with headset() as (server, _):
        check = run_display_check(server, RIG, by_wearer(ask), "wearer", eyes=("right",))
    assert asked == [("right", probe) for probe in ("control", "shift", "eye shift", "other eye")]
    assert check.observer == "wearer"
    assert set(check.problems) == {"right"}
    assert "focus plane" in check.problems["right"]


def test_a_camera_before_the_wrong_eye_is_said() -> None:
    with headset() as (server, client):
        camera = SimulatedDisplay(client, RIG)
        observe = by_camera(camera, lambda _: camera.place("left"), settle_s=0.0)
        with pytest.raises(HandcalError, match="right eye: the camera does not see the square"):
            run_display_check(server, RIG, observe, "camera", eyes=("right",))
        eventually(lambda: client.state().target is None)


def test_a_check_is_cancelled_and_the_square_removed() -> None:
    with headset() as (server, client):
        asked: list[Probe] = []

        def ask(_eye: Eye, probe: Probe, show: Show) -> Answer:
            asked.append(probe)
            show(probe)
            return "whole"

        progress = Progress(is_cancelled=lambda: bool(asked))
        with pytest.raises(CancelledError):
            run_display_check(server, RIG, by_wearer(ask), "wearer", progress)
        eventually(lambda: client.state().target is None)


@pytest.mark.parametrize(
    "change",
    [
        {"problems": {}},
        {"made": ""},
        {"app": "two\nlines"},
        {"problems": {"left": 501 * "x"}},
    ],
)
def test_an_implausible_check_is_not_written(tmp_path: Path, change: dict[str, object]) -> None:
    check = DisplayCheck("2026-11-23", "camera", "c" * 16, "runtime", "app", {"left": ""})
    wrong = replace(check, **change)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="display_check"):
        write_rig(tmp_path / "rig.yaml", replace(RIG, display_check=wrong))
