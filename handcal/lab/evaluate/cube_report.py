"""The report of a cube test."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

from matplotlib.axes import Axes

from handcal.core.types import Intrinsics
from handcal.export.figures import name_axes
from handcal.lab.evaluate.cube_summary import ErrorSummary
from handcal.lab.evaluate.cube_test import CubeRow, CubeTest
from handcal.lab.methods.published import MISALIGNMENT
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
from handcal.report.statistics import INTERVAL_METHOD
from handcal.rig.cube import Cube

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
    return Table(columns, rows, f"{drawn}, {pairs} pairs of captures")


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
