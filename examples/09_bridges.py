"""Follow a calibration of the simulated wearer by the Lab Streaming Layer, and serve OpenIGTLink.

    python examples/09_bridges.py [--sessions FOLDER] [--port N]

Needs handcal[slicer,lsl]. While it runs, 3D Slicer can connect to the port.
"""

import argparse
from pathlib import Path

import pylsl

from handcal.bridge.bridges import Bridge
from handcal.bridge.lsl import LslOutput
from handcal.bridge.slicer import DEFAULT_PORT, SlicerOutput
from handcal.station.run import RunSettings, run_calibration
from handcal.station.settings import StationSettings


def main() -> None:
    """Follow one calibration, and print its events."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sessions", type=Path, default=Path("sessions"))
    parser.add_argument("--rig", default="")
    parser.add_argument("--port", type=int, default=DEFAULT_PORT)
    arguments = parser.parse_args()
    arguments.sessions.mkdir(parents=True, exist_ok=True)

    with (
        Bridge(SlicerOutput(print, port=arguments.port), print) as slicer,
        Bridge(LslOutput("handcal-example"), print) as lsl,
    ):
        # As a recorder would, on this computer or another.
        inlet = pylsl.StreamInlet(pylsl.resolve_byprop("source_id", "handcal-example", 1, 10.0)[0])
        inlet.open_stream(timeout=10.0)
        station = StationSettings(sessions=str(arguments.sessions), rig=arguments.rig)
        run_calibration(RunSettings(station), watchers=[slicer, lsl])
        # Before the stream ends: pylsl waits without limit for one that has.
        texts, times_s = inlet.pull_chunk(timeout=1.0)
        inlet.close_stream()

    for (text,), time_s in zip(texts, times_s, strict=True):
        print(f"{time_s - times_s[0]:6.2f} s  {text}")


if __name__ == "__main__":
    main()
