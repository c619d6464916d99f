"""The report of a method comparison, from the rows of its wearers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import partial
from typing import TypeAlias

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from handcal.core.display import TARGET_DEPTHS_M
from handcal.core.types import EYES, Bool
from handcal.export.figures import COLORS, name_axes
from handcal.lab.methods import MISALIGNMENT, REPROJECTION
from handcal.lab.study.methods import HANDCAL_BOTH, HANDCAL_EACH, PAPER, MethodSettings
from handcal.lab.study.store import StudyRow
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
from handcal.report.statistics import mean_interval, summarise
from handcal.rig.example import example_rig

ErrorTable: TypeAlias = "NDArray[np.void]"
"""`_COLUMNS` of each row of the study."""

ARCMIN_COLUMNS = tuple(f"{eye}_{corner}_arcmin" for eye in EYES for corner in (1, 2, 3, 4))
_MM_COLUMNS = tuple(f"{axis}_mm" for axis in "xyz")
_NUMBERS = {
    "wearer": int,
    "eye_distance_sigma_mm": float,
    "method": object,
    "alignments": int,
    "wearer_s": float,
    "depth_m": float,
    "refused": bool,
}
_COLUMNS = np.dtype([*_NUMBERS.items(), ("arcmin", float, 8), ("mm", float, 3)])
_MODEL = (
    "Every method calibrates the same simulated wearers of the example rig. What they align is "
    "found by rays through the displays; no method's equation takes part. Errors are of a square "
    "of 80 mm, 0.4, 0.5 and 0.6 m straight ahead: in arcmin between where each eye sees a corner "
    "and where it is drawn; in mm between the corner and where both eyes together see it drawn, "
    "mean over corners and wearers of each axis."
)
_TIME = (
    "The wearer's time is a model: 1.8 s for an alignment (0.4 s to notice, 0.8 s to move, 0.6 s "
    "to hold still: the simulated wearer's), 1.6 s more to raise a hand for its cursor, and 10 s "
    "for the paper's solver. Methods for one eye at a time count both."
)
_REFUSED = "Refused: wearers whose alignments the method cannot make a projection of."
_FEWEST = 20
"""Of fewer wearers, a mean's standard error is more than a fifth of their spread."""
_ROW_MM, _FIGURE_MM = 4.2, 12.0
_NAMES_MM = 42.0


def methods_report(settings: MethodSettings, rows: Sequence[StudyRow]) -> Report:
    """Return the report of a method comparison."""
    errors = _error_table(rows)
    judged = errors[~errors["refused"] & _is_population(errors, settings.eye_distance_sigmas_m[0])]
    paper, one, three, each = (
        float(judged[judged["method"] == name]["arcmin"].mean())
        for name in (PAPER, f"{HANDCAL_BOTH} 1", f"{HANDCAL_BOTH} 3", f"{HANDCAL_EACH} 3")
    )
    too_few = "Too few wearers for figures to report. " if settings.wearers < _FEWEST else ""
    return Report(
        title="Calibration methods compared",
        subject=f"{settings.wearers} simulated wearers, {len(_methods(errors))} methods",
        lead=f"{too_few}Mean reprojection error: the paper's method {paper:.1f} arcmin; "
        f"handcal {one:.1f} with one alignment, {three:.1f} with three, and {each:.1f} with three "
        "of each eye.",
        sections=list(_sections(settings, rows, errors)),
    )


def _sections(
    settings: MethodSettings, rows: Sequence[StudyRow], errors: ErrorTable
) -> Iterator[Section]:
    yield Section("", [facts(made_with()), _MODEL, _TIME, _REFUSED])
    for sigma_m in settings.eye_distance_sigmas_m:
        is_of = _is_population(errors, sigma_m)
        title = f"Eye distances that vary by {1e3 * sigma_m:g} mm"
        yield Section(
            title if sigma_m else "Headset set to the wearer's eye distance",
            [
                _reprojection_table(errors[is_of]),
                _figure(
                    errors[is_of],
                    [row for row, is_shown in zip(rows, is_of, strict=True) if is_shown],
                    f"reprojection-{1e3 * sigma_m:g}mm".replace(".", "-"),
                ),
                _misalignment_table(errors[is_of]),
            ],
        )
    if len(settings.eye_distance_sigmas_m) > 1 and settings.eye_distance_sigmas_m[0] == 0.0:
        yield _eye_distance(settings, errors)
    yield _published()
    yield Section("Settings", settings_items(asdict(settings), "study.json"))


def _reprojection_table(errors: ErrorTable) -> Table:
    columns = [Column("method", "left")] + [
        Column(title)
        for title in (
            *("alignments", "time, s", "refused", "mean, arcmin", "95 %, arcmin"),
            *("median, arcmin", "IQR, arcmin", "min, arcmin", "max, arcmin"),
        )
    ]
    cells = []
    for name in _methods(errors):
        of_method = errors[errors["method"] == name]
        judged = of_method[~of_method["refused"]]
        refused = (len(of_method) - len(judged)) // len(TARGET_DEPTHS_M)
        first = of_method[0]
        start = [name, str(first["alignments"]), f"{first['wearer_s']:.0f}", str(refused)]
        if len(set(judged["wearer"])) < 2:
            cells.append([*start, *["–"] * 6])
            continue
        spread = summarise(judged["arcmin"].ravel())
        mean = mean_interval(judged["arcmin"].mean(axis=1), judged["wearer"].tolist())
        cells.append(
            [
                *start,
                f"{mean.mean:.1f}",
                f"{mean.low:.1f}–{mean.high:.1f}",
                f"{spread.median:.2f}",
                f"{spread.q1:.2f}–{spread.q3:.2f}",
                f"{spread.min:.2f}",
                f"{spread.max:.2f}",
            ]
        )
    caption = "Reprojection error over all corners, eyes and distances."
    return Table(columns, cells, caption, "Reprojection error")


