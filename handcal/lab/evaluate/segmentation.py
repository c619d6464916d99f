"""Agreement of the segmented hand with true masks, and its stability against small changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes

from handcal.core.errors import HandError
from handcal.core.progress import Progress
from handcal.core.types import Bool, Frame, HandCloud, UInt8
from handcal.export.figures import name_axes
from handcal.hand.settings import SegmentSettings
from handcal.hand.shipped import make_finder
from handcal.io.files import make_folder, require_suffix, user_path
from handcal.io.images import write_png
from handcal.lab.evaluate.masked_frames import (
    MaskedFrame,
    cropped,
    read_masked_frames,
    read_masked_names,
    scaled,
    subsampled,
)
from handcal.lab.settings import SegmentationTestSettings, output_folder
from handcal.lab.study.store import free_of_studies
from handcal.report.document import Column, Figure, Report, Section, Table, facts
from handcal.report.provenance import made_with
from handcal.report.write import write_report

Find = Callable[[Frame], HandCloud]
"""Segments the hand in a frame that stands alone; raises HandError if it finds none."""

CROPS_PX = 1, 2, 3, 5, 8
SCALES = 0.7, 0.85, 1.2
_SIDES = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [1, 1, 0, 0]])
_LARGE_CHANGE = 0.1


@dataclass(frozen=True, slots=True)
class FrameFigures:
    """Figures of the segmentation of one frame; None where there is none."""

    name: str
    refused: str | None
    """The reason, if no hand was returned."""
    iou: float | None
    """Intersection over union with the true mask."""
    kept: float | None
    """Share of the true hand's measured pixels that the mask holds."""
    beyond_wrist_mm: float | None
    """Mean distance of the cut edge beyond the wrist joint, along the forearm."""
    crop_change: float | None
    scale_change: float | None
    sampling_change: float | None
    """Greatest relative change of the mask's area if 1 to 8 px are cropped off each side, if the
    image is scaled, and if every second pixel of the depth is used; 1 if the hand is refused then.
    """
    centroid_change_mm: float | None
    """Greatest movement of the cloud's centroid in the same cases."""

    @property
    def area_change(self) -> float | None:
        """Greatest of the relative changes of the mask's area."""
        if self.crop_change is None or self.scale_change is None or self.sampling_change is None:
            return None
        return max(self.crop_change, self.scale_change, self.sampling_change)


def evaluate_frame(shot: MaskedFrame, find: Find) -> tuple[FrameFigures, Bool | None]:
    """Segment the hand in a frame and in its variants; return the figures and the frame's mask.

    Parameters
    ----------
    shot : MaskedFrame
    find : callable
    """
    try:
        cloud = find(shot.frame)
    except HandError as error:
        return FrameFigures(shot.name, str(error), *[None] * 7), None
    mask = cloud.mask > 0
    measured = shot.is_hand & (shot.frame.depth > 0)
    changes = [_changes(shot.frame, cloud, kind, find) for kind in _variants(shot.frame)]
    figures = FrameFigures(
        name=shot.name,
        refused=None,
        iou=_share(mask & shot.is_hand, mask | shot.is_hand),
        kept=_share(mask & measured, measured),
        beyond_wrist_mm=_beyond_wrist_mm(shot, cloud),
        crop_change=changes[0][0],
        scale_change=changes[1][0],
        sampling_change=changes[2][0],
        centroid_change_mm=max(centroid_mm for _, centroid_mm in changes),
    )
    return figures, mask


def evaluation(rows: Sequence[FrameFigures]) -> dict[str, Any]:
    """Return the figures of all frames, and of each under ``rows``, JSON-able.

    All but ``frames`` and ``refused`` are over the frames in which a hand was segmented. None
    where no frame has it.
    """
    beyond_mm = [row.beyond_wrist_mm for row in rows]
    known_mm = [one for one in beyond_mm if one is not None]
    steps_mm = [
        abs(after - before)
        for before, after in pairwise(beyond_mm)
        if before is not None and after is not None
    ]
    ious, kept, changes = (
        [one for one in values if one is not None]
        for values in (
            [row.iou for row in rows],
            [row.kept for row in rows],
            [row.area_change for row in rows],
        )
    )
    return {
        "frames": len(rows),
        "refused": sum(row.refused is not None for row in rows),
        "iou_mean": float(np.mean(ious)) if ious else None,
        "iou_min": min(ious, default=None),
        "kept_min": min(kept, default=None),
        "wrist_sd_mm": float(np.std(known_mm, ddof=1)) if len(known_mm) > 1 else None,
        "wrist_max_step_mm": max(steps_mm, default=None),
        "area_change_max": max(changes, default=None),
        "area_changes_over_10_percent": sum(bool(change > _LARGE_CHANGE) for change in changes),
        "rows": [asdict(row) | {"area_change": row.area_change} for row in rows],
    }


