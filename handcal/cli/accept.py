"""``handcal rig accept, simulate``: acceptance of a rig, and rendered images to practise with."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.cli.output import console, save, show_progress, table, triple
from handcal.cli.rig import BOARD_OPTIONS, GRID_OPTION, board_of, grid_of, views_of
from handcal.cli.terminal import arg, command, number
from handcal.errors import HandcalError
from handcal.io.files import make_folder
from handcal.types import EYES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from handcal.report.document import Report
    from handcal.rig.accept import EyeAcceptance
    from handcal.rig.board import BoardView
    from handcal.types import Eye, Rig


@command(
    arg("folder", type=Path, help="images: EYE/grid.png, EYE/viewpoint, EYE/depth; camera.json"),
    arg("--rig", type=Path, metavar="FILE", required=True, help="rig file to accept"),
    arg("--eyes", choices=("both", *EYES), default="both", help="eyes to check"),
    arg(
        "--camera-intrinsics",
        type=Path,
        metavar="FILE",
        help="intrinsics of the viewpoint camera (default: FOLDER/camera.json)",
    ),
    arg(
        "--depth-intrinsics",
        type=Path,
        metavar="FILE",
        help="intrinsics of the depth camera's images (default: FOLDER/depth.json if it exists, "
        "else the rig's)",
    ),
    arg(
        "--limit-arcmin",
        type=number(float, 0.1, 60.0),
        metavar="ARCMIN",
        default=5.0,
        help="largest accepted mean error at any distance",
    ),
    arg(
        "--output",
        type=Path,
        metavar="FOLDER",
        default=Path("results/acceptance"),
        help="folder for the page with the result",
    ),
    *BOARD_OPTIONS,
    GRID_OPTION,
    json=True,
)
def accept(arguments: argparse.Namespace) -> None:
    """Check a rig without a wearer, by a camera in the eye's place; exit code 1 if it fails."""
    from handcal.report.write import write_report
    from handcal.rig.accept import likely_cause, problem
    from handcal.rig.rig_file import read_rig

    rig = read_rig(arguments.rig)
    eyes = EYES if arguments.eyes == "both" else (arguments.eyes,)
    found = {eye: _accept_eye(arguments, rig, eye) for eye in eyes}
    problems = {eye: problem(one, arguments.limit_arcmin) for eye, one in found.items()}
    failed = {eye: text for eye, text in problems.items() if text}
    cause = likely_cause([found[eye] for eye in failed]) if failed else ""
    shown = table("eye", "distance, m", "corners", "mean, arcmin", "largest, arcmin")
    for eye, one in found.items():
        for view in one.views:
            errors = f"{view.mean_arcmin:.1f}", f"{view.largest_arcmin:.1f}"
            shown.add_row(eye, f"{view.depth_m:.2f}", str(view.corners), *errors)
    console.print(shown)
    result = {
        "passed": not failed,
        "limit_arcmin": arguments.limit_arcmin,
        "cause": cause,
        "eyes": {
            eye: {
                "problem": problems[eye],
                "mean_arcmin": one.mean_arcmin,
                "worst_arcmin": one.worst_arcmin,
                "camera_from_C0_mm": (1e3 * one.shift_m).tolist(),
                "turn_rad": one.turn_rad.tolist(),
                "left_arcmin": one.left_arcmin,
                "views": [asdict(view) for view in one.views],
            }
            for eye, one in found.items()
        },
    }
    save(arguments.json, result)
    with show_progress() as progress:
        files = write_report(arguments.output, _page(rig, found, problems, cause), progress)
    for file in files:
        console.print(str(file), markup=False)
    for eye, one in found.items():
        console.print(
            f"{eye}: {problems[eye] or 'passed'}; {one.mean_arcmin:.1f}′ on average, camera "
            f"{triple(1e3 * one.shift_m)} mm from C0",
            markup=False,
        )
    if failed:
        raise HandcalError(f"the rig fails: {cause}")
    console.print(f"passed: at most {arguments.limit_arcmin:g}′ at every distance")


