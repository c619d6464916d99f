"""The acceptance of a rig from a folder of images, and the page with its result."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from handcal.core.errors import HandcalError
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, EyeDisplay, Intrinsics, Rig
from handcal.io.images import image_named, read_grey
from handcal.report.document import Column, Report, Section, Table, facts
from handcal.report.provenance import made_with
from handcal.report.write import write_report
from handcal.rig.acceptance.accept import (
    LIMIT_ARCMIN,
    CameraMove,
    Cause,
    EyeAcceptance,
    accept_eye,
    camera_move,
    likely_cause,
    problem,
)
from handcal.rig.boards.board import Board, BoardError, BoardView
from handcal.rig.boards.tracked_file import read_tracked
from handcal.rig.boards.views import image_files, pair_views, read_views
from handcal.rig.displays.display import DisplayHomography, fit_homography
from handcal.rig.displays.grid import Grid, GridView, find_grid, grid_on
from handcal.rig.formats import read_intrinsics
from handcal.rig.lens.viewpoint import TrackedView
from handcal.rig.rig_file import read_rig


@dataclass(frozen=True, slots=True)
class AcceptanceSettings:
    """Settings of an acceptance."""

    folder: Path
    """Images: EYE/grid.png, or a folder EYE/grid; EYE/viewpoint and EYE/depth; EYE/tracked.json,
    poses T_H_B of the board by the viewpoint camera's images, if the headset tracks it."""
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
    cause: Cause
    """Likely cause of the problems; empty if there are none."""
    move: CameraMove | None
    """Of the depth camera from its place in the rig; None without tracked poses of the board."""
    left_out: Mapping[str, str]
    """Reasons why images were left out, by name."""
    files: tuple[Path, ...]
    """The page, as PDF and HTML."""

    def json(self, limit_arcmin: float) -> dict[str, Any]:
        """Return the result as JSON-able values."""
        return {
            "passed": not self.cause.words,
            "limit_arcmin": limit_arcmin,
            "cause": self.cause.words,
            "depth_camera": None
            if self.move is None
            else {
                "shift_mm": (1e3 * self.move.shift_m).tolist(),
                "turn_rad": self.move.turn_rad.tolist(),
                "sigma_mm": 1e3 * self.move.sigma_m,
                "sigma_rad": self.move.sigma_rad,
            },
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
    depth_file = settings.depth_camera or settings.folder / "depth.json"
    is_given = settings.depth_camera is not None or depth_file.exists()
    depth_camera = read_intrinsics(depth_file) if is_given else rig.depth_intrinsics
    found: dict[Eye, EyeAcceptance] = {}
    tracked: dict[str, TrackedView] = {}
    left_out: dict[str, str] = {}
    for number, eye in enumerate(settings.eyes):
        share = 0.8 * number / len(settings.eyes), 0.8 * (number + 1) / len(settings.eyes)
        images = _read_eye(settings, rig.eyes[eye], eye, left_out, progress.part(*share))
        try:
            found[eye] = accept_eye(
                rig, rig.eyes[eye], images.homography, images.camera, images.pairs, depth_camera
            )
        except HandcalError as error:
            raise HandcalError(f"{eye}: {error}") from error
        tracked |= {f"{eye}/{name}": one for name, one in images.tracked.items()}
    move = camera_move(rig, tracked, depth_camera) if tracked else None
    problems = {eye: problem(one, settings.limit_arcmin) for eye, one in found.items()}
    failed = [eye for eye, text in problems.items() if text]
    has_moved = move is not None and bool(move.problem)
    cause = likely_cause(found, failed, move) if failed or has_moved else Cause()
    page = _page(rig, found, problems, cause.words, move)
    files = write_report(settings.output, page, progress.part(0.8, 1.0))
    return Acceptance(found, problems, cause, move, left_out, files)


class _Images(NamedTuple):
    """Contents of one eye's images."""

    homography: DisplayHomography
    camera: Intrinsics
    pairs: dict[str, tuple[BoardView, BoardView]]
    tracked: dict[str, TrackedView]


def _read_eye(
    settings: AcceptanceSettings,
    display: EyeDisplay,
    eye: Eye,
    left_out: dict[str, str],
    progress: Progress,
) -> _Images:
    folder = settings.folder
    camera = read_intrinsics(settings.camera or folder / "camera.json")
    grid = grid_on(display.width_px, display.height_px, settings.square_px)
    pictures = [image_named(folder / eye, "grid")]
    if not pictures[0].exists():
        pictures = image_files([folder / eye / "grid"])
    seen = {path.name: _find_grid(path, grid) for path in pictures}
    homography = fit_homography(seen, camera, display.width_px, display.height_px)
    viewpoint, depth = (
        read_views(image_files([folder / eye / who]), settings.board, progress.part(*share))
        for who, share in (("viewpoint", (0.0, 0.5)), ("depth", (0.5, 1.0)))
    )
    poses = folder / eye / "tracked.json"
    T_H_B = read_tracked(poses) if poses.exists() else {}
    pairs: dict[str, tuple[BoardView, BoardView]] = {}
    tracked: dict[str, TrackedView] = {}
    for by_viewpoint, by_depth in pair_views(viewpoint, depth):
        name = by_viewpoint.name
        if by_viewpoint.found is not None and by_depth.found is not None:
            pairs[name] = by_viewpoint.found, by_depth.found
        else:
            left_out[f"{eye}/{name}"] = by_viewpoint.problem or by_depth.problem
        if by_depth.found is not None and name in T_H_B:
            tracked[name] = TrackedView(by_depth.found, T_H_B[name])
    return _Images(homography, camera, pairs, tracked)


def _find_grid(picture: Path, grid: Grid) -> GridView:
    try:
        return find_grid(read_grey(picture), grid)
    except BoardError as error:
        raise HandcalError(f"{picture}: {error}") from error


def _page(
    rig: Rig,
    found: Mapping[Eye, EyeAcceptance],
    problems: Mapping[Eye, str],
    cause: str,
    move: CameraMove | None,
) -> Report:
    titles = "distance, m", "corners", "mean, arcmin", "largest, arcmin"
    rows = [[eye, *row] for eye, one in found.items() for row in view_rows(one)]
    about = dict(made_with())
    for eye, one in found.items():
        x_mm, y_mm, z_mm = 1e3 * one.shift_m
        about[f"camera from C0, {eye}"] = f"{x_mm:.1f} {y_mm:.1f} {z_mm:.1f} mm"
    about["depth camera"] = "not tracked" if move is None else move.words
    return Report(
        title="Acceptance of a rig",
        subject=f"Rig: {rig.name}",
        lead=f"FAILED: {cause}." if cause else f"PASSED: {passed_words(found)}.",
        sections=[
            Section("", [facts({str(eye): text or "passed" for eye, text in problems.items()})]),
            Section(
                "Drawn and seen corners",
                [Table([Column("eye", "left"), *map(Column, titles)], rows), facts(about)],
            ),
        ],
    )


def passed_words(eyes: Collection[Eye]) -> str:
    """Return the eyes that pass, and the one that was not looked at, in words."""
    unseen = [f"{eye} not looked at" for eye in EYES if eye not in eyes]
    return "; ".join([" and ".join(eyes), *unseen])


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
