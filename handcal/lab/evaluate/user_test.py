"""The user test of Hu et al. 2021 over the sessions of several wearers.

The reprojection error is the distance in the display between a corner of the target drawn with the
calibrated φ and with the φ that the wearer adjusted by hand; each trial counts once, with the mean
of its corners, as the errors of its corners are not independent.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.core.types import EYES, Float64
from handcal.export.figures import COLORS, MARKERS, draw_trial_errors, name_axes
from handcal.export.tables import corner_rows
from handcal.io.files import read_limited, user_path
from handcal.lab.methods import REPROJECTION
from handcal.lab.settings import UserTestSettings, output_folder
from handcal.lab.study.store import free_of_studies
from handcal.report.cells import extremes, interval_ends, mean_sd, median_quartiles
from handcal.report.document import Column, Figure, FigureRow, Item, Report, Section, Table, facts
from handcal.report.page import families, plain
from handcal.report.provenance import at_minute, made_with
from handcal.report.statistics import (
    INTERVAL_METHOD,
    MeanInterval,
    Summary,
    VarianceComponents,
    mean_interval,
    summarise,
    variance_components,
)
from handcal.report.write import write_report
from handcal.session.comparison import count_comparisons, read_comparisons
from handcal.session.journal import JOURNAL, MAX_JOURNAL_BYTES
from handcal.session.record import replay
from handcal.session.session import Session, SessionRecord
from handcal.session.state import SessionEvent
from handcal.session.trial import calibration_numbers

CornerRow: TypeAlias = dict[str, Any]
"""One corner of one trial: the columns of `corner_rows`, and whose it is."""

Unit: TypeAlias = Literal["wearer", "calibration"]
"""The unit that an interval treats as independent."""


@dataclass(frozen=True, slots=True, eq=False)
class UserTest:
    """The trials of all sessions."""

    sessions: Mapping[str, SessionRecord]
    """Sessions with trials, by unique names."""
    left_out: Mapping[str, str]
    """Reasons why the others are left out, by their folders."""
    corners: Sequence[CornerRow]
    """All errors."""


@dataclass(frozen=True, slots=True)
class GroupErrors:
    """The errors of some of the trials."""

    calibrations: int
    trials: int
    corners: int
    px: Summary
    arcmin: Summary
    """Of the trials' mean errors."""
    corner_arcmin: Summary
    """Of the corners' errors, as published tests give them."""
    unit: Unit
    interval_arcmin: MeanInterval | None
    """Of the mean over units; None if there are less than two."""


@dataclass(frozen=True, slots=True)
class UserTestResult:
    """The errors found in a user test; JSON-able with `dataclasses.asdict`."""

    total: GroupErrors
    by_wearer: Mapping[str, GroupErrors]
    by_eye: Mapping[str, GroupErrors]
    by_depth_m: Mapping[str, GroupErrors]
    components_arcmin: VarianceComponents | None
    """Spread between wearers and within one; None for a single wearer."""
    left_out: Mapping[str, str]


def read_user_test(folders: Iterable[Path], progress: Progress = Progress()) -> UserTest:
    """Read the trials of sessions; those that are damaged or hold none are left out and named.

    Parameters
    ----------
    folders : iterable of Path
        Sessions, and folders of sessions.
    progress : Progress

    Raises
    ------
    FileError
        If no session holds a trial.
    """
    paths = list(dict.fromkeys(path for folder in folders for path in _sessions(folder)))
    kept: dict[Path, SessionRecord] = {}
    left_out: dict[str, str] = {}
    for done, path in enumerate(paths):
        progress.at(done / len(paths), "Reading sessions")
        try:
            record = Session.open(path)
        except FileError as error:
            left_out[str(path)] = str(error)
            continue
        if why := _unfit(record, kept):
            left_out[str(path)] = why
        else:
            kept[path] = record
            if record.left_out:
                left_out[str(path)] = record.left_out
    if not kept:
        raise FileError(
            f"there is no trial of the user test to evaluate ({_reasons(left_out) or 'no folder'})",
            "record some first",
        )
    names = Counter(path.name for path in kept)
    sessions = {
        path.name if names[path.name] == 1 else str(path): record for path, record in kept.items()
    }
    rows = [row for name, record in sessions.items() for row in _corners(name, record)]
    return UserTest(sessions, left_out, rows)


def holds_trials(folder: Path) -> bool:
    """Return whether a session, or one in a folder of sessions, holds a trial.

    Reads no further than the first.
    """
    return any(map(_holds_trials, _sessions(folder)))


