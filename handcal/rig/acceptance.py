"""Acceptance of a rig without a wearer: a camera in the eye's place sees what would be drawn.

The viewpoint camera stands behind a display. A picture of the display's grid gives the display's
pixel for each of the camera's. Then it sees a board at several distances, which the depth camera
sees, too. The depth camera's picture gives the place of the board and, with the viewpoint camera's,
the camera's own place φ. The pixels at which the rig draws the board's corners for an eye at φ are
compared with those at which the camera sees them. Nothing is fitted.

A depth camera that has only shifted moves φ and the board equally. What is drawn then moves by the
shift divided by the virtual image's distance, 1.7′ for 1 mm at 2 m, at every distance of the board,
as with a rotated camera. A wearer's calibration compensates most of it. Poses of the board tracked
by the headset distinguish a shift from a rotation, and measure it to fractions of a millimetre.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from handcal.core.display import arcmin_from_px, eye_projection, view_of_eye
from handcal.core.errors import HandcalError
from handcal.core.frozen import freeze
from handcal.core.geometry import invert, project, rigid, transform
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, EyeDisplay, Float64, Intrinsics, Rig, RigPart
from handcal.io.images import image_named, read_grey
from handcal.report.document import Column, Report, Section, Table, facts, made_with
from handcal.report.html import write_report
from handcal.rig.boards.board import Board, BoardError, BoardView
from handcal.rig.boards.views import ViewsError, image_files, pair_views, read_views
from handcal.rig.displays.grid import Grid, GridView, find_grid, grid_on
from handcal.rig.displays.homography import DisplayHomography, fit_homography
from handcal.rig.formats import read_intrinsics, read_tracked
from handcal.rig.lens.lens import undistort
from handcal.rig.lens.shape import boards_seen
from handcal.rig.lens.viewpoint import TrackedView, board_pose, locate_viewpoint
from handcal.rig.rig_file import read_rig

FEWEST_VIEWS = 5
LIMIT_ARCMIN = 5.0
"""Largest accepted mean error at any distance; calibrated wearers have 4 to 9 arcmin in total."""
LARGEST_SHIFT_M = 0.015
LARGEST_MOVE_M = 0.001
"""Largest accepted shift of the depth camera, beyond twice its standard deviation."""
_DIRECTIONS = (
    ("to the left", "to the right"),
    ("upwards", "downwards"),
    ("backwards", "forwards"),
)
"""Against and along each of H's axes: x right, y down, z forward, as the wearer looks."""
_SHOWN_MM = 0.05
"""Smaller shifts are 0.0 mm."""
_LEAST_SPREAD = 1.2
_EXPLAINED = 0.5
_SAME_TURN = 0.35


@dataclass(frozen=True, slots=True)
class AcceptedView:
    """The error of drawing in one pair of images."""

    name: str
    depth_m: float
    """Distance of the board's middle from the viewpoint camera."""
    corners: int
    mean_arcmin: float
    largest_arcmin: float


@dataclass(frozen=True, slots=True, eq=False)
class EyeAcceptance:
    """The errors of one eye's drawing."""

    views: tuple[AcceptedView, ...]
    """By distance."""
    shift_m: Float64
    """(3,); place φ of the viewpoint camera from C0, E axes."""
    turn_rad: Float64
    """(3,); rotation of the depth camera, H axes, that would explain the errors best."""
    left_arcmin: float
    """Mean error that this rotation leaves."""
    image_distance_m: float
    """Of the virtual image from C0."""

    def __post_init__(self) -> None:
        freeze(self, "shift_m", np.float64, 3)
        freeze(self, "turn_rad", np.float64, 3)

    @property
    def mean_arcmin(self) -> float:
        """Mean over views."""
        return float(np.mean([view.mean_arcmin for view in self.views]))

    @property
    def worst_arcmin(self) -> float:
        """The largest mean of a view."""
        return max(view.mean_arcmin for view in self.views)


@dataclass(frozen=True, slots=True, eq=False)
class CameraMove:
    """The depth camera's pose as tracked boards give it, relative to the rig's."""

    shift_m: Float64
    """(3,); H axes."""
    turn_rad: Float64
    """(3,); rotation vector, H axes."""
    sigma_m: float
    sigma_rad: float
    """Standard deviations along the worst axis, over views."""

    def __post_init__(self) -> None:
        freeze(self, "shift_m", np.float64, 3)
        freeze(self, "turn_rad", np.float64, 3)

    @property
    def words(self) -> str:
        """The move in words."""
        mm = 1e3 * self.shift_m
        parts = ", ".join(
            f"{abs(one):.1f} mm {words[int(one > 0)]}"
            for one, words in zip(mm, _DIRECTIONS, strict=True)
            if abs(one) >= _SHOWN_MM
        )
        return (
            f"shifted by {parts or '0.0 mm'} (± {1e3 * self.sigma_m:.1f} mm) and "
            f"turned by {np.degrees(np.linalg.norm(self.turn_rad)):.2f}° (± "
            f"{np.degrees(self.sigma_rad):.2f}°)"
        )

    @property
    def problem(self) -> str:
        """Likely cause of a failure; empty if the camera has not shifted too far."""
        if np.linalg.norm(self.shift_m) <= LARGEST_MOVE_M + 2.0 * self.sigma_m:
            return ""
        return (
            f"the depth camera is {self.words} from its place in the rig: check the board's "
            "measured sides, fasten the camera, and calibrate its pose again"
        )


