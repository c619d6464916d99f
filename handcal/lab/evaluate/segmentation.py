"""Agreement of the segmented hand with true masks, and its stability against small changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from handcal.core.errors import HandError
from handcal.core.types import Bool, Frame, HandCloud
from handcal.lab.evaluate.masked_frames import MaskedFrame, cropped, scaled, subsampled

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