def evaluate_user_test(test: UserTest) -> UserTestResult:
    """Return the errors of all trials, and of each wearer, eye and distance.

    Intervals treat wearers as independent; for a single wearer, calibrations.
    """
    wearers = [row["wearer"] for row in test.corners]
    unit: Unit = "wearer" if len(set(wearers)) > 1 else "calibration"
    trials = _trial_means(test.corners, "error_arcmin")
    return UserTestResult(
        total=_errors(test.corners, unit),
        by_wearer=_by(test.corners, "wearer", "calibration"),
        by_eye=_by(test.corners, "eye", unit),
        by_depth_m=_by(test.corners, "target_depth_m", unit),
        components_arcmin=(
            variance_components([mean for _, mean in trials], [wearer for wearer, _ in trials])
            if unit == "wearer" and len(trials) > len(set(wearers))
            else None
        ),
        left_out=test.left_out,
    )


def _sessions(folder: Path) -> Iterator[Path]:
    """Yield the sessions in a folder, or the folder itself if it is one, or holds none."""
    inside = sorted(journal.parent for journal in folder.glob(f"*/{JOURNAL}"))
    if (folder / JOURNAL).exists() or not inside:
        inside = [folder]
    yield from (path.absolute() for path in inside)


def _holds_trials(path: Path) -> bool:
    try:
        # Long before all events are read and applied.
        content = read_limited(path / JOURNAL, MAX_JOURNAL_BYTES, path)
        if SessionEvent.TRIAL_SAVED.encode() not in content:
            return False
        return bool(replay(path).state.trials.active)
    except FileError:
        return False


def _reasons(left_out: Mapping[str, str]) -> str:
    """Return why sessions were left out; those with the same reason are counted."""
    counts = Counter(left_out.values())
    single = (f"{path}: {why}" for path, why in left_out.items() if counts[why] == 1)
    common = (f"{count} sessions: {why}" for why, count in counts.items() if count > 1)
    return "; ".join([*common, *single][:3])


def _unfit(record: SessionRecord, kept: Mapping[Path, SessionRecord]) -> str:
    """Return why a session is left out; empty if it is not."""
    if not record.trials:
        return "holds no trial of the user test"
    for path, other in kept.items():
        if other.events[0] == record.events[0]:
            return f"is a copy of {path}"
    return ""


def _corners(name: str, record: SessionRecord) -> Iterator[CornerRow]:
    """Yield the rows of a session; a wearer without name is one of their own."""
    calibrations = calibration_numbers(record.trials)
    whose = {"wearer": record.wearer or f"not named, {name}", "session": name}
    for row in corner_rows(record.trials):
        yield {**whose, "calibration": calibrations[row["trial"]], **row}


def _trial_means(rows: Sequence[CornerRow], column: str) -> list[tuple[str, float]]:
    """Return the wearer and the mean error of each trial."""
    trials: dict[tuple[str, int], list[CornerRow]] = {}
    for row in rows:
        trials.setdefault((row["session"], row["trial"]), []).append(row)
    return [
        (corners[0]["wearer"], float(np.mean([row[column] for row in corners])))
        for corners in trials.values()
    ]


def _by(rows: Sequence[CornerRow], column: str, unit: Unit) -> dict[str, GroupErrors]:
    return {
        str(value): _errors([row for row in rows if row[column] == value], unit)
        for value in sorted({row[column] for row in rows})
    }


def _errors(rows: Sequence[CornerRow], unit: Unit) -> GroupErrors:
    calibrations = [(row["session"], row["calibration"]) for row in rows]
    units = [row["wearer"] for row in rows] if unit == "wearer" else calibrations
    arcmin = [row["error_arcmin"] for row in rows]
    return GroupErrors(
        calibrations=len(set(calibrations)),
        trials=len(_trial_means(rows, "error_arcmin")),
        corners=len(rows),
        px=summarise([mean for _, mean in _trial_means(rows, "error_px")]),
        arcmin=summarise([mean for _, mean in _trial_means(rows, "error_arcmin")]),
        corner_arcmin=summarise(arcmin),
        unit=unit,
        interval_arcmin=mean_interval(arcmin, units) if len(set(units)) > 1 else None,
    )


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


# Wearers in one figure, and the height of each.
_WEARERS, _WEARER_MM, _FIGURE_MM = 24, 6.0, 30.0
_METHOD = (
    "After a calibration, the wearer adjusted φ by hand until the drawn target covered the real "
    "one. The reprojection error is the distance in the display between a corner of the target "
    "drawn with the calibrated φ and with the adjusted one (Hu, Rodriguez y Baena, Cutolo, ISMAR "
    "2021, user test). Each trial, of one eye at one distance, counts once, with the mean of its "
    "four corners."
)
_INTERVALS = (
    "Errors of one wearer are correlated, so only wearers count as independent: intervals are of "
    f"the mean of wearers' means, by {INTERVAL_METHOD}. "
    "Those of one wearer take calibrations for independent."
)