def _misalignment_table(errors: ErrorTable) -> Table:
    columns = [Column("method", "left")] + [
        Column(f"{axis} at {depth_m} m, mm") for depth_m in TARGET_DEPTHS_M for axis in "xyz"
    ]
    cells = []
    judged = errors[~errors["refused"]]
    for name in _methods(errors):
        of_method = judged[judged["method"] == name]
        at_depths = [of_method[of_method["depth_m"] == depth_m] for depth_m in TARGET_DEPTHS_M]
        means = [
            at_depth["mm"][:, axis].mean() if len(at_depth) else np.nan
            for at_depth in at_depths
            for axis in range(3)
        ]
        cells.append([name, *(f"{mean:.2f}" if np.isfinite(mean) else "–" for mean in means)])
    return Table(columns, cells, "Misalignment in space.", "Misalignment in space")


def _eye_distance(settings: MethodSettings, errors: ErrorTable) -> Section:
    """Compare the errors that a varying eye distance causes, by method, with the prediction."""
    sigma_m = settings.eye_distance_sigmas_m[1]
    depth_m = TARGET_DEPTHS_M[1]
    columns = [Column("method", "left"), Column("rms, set, arcmin"), Column("rms, varying, arcmin")]
    columns.append(Column("cost, arcmin"))
    cells = []
    at_depth = errors[~errors["refused"] & (errors["depth_m"] == depth_m)]
    for name in _methods(errors):
        if not name.startswith((HANDCAL_BOTH, HANDCAL_EACH)):
            continue
        of_method = at_depth[at_depth["method"] == name]
        before, after = (
            float(np.sqrt(np.mean(of_method[_is_population(of_method, s)]["arcmin"] ** 2)))
            for s in (settings.eye_distance_sigmas_m[0], sigma_m)
        )
        cost = np.copysign(np.sqrt(abs(after**2 - before**2)), after - before)
        cells.append([name, f"{before:.2f}", f"{after:.2f}", f"{cost:+.2f}"])
    predicted = predicted_cost_arcmin(sigma_m, depth_m)
    text = (
        f"One alignment with both eyes open gives one displacement of the hand: half of the eye "
        f"distance's deviation stays in each eye. At {depth_m} m that is {predicted:.1f} arcmin "
        f"rms for σ = {1e3 * sigma_m:g} mm. Cost: the root of the difference of squares, on the "
        "same wearers with the same slips."
    )
    return Section("One eye at a time, or both", [text, Table(columns, cells)])


def predicted_cost_arcmin(sigma_m: float, depth_m: float) -> float:
    """Return the rms error in each eye that an unknown eye distance causes.

    It is the parallax of half the deviation between the depths of the target and the display.
    """
    distance_m = example_rig().eyes["left"].z_C0_S_m
    return float(60.0 * np.degrees(0.5 * sigma_m * (1.0 / depth_m - 1.0 / distance_m)))


def _published() -> Section:
    columns = [Column("published", "left")] + [
        Column(title) for title in ("median, arcmin", "IQR, arcmin", "min, arcmin", "max, arcmin")
    ]
    cells = [
        [p.study, f"{p.median:.2f}", f"{p.q1:.2f}–{p.q3:.2f}", f"{p.min:.2f}", f"{p.max:.2f}"]
        for p in REPROJECTION
    ]
    in_space = [
        [p.study, p.alignments, p.whole_mm or f"x {p.x_mm}, y {p.y_mm}, z {p.z_mm}"]
        for p in MISALIGNMENT
    ]
    spaces = Column("published", "left"), Column("alignments", "left"), Column("mm", "left")
    return Section(
        "Published",
        [
            Table(columns, cells, "Reprojection error."),
            Table(spaces, in_space, "In space."),
            "As Hu et al. 2021 give them. Displays, distances and users differ between studies.",
        ],
    )


def _figure(errors: ErrorTable, rows: Sequence[StudyRow], name: str) -> Figure:
    return Figure(
        name,
        "Boxes: quartiles and median over all corners; whiskers: 5th and 95th percentile.",
        partial(_draw, errors),
        rows,
        height_mm=_FIGURE_MM + _ROW_MM * len(_methods(errors)),
        left_mm=_NAMES_MM,
    )


def _draw(errors: ErrorTable, axes: Sequence[Axes]) -> None:
    (ax,) = axes
    names = _methods(errors)
    judged = errors[~errors["refused"]]
    ax.boxplot(
        [judged[judged["method"] == name]["arcmin"].ravel() for name in names],
        positions=range(len(names)),
        orientation="horizontal",
        widths=0.6,
        whis=(5, 95),
        showfliers=False,
        medianprops={"color": COLORS["left"], "linewidth": 1.6},
    )
    ax.set_yticks(range(len(names)), names, parse_math=False)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.set_xscale("log")
    name_axes(ax, "reprojection error", "arcmin", "")


def _error_table(rows: Sequence[StudyRow]) -> ErrorTable:
    """Return the rows as a structured array; errors are NaN where a method refused."""
    cells = []
    for row in rows:
        arcmin, mm = (
            tuple(np.nan if row["refused"] else row[name] for name in names)
            for names in (ARCMIN_COLUMNS, _MM_COLUMNS)
        )
        cells.append((*(row[name] for name in _NUMBERS), arcmin, mm))
    return np.array(cells, _COLUMNS)


def _methods(errors: ErrorTable) -> list[str]:
    return list(dict.fromkeys(errors["method"].tolist()))


def _is_population(errors: ErrorTable, sigma_m: float) -> Bool:
    return np.asarray(errors["eye_distance_sigma_mm"] == 1e3 * sigma_m)
