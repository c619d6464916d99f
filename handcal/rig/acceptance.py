"""The acceptance of a rig from a folder of images, and the page with its result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cv2

from handcal.errors import HandcalError
from handcal.io.images import read_image
from handcal.progress import Progress
from handcal.report.document import Column, Report, Section, Table, facts
from handcal.report.provenance import made_with
from handcal.report.write import write_report
from handcal.rig.accept import LIMIT_ARCMIN, EyeAcceptance, accept_eye, likely_cause, problem
from handcal.rig.board import Board, BoardError, BoardView
from handcal.rig.display import fit_homography
from handcal.rig.formats import read_intrinsics
from handcal.rig.grid import find_grid, grid_on
from handcal.rig.rig_file import read_rig
from handcal.rig.views import image_files, pair_views, read_views
from handcal.types import EYES, Eye, Rig


@dataclass(frozen=True, slots=True)
class AcceptanceSettings:
    """Settings of an acceptance."""

    folder: Path
    """Images: EYE/grid.png, EYE/viewpoint and EYE/depth."""
    rig: Path
    output: Path
    """Folder for the page with the result."""
    board: Board = field(default_factory=Board)
    square_px: int = 80
    """Side of the grid's squares."""
    eyes: tuple[Eye, ...] = EYES
    camera: Path | None = None
    """Intrinsics of the viewpoint camera; None: camera.json in the folder."""
    depth_camera: Path | None = None
    """Intrinsics of the depth camera's images; None: depth.json in the folder if there is one, else
    the rig's."""
    limit_arcmin: float = LIMIT_ARCMIN


@dataclass(frozen=True, slots=True, eq=False)
class Acceptance:
    """Result of an acceptance."""

    eyes: Mapping[Eye, EyeAcceptance]
    problems: Mapping[Eye, str]
    """For each eye; empty if it passes."""
    cause: str
    """Likely cause of the problems; empty if there are none."""
    left_out: Mapping[str, str]
    """Reasons why images were left out, by name."""
    files: tuple[Path, ...]
    """The page, as PDF and HTML."""

    def json(self, limit_arcmin: float) -> dict[str, Any]:
        """Return the result as JSON-able values."""
        return {
            "passed": not self.cause,
            "limit_arcmin": limit_arcmin,
            "cause": self.cause,
            "eyes": {
                eye: {
                    "problem": self.problems[eye],
                    "mean_arcmin": one.mean_arcmin,
                    "worst_arcmin": one.worst_arcmin,
                    "camera_from_C0_mm": (1e3 * one.shift_m).tolist(),
                    "turn_rad": one.turn_rad.tolist(),
                    "left_arcmin": one.left_arcmin,
                    "views": [asdict(view) for view in one.views],
                }
                for eye, one in self.eyes.items()
            },
        }


def run_acceptance(settings: AcceptanceSettings, progress: Progress = Progress()) -> Acceptance:
    """Accept or refuse a rig by the images in a folder, and write the page.

    Raises
    ------
    FileError
        If a file cannot be read or written.
    HandcalError
        If an image does not show the grid, or too few pairs show the board.
    CancelledError
    """
    rig = read_rig(settings.rig)
    found: dict[Eye, EyeAcceptance] = {}
    left_out: dict[str, str] = {}
    for number, eye in enumerate(settings.eyes):
        share = 0.8 * number / len(settings.eyes), 0.8 * (number + 1) / len(settings.eyes)
        found[eye] = _accept_eye(settings, rig, eye, left_out, progress.part(*share))
    problems = {eye: problem(one, settings.limit_arcmin) for eye, one in found.items()}
    failed = [found[eye] for eye, text in problems.items() if text]
    cause = likely_cause(failed) if failed else ""
    page = _page(rig, found, problems, cause)
    files = write_report(settings.output, page, progress.part(0.8, 1.0))
    return Acceptance(found, problems, cause, left_out, files)


def _accept_eye(
    settings: AcceptanceSettings, rig: Rig, eye: Eye, left_out: dict[str, str], progress: Progress
) -> EyeAcceptance:
    folder, display = settings.folder, rig.eyes[eye]
    camera = read_intrinsics(settings.camera or folder / "camera.json")
    depth_file = settings.depth_camera or folder / "depth.json"
    is_given = settings.depth_camera is not None or depth_file.exists()
    depth_camera = read_intrinsics(depth_file) if is_given else rig.depth_intrinsics
    picture = folder / eye / "grid.png"
    grid = grid_on(display.width_px, display.height_px, settings.square_px)
    try:
        seen = find_grid(read_image(picture, cv2.IMREAD_GRAYSCALE), grid)
    except BoardError as error:
        raise HandcalError(f"{picture}: {error}") from error
    homography = fit_homography({"grid": seen}, camera, display.width_px, display.height_px)
    viewpoint, depth = (
        read_views(image_files([folder / eye / who]), settings.board, progress.part(*share))
        for who, share in (("viewpoint", (0.0, 0.5)), ("depth", (0.5, 1.0)))
    )
    pairs: dict[str, tuple[BoardView, BoardView]] = {}
    for by_viewpoint, by_depth in pair_views(viewpoint, depth):
        if by_viewpoint.found is not None and by_depth.found is not None:
            pairs[by_viewpoint.name] = by_viewpoint.found, by_depth.found
        else:
            left_out[f"{eye}/{by_viewpoint.name}"] = by_viewpoint.problem or by_depth.problem
    return accept_eye(rig, display, homography, camera, pairs, depth_camera)


def _page(
    rig: Rig, found: Mapping[Eye, EyeAcceptance], problems: Mapping[Eye, str], cause: str
) -> Report:
    titles = "distance, m", "corners", "mean, arcmin", "largest, arcmin"
    rows = [[eye, *row] for eye, one in found.items() for row in view_rows(one)]
    about = dict(made_with())
    for eye, one in found.items():
        x_mm, y_mm, z_mm = 1e3 * one.shift_m
        about[f"camera from C0, {eye}"] = f"{x_mm:.1f} {y_mm:.1f} {z_mm:.1f} mm"
    return Report(
        title="Acceptance of a rig",
        subject=f"Rig: {rig.name}",
        lead=f"FAILED: {cause}." if cause else "PASSED.",
        sections=[
            Section("", [facts({str(eye): text or "passed" for eye, text in problems.items()})]),
            Section(
                "Drawn against seen",
                [Table([Column("eye", "left"), *map(Column, titles)], rows), facts(about)],
            ),
        ],
    )


def view_rows(found: EyeAcceptance) -> list[tuple[str, str, str, str]]:
    """Return distance, corners, mean and largest error of each view, as texts."""
    return [
        (
            f"{view.depth_m:.2f}",
            str(view.corners),
            f"{view.mean_arcmin:.1f}",
            f"{view.largest_arcmin:.1f}",
        )
        for view in found.views
    ]
