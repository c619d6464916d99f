"""Build a rig file from images of a board and of the displays' grids; here, rendered images.

python examples/05_build_a_rig.py [--output FOLDER] [--views N]

With a real headset the images come from `handcal rig take`; docs/rig-guide.md says how.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

import handcal
from handcal.cli.terminal import errors_in_one_line
from handcal.core.types import EYES
from handcal.rig.boards.views import BoardImage, image_files, pair_views, read_views, used
from handcal.rig.compare import compare_rigs
from handcal.rig.displays.grid import Grid, on_display
from handcal.rig.displays.homography import DisplaySettings, calibrate_display, fit_homography
from handcal.rig.example import example_rig
from handcal.rig.formats import read_tracked
from handcal.rig.lens.camera import calibrate_camera
from handcal.rig.lens.stereo import calibrate_stereo
from handcal.rig.lens.viewpoint import viewpoint_from_tracked
from handcal.rig.steps import screen_of, with_display, with_stereo
from handcal.sim.photographs import BOARD, DEPTH_CAMERA, write_photographs


def main() -> None:
    """Calibrate the cameras, the depth camera's place and both displays; write the rig."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("results/rig"))
    parser.add_argument("--views", type=int, default=15, help="images by each camera")
    arguments = parser.parse_args()

    # Photographs by the depth, the headset's and the viewpoint camera of a known headset.
    images = arguments.output / "images"
    truth = replace(example_rig(), depth_intrinsics=DEPTH_CAMERA)
    write_photographs(images, truth, views=arguments.views, rng=np.random.default_rng(0))

    def views_of(name: str) -> tuple[BoardImage, ...]:
        return read_views(image_files([images / name]), BOARD)

    # The depth camera's place on the headset, from pairs of images of one board.
    stereo = calibrate_stereo(pair_views(views_of("depth"), views_of("headset")))
    print(f"depth camera: {stereo.verdict.name}: {stereo.verdict.reason}")
    rig = with_stereo(truth, stereo)  # keeps what the headset itself states: T_V_H, sizes

    # Each display, from its grid seen by a camera whose place a tracked board gives.
    camera = calibrate_camera(views_of("viewpoint")).pinhole
    for eye in EYES:
        poses = read_tracked(images / f"tracked-{eye}.json")
        viewpoint = viewpoint_from_tracked(views_of(f"board-{eye}"), poses, camera)
        screen = screen_of(rig, eye)
        grid = Grid(screen.width_px, screen.height_px)
        seen = used(read_views(image_files([images / f"grid-{eye}"]), grid.board), at_least=1)
        corners = {name: on_display(found, grid) for name, found in seen.items()}
        homography = fit_homography(corners, camera, screen.width_px, screen.height_px)
        measured = DisplaySettings(distance_m=2.0)  # of the virtual image
        display = calibrate_display(homography, camera, viewpoint, screen, measured)
        print(f"{eye} display: {display.verdict.name}: {display.verdict.reason}")
        rig = with_display(rig, eye, display)

    handcal.write_rig(arguments.output / "rig.yaml", rig)
    for one in compare_rigs(truth, rig):
        print(f"{one.name} differs from the truth by {one.value:.3g} {one.unit}")


if __name__ == "__main__":
    with errors_in_one_line():
        main()
