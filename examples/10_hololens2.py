"""Read a HoloLens 2's own depth camera: print its position, and the hand in front of it.

    python 10_hololens2.py HOST

Needs hl2ss on the headset; see docs/hololens2.md. Hold up a hand.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

from handcal.camera.hololens2 import HoloLens2Camera
from handcal.camera.settings import HoloLens2Settings
from handcal.core.errors import HandcalError, HandError
from handcal.core.geometry import transform
from handcal.hand.settings import SegmentSettings
from handcal.hand.shipped import make_finder


def main() -> None:
    """Read frames, and place the hand of each in the world."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("host", help="address of the headset")
    parser.add_argument("--port", type=int, help="port of the stream (default: hl2ss's own)")
    parser.add_argument("--frames", type=int, default=100)
    arguments = parser.parse_args()
    finder = make_finder(SegmentSettings())
    with HoloLens2Camera(HoloLens2Settings(arguments.host, port=arguments.port)) as camera:
        print(f"{camera.name}: {camera.depth_intrinsics}")
        for _ in range(arguments.frames):
            frame = camera.read(5.0)
            assert frame.T_W_D is not None
            print(f"camera at {1e3 * frame.T_W_D[:3, 3].round(3)} mm", end="; ")
            try:
                hand = finder.find(frame)
            except HandError as error:
                print(error)
                continue
            hand_W_m = transform(frame.T_W_D, hand.points_m)
            print(f"hand at {1e3 * np.median(hand_W_m, axis=0).round(3)} mm in the world")


if __name__ == "__main__":
    try:
        main()
    except HandcalError as error:
        sys.exit(str(error))