def camera_move(rig: Rig, views: Mapping[str, TrackedView], depth_camera: Intrinsics) -> CameraMove:
    """Return the depth camera's move from views of a board that the headset tracks.

    Parameters
    ----------
    rig : Rig
    views : mapping of name to TrackedView
        By the depth camera.
    depth_camera : Intrinsics
        Of its images.

    Raises
    ------
    ViewsError
        If there are too few views.
    """
    found = locate_viewpoint(views, depth_camera)
    turn = Rotation.from_matrix(found.T_H_C[:3, :3] @ rig.T_H_D[:3, :3].T)
    sigma_rad, sigma_m = (
        float(np.sqrt(np.linalg.eigvalsh(part).max()))
        for part in (found.covariance[:3, :3], found.covariance[3:, 3:])
    )
    shift_m = found.T_H_C[:3, 3] - rig.T_H_D[:3, 3]
    return CameraMove(shift_m, turn.as_rotvec(), sigma_m, sigma_rad)


def accept_eye(
    rig: Rig,
    display: EyeDisplay,
    homography: DisplayHomography,
    camera: Intrinsics,
    pairs: Mapping[str, tuple[BoardView, BoardView]],
    depth_camera: Intrinsics,
) -> EyeAcceptance:
    """Compare what the rig draws for one eye with what a camera in its place sees.

    Parameters
    ----------
    rig : Rig
    display : EyeDisplay
    homography : DisplayHomography
        Of the display's grid, seen from the same place as the boards.
    camera : Intrinsics
        The viewpoint camera.
    pairs : mapping of name to (BoardView, BoardView)
        The board seen by the viewpoint camera and, at the same place, by the depth camera.
    depth_camera : Intrinsics
        Of the depth camera's images.

    Raises
    ------
    ViewsError
        If there are fewer than `FEWEST_VIEWS` pairs, or the board's distance hardly changes.
    """
    if len(pairs) < FEWEST_VIEWS:
        raise ViewsError(
            f"{len(pairs)} pairs of images show the board",
            f"take at least {FEWEST_VIEWS}, at different distances",
        )
    _, board = boards_seen({name: seen for name, (_, seen) in pairs.items()}, depth_camera)
    pairs = {name: (board.of(first), board.of(second)) for name, (first, second) in pairs.items()}
    T_E_H = view_of_eye(display, np.eye(4))
    T_C_B = {name: board_pose(seen, camera) for name, (seen, _) in pairs.items()}
    T_H_B = {name: rig.T_H_D @ board_pose(seen, depth_camera) for name, (_, seen) in pairs.items()}
    depths_m = {name: _middle_m(T_C_B[name], pairs[name][0]) for name in pairs}
    if max(depths_m.values()) < _LEAST_SPREAD * min(depths_m.values()):
        raise ViewsError("the board is at nearly the same distance in all images", "move it")
    # Far away the board is smaller and its rotation acts on a longer lever: σ grows as z².
    weights = [depths_m[name] ** -4 for name in pairs]
    T_S_C = np.linalg.inv(homography.H_C_S)
    seen_px = {
        name: cv2.perspectiveTransform(undistort(seen.pixels, camera)[None], T_S_C)[0]
        for name, (seen, _) in pairs.items()
    }

    def errors_px(turn_rad: Float64) -> tuple[dict[str, Float64], Float64]:
        """Return each corner's error, (N, 2), with a turned depth camera, and φ."""
        turned = rig.T_H_D @ rigid(rig.T_H_D[:3, :3].T @ turn_rad) @ invert(rig.T_H_D)
        placed = {name: T_E_H @ turned @ T for name, T in T_H_B.items()}
        places_m = [placed[name] @ invert(T_C_B[name]) for name in pairs]
        shift_m: Float64 = np.average([T[:3, 3] for T in places_m], axis=0, weights=weights)
        P = eye_projection(display, shift_m)
        return {
            name: project(P, transform(placed[name], seen.points_m)) - seen_px[name]
            for name, (seen, _) in pairs.items()
        }, shift_m

    off_px, shift_m = errors_px(np.zeros(3))

    def residuals(turn_rad: Float64) -> Float64:
        return np.concatenate([one.ravel() for one in errors_px(turn_rad)[0].values()])

    fitted = least_squares(residuals, np.zeros(3), x_scale=1e-3)
    arcmin = {name: _arcmin(display, one) for name, one in off_px.items()}
    views = [
        AcceptedView(name, depths_m[name], len(one), float(one.mean()), float(one.max()))
        for name, one in arcmin.items()
    ]
    return EyeAcceptance(
        tuple(sorted(views, key=lambda view: view.depth_m)),
        shift_m,
        fitted.x,
        float(_arcmin(display, np.reshape(fitted.fun, (-1, 2))).mean()),
        display.z_C0_S_m,
    )


