"""The figures of the report, each drawn into given axes.

Left and right differ in colour, marker and line, so that the report is readable in grey too.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Ellipse, Polygon, Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from handcal.core.display import eye_projection
from handcal.core.geometry import project, transform
from handcal.core.types import EYES, Alignment, Eye, EyeDisplay, EyeShift, Float64
from handcal.export.outcome import SessionOutcome
from handcal.register.benefit import DISTANCES_M
from handcal.register.results import Results
from handcal.session.trial import Trial

COLORS: Mapping[Eye, str] = {"left": "#0072B2", "right": "#D55E00"}
MARKERS: Mapping[Eye, str] = {"left": "o", "right": "s"}
_LINES: Mapping[Eye, str] = {"left": "-", "right": "--"}
_HAND, _CURSOR = "#0072B2", "#D55E00"
# Smallest range of a scale, so that rounding errors do not look like findings.
_LEAST_MM = 0.01
_LABEL_PT, _TITLE_PT = 7.5, 8.5
# Side of a cell of the residual map, and the colour of one without inliers.
CELL_MM = 2.5
_OUTLIER = (0.75, 0.75, 0.75, 1.0)
# Outlines are found in a mask: length of the display's longer side in it, and of gaps to close.
_MASK_PX, _GAP_PX = 500, 9
_AROUND_DISPLAY = 0.12


def draw_convergence(axes: Sequence[Axes], results: Results) -> None:
    """Draw the registration error of each alignment by iteration, with axes for each eye."""
    for ax, eye in zip(axes, EYES, strict=True):
        for number, shifts in results.alignments.items():
            if eye in shifts:
                rms_mm = 1e3 * np.sqrt(shifts[eye].history_m2)
                steps = np.arange(1, len(rms_mm) + 1)
                ax.plot(steps, rms_mm, ".-", linewidth=0.8, markersize=3, label=f"{number}")
        ax.set_ylim(0.0, max(_LEAST_MM, ax.get_ylim()[1]))
        ax.xaxis.set_major_locator(MaxNLocator(integer=True))
        name_axes(ax, f"{eye} eye", "iteration", "RMS pair distance, mm")
        if 0 < len(ax.lines) <= 8:
            ax.legend(title="alignment", fontsize=6.5, title_fontsize=6.5, frameon=False)


def draw_distances(axes: Sequence[Axes], results: Results) -> None:
    """Draw each eye's error against distance, without the calibration (grey) and with it."""
    for ax, eye in zip(axes, EYES, strict=True):
        for name, color in (("without", "0.5"), ("after", COLORS[eye])):
            at = results.benefits[eye].by_distance if eye in results.benefits else ()
            x = [one.distance_m for one in at]
            error, low, high = (
                [getattr(one, f"{name}{end}_arcmin") for one in at] for end in ("", "_low", "_high")
            )
            ax.plot(x, error, f"{MARKERS[eye]}-", color=color, markersize=3, linewidth=1.0)
            ax.fill_between(x, low, high, color=color, alpha=0.2, lw=0)
        ax.set_xscale("log")
        ax.set_xticks(DISTANCES_M, [f"{one:g}" for one in DISTANCES_M])
        ax.minorticks_off()
        ax.set_ylim(bottom=0.0)
        name_axes(ax, f"{eye} eye", "distance, m", "expected error, arcmin")


