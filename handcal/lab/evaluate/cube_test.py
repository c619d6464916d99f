"""The cube test: errors in all its captures, one row for each pair."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from scipy.spatial.transform import Rotation

from handcal.core.errors import FileError, HandcalError
from handcal.core.frozen import freeze
from handcal.core.geometry import camera_matrix, transform
from handcal.core.progress import Progress
from handcal.core.types import Float64, Intrinsics, Rig
from handcal.export.figures import name_axes
from handcal.io.files import user_path
from handcal.io.images import read_grey
from handcal.io.resources import resource_path
from handcal.lab.evaluate.cube_folder import GRID, find_captures, images_in
from handcal.lab.methods import MISALIGNMENT
from handcal.lab.settings import CubeTestSettings, output_folder
from handcal.lab.study.store import free_of_studies
from handcal.report.cells import interval_ends, mean_sd
from handcal.report.document import (
    Column,
    Figure,
    Report,
    Section,
    Table,
    facts,
    made_with,
    settings_items,
)
from handcal.report.html import write_report
from handcal.report.statistics import (
    INTERVAL_METHOD,
    MeanInterval,
    Summary,
    mean_interval,
    summarise,
)
from handcal.rig.boards.board import BoardError
from handcal.rig.boards.views import ViewsError
from handcal.rig.cube import (
    MIN_FACES,
    Cube,
    CubeError,
    cube_pose,
    find_cube,
    marker_corners_m,
    read_cube,
)
from handcal.rig.displays.grid import Grid, find_grid, grid_on
from handcal.rig.displays.homography import RotationWarp, fit_homography, pose_before
from handcal.rig.formats import read_intrinsics
from handcal.rig.rig_file import read_rig
from handcal.sim.cube_captures import CaptureSettings, write_captures

CubeRow: TypeAlias = dict[str, float | int | str]
"""Errors of one pair of captures; units are in the names."""

_UNUSABLE = (CubeError, BoardError, ViewsError, FileError, ValueError)


@dataclass(frozen=True, slots=True)
class CubeTest:
    """The errors found in captures."""

    rows: list[CubeRow]
    """`cube_row` of each pair, and whose it is: ``position``, ``pose``, ``drawn``."""
    left_out: dict[str, str]
    """Reasons, by the name of the capture that could not be used."""


def judge_captures(
    folder: Path,
    cube: Cube,
    camera: Intrinsics,
    grid: Grid,
    progress: Progress = Progress(),
) -> CubeTest:
    """Find and compare the cubes in all captures; missing and failed ones are left out.

    Captures are undistorted and, where the position has an image of the display's grid, turned to
    the display's axes (Hu et al. 2021), as an eye is: errors are along these.

    Parameters
    ----------
    folder : Path
        Laid out as in `handcal.lab.evaluate.cube_folder`.
    cube : Cube
    camera : Intrinsics
        The eye-replacement camera, lens included.
    grid : Grid
        The grid that the display shows in the grid images.
    progress : Progress

    Raises
    ------
    FileError
        If there are no captures, or too many.
    """
    poses, left_out = find_captures(folder)
    straight = replace(camera, distortion=())
    rows: list[CubeRow] = []
    for position, of_position in groupby(poses, key=lambda pose: pose.position):
        with _noted(left_out, f"{position}/{GRID}"):
            warp = display_warp(folder / position, camera, grid)
            if warp is None:
                warp = RotationWarp(camera, np.eye(3))
            for pose in of_position:
                name = f"{position}/{pose.pose}"
                progress.at(poses.index(pose) / len(poses), f"Looking at {name}")
                with _noted(left_out, f"{name}/{pose.real.name}"):
                    real_px = find_cube(warp.warp(read_grey(pose.real)), cube)
                    for drawn, path in pose.virtual.items():
                        with _noted(left_out, f"{name}/{path.name}"):
                            virtual_px = find_cube(warp.warp(read_grey(path)), cube)
                            errors = cube_row(compare_cubes(real_px, virtual_px, cube, straight))
                            whose = {"position": position, "pose": pose.pose, "drawn": drawn}
                            rows.append(whose | errors)
    return CubeTest(rows, left_out)


def display_warp(position: Path, camera: Intrinsics, grid: Grid) -> RotationWarp | None:
    """Return the warp of a position's images to the display's axes; None without its grid.

    Parameters
    ----------
    position : Path
        Folder of the position.
    camera : Intrinsics
    grid : Grid

    Raises
    ------
    FileError, BoardError, ViewsError, ValueError
        If the image of the grid cannot be used.
    """
    path = images_in(position).get(GRID) if position.is_dir() else None
    if path is None:
        return None
    size = grid.width_px, grid.height_px
    homography = fit_homography({GRID: find_grid(read_grey(path), grid)}, camera, *size)
    return RotationWarp(camera, pose_before(homography, camera, *size)[0])


def cube_row(found: CubeMisalignment) -> CubeRow:
    """Return the errors as the paper defines them: magnitudes, corners averaged.

    ``err_t_xy`` is the mean length of the corners' offsets in the image, ``err_R`` the angle.
    """
    x_mm, y_mm = 1e3 * np.abs(found.offset_m).mean(axis=0)
    x_arcmin, y_arcmin = 60.0 * np.degrees(np.abs(found.offset_rad).mean(axis=0))
    turn_deg = np.degrees(found.rotation_rad)
    row = {
        "depth_mm": 1e3 * found.depth_m,
        "err_t_x_mm": x_mm,
        "err_t_y_mm": y_mm,
        "err_t_z_mm": 1e3 * abs(found.along_m),
        "err_t_xy_mm": 1e3 * np.linalg.norm(found.offset_m, axis=1).mean(),
        "err_t_x_arcmin": x_arcmin,
        "err_t_y_arcmin": y_arcmin,
        "err_t_xy_arcmin": 60.0 * np.degrees(np.linalg.norm(found.offset_rad, axis=1).mean()),
        "err_R_x_deg": abs(turn_deg[0]),
        "err_R_y_deg": abs(turn_deg[1]),
        "err_R_z_deg": abs(turn_deg[2]),
        "err_R_deg": np.linalg.norm(turn_deg),
    }
    return {"faces": found.faces, **{name: float(value) for name, value in row.items()}}


@contextmanager
def _noted(left_out: dict[str, str], name: str) -> Iterator[None]:
    """Record the reason of a HandcalError, and continue after the block."""
    try:
        yield
    except _UNUSABLE as error:
        left_out[name] = str(error)


# Misalignment of a virtual cube and the real one in captures by the eye-replacement camera.
#
# As in Hu et al. 2021 (assessment with eye-replacement camera): across the line of sight by the
# markers' corners in the image, along it and in rotation by the cube's pose from all of them.


@dataclass(frozen=True, slots=True, eq=False)
class CubeMisalignment:
    """The virtual cube minus the real one, in the axes of the (rotated) camera."""

    faces: int
    """Seen in both captures."""
    depth_m: float
    """z of the real cube's middle."""
    offset_m: Float64
    """(N, 2); of each corner across the line of sight, at the real corner's depth."""
    offset_rad: Float64
    """(N, 2); the same as angles."""
    along_m: float
    """Of the cube's middle along z."""
    rotation_rad: Float64
    """(3,); rotation vector from the real cube to the virtual one."""

    def __post_init__(self) -> None:
        freeze(self, "offset_m", np.float64, None, 2)
        freeze(self, "offset_rad", np.float64, len(self.offset_m), 2)
        freeze(self, "rotation_rad", np.float64, 3)


