"""The report of a noise study, from the rows of its trials."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import takewhile
from typing import TypeAlias

import numpy as np
from matplotlib.axes import Axes

from handcal.core.types import Float64
from handcal.export.figures import name_axes
from handcal.lab.study.noise import ERRORS_MM, FLOOR, HANDS, SECTIONS, NoiseSettings
from handcal.lab.study.store import StudyRow
from handcal.lab.study.trials import BEST_ITERATE
from handcal.report.document import (
    Column,
    Figure,
    Item,
    Report,
    Section,
    Table,
    facts,
    made_with,
    settings_items,
)
from handcal.report.statistics import INTERVAL_METHOD, MeanInterval, mean_interval

LINE_MM = 4.0
_PUBLISHED_DEG = 9.0
# Rotations at which rcICP and ICP are compared.
_COMPARED_DEG = 5.0, 9.0, 20.0, 40.0, 60.0
_STYLES = {
    "consistent": ("#0072b2", "o", "-"),
    "paper": ("#d55e00", "s", "--"),
    BEST_ITERATE: ("#cc79a7", "^", "-."),
    "linear": ("#e69f00", "v", ":"),
    "icp": ("#7f7f7f", "D", "--"),
    "icp-open3d": ("#56b4e9", "x", "-."),
    FLOOR: ("#009e73", "*", ":"),
}
"""Colour, marker and line of each method: not everyone can tell colours apart."""
_INTERVALS = (
    "Intervals are of 95 % confidence. Errors of one person's hand are correlated, "
    "so that people count as independent, not alignments: intervals are of the mean of people's "
    f"means, by {INTERVAL_METHOD}."
)
_METHODS = (
    "consistent: handcal's default. paper: rotation-constrained ICP as published; with a rotated "
    "hand it may swing between two states to its last iteration. paper, best iterate: the same, "
    "ended at the smallest distance of the pairs. linear: its "
    "model, all three rows of each pair. icp: rigid, point to point, the paper's baseline. "
    "icp-open3d: the same by Open3D. known pairs: least squares with the true pairs of noise-free "
    "points, which only a turned hand disturbs: what any solver of φ alone is left with."
)
_TEXTS: Mapping[str, str] = {
    "rotation": (
        "As in the paper's simulation: the cursor made from the hand with UQ of a known φ, uniform "
        "within ± 10 mm, and turned about a random axis through a random point of the cloud."
    ),
    "rotation, size kept": (
        "The same, but the hand keeps its size, as hands do: UQ alone shrinks it by 1 - φ3φ4."
    ),
    "rotation, to the wrist": (
        "As rotation, with a hand cut at the wrist, as a detector of hands gives it. The published "
        "figures plot the components."
    ),
    "eye box": "Eyes within the eye box and beyond it.",
    "depth noise": "Independent noise on the depth of every point of both clouds.",
    "forearm": "The cursor shows 40 mm of forearm, the hand more or less of it.",
    "points": "Clouds sampled more or less densely.",
    HANDS: "Hands of different people, each aligned as often; by the quick methods only.",
    "wearer": (
        "One eye of a wearer who looks through the displays and puts the hand over the cursor; no "
        "solver's equation takes part. The usual errors are those of the simulated wearer."
    ),
}


@dataclass(frozen=True, slots=True)
class _Point:
    """The errors of one method at one value: mean |Δφ|, and means of its components, in mm."""

    value: float
    method: str
    trials: int
    length: MeanInterval
    components: tuple[MeanInterval, ...]


_Mean: TypeAlias = Callable[[_Point], float]


def noise_report(settings: NoiseSettings, rows: Sequence[StudyRow]) -> Report:
    """Return the report of a noise study from all its rows."""
    sections = {name: _points([row for row in rows if row["section"] == name]) for name in SECTIONS}
    alignments = len({(row["section"], row["value"], row["trial"]) for row in rows})
    solved = sum(row["method"] not in (FLOOR, BEST_ITERATE) for row in rows)
    return Report(
        title="Noise study",
        subject=f"{alignments:,} simulated alignments, solved {solved:,} times",
        lead=_lead(sections["rotation"]),
        sections=[
            Section("", [facts(_counts(settings, rows) | made_with()), _METHODS, _INTERVALS]),
            Section("The paper's findings and these", [_published(sections["rotation"])]),
            *(_section(settings, name, points) for name, points in sections.items() if points),
            Section("Settings", settings_items(asdict(settings), "study.json")),
        ],
    )


def _counts(settings: NoiseSettings, rows: Sequence[StudyRow]) -> dict[str, str]:
    solved = {
        method: f"{sum(row['method'] == method for row in rows):,}"
        for method in _STYLES
        if method not in (FLOOR, BEST_ITERATE) and (settings.open3d or method != "icp-open3d")
    }
    return {
        "Alignments solved": ", ".join(f"{count} by {name}" for name, count in solved.items()),
        "Of each value": f"{settings.trials} alignments, of {settings.hands} people; the first "
        f"{settings.linear_trials} also by linear, the first {settings.paper_trials} also by "
        "paper, which takes a hundred times as long",
    }


def _points(rows: Sequence[StudyRow]) -> list[_Point]:
    """Return the errors by method and value."""
    groups: dict[tuple[str, float], list[StudyRow]] = {}
    for row in rows:
        groups.setdefault((str(row["method"]), _number(row["value"])), []).append(row)
    return [_point(value, method, group) for (method, value), group in groups.items()]


def _point(value: float, method: str, rows: Sequence[StudyRow]) -> _Point:
    errors_mm = np.array([[_number(row[name]) for name in ERRORS_MM] for row in rows])
    hands = [row["hand"] for row in rows]
    length, *components = (
        _interval(column, hands)
        for column in (np.linalg.norm(errors_mm, axis=1), *np.abs(errors_mm).T)
    )
    return _Point(value, method, len(rows), length, tuple(components))


def _interval(values: Float64, hands: Sequence[object]) -> MeanInterval:
    """Return a mean over people, or over the alignments of one; NaN for an interval of one."""
    if len(values) == 1:
        return MeanInterval(float(values[0]), np.nan, np.nan, 0.95, 1)
    return mean_interval(values, hands if len(set(hands)) > 1 else None)


def _number(cell: float | str | None) -> float:
    return float(cell or 0.0)


def _reach(points: Sequence[_Point], method: str, mean_mm: _Mean) -> str:
    """Return, in words, up to which rotation a method's mean error is within the line."""
    found = sorted((point.value, mean_mm(point)) for point in points if point.method == method)
    within = [value for value, _ in takewhile(lambda pair: pair[1] <= LINE_MM, found)]
    if not within:
        return "at no rotation"
    return f"up to {within[-1]:g}°" if within[-1] else "only at 0°"