def user_test_report(test: UserTest, result: UserTestResult) -> Report:
    """Return the report of a user test."""
    total = result.total
    simulated = sum(bool(record.simulated) for record in test.sessions.values())
    told = f" Simulated sessions: {simulated} of {len(test.sessions)}." if simulated else ""
    return Report(
        title="User test",
        subject=f"{_count(len(result.by_wearer), 'wearer')}, "
        f"{_count(len(test.sessions), 'session')}, {_count(total.trials, 'trial')}",
        lead=f"{_mean(total)} Of all trials: {mean_sd(total.arcmin)} arcmin, "
        f"{mean_sd(total.px)} px (± SD).{told}",
        sections=list(_sections(test, result)),
    )


def _sections(test: UserTest, result: UserTestResult) -> Iterator[Section]:
    yield _summary_section(test, result)
    yield _error_section(test, result)
    yield _wearer_section(test, result)
    yield _corner_section(test)
    yield _published_section(result)
    yield _session_section(test)
    if result.left_out:
        columns = Column("folder", "left"), Column("why", "left")
        yield Section("Left out", [Table(columns, list(result.left_out.items()))])


def _summary_section(test: UserTest, result: UserTestResult) -> Section:
    total = result.total
    counts = {
        "Wearers": str(len(result.by_wearer)),
        "Sessions": str(len(test.sessions)),
        "Calibrations": str(total.calibrations),
        "Trials": f"{total.trials}, each one eye at one distance",
        "Corners": str(total.corners),
    }
    sessions = test.sessions.values()
    if simulated := sum(bool(record.simulated) for record in sessions):
        counts["Simulated sessions"] = str(simulated)
    compared = [one for record in sessions for one in read_comparisons(record.events)]
    if compared:
        found = count_comparisons(compared)
        counts["Blinded comparisons"] = (
            f"{found.applied} better with the calibration, {found.offline} without it, "
            f"{found.neither} neither"
        )
    return Section("", [facts(counts | made_with()), _METHOD])


def _error_section(test: UserTest, result: UserTestResult) -> Section:
    groups = {"all": result.total}
    groups |= {f"{eye} eye": errors for eye, errors in result.by_eye.items()}
    groups |= {f"at {depth_m} m": errors for depth_m, errors in result.by_depth_m.items()}
    items: list[Item] = [_table("which", groups), _INTERVALS]
    if result.components_arcmin is not None:
        found = result.components_arcmin
        items.append(
            f"Standard deviation of wearers' mean errors {found.between:.2f} arcmin, of the trials "
            f"of one wearer {found.within:.2f} arcmin (analysis of variance)."
        )
    trials = [trial for record in test.sessions.values() for trial in record.trials.values()]
    figure = Figure(
        "errors",
        "Boxes: quartiles and median of all corners; whiskers: the farthest within 1.5 "
        "interquartile ranges.",
        lambda axes: draw_trial_errors(axes, trials),
        test.corners,
        height_mm=62.0,
        columns=2,
    )
    return Section("Reprojection error", [*items, figure])


def _wearer_section(test: UserTest, result: UserTestResult) -> Section:
    names = list(result.by_wearer)
    items: list[Item] = [_table("wearer", result.by_wearer)]
    for first in range(0, len(names), _WEARERS):
        shown = {name: result.by_wearer[name] for name in names[first : first + _WEARERS]}
        items.append(
            Figure(
                f"wearers-{first // _WEARERS + 1}",
                "Means over calibrations; a wearer of one calibration has no interval.",
                partial(draw_wearers, by_wearer=shown, rows=test.corners),
                list(_wearer_rows(shown)),
                height_mm=_FIGURE_MM + _WEARER_MM * len(shown),
                columns=2,
                left_mm=34.0,
            )
        )
    return Section("Wearers", items)


def _corner_section(test: UserTest) -> Section:
    displays = [
        display for record in test.sessions.values() for display in record.rig.eyes.values()
    ]
    sizes_px = {(display.width_px, display.height_px) for display in displays}
    figure = Figure(
        "corners",
        "Left: crosses are the true places, dots the drawn ones; the frame is the display. Right: "
        "how far each drawn corner is from its true place.",
        lambda axes: draw_corners(axes, test.corners, sizes_px),
        test.corners,
        height_mm=72.0,
        columns=2,
    )
    return Section("Where corners are drawn", [figure])