def compare_cubes(
    real_px: Mapping[int, Float64],
    virtual_px: Mapping[int, Float64],
    cube: Cube,
    camera: Intrinsics,
) -> CubeMisalignment:
    """Compare what `find_cube` found in a capture of the real cube and in one of the virtual.

    Only faces seen in both count, so that errors of the print cancel.

    Parameters
    ----------
    real_px, virtual_px : mapping of int to (4, 2) float64
        The corners of each marker.
    cube : Cube
    camera : Intrinsics
        Of both captures, without lens distortion: they are `RotationWarp`'s.

    Raises
    ------
    CubeError
        If fewer than two faces are seen in both, or the corners do not lie as on the cube.
    """
    shared = sorted(real_px.keys() & virtual_px.keys())
    if len(shared) < MIN_FACES:
        raise CubeError(
            f"the two captures share {len(shared)} faces, at least {MIN_FACES} are needed: they "
            "must show the same pose of the cube"
        )
    real_px, virtual_px = ({i: px[i] for i in shared} for px in (real_px, virtual_px))
    T_real, T_virtual = (cube_pose(px, cube, camera) for px in (real_px, virtual_px))
    real, virtual = (_plane(px, camera) for px in (real_px, virtual_px))
    depths_m = transform(T_real, marker_corners_m(cube, shared))[:, 2:]
    turn = Rotation.from_matrix(T_virtual[:3, :3] @ T_real[:3, :3].T)
    return CubeMisalignment(
        faces=len(shared),
        depth_m=float(T_real[2, 3]),
        offset_m=(virtual - real) * depths_m,
        offset_rad=np.arctan(virtual) - np.arctan(real),
        along_m=float(T_virtual[2, 3] - T_real[2, 3]),
        rotation_rad=turn.as_rotvec(),
    )