def draw_shifts(axes: Sequence[Axes], outcome: SessionOutcome, results: Results) -> None:
    """Draw φ1, φ2 and φ3 of every alignment with ± σ, as solved, and if another, final."""
    count = len(results.alignments)
    room = max(1.0, 0.4 * count)  # for the names below
    fused, final = count + room, count + 2.0 * room
    others = {eye: one for eye, one in outcome.drawn.items() if one.kind != "solved"}
    for component, ax in enumerate(axes):
        for eye in EYES:
            offset = -0.12 if eye == "left" else 0.12
            each = {
                place + offset: shifts[eye]
                for place, shifts in enumerate(results.alignments.values(), 1)
                if eye in shifts
            }
            if eye in results.eyes:
                each[fused + offset] = results.eyes[eye]
            ax.errorbar(
                list(each),
                [1e3 * shift.shift_m[component] for shift in each.values()],
                [1e3 * _sigma_m(shift)[component] for shift in each.values()],
                fmt=MARKERS[eye],
                color=COLORS[eye],
                markersize=4,
                linewidth=1.0,
                capsize=2,
                label=eye,
            )
            if eye in others:
                final_mm = 1e3 * others[eye].shift_m[component]
                ax.plot(final + offset, final_mm, MARKERS[eye], color=COLORS[eye], mfc="none")
        ax.axhline(0.0, color="0.7", linewidth=0.5, zorder=0)
        ax.axvline(count + 0.5, color="0.7", linewidth=0.5, linestyle=":", zorder=0)
        numbers = list(results.alignments)
        names: dict[float, str] = {
            index + 1: str(numbers[index]) for index in range(0, count, -(-count // 6))
        }
        names |= {fused: "solved", final: "final"} if others else {fused: "solved"}
        ax.set_xticks(list(names), list(names.values()))
        ax.set_xlim(0.5, max(names) + 0.5 * room)
        name_axes(ax, f"φ{'₁₂₃'[component]}", "alignment", "mm")
    axes[0].legend(fontsize=6.5, frameon=False)


def draw_ellipses(axes: Sequence[Axes], results: Results) -> None:
    """Draw φ1 and φ2 of every alignment and fused with their 1σ ellipses, axes for each eye."""
    for ax, eye in zip(axes, EYES, strict=True):
        for number, shifts in results.alignments.items():
            if eye in shifts:
                _ellipse(ax, shifts[eye], "0.45", linewidth=0.8)
                x_mm, y_mm, _ = 1e3 * shifts[eye].shift_m
                ax.text(x_mm, y_mm, f"{number}", fontsize=6.5, color="0.3", ha="center")
        if eye in results.eyes:
            _ellipse(ax, results.eyes[eye], COLORS[eye], linewidth=1.6)
            ax.plot(*(1e3 * results.eyes[eye].shift_m[:2]), "+", color=COLORS[eye])
        ax.plot(0.0, 0.0, "x", color="black", markersize=5)
        ax.set_aspect("equal", adjustable="datalim")
        ax.margins(0.08)
        ax.invert_yaxis()
        name_axes(ax, f"{eye} eye", "φ₁, mm (to the right)", "φ₂, mm (down)")


@dataclass(frozen=True, slots=True)
class ResidualCells:
    """A hand seen from the eye, in cells, each (N,)."""

    x_mm: Float64
    y_mm: Float64
    """Upper left corners, in E."""
    points: NDArray[np.int64]
    inliers: NDArray[np.int64]
    mean_mm: Float64
    """Mean residual of the inliers; NaN without inliers."""


def residual_cells(alignment: Alignment, eye: Eye, shift: EyeShift) -> ResidualCells:
    """Return the mean residual of an alignment's hand points in cells of `CELL_MM`."""
    hand_mm = 1e3 * transform(alignment.T_E_W[eye], alignment.hand_m)[:, :2]
    corner_mm = hand_mm.min(axis=0)
    places = ((hand_mm - corner_mm) / CELL_MM).astype(int)
    cells, of_point = np.unique(places, axis=0, return_inverse=True)
    is_inlier = np.isfinite(shift.residuals_m)
    points, inliers = (
        np.bincount(each, minlength=len(cells)) for each in (of_point, of_point[is_inlier])
    )
    sums_mm = np.bincount(of_point[is_inlier], 1e3 * shift.residuals_m[is_inlier], len(cells))
    mean_mm = np.divide(sums_mm, inliers, out=np.full(len(cells), np.nan), where=inliers > 0)
    x_mm, y_mm = (corner_mm + CELL_MM * cells).T
    return ResidualCells(x_mm, y_mm, points, inliers, mean_mm)


def draw_residuals(ax: Axes, cells: ResidualCells, most_mm: float) -> None:
    """Draw the hand seen from the eye, coloured by the mean residual in each cell.

    The colour scale ends at `most_mm`; cells with only outliers are grey.
    """
    left_mm, top_mm = cells.x_mm.min(), cells.y_mm.min()
    columns, rows = (
        np.rint((axis_mm - axis_mm.min()) / CELL_MM).astype(int)
        for axis_mm in (cells.x_mm, cells.y_mm)
    )
    width, height = columns.max() + 1, rows.max() + 1
    colors = ScalarMappable(Normalize(0.0, max(_LEAST_MM, most_mm), clip=True), "viridis")
    picture = np.zeros((height, width, 4))
    has_inliers = cells.inliers > 0
    picture[rows, columns] = _OUTLIER
    picture[rows[has_inliers], columns[has_inliers]] = colors.to_rgba(cells.mean_mm[has_inliers])
    ax.imshow(
        picture,
        extent=(left_mm, left_mm + width * CELL_MM, top_mm + height * CELL_MM, top_mm),
        interpolation="nearest",
    )
    ax.set_aspect("equal", adjustable="datalim")
    _color_bar(ax, colors)


def overlay_outlines(
    display: EyeDisplay, alignment: Alignment, eye: Eye, eye_shift_m: Float64
) -> dict[str, list[Float64]]:
    """Return the outlines that an eye with this φ saw at an alignment, in display pixels.

    Outlines, each (N, 2) and closed, of the hand as the eye sees it through the display, and of the
    cursor as the headset drew it.
    """
    hand_E, cursor_E = (
        transform(alignment.T_E_W[eye], points) for points in (alignment.hand_m, alignment.cursor_m)
    )
    seen = project(eye_projection(display, eye_shift_m), hand_E)
    drawn = project(eye_projection(display, alignment.drawn_shift_m[eye]), cursor_E)
    return {"hand": _outlines(seen, display), "cursor": _outlines(drawn, display)}


def draw_overlay(ax: Axes, display: EyeDisplay, outlines: Mapping[str, Sequence[Float64]]) -> None:
    """Draw the outlines of `overlay_outlines` within the display's frame."""
    for outline in outlines["hand"]:
        # As an artist only: add_patch would look through all curves for limits, which are set here.
        ax.add_artist(Polygon(outline, facecolor=_HAND, alpha=0.25, linewidth=0.0))
        ax.plot(*outline.T, color=_HAND, linewidth=0.6)
    for outline in outlines["cursor"]:
        ax.plot(*outline.T, color=_CURSOR, linewidth=1.0, linestyle=(0, (4, 1.5)))
    width, height = display.width_px, display.height_px
    ax.add_patch(Rectangle((-0.5, -0.5), width, height, fill=False, linewidth=0.6))
    ax.set_xlim(-_AROUND_DISPLAY * width, (1 + _AROUND_DISPLAY) * width)
    ax.set_ylim((1 + _AROUND_DISPLAY) * height, -_AROUND_DISPLAY * height)
    ax.set_aspect("equal")


def draw_trial_errors(axes: Sequence[Axes], trials: Collection[Trial]) -> None:
    """Draw box plots of the corners' errors by distance and eye: in pixels, and in arcminutes."""
    depths_m = sorted({trial.target_depth_m for trial in trials})
    for ax, name, unit in zip(axes, ("error_px", "error_arcmin"), ("px", "arcmin"), strict=True):
        for eye in EYES:
            offset = -0.18 if eye == "left" else 0.18
            errors = {
                place + offset: np.concatenate(found)
                for place, depth_m in enumerate(depths_m)
                if (
                    found := [
                        getattr(trial, name)
                        for trial in trials
                        if (trial.eye, trial.target_depth_m) == (eye, depth_m)
                    ]
                )
            }
            if not errors:
                continue
            ax.boxplot(
                list(errors.values()),
                positions=list(errors),
                widths=0.28,
                manage_ticks=False,
                boxprops={"color": COLORS[eye], "linestyle": _LINES[eye]},
                medianprops={"color": COLORS[eye], "linewidth": 1.6},
                whiskerprops={"color": COLORS[eye]},
                capprops={"color": COLORS[eye]},
                flierprops={"marker": MARKERS[eye], "markersize": 2.5},
            )
        for eye in EYES:
            ax.plot([], [], _LINES[eye], color=COLORS[eye], label=f"{eye} eye")
        ax.set_xticks(range(len(depths_m)), [f"{depth_m:g}" for depth_m in depths_m])
        ax.set_xlim(-0.6, len(depths_m) - 0.4)
        ax.set_ylim(bottom=0.0)
        name_axes(ax, f"reprojection error, {unit}", "distance of the target, m", unit)
    axes[0].legend(fontsize=6.5, frameon=False)


def draw_running_mean(ax: Axes, trials: Mapping[int, Trial]) -> None:
    """Draw each trial's mean error and the mean of all so far, by eye."""
    for eye in EYES:
        errors = {
            number: float(trial.error_arcmin.mean())
            for number, trial in trials.items()
            if trial.eye == eye
        }
        if errors:
            means = np.cumsum(list(errors.values())) / np.arange(1, len(errors) + 1)
            color, label = COLORS[eye], f"{eye}, mean so far"
            ax.plot(list(errors), list(errors.values()), MARKERS[eye], color=color, markersize=3)
            ax.plot(list(errors), means, _LINES[eye], color=color, label=label)
    ax.set_ylim(bottom=0.0)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    name_axes(ax, "mean error so far", "trial", "arcmin")
    ax.legend(fontsize=6.5, frameon=False)


def name_axes(ax: Axes, title: str, x: str, y: str) -> None:
    """Set the title and the axis labels, with units."""
    # At the default height: where none is given, every drawing looks for labels in its way.
    ax.set_title(title, fontsize=_TITLE_PT, loc="left", y=1.0)
    ax.set_xlabel(x, fontsize=_LABEL_PT)
    ax.set_ylabel(y, fontsize=_LABEL_PT)


def _sigma_m(shift: EyeShift) -> Float64:
    return np.asarray(np.sqrt(np.diag(shift.covariance_m2)))


def _ellipse(ax: Axes, shift: EyeShift, color: str, linewidth: float) -> None:
    """Add the 1σ ellipse of φ1 and φ2."""
    variances, directions = np.linalg.eigh(1e6 * shift.covariance_m2[:2, :2])
    width_mm, height_mm = 2.0 * np.sqrt(variances)
    ax.add_patch(
        Ellipse(
            tuple(1e3 * shift.shift_m[:2]),
            width_mm,
            height_mm,
            angle=float(np.degrees(np.arctan2(directions[1, 0], directions[0, 0]))),
            fill=False,
            edgecolor=color,
            linewidth=linewidth,
        )
    )


def _color_bar(ax: Axes, colored: ScalarMappable) -> None:
    inset = ax.inset_axes((0.9, 0.1, 0.025, 0.8))
    bar = ax.figure.colorbar(colored, cax=inset, extend="max")
    bar.ax.tick_params(labelsize=6.0, pad=1, length=2)
    bar.set_label("mm", fontsize=6.0, labelpad=1)


def _outlines(pixels: Float64, display: EyeDisplay) -> list[Float64]:
    """Return the outlines, each (N, 2) px and closed, of the area a cloud covers on a display.

    Points farther outside the display than its own size are left out.
    """
    size = np.array([display.width_px, display.height_px])
    scale = _MASK_PX / size.max()
    width, height = np.ceil(3 * scale * size).astype(int)
    placed = scale * (pixels + size)
    inside = ((placed >= 0) & (placed <= [width - 1, height - 1])).all(axis=1)  # NaN is not
    columns, rows = np.rint(placed[inside]).astype(int).T
    mask = np.zeros((height, width), np.uint8)
    mask[rows, columns] = 255
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_GAP_PX, _GAP_PX))
    closed = cv2.erode(cv2.dilate(mask, disc), disc)
    contours, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    return [
        np.concatenate([contour, contour[:1]]).reshape(-1, 2) / scale - size
        for contour in contours
        if cv2.contourArea(contour) > _GAP_PX**2
    ]