def _variants(frame: Frame) -> tuple[Iterator[Frame], ...]:
    """Return a frame cropped, scaled and sub-sampled in several ways."""
    return (
        (cropped(frame, *(px * side).tolist()) for px in CROPS_PX for side in _SIDES),
        (scaled(frame, scale) for scale in SCALES),
        (subsampled(frame, 2, column, row) for column in (0, 1) for row in (0, 1)),
    )


def _changes(
    frame: Frame, cloud: HandCloud, variants: Iterable[Frame], find: Find
) -> tuple[float, float]:
    """Return the greatest relative change of the area and movement of the centroid, in mm."""
    area_m2, centroid_m = _area_m2(cloud, frame), cloud.points_m.mean(axis=0)
    change = moved_m = 0.0
    for variant in variants:
        try:
            found = find(variant)
        except HandError:
            change = 1.0
            continue
        change = max(change, abs(_area_m2(found, variant) / area_m2 - 1.0))
        shift_m = found.points_m.mean(axis=0) - centroid_m
        moved_m = max(moved_m, float(np.linalg.norm(shift_m)))
    return change, 1e3 * moved_m


def _area_m2(cloud: HandCloud, frame: Frame) -> float:
    """Return the mask's area at a depth of 1 m."""
    camera = frame.depth_intrinsics
    return int(np.count_nonzero(cloud.mask)) / (camera.fx * camera.fy)


def _beyond_wrist_mm(shot: MaskedFrame, cloud: HandCloud) -> float | None:
    if shot.wrist_m is None or shot.arm_axis is None or not cloud.contour_is_cut.any():
        return None
    cut_m = cloud.contour_m[cloud.contour_is_cut] - shot.wrist_m
    return float(1e3 * (cut_m @ shot.arm_axis).mean())


def _share(part: Bool, whole: Bool) -> float | None:
    pixels = np.count_nonzero(whole)
    return float(np.count_nonzero(part) / pixels) if pixels else None


_COLUMNS, _MOST_TILES = 4, 200
_TILE_PX = 320
_RIGHT, _WRONG, _MISSED = (60, 200, 60), (255, 60, 60), (60, 120, 255)


def tile(shot: MaskedFrame, mask: Bool | None, row: FrameFigures) -> UInt8:
    """Draw one frame: green where mask and truth agree, red beyond the truth, blue what is missed.

    Parameters
    ----------
    shot : MaskedFrame
    mask : (H, W) bool or None
        The segmented hand, if there is one.
    row : FrameFigures
        Its numbers, written above the picture.

    Returns
    -------
    (320, 320, 3) uint8
        RGB.
    """
    found = np.zeros_like(shot.is_hand) if mask is None else mask
    picture = _picture(shot)
    for part, color in (
        (found & shot.is_hand, _RIGHT),
        (found & ~shot.is_hand, _WRONG),
        (shot.is_hand & ~found, _MISSED),
    ):
        picture[part] = picture[part] // 2 + np.array(color, np.uint8) // 2
    height, width = picture.shape[:2]
    scale = _TILE_PX / max(width, height)
    size = max(1, round(scale * width)), max(1, round(scale * height))
    drawn = np.zeros((_TILE_PX, _TILE_PX, 3), np.uint8)
    drawn[_TILE_PX - size[1] :, : size[0]] = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    for number, line in enumerate((row.name, _numbers(row))):
        cv2.putText(
            drawn, line, (4, 14 + 16 * number), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (255, 255, 255), 1
        )
    return drawn


def contact_sheet(tiles: Sequence[UInt8]) -> UInt8:
    """Arrange tiles in rows of four; at most 200 are shown."""
    shown = list(tiles[:_MOST_TILES])
    shown += [np.zeros((_TILE_PX, _TILE_PX, 3), np.uint8)] * (-len(shown) % _COLUMNS)
    rows = [np.hstack(shown[i : i + _COLUMNS]) for i in range(0, len(shown), _COLUMNS)]
    return np.vstack(rows)


def _picture(shot: MaskedFrame) -> UInt8:
    """Return the colour image, or the depth in grey: white at the camera, black from 1 m on."""
    frame = shot.frame
    if frame.color is not None:
        return frame.color.copy()
    near = np.where(frame.depth > 0, 1.0 - frame.depth * frame.depth_scale_m, 0.0)
    return np.repeat((255 * near.clip(0.0, 1.0)).astype(np.uint8)[..., None], 3, axis=2)