def _plane(corners_px: Mapping[int, Float64], camera: Intrinsics) -> Float64:
    """Return where corners are on the plane at unit distance, (N, 2)."""
    pixels = np.concatenate([*corners_px.values()])
    homogeneous = np.column_stack([pixels, np.ones(len(pixels))])
    return np.asarray(np.linalg.solve(camera_matrix(camera), homogeneous.T).T[:, :2])


@dataclass(frozen=True, slots=True)
class ErrorSummary:
    """One error over all pairs."""

    spread: Summary
    interval: MeanInterval | None
    """Of the mean; positions of the camera count as independent, as each has its own calibration.
    None of a single position."""


def cube_summary(rows: Sequence[CubeRow]) -> dict[str, dict[str, ErrorSummary]]:
    """Return each error's summary by name, for each way of drawing."""
    by_drawn: dict[str, list[CubeRow]] = {}
    for row in rows:
        by_drawn.setdefault(str(row["drawn"]), []).append(row)
    return {
        drawn: {name: _summarise(group, name) for name in group[0] if name.startswith("err_")}
        for drawn, group in by_drawn.items()
    }


def _summarise(rows: Sequence[Mapping[str, float | int | str]], name: str) -> ErrorSummary:
    values = [float(row[name]) for row in rows]
    positions = [row["position"] for row in rows]
    several = len(set(positions)) > 1
    return ErrorSummary(summarise(values), mean_interval(values, positions) if several else None)


