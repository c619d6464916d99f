"""Drive a whole station without a window: camera, headset, guard, solver and session file.

python examples/06_drive_a_station.py [--output FOLDER] [--seed N]

The simulator takes the place of camera, headset and wearer; datagrams and frames are real. With
StationSettings(source="realsense", headset="network") the same lines drive real hardware.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import handcal
from handcal.calibration.sight import Observation
from handcal.calibration.states import State
from handcal.cli.terminal import errors_in_one_line
from handcal.station.settings import StationSettings
from handcal.station.station import Station

LIMIT_S, LEAST_STEPS = 60.0, 300


def main() -> None:
    """Calibrate one wearer, who aligns the hand once with both eyes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("results/sessions"))
    parser.add_argument("--seed", type=int, default=1, help="of the simulated wearer")
    arguments = parser.parse_args()

    settings = StationSettings(seed=arguments.seed, sessions=str(arguments.output))
    with Station(settings, "Simulated wearer") as station:
        calibration = station.calibration
        step_until(station, lambda seen: seen.is_steady, "a steady hand")
        calibration.make_cursor()  # freezes the hand, and shows it to the wearer
        step_until(station, lambda seen: seen.state is State.ALIGNED, "an aligned hand")
        results = calibration.solve()
        calibration.apply()  # sends the projections to the headset
        calibration.wait_applied()  # until it has acknowledged them
        station.finish()
        folder = station.session.path

    print(results)
    # Everything is in the session's folder, and can be solved again at any time.
    session = handcal.open_session(folder)
    print(f"Stored in {folder}; applied: {session.is_applied}, finished: {session.is_finished}")


def step_until(station: Station, is_done: Callable[[Observation], bool], awaited: str) -> None:
    """Take frame after frame until one shows what is awaited."""
    started_s, steps = time.monotonic(), 0
    # A busy computer takes fewer steps a second, and gets more time.
    while time.monotonic() < started_s + LIMIT_S or steps < LEAST_STEPS:
        station.require_headset()
        steps += 1
        snapshot = station.step()
        if snapshot.problem:
            raise handcal.HandcalError(snapshot.problem)
        if snapshot.observation is not None and is_done(snapshot.observation):
            return
    raise handcal.HandcalError(f"{awaited} was not seen within {LIMIT_S:.0f} s")


if __name__ == "__main__":
    with errors_in_one_line():
        main()