@command(
    arg("folder", type=Path, help="new folder for the images"),
    arg("--rig", type=Path, metavar="FILE", help="the true rig (default: the shipped example)"),
    arg(
        "--views",
        type=number(int, 3, 100),
        metavar="N",
        default=20,
        help="images of the board for each camera",
    ),
    arg("--seed", type=number(int, 0, 2**32 - 1), metavar="N", default=1, help="random seed"),
)
def simulate(arguments: argparse.Namespace) -> None:
    """Render the images of an offline calibration and of an acceptance, to practise with."""
    import numpy as np

    from handcal.rig.example import example_rig
    from handcal.rig.formats import write_intrinsics
    from handcal.rig.rig_file import read_rig
    from handcal.sim.acceptance import write_acceptance
    from handcal.sim.photographs import DEPTH_CAMERA, HEADSET_CAMERA, write_photographs

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
    console.print(f"{folder}: made with a board of 8×6 squares", markup=False)


def _accept_eye(arguments: argparse.Namespace, rig: Rig, eye: Eye) -> EyeAcceptance:
    import cv2

    from handcal.io.images import read_image
    from handcal.rig.accept import accept_eye
    from handcal.rig.board import BoardError
    from handcal.rig.display import fit_homography
    from handcal.rig.formats import read_intrinsics
    from handcal.rig.grid import find_grid
    from handcal.rig.views import pair_views

    folder, board, display = arguments.folder, board_of(arguments), rig.eyes[eye]
    camera = read_intrinsics(arguments.camera_intrinsics or folder / "camera.json")
    file = arguments.depth_intrinsics or folder / "depth.json"
    is_given = arguments.depth_intrinsics is not None or file.exists()
    depth_camera = read_intrinsics(file) if is_given else rig.depth_intrinsics
    picture = folder / eye / "grid.png"
    try:
        seen = find_grid(
            read_image(picture, cv2.IMREAD_GRAYSCALE),
            grid_of(arguments, display.width_px, display.height_px),
        )
    except BoardError as error:
        raise HandcalError(f"{picture}: {error}") from error
    homography = fit_homography({"grid": seen}, camera, display.width_px, display.height_px)
    viewpoint, depth = (views_of([folder / eye / who], board) for who in ("viewpoint", "depth"))
    pairs: dict[str, tuple[BoardView, BoardView]] = {}
    for by_viewpoint, by_depth in pair_views(viewpoint, depth):
        if by_viewpoint.found is not None and by_depth.found is not None:
            pairs[by_viewpoint.name] = by_viewpoint.found, by_depth.found
        else:
            why = by_viewpoint.problem or by_depth.problem
            console.print(f"Left out: {eye}, {by_viewpoint.name}: {why}", markup=False)
    return accept_eye(rig, display, homography, camera, pairs, depth_camera)


def _page(
    rig: Rig,
    found: Mapping[Eye, EyeAcceptance],
    problems: Mapping[Eye, str],
    cause: str,
) -> Report:
    from handcal.report.document import Column, Report, Section, Table, facts
    from handcal.report.provenance import made_with

    titles = "distance, m", "corners", "mean, arcmin", "largest, arcmin"
    columns = [Column("eye", "left"), *map(Column, titles)]
    rows = [
        [
            eye,
            f"{view.depth_m:.2f}",
            str(view.corners),
            f"{view.mean_arcmin:.1f}",
            f"{view.largest_arcmin:.1f}",
        ]
        for eye, one in found.items()
        for view in one.views
    ]
    verdicts = {eye: text or "passed" for eye, text in problems.items()}
    places = {f"camera from C0, {eye}, mm": triple(1e3 * one.shift_m) for eye, one in found.items()}
    return Report(
        title="Acceptance of a rig",
        subject=f"Rig: {rig.name}",
        lead=f"FAILED: {cause}." if cause else "PASSED.",
        sections=[
            Section("", [facts(verdicts), facts(made_with() | places)]),
            Section("Drawn against seen", [Table(columns, rows)]),
        ],
    )