_METHOD = (
    "A camera in the eye's place captures the real cube with the display off, and the drawn cube "
    "with the real one covered (Hu, Rodriguez y Baena, Cutolo, ISMAR 2021, assessment with "
    "eye-replacement camera). Captures are undistorted and, where the display's grid was captured, "
    "turned to its axes. err_t in x, y and xy is the mean distance of corresponding marker corners "
    "in the image, in mm at the real corners' depth; err_t in z and err_R compare the cube's pose "
    "by PnP. All are magnitudes. x is to the right, y down, z away from the eye."
)
_INTERVALS = (
    "Each position of the camera has its own calibration, so that only positions count as "
    f"independent: intervals are of the mean of positions' means, by {INTERVAL_METHOD}."
)
_ERRORS = {
    "err_t_x_mm": "err_t x, mm",
    "err_t_y_mm": "err_t y, mm",
    "err_t_z_mm": "err_t z, mm",
    "err_t_xy_mm": "err_t xy, mm",
    "err_t_x_arcmin": "err_t x, arcmin",
    "err_t_y_arcmin": "err_t y, arcmin",
    "err_t_xy_arcmin": "err_t xy, arcmin",
    "err_R_x_deg": "err_R x, °",
    "err_R_y_deg": "err_R y, °",
    "err_R_z_deg": "err_R z, °",
    "err_R_deg": "err_R, °",
}
_COMPARED = (
    "err_t_x_mm",
    "err_t_y_mm",
    "err_t_z_mm",
    "err_t_xy_mm",
    "err_t_xy_arcmin",
    "err_R_deg",
)
_STYLES = (
    ("#0072B2", "-"),
    ("#D55E00", "--"),
    ("#009E73", ":"),
    ("#CC79A7", "-."),
    ("#56B4E9", (0, (8, 1))),
    ("#E69F00", (0, (1, 3))),
)
"""Colour and line of each way of drawing: not everyone can tell colours apart."""
_BOX_WIDTH = 0.8


def cube_report(
    test: CubeTest,
    summary: Mapping[str, Mapping[str, ErrorSummary]],
    cube: Cube,
    camera: Intrinsics,
) -> Report:
    """Return the report of a cube test."""
    positions = {row["position"] for row in test.rows}
    poses = {(row["position"], row["pose"]) for row in test.rows}
    findings = [
        f"{drawn} {mean_sd(errors['err_t_xy_arcmin'].spread)} arcmin "
        f"({mean_sd(errors['err_t_xy_mm'].spread)} mm), "
        f"{mean_sd(errors['err_t_z_mm'].spread)} mm, {mean_sd(errors['err_R_deg'].spread)}°"
        for drawn, errors in summary.items()
    ]
    return Report(
        title="Cube test",
        subject=f"Positions of the camera: {len(positions)}, poses of the cube: {len(poses)}",
        lead="Across the line of sight, along it, and in rotation, mean ± SD: "
        f"{'; '.join(findings)}.",
        sections=list(_sections(test, summary, cube, camera)),
    )


def _sections(
    test: CubeTest,
    summary: Mapping[str, Mapping[str, ErrorSummary]],
    cube: Cube,
    camera: Intrinsics,
) -> Iterator[Section]:
    yield Section("", [facts(made_with()), _METHOD])
    yield Section("Errors", [*(_table(*one) for one in summary.items()), _INTERVALS])
    yield Section("Spread", _figures(test.rows, list(summary)))
    yield _published(summary)
    if test.left_out:
        columns = Column("capture", "left"), Column("why", "left")
        yield Section("Left out", [Table(columns, list(test.left_out.items()))])
    settings = {"cube": asdict(cube), "camera": asdict(camera)}
    yield Section("Cube and camera", settings_items(settings))


def _table(drawn: str, errors: Mapping[str, ErrorSummary]) -> Table:
    titles = ("", "mean ± SD", "95 % interval", "median", "quartiles", "min to max")
    columns = [Column(title, "right" if title else "left") for title in titles]
    rows = [_cells(name, errors[key]) for key, name in _ERRORS.items()]
    pairs = next(iter(errors.values())).spread.count
    return Table(columns, rows, f"{drawn}, {pairs} pairs of captures", drawn.capitalize())


def _cells(name: str, error: ErrorSummary) -> list[str]:
    spread = error.spread
    return [
        name,
        mean_sd(spread),
        interval_ends(error.interval),
        f"{spread.median:.2f}",
        f"{spread.q1:.2f} to {spread.q3:.2f}",
        f"{spread.min:.2f} to {spread.max:.2f}",
    ]


