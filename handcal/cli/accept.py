"""``handcal rig accept, simulate``: acceptance of a rig, and rendered images to practise with."""

from __future__ import annotations

import argparse
from pathlib import Path

from handcal.cli.boards import BOARD_OPTIONS, GRID_OPTION, board_of
from handcal.cli.output import console, save, show_progress, table, triple
from handcal.cli.terminal import (
    arg,
    command,
    eyes_of,
    eyes_option,
    file_option,
    folder_option,
    number,
    seed,
    settings_of,
    value,
)
from handcal.core.errors import HandcalError
from handcal.core.types import EYES, RigPart
from handcal.io.files import make_folder

_DISPLAY = "handcal rig display; handcal rig compare shows what has changed"
_HOW: dict[RigPart, str] = {
    "T_H_D": "handcal rig stereo, rig make",
    "left": _DISPLAY,
    "right": _DISPLAY,
}


@command(
    arg(
        "folder",
        type=Path,
        help="images: EYE/grid.png, EYE/viewpoint, EYE/depth; camera.json; EYE/tracked.json if the "
        "headset tracks the board",
    ),
    file_option("--rig", "rig file to accept", required=True),
    eyes_option("eyes to check"),
    file_option(
        "--camera-intrinsics", "intrinsics of the viewpoint camera (default: FOLDER/camera.json)"
    ),
    file_option(
        "--depth-intrinsics",
        "intrinsics of the depth camera's images (default: FOLDER/depth.json if it exists, "
        "else the rig's)",
    ),
    value(
        "--limit-arcmin",
        number(float, 0.1, 60.0),
        "ARCMIN",
        "largest accepted mean error at any distance",
        default=5.0,
    ),
    folder_option(
        "--output", "folder for the page with the result", default=Path("results/acceptance")
    ),
    *BOARD_OPTIONS,
    GRID_OPTION,
    example="handcal rig accept captures --rig rig.yaml",
    json=True,
)
def accept(arguments: argparse.Namespace) -> None:
    """Check a rig without a wearer, with a camera in the eye's place; exit code 1 if it fails."""
    from handcal.rig.acceptance import (
        AcceptanceSettings,
        passed_words,
        run_acceptance,
        view_rows,
    )

    settings = settings_of(
        AcceptanceSettings,
        arguments,
        board=board_of(arguments),
        eyes=eyes_of(arguments),
        camera=arguments.camera_intrinsics,
        depth_camera=arguments.depth_intrinsics,
    )
    with show_progress() as progress:
        found = run_acceptance(settings, progress)
    save(arguments.json, found.json(settings.limit_arcmin))
    for name, why in found.left_out.items():
        console.print(f"Left out: {name}: {why}")
    shown = table("eye", "distance, m", "corners", "mean, arcmin", "largest, arcmin")
    for eye, one in found.eyes.items():
        for row in view_rows(one):
            shown.add_row(eye, *row)
    console.print(shown)
    for file in found.files:
        console.print(str(file))
    for eye, one in found.eyes.items():
        console.print(
            f"{eye}: {found.problems[eye] or 'passed'}; {one.mean_arcmin:.1f}′ on average, camera "
            f"{triple(1e3 * one.shift_m)} mm from C0"
        )
    if found.move is not None:
        console.print(f"depth camera: {found.move.words}, by tracked boards")
    if found.cause.words:
        how = "; ".join(dict.fromkeys(_HOW[part] for part in found.cause.again))
        raise HandcalError(f"the rig fails: {found.cause.words}{how and f' ({how})'}")
    passed = passed_words(found.eyes)
    console.print(f"passed, at most {settings.limit_arcmin:g}′ at every distance: {passed}")


@command(
    arg("folder", type=Path, help="new folder for the images"),
    file_option("--rig", "the true rig (default: the shipped example)"),
    value("--views", number(int, 3, 100), "N", "images of the board for each camera", default=20),
    seed(),
    example="handcal rig simulate captures --views 8",
)
def simulate(arguments: argparse.Namespace) -> None:
    """Render the images of an offline calibration and of an acceptance, to practise with."""
    import numpy as np

    from handcal.rig.displays.grid import Grid
    from handcal.rig.example import example_rig
    from handcal.rig.formats import write_intrinsics
    from handcal.rig.rig_file import read_rig
    from handcal.sim.photographs import (
        BOARD,
        DEPTH_CAMERA,
        HEADSET_CAMERA,
        write_acceptance,
        write_photographs,
    )

    folder = make_folder(arguments.folder)
    if any(folder.iterdir()):
        raise HandcalError(f"{folder} is not empty: choose a new folder")
    rig = example_rig() if arguments.rig is None else read_rig(arguments.rig)
    rng = np.random.default_rng(arguments.seed)
    with show_progress() as progress:
        progress.at(0.0, "Offline calibration")
        write_photographs(folder, rig, arguments.views, rng, samples=2)
        for name, camera in (("depth", DEPTH_CAMERA), ("headset", HEADSET_CAMERA)):
            write_intrinsics(folder / f"{name}.json", camera, "json")
        progress.at(0.7, "Acceptance")
        write_acceptance(folder / "accept", rig, max(8, arguments.views // 2), rng)
    columns, rows = BOARD.squares
    lines = [
        f"{folder}: to enter in the rig window, step by step",
        f"Board: ChArUco, {columns}×{rows} squares of {1e3 * BOARD.square_m:g} mm, markers of "
        f"{1e3 * BOARD.marker_m:g} mm, {BOARD.dictionary}",
        "Depth and headset camera: images in depth and headset, intrinsics in depth.json and "
        "headset.json",
        "Viewpoint camera: images in viewpoint",
    ]
    for eye in EYES:
        display = rig.eyes[eye]
        grid = Grid(display.width_px, display.height_px)
        lines.append(
            f"{eye.capitalize()} display: images of the grid in grid-{eye}, grid squares "
            f"{grid.square_px} px; images of the board in board-{eye}, its poses in "
            f"tracked-{eye}.json; measured distance {display.z_C0_S_m:g} m"
        )
    lines.append("Acceptance: images for 'handcal rig accept' in accept")
    for line in lines:
        console.print(line)