def problem(found: EyeAcceptance, limit_arcmin: float = LIMIT_ARCMIN) -> str:
    """Return what is wrong with an eye's drawing; empty if it passes."""
    away_m = _away_m(found)
    if away_m > LARGEST_SHIFT_M:
        return (
            f"the camera is {1e3 * away_m:.0f} mm from the eye's place; move it there and check "
            "again, or the depth camera has shifted"
        )
    if found.worst_arcmin <= limit_arcmin:
        return ""
    where = max(found.views, key=lambda view: view.mean_arcmin)
    return f"{where.mean_arcmin:.1f}′ at {where.depth_m:.2f} m, more than {limit_arcmin:g}′"


class Cause(NamedTuple):
    """The likely cause of a failure."""

    words: str = ""
    again: tuple[RigPart, ...] = ()
    """Parts of the rig to calibrate again."""


def likely_cause(
    found: Mapping[Eye, EyeAcceptance], failed: Sequence[Eye], move: CameraMove | None = None
) -> Cause:
    """Return what has probably moved on a rig that fails, as far as the errors show it."""
    if move is not None and move.problem:
        return Cause(move.problem, ("T_H_D",))
    turns_rad = np.array([found[eye].turn_rad for eye in failed])
    mean_rad = turns_rad.mean(axis=0)
    apart_rad = np.linalg.norm(turns_rad - mean_rad, axis=1).max()
    strange = [eye for eye in failed if not _is_rotation(found[eye])]
    if not strange and len(failed) > 1 and apart_rad <= _SAME_TURN * np.linalg.norm(mean_rad):
        degrees = np.degrees(np.linalg.norm(mean_rad))
        return Cause(
            f"both eyes' errors are those of a depth camera turned by {degrees:.2f}° on the "
            f"headset{_or_shifted(mean_rad, found[failed[0]]) if move is None else ''}: fasten it, "
            "and calibrate its pose again",
            ("T_H_D",),
        )
    read = "; ".join(f"{eye}: {_reading(found[eye])}" for eye in failed)
    again = f"calibrate the {' and '.join(failed)} display{'s' if len(failed) > 1 else ''} again"
    if len(failed) < len(found):
        (other,) = set(found) - set(failed)
        advice = (
            f"{other} passes with the same board and cameras: take {failed[0]}'s images again, and "
            f"if it still fails, {again}"
        )
    elif strange:
        advice = (
            "check the board's measured sides, the intrinsics, and that the camera stood still in "
            f"the eye's place; then {again}"
        )
    elif len(failed) > 1:
        advice = (
            "one depth camera cannot have turned by both: check the board's measured sides and the "
            f"screens' distances; then {again}"
        )
    else:
        return Cause(
            f"{read}; display or depth camera: images of the other eye's display would show which"
        )
    return Cause(f"{read}; {advice}", tuple(failed))


def _is_rotation(found: EyeAcceptance) -> bool:
    """Return whether a rotation explains most of an eye's errors, with the camera in its place."""
    is_explained = found.left_arcmin <= _EXPLAINED * found.mean_arcmin
    return is_explained and _away_m(found) <= LARGEST_SHIFT_M


def _reading(found: EyeAcceptance) -> str:
    if _away_m(found) > LARGEST_SHIFT_M:
        return f"the camera is {1e3 * _away_m(found):.0f} mm from the eye's place"
    if not _is_rotation(found):
        return "no rotation explains the errors"
    return (
        f"the errors are those of a rotation by {np.degrees(np.linalg.norm(found.turn_rad)):.2f}°"
    )


def _away_m(found: EyeAcceptance) -> float:
    return float(np.linalg.norm(found.shift_m))


def _or_shifted(turn_rad: Float64, found: EyeAcceptance) -> str:
    """Return the shift with the effect of a small rotation, in words; empty if it is large."""
    shift_m = float(np.linalg.norm(turn_rad)) * found.image_distance_m
    if shift_m > LARGEST_SHIFT_M:
        return ""
    told = "poses of the board tracked by the headset would show which"
    return f" or shifted by {1e3 * shift_m:.0f} mm ({told})"


def _middle_m(T_C_B: Float64, seen: BoardView) -> float:
    return float(transform(T_C_B, seen.points_m).mean(axis=0)[2])


def _arcmin(display: EyeDisplay, off_px: Float64) -> Float64:
    return arcmin_from_px(display, np.linalg.norm(off_px, axis=1))


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
            raise HandcalError(f"{eye}: {error.what}", error.advice) from error
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
        raise HandcalError(f"{picture}: {error.what}", error.advice) from error


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