def _figures(rows: Sequence[CubeRow], drawn: Sequence[str]) -> list[Figure]:
    caption = (
        "Boxes: quartiles and median; whiskers: the farthest within 1.5 interquartile ranges. "
        "Axes of the display, or of the camera where no grid was captured."
    )
    by_axis = Figure(
        "errors", caption, partial(_draw_by_axis, rows, drawn), rows, height_mm=70.0, columns=2
    )
    by_position = Figure(
        "positions",
        "Across the line of sight, by position of the camera in the eye box.",
        partial(_draw_by_position, rows, drawn),
        rows,
        height_mm=60.0,
    )
    return [by_axis, by_position]


def _draw_by_axis(rows: Sequence[CubeRow], drawn: Sequence[str], axes: Sequence[Axes]) -> None:
    for ax, kind, unit, shown_unit in zip(
        axes, ("err_t", "err_R"), ("mm", "deg"), ("mm", "degrees"), strict=True
    ):
        groups = {axis: [(row, f"{kind}_{axis}_{unit}") for row in rows] for axis in "xyz"}
        _draw_boxes(ax, groups, drawn)
        name_axes(ax, kind, "axis", shown_unit)


def _draw_by_position(rows: Sequence[CubeRow], drawn: Sequence[str], axes: Sequence[Axes]) -> None:
    groups: dict[str, list[tuple[CubeRow, str]]] = {}
    for row in rows:
        groups.setdefault(str(row["position"]), []).append((row, "err_t_xy_arcmin"))
    _draw_boxes(axes[0], groups, drawn)
    name_axes(axes[0], "err_t xy", "position", "arcmin")


def _draw_boxes(
    ax: Axes, groups: Mapping[str, Sequence[tuple[CubeRow, str]]], drawn: Sequence[str]
) -> None:
    """Draw groups of boxes, one box in each for each way of drawing; of rows' named errors."""
    width = _BOX_WIDTH / len(drawn)
    for number, name in enumerate(drawn):
        color, line = _STYLES[number % len(_STYLES)]
        style: dict[str, Any] = {"color": color, "linestyle": line}
        offset = (number + 0.5) * width - 0.5 * _BOX_WIDTH
        ax.boxplot(
            [
                [float(row[error]) for row, error in group if row["drawn"] == name]
                for group in groups.values()
            ],
            positions=[place + offset for place in range(len(groups))],
            widths=0.8 * width,
            manage_ticks=False,
            boxprops=style,
            medianprops={"color": color, "linewidth": 1.6},
            whiskerprops=style,
            capprops={"color": color},
            flierprops={"marker": ".", "markersize": 3, "markeredgecolor": color},
        )
        ax.plot([], [], label=name, **style)
    ax.set_xticks(range(len(groups)), list(groups))
    ax.set_xlim(-0.5, len(groups) - 0.5)
    ax.set_ylim(bottom=0.0)
    ax.legend(fontsize=6.5, frameon=False)


def _published(summary: Mapping[str, Mapping[str, ErrorSummary]]) -> Section:
    columns = [Column("study", "left"), *(Column(_ERRORS[key]) for key in _COMPARED)]
    here = [
        (f"this test, {drawn}", *(mean_sd(errors[key].spread) for key in _COMPARED))
        for drawn, errors in summary.items()
    ]
    caption = "Mean ± SD, others as given by Hu et al. 2021; all at arm's reach, 0.4 to 0.6 m."
    published = [
        (
            f"{p.study}, {p.whole_mm} mm in all" if p.whole_mm else p.study,
            *(p.x_mm, p.y_mm, p.z_mm, p.across_mm, p.across_arcmin, p.rotation_deg),
        )
        for p in MISALIGNMENT
    ]
    return Section("Beside published tests", [Table(columns, [*here, *published], caption)])


# Shares of the time of an evaluation.
_READING, _RENDERING = 0.7, 0.49
_MOST_REASONS = 3


