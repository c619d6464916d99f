"""The report of a test of the segmentation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from matplotlib.axes import Axes

from handcal.core.types import UInt8
from handcal.export.figures import name_axes
from handcal.lab.evaluate.segmentation_sheet import contact_sheet
from handcal.report.document import Column, Figure, Report, Section, Table, facts, made_with

_METHOD = (
    "Each frame is segmented on its own, as the first one of a camera, and compared with its true "
    "mask. Kept is the share of the true hand's measured pixels in the mask. The area is that of "
    "the mask: its greatest relative change if 1 to 8 px are cropped off a side, if the image is "
    "scaled by 0.7 to 1.2, or if every second pixel of the depth is used. The wrist is the mean "
    "distance of the cut edge beyond the wrist joint, along the forearm, where joints are given."
)
_COLORS = "Green: mask and truth agree; red: beyond the truth; blue: missed."
_TILES_IN_FIGURE = 12
_ROW_MM = 42.0
_PERCENT = 100.0


def segmentation_report(figures: Mapping[str, Any], tiles: Sequence[UInt8]) -> Report:
    """Return the report of a test of the segmentation.

    Parameters
    ----------
    figures : mapping
        As `evaluation` gives them.
    tiles : sequence of (h, w, 3) uint8
        The picture of each frame, as `tile` draws it.
    """
    return Report(
        title="Test of the segmentation",
        subject=f"Frames: {figures['frames']}, refused: {figures['refused']}",
        lead=f"Intersection over union with the true masks: {_cell(figures['iou_mean'], 1, 3)} on "
        f"average, at least {_cell(figures['iou_min'], 1, 3)}. At least "
        f"{_cell(figures['kept_min'], _PERCENT, 1)} % of the hand are kept. With crops, scale and "
        f"sampling the area changes by up to {_cell(figures['area_change_max'], _PERCENT, 1)} %.",
        sections=list(_sections(figures, tiles)),
    )


def _sections(figures: Mapping[str, Any], tiles: Sequence[UInt8]) -> Iterator[Section]:
    wrist = {
        "Wrist, standard deviation": f"{_cell(figures['wrist_sd_mm'], 1, 1)} mm",
        "Wrist, largest step": f"{_cell(figures['wrist_max_step_mm'], 1, 1)} mm",
        "Frames with a change of area over 10 %": str(figures["area_changes_over_10_percent"]),
    }
    yield Section("", [facts(made_with()), _METHOD, facts(wrist)])
    rows = figures["rows"]
    figure = Figure(
        "frames", "Each frame that is not refused.", partial(_draw, rows), rows, columns=2
    )
    yield Section("Frames", [figure, _table(rows)])
    if refused := [(row["name"], row["refused"]) for row in rows if row["refused"] is not None]:
        yield Section("Refused", [Table((Column("frame", "left"), Column("why", "left")), refused)])
    yield Section("Pictures", list(_pictures(rows, tiles)), starts_page=True)


def _pictures(rows: Sequence[Any], tiles: Sequence[UInt8]) -> Iterator[Figure]:
    for first in range(0, len(tiles), _TILES_IN_FIGURE):
        sheet = contact_sheet(tiles[first : first + _TILES_IN_FIGURE])
        shown = [{"frame": row["name"]} for row in rows[first : first + _TILES_IN_FIGURE]]
        height_mm = _ROW_MM * sheet.shape[0] / tiles[first].shape[0]
        name = f"pictures-{first // _TILES_IN_FIGURE + 1}"
        yield Figure(name, _COLORS, partial(_show, sheet), shown, height_mm, left_mm=0.0)


def _show(sheet: UInt8, axes: Sequence[Axes]) -> None:
    axes[0].imshow(sheet)
    axes[0].set_axis_off()


def _draw(rows: Sequence[Any], axes: Sequence[Axes]) -> None:
    for ax, key, scale, title, label in (
        (axes[0], "iou", 1.0, "Agreement", "intersection over union"),
        (axes[1], "area_change", _PERCENT, "Stability", "change of the area, %"),
    ):
        known = [(n, scale * row[key]) for n, row in enumerate(rows, 1) if row[key] is not None]
        places, values = [n for n, _ in known], [value for _, value in known]
        ax.plot(places, values, "o", markersize=3, clip_on=False)
        ax.set_ylim(bottom=0.0)
        name_axes(ax, title, "frame", label)


def _table(rows: Sequence[Any]) -> Table:
    titles = "IoU", "kept, %", "beyond wrist, mm", "area ±, %", "centroid ±, mm"
    cells = [
        [
            row["name"],
            _cell(row["iou"], 1, 3),
            _cell(row["kept"], _PERCENT, 1),
            _cell(row["beyond_wrist_mm"], 1, 1),
            _cell(row["area_change"], _PERCENT, 1),
            _cell(row["centroid_change_mm"], 1, 1),
        ]
        for row in rows
    ]
    return Table([Column("frame", "left"), *map(Column, titles)], cells)


def _cell(value: float | None, scale: float, digits: int) -> str:
    return "–" if value is None else f"{scale * value:.{digits}f}"
