"""The figures of a user test, each drawn into given axes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from handcal.core.types import EYES, Float64
from handcal.export.figures import COLORS, MARKERS, name_axes
from handcal.lab.evaluate.user_test import CornerRow, GroupErrors
from handcal.report.page import families, plain

# More points than these are drawn as a picture: otherwise a page would take long to show.
_MOST_POINTS = 2000
_NAME_CHARACTERS = 22


def draw_wearers(
    axes: Sequence[Axes], by_wearer: Mapping[str, GroupErrors], rows: Sequence[CornerRow]
) -> None:
    """Draw each wearer's errors as a box plot, and their mean with its interval."""
    boxes, means = axes
    places = range(len(by_wearer))
    errors = [
        [row["error_arcmin"] for row in rows if row["wearer"] == wearer] for wearer in by_wearer
    ]
    boxes.boxplot(
        errors,
        positions=places,
        orientation="horizontal",
        widths=0.6,
        medianprops={"color": COLORS["left"], "linewidth": 1.6},
        flierprops={"marker": ".", "markersize": 2.5},
    )
    for place, group in enumerate(by_wearer.values()):
        found = group.interval_arcmin
        mean = group.arcmin.mean if found is None else found.mean
        means.plot(mean, place, MARKERS["left"], color=COLORS["left"], markersize=4)
        if found is not None:
            ends = found.low, found.high
            means.plot(ends, (place, place), color=COLORS["left"], linewidth=1.2)
    titles = "reprojection error by wearer", "mean, with interval"
    for ax, title in zip(axes, titles, strict=True):
        names = [_short(wearer) for wearer in by_wearer]
        ax.set_yticks(places, names, parse_math=False, family=families("".join(names)))
        ax.set_ylim(len(by_wearer) - 0.4, -0.6)
        ax.set_xlim(left=0.0)
        name_axes(ax, title, "arcmin", "")


def draw_corners(
    axes: Sequence[Axes], rows: Sequence[CornerRow], sizes_px: Collection[tuple[int, int]]
) -> None:
    """Draw where the corners are and were drawn in the display, and by how much they differ."""
    display, offsets = axes
    for eye in EYES:
        of_eye = [row for row in rows if row["eye"] == eye]
        truth, drawn = (_points(of_eye, name) for name in ("truth", "drawn"))
        style: dict[str, Any] = {"linestyle": "none", "rasterized": len(rows) > _MOST_POINTS}
        cross: dict[str, Any] = {"marker": "+", "markersize": 3, "markeredgewidth": 0.5}
        display.plot(*truth.T, color="black", zorder=3, **cross, **style)
        style |= {"marker": MARKERS[eye], "color": COLORS[eye], "markersize": 2.5, "label": eye}
        display.plot(*drawn.T, alpha=0.6, **style)
        offsets.plot(*(drawn - truth).T, alpha=0.6, **style)
    for width_px, height_px in sizes_px:
        display.add_patch(Rectangle((-0.5, -0.5), width_px, height_px, fill=False, linewidth=0.6))
    offsets.axhline(0.0, color="0.7", linewidth=0.5, zorder=0)
    offsets.axvline(0.0, color="0.7", linewidth=0.5, zorder=0)
    for ax in axes:
        ax.set_aspect("equal", adjustable="datalim")
        ax.invert_yaxis()
    name_axes(display, "corners in the display", "px", "px")
    name_axes(offsets, "drawn less true", "to the right, px", "down, px")
    offsets.legend(title="eye", fontsize=6.5, title_fontsize=6.5, frameon=False)


def _points(rows: Sequence[CornerRow], name: str) -> Float64:
    found = [[row[f"{name}_x_px"], row[f"{name}_y_px"]] for row in rows]
    return np.array(found, dtype=np.float64).reshape(-1, 2)


def _short(wearer: str) -> str:
    name = plain(wearer)
    return name if len(name) <= _NAME_CHARACTERS else f"{name[: _NAME_CHARACTERS - 1]}…"