@dataclass(frozen=True, slots=True, eq=False)
class CubeTestResult:
    """The errors found in a cube test, and its report as it was written."""

    test: CubeTest
    summary: Mapping[str, Mapping[str, ErrorSummary]]
    """By the name of the drawn cube and of the error."""
    report: Report
    files: tuple[Path, ...]
    """The report as PDF and as HTML."""


def run_cube_test(settings: CubeTestSettings, progress: Progress = Progress()) -> CubeTestResult:
    """Evaluate the captures of a cube test, rendered ones without a folder, and write the report.

    Raises
    ------
    CancelledError
    HandcalError
        If a file cannot be used, the results would go into a study's folder, or no pair of captures
        can be evaluated.
    """
    output = free_of_studies(output_folder(settings.output))
    if settings.captures:
        folder = user_path(settings.captures)
        return _evaluate_captures(settings, folder, output, progress, 0.0)
    with TemporaryDirectory() as rendered:
        render_captures(settings, Path(rendered), progress.part(0.0, _RENDERING))
        return _evaluate_captures(settings, Path(rendered), output, progress, _RENDERING)


def render_captures(
    settings: CubeTestSettings, folder: Path, progress: Progress = Progress()
) -> None:
    """Render all captures of a cube test into a new or empty folder.

    Raises
    ------
    CancelledError
    HandcalError
        If the rig file cannot be used, or the folder is not empty or cannot be written.
    """
    chosen = CaptureSettings(
        seed=settings.seed,
        eye=settings.eye,
        poses=settings.poses,
        alignments=settings.alignments,
        prior=settings.prior,
    )
    write_captures(folder, _rig(settings), chosen, progress)


def cube_and_grid(settings: CubeTestSettings, folder: Path) -> tuple[Cube, Grid]:
    """Return the cube and the display's grid that the captures in a folder show.

    Raises
    ------
    HandcalError
        If a file is missing or wrong, or the display has no room for such a grid.
    """
    file = _file(settings.cube, folder / "cube.json")
    if not file.exists():
        raise FileError(
            f"there is no {file}",
            "choose the description of the cube, or write one together with the cube's net by "
            "handcal evaluate cube net",
        )
    display = _rig(settings).eyes[settings.eye]
    return read_cube(file), grid_on(display.width_px, display.height_px, settings.square_px)


def position_warp(settings: CubeTestSettings, folder: Path, position: str) -> RotationWarp | None:
    """Return the warp of the live view at a position; None before its grid is captured.

    Raises
    ------
    HandcalError
        If the camera's intrinsics or the image of the grid cannot be used.
    """
    file = _file(settings.camera, folder / "camera.json")
    if not file.exists():
        raise FileError(f"there is no {file}", "choose the file of the camera's intrinsics")
    camera = read_intrinsics(file)
    grid = cube_and_grid(settings, folder)[1]
    return display_warp(folder / position, camera, grid)


def _evaluate_captures(
    settings: CubeTestSettings, folder: Path, output: Path, progress: Progress, begun: float
) -> CubeTestResult:
    cube, grid = cube_and_grid(settings, folder)
    camera = read_intrinsics(_file(settings.camera, folder / "camera.json"))
    test = judge_captures(folder, cube, camera, grid, progress.part(begun, _READING))
    if not test.rows:
        reasons = [f"{name}: {why}" for name, why in test.left_out.items()]
        shown = "; ".join(reasons[:_MOST_REASONS])
        raise HandcalError(f"no pair of captures can be evaluated ({shown})")
    summary = cube_summary(test.rows)
    report = cube_report(test, summary, cube, camera)
    return CubeTestResult(
        test,
        summary,
        report,
        write_report(output, report, progress.part(_READING, 1.0, "Writing the report")),
    )


def _rig(settings: CubeTestSettings) -> Rig:
    return read_rig(_file(settings.rig, resource_path("example_rig.yaml")))


def _file(chosen: str, otherwise: Path) -> Path:
    return user_path(chosen) if chosen else otherwise