def _length_mm(point: _Point) -> float:
    return point.length.mean


def _components_mm(point: _Point) -> float:
    return float(np.mean([component.mean for component in point.components]))


def _lead(points: Sequence[_Point]) -> str:
    reaches = {
        method: (_reach(points, method, _length_mm), _reach(points, method, _components_mm))
        for method in ("paper", "consistent")
    }
    (length, component), (own_length, own_component) = reaches.values()
    return (
        f"On the paper's data, the paper's method keeps a mean |Δφ| within {LINE_MM:g} mm "
        f"{length}, and a mean error of its components {component} (published: up to "
        f"{_PUBLISHED_DEG:g}°); handcal's default {own_length}, and {own_component}."
    )


def _published(points: Sequence[_Point]) -> Table:
    """Return the paper's findings and those of this study."""
    rows = [
        (f"{method}: {what} within {LINE_MM:g} mm", published, _reach(points, method, mean))
        for method, published in (("paper", f"up to {_PUBLISHED_DEG:g}°"), ("consistent", ""))
        for what, mean in (("|Δφ|", _length_mm), ("mean of |Δφ1|, |Δφ2|, |Δφ3|", _components_mm))
    ]
    of = {(point.method, point.value): point.length.mean for point in points}
    for angle in sorted({point.value for point in points if point.value}):
        if angle in _COMPARED_DEG:
            ratio = of["icp", angle] / of["paper", angle]
            rows.append(
                (f"|Δφ| of icp over that of paper, at {angle:g}°", "above 1", f"{ratio:.1f}")
            )
    return Table([Column("finding", "left"), Column("published"), Column("here")], rows)


def _section(settings: NoiseSettings, name: str, points: Sequence[_Point]) -> Section:
    items: list[Item] = [_TEXTS[name]]
    slug = name.replace(",", "").replace(" ", "-")
    rows = [_figure_row(name, point) for point in points]
    coarse, fine = _shown(settings, name, points)
    items.append(
        Figure(
            slug,
            f"Mean |Δφ| with its confidence interval. Left: all methods, on a logarithmic scale. "
            f"Right: without icp. Grey, without markers: {LINE_MM:g} mm.",
            partial(_draw_lengths, name, coarse, fine),
            rows,
            height_mm=70.0,
            columns=2,
        )
    )
    if name == "rotation":
        items.append(
            Figure(
                f"{slug}-components",
                "Means of |Δφ1|, |Δφ2| and |Δφ3|, as in the paper's figures, without icp.",
                partial(_draw_components, name, fine),
                rows,
                height_mm=60.0,
                columns=3,
            )
        )
    return Section(
        name.capitalize(), [*items, _table(name, points)], starts_page=name == "rotation"
    )