def _numbers(row: FrameFigures) -> str:
    if row.refused is not None:
        return row.refused
    texts = [f"IoU {row.iou:.2f}"]
    if row.kept is not None:
        texts.append(f"kept {100 * row.kept:.0f} %")
    if row.beyond_wrist_mm is not None:
        texts.append(f"wrist +{row.beyond_wrist_mm:.0f} mm".replace("+-", "-"))
    if row.area_change is not None:
        texts.append(f"area {100 * row.area_change:.1f} %")
    return ", ".join(texts)


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
        lead=f"Intersection over union with the true masks: {cell(figures['iou_mean'], 1, 3)} on "
        f"average, at least {cell(figures['iou_min'], 1, 3)}. At least "
        f"{cell(figures['kept_min'], _PERCENT, 1)} % of the hand are kept. With crops, scale and "
        f"sampling the area changes by up to {cell(figures['area_change_max'], _PERCENT, 1)} %.",
        sections=list(_sections(figures, tiles)),
    )


def _sections(figures: Mapping[str, Any], tiles: Sequence[UInt8]) -> Iterator[Section]:
    wrist = {
        "Wrist, standard deviation": f"{cell(figures['wrist_sd_mm'], 1, 1)} mm",
        "Wrist, largest step": f"{cell(figures['wrist_max_step_mm'], 1, 1)} mm",
        "Frames with a change of area over 10 %": str(figures["area_changes_over_10_percent"]),
    }
    yield Section("", [facts(made_with()), _METHOD, facts(wrist)])
    rows = figures["rows"]
    figure = Figure(
        "frames", "Each frame that is not refused.", partial(_draw, rows), rows, columns=2
    )
    yield Section("Frames", [figure, frame_table(rows)])
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


def frame_table(rows: Sequence[Any]) -> Table:
    """Return the figures of each frame, as `evaluation` gives them under ``rows``."""
    titles = "IoU", "kept, %", "beyond wrist, mm", "area ±, %", "centroid ±, mm"
    cells = [
        [
            row["name"],
            cell(row["iou"], 1, 3),
            cell(row["kept"], _PERCENT, 1),
            cell(row["beyond_wrist_mm"], 1, 1),
            cell(row["area_change"], _PERCENT, 1),
            cell(row["centroid_change_mm"], 1, 1),
        ]
        for row in rows
    ]
    return Table([Column("frame", "left"), *map(Column, titles)], cells)


def cell(value: float | None, scale: float, digits: int) -> str:
    """Return a scaled number, or a dash if there is none."""
    return "–" if value is None else f"{scale * value:.{digits}f}"


_SEGMENTING = 0.95
"""Share of the time of an evaluation."""


@dataclass(frozen=True, slots=True, eq=False)
class SegmentationRun:
    """The figures of a test of the segmentation, and its report."""

    figures: dict[str, Any]
    """As `evaluation` gives them."""
    report: Report
    files: tuple[Path, ...]
    """The report as PDF and as HTML, if it was written."""


def run_segmentation_test(
    settings: SegmentationTestSettings, progress: Progress = Progress()
) -> SegmentationRun:
    """Segment the hand in a folder of frames with true masks.

    Writes the report and the contact sheet, if they are wanted.

    Raises
    ------
    CancelledError
    FileError
        If a file cannot be used or written, or the report would go into a study's folder.
    """
    output = free_of_studies(output_folder(settings.output)) if settings.output else None
    sheet = user_path(settings.sheet) if settings.sheet else None
    if sheet is not None:  # before the long work, whose result would be lost
        require_suffix(sheet, ".png")
        make_folder(sheet.parent)
    folder = user_path(settings.folder)
    segmenting = SegmentSettings(roi=settings.roi)
    described = read_masked_names(folder)
    rows, tiles = [], []
    for shot in read_masked_frames(folder, described):
        row, mask = evaluate_frame(shot, lambda one: make_finder(segmenting).find(one))
        rows.append(row)
        tiles.append(tile(shot, mask, row))
        progress.at(_SEGMENTING * len(rows) / len(described), "Segmenting hands")
    if sheet is not None:
        write_png(sheet, contact_sheet(tiles))
    figures = evaluation(rows)
    report = segmentation_report(figures, tiles)
    files = (
        ()
        if output is None
        else write_report(output, report, progress.part(_SEGMENTING, 1.0, "Writing the report"))
    )
    return SegmentationRun(figures, report, files)