def _published_section(result: UserTestResult) -> Section:
    found = result.total.corner_arcmin  # each corner counts once in the published figures
    here = (
        "this test",
        f"{found.median:.2f}",
        f"{found.q1:.2f}–{found.q3:.2f}",
        extremes(found),
    )
    columns = [
        Column("study", "left"),
        Column("median, arcmin"),
        Column("interquartile range, arcmin"),
        Column("min–max, arcmin"),
    ]
    text = (
        "Published figures as printed in Hu et al. 2021, those of SPAAM in its source; its test "
        "had 3 wearers, 10 calibrations each, 3 distances and 4 corners, and a mean of "
        "10.79 ± 3.21 arcmin (7.71 ± 2.29 px). The maximum printed for the stylus is below its "
        "third quartile. Displays, wearers and targets differ between the studies."
    )
    published = [
        (p.study, f"{p.median:.2f}", f"{p.q1:.2f}–{p.q3:.2f}", f"{p.min:.2f}–{p.max:.2f}")
        for p in REPROJECTION
    ]
    return Section("Beside published tests", [text, Table(columns, [here, *published])])


def _session_section(test: UserTest) -> Section:
    columns = [
        Column("session", "left"),
        Column("wearer", "left"),
        Column("begun", "left"),
        Column("rig", "left"),
        Column("calibrations"),
        Column("trials"),
    ]
    rows = [
        [
            name,
            record.wearer or "not named",
            at_minute(record.events[0].time),
            record.rig.name,
            str(len(set(calibration_numbers(record.trials).values()))),
            str(len(record.trials)),
        ]
        for name, record in test.sessions.items()
    ]
    return Section("Sessions", [Table(columns, rows)])


def _table(of: str, groups: Mapping[str, GroupErrors]) -> Table:
    columns = [
        Column(of, "left"),
        Column("calibrations"),
        Column("trials"),
        Column("mean ± SD, px"),
        Column("mean ± SD, arcmin"),
        Column("95 % interval, arcmin"),
        Column("median (quartiles), arcmin"),
        Column("min–max, arcmin"),
    ]
    rows = [
        [
            name,
            str(group.calibrations),
            str(group.trials),
            mean_sd(group.px),
            mean_sd(group.arcmin),
            interval_ends(group.interval_arcmin),
            median_quartiles(group.arcmin),
            extremes(group.arcmin),
        ]
        for name, group in groups.items()
    ]
    return Table(
        columns, rows, "SD, quartiles and extremes: of trials. The interval is that of the mean."
    )


def _wearer_rows(shown: Mapping[str, GroupErrors]) -> Iterator[FigureRow]:
    for wearer, group in shown.items():
        interval = group.interval_arcmin
        yield {
            "wearer": wearer,
            "calibrations": group.calibrations,
            "trials": group.trials,
            "corners": group.corners,
            "mean_arcmin": group.arcmin.mean,
            "sd_arcmin": group.arcmin.sd,
            "low_arcmin": interval.low if interval else None,
            "high_arcmin": interval.high if interval else None,
            "median_arcmin": group.arcmin.median,
            "q1_arcmin": group.arcmin.q1,
            "q3_arcmin": group.arcmin.q3,
            "min_arcmin": group.arcmin.min,
            "max_arcmin": group.arcmin.max,
            "mean_px": group.px.mean,
            "sd_px": group.px.sd,
        }


def _mean(total: GroupErrors) -> str:
    found = total.interval_arcmin
    if found is None:
        return "One calibration was tested, so how far another would differ is not known."
    return (
        f"Mean reprojection error over {found.clusters} {total.unit}s {found.mean:.2f} arcmin, "
        f"{100 * found.level:g} % interval {interval_ends(found)}."
    )


def _count(number: int, what: str) -> str:
    return f"1 {what}" if number == 1 else f"{number:,} {what}s"


_READING = 0.7
"""Share of the time of an evaluation."""


@dataclass(frozen=True, slots=True, eq=False)
class UserTestRun:
    """The errors found in a user test, and its report as it was written."""

    result: UserTestResult
    report: Report
    files: tuple[Path, ...]
    """The report as PDF and as HTML."""


def run_user_test(settings: UserTestSettings, progress: Progress = Progress()) -> UserTestRun:
    """Evaluate the user test over sessions, and write the report.

    Raises
    ------
    CancelledError
    FileError
        If no session holds a trial, or the results would go into a study's folder.
    """
    output = free_of_studies(output_folder(settings.output))
    folders = [user_path(folder) for folder in settings.folders]
    test = read_user_test(folders, progress.part(0.0, _READING))
    result = evaluate_user_test(test)
    report = user_test_report(test, result)
    return UserTestRun(
        result,
        report,
        write_report(output, report, progress.part(_READING, 1.0, "Writing the report")),
    )
