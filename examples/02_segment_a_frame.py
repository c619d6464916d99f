"""Segment the bare hand in one frame: your own image files, or a simulated frame.

python examples/02_segment_a_frame.py [--output FOLDER]
python examples/02_segment_a_frame.py --frame color.png depth.png intrinsics.json

The depth image is a 16-bit PNG aligned to colour; the JSON file gives width, height, fx, fy, cx, cy
in pixels and depth_scale in metres per unit of depth.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import handcal
from handcal.camera.images import write_frame
from handcal.cli.recordings import write_segmentation
from handcal.cli.terminal import errors_in_one_line
from handcal.sim.camera import simulated_frame


def main() -> None:
    """Read a frame, segment it, and write the cloud, the contour, the mask and an overlay."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frame", nargs=3, metavar=("COLOR", "DEPTH", "INTRINSICS"))
    parser.add_argument("--roi", choices=("detector", "left", "right", "depth"), default="detector")
    parser.add_argument("--output", type=Path, default=Path("results/segment"))
    arguments = parser.parse_args()

    # Without a frame of your own, the simulated camera takes one.
    paths = arguments.frame or write_frame(
        folder=arguments.output / "frame", frame=simulated_frame(seed=1)
    )
    frame = handcal.read_frame(*paths)

    # HandError says why there is no hand, in one line.
    try:
        hand = handcal.segment(frame, roi=arguments.roi)
    except handcal.HandError as error:
        sys.exit(str(error))

    cut = 100 * hand.contour_is_cut.mean()
    print(f"{len(hand.points_m)} points, median depth {hand.median_depth_m:.3f} m")
    print(f"box {hand.box_px} px; {cut:.0f} % of the contour runs along the cut forearm")
    write_segmentation(cloud=hand, frame=frame, folder=arguments.output)
    print(f"Written to {arguments.output}: see overlay.png and hand.ply")


if __name__ == "__main__":
    with errors_in_one_line():
        main()