def _shown(
    settings: NoiseSettings, name: str, points: Sequence[_Point]
) -> tuple[Sequence[_Point], Sequence[_Point]]:
    """Return the curves of the figure's left and right axes."""
    right = [point for point in points if not point.method.startswith("icp")]
    if name != "rotation":
        return points, right
    left = [point for point in points if point.value in settings.coarse_deg]
    return left, [point for point in right if point.value in settings.fine_deg]


def _draw_lengths(
    name: str, left: Sequence[_Point], right: Sequence[_Point], axes: Sequence[Axes]
) -> None:
    for ax, points, title in zip(axes, (left, right), ("all methods", "without icp"), strict=True):
        _draw(ax, name, points, lambda point: point.length)
        name_axes(ax, title, SECTIONS[name].label, "mean |Δφ|, mm")
    axes[0].set_yscale("symlog", linthresh=1.0)
    axes[0].legend(fontsize=6)


def _draw_components(name: str, points: Sequence[_Point], axes: Sequence[Axes]) -> None:
    for i, ax in enumerate(axes):
        _draw(ax, name, points, lambda point, i=i: point.components[i])  # type: ignore[misc]
        name_axes(ax, f"φ{i + 1}", SECTIONS[name].label, f"mean |Δφ{i + 1}|, mm")
    axes[0].legend(fontsize=6)


def _draw(
    ax: Axes, name: str, points: Sequence[_Point], interval: Callable[[_Point], MeanInterval]
) -> None:
    """Draw a line with a band for each method, or a dot with a bar for each person."""
    for method, (color, marker, line) in _STYLES.items():
        of_method = sorted((p for p in points if p.method == method), key=lambda p: p.value)
        if not of_method:
            continue
        values = SECTIONS[name].scale * np.array([point.value for point in of_method])
        means, low, high = np.array(
            [(found.mean, found.low, found.high) for found in map(interval, of_method)]
        ).T
        if name == HANDS:
            ax.errorbar(
                values,
                means,
                [means - low, high - means],
                fmt=marker,
                color=color,
                label=method,
                markersize=3,
                elinewidth=0.6,
            )
        else:
            ax.plot(
                values,
                means,
                color=color,
                label=method,
                marker=marker,
                markersize=3,
                linestyle=line,
                linewidth=1.0,
                clip_on=False,
            )
            ax.fill_between(values, low, high, color=color, alpha=0.2, linewidth=0.0)
    ax.axhline(LINE_MM, color="0.3", linewidth=0.6)
    ax.set_ylim(bottom=0.0)


def _figure_row(name: str, point: _Point) -> StudyRow:
    row: StudyRow = {
        "section": name,
        "value": point.value,
        "method": point.method,
        "trials": point.trials,
        "people": point.length.clusters,
    }
    for what, found in zip(
        ("length", "error_1", "error_2", "error_3"), (point.length, *point.components), strict=True
    ):
        row[f"{what}_mean_mm"] = found.mean
        row[f"{what}_low_mm"] = found.low if np.isfinite(found.low) else None
        row[f"{what}_high_mm"] = found.high if np.isfinite(found.high) else None
    return row


def _table(name: str, points: Sequence[_Point]) -> Table:
    """Return mean |Δφ| with its interval by value and method."""
    methods = [method for method in _STYLES if any(point.method == method for point in points)]
    cells = {(point.value, point.method): _cell(point.length) for point in points}
    section = SECTIONS[name]
    return Table(
        [Column(section.label), *(Column(f"{method}, mm") for method in methods)],
        [
            [f"{section.scale * value:g}", *(cells.get((value, method), "–") for method in methods)]
            for value in sorted({point.value for point in points})
        ],
        "Mean |Δφ| and its 95 % confidence interval.",
    )


def _cell(found: MeanInterval) -> str:
    if not np.isfinite(found.low):
        return f"{found.mean:.1f}"
    return f"{found.mean:.1f} ({found.low:.1f}–{found.high:.1f})"
