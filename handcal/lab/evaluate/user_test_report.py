"""The report of a user test."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial

from handcal.export.figures import draw_trial_errors
from handcal.lab.evaluate.user_test import GroupErrors, UserTest, UserTestResult
from handcal.lab.evaluate.user_test_figures import draw_corners, draw_wearers
from handcal.lab.methods.published import REPROJECTION
from handcal.report.cells import extremes, interval_ends, mean_sd, median_quartiles
from handcal.report.document import (
    Column,
    Figure,
    FigureRow,
    Item,
    Report,
    Section,
    Table,
    at_minute,
    facts,
    made_with,
)
from handcal.report.statistics import INTERVAL_METHOD
from handcal.session.comparison import count_comparisons, read_comparisons
from handcal.session.trial import calibration_numbers

# Wearers in one figure, and the height of each.
_WEARERS, _WEARER_MM, _FIGURE_MM = 24, 6.0, 30.0
_METHOD = (
    "After a calibration, the wearer adjusted φ by hand until the drawn target covered the real "
    "one. The reprojection error is the distance in the display between a corner of the target "
    "drawn with the calibrated φ and with the adjusted one (Hu, Rodriguez y Baena, Cutolo, ISMAR "
    "2021, user test). Each of the four corners, at each distance and for each eye, counts once."
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
        lead=f"{_mean(total)} Of all corners: {mean_sd(total.arcmin)} arcmin, "
        f"{mean_sd(total.px)} px (± SD).{told}",
        sections=list(_sections(test, result)),
    )


def _sections(test: UserTest, result: UserTestResult) -> Iterator[Section]:
    yield _summary(test, result)
    yield _errors(test, result)
    yield _wearers(test, result)
    yield _corners(test)
    yield _published(result)
    yield _sessions(test)
    if result.left_out:
        columns = Column("folder", "left"), Column("why", "left")
        yield Section("Left out", [Table(columns, list(result.left_out.items()))])


def _summary(test: UserTest, result: UserTestResult) -> Section:
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


def _errors(test: UserTest, result: UserTestResult) -> Section:
    groups = {"all": result.total}
    groups |= {f"{eye} eye": errors for eye, errors in result.by_eye.items()}
    groups |= {f"at {depth_m} m": errors for depth_m, errors in result.by_depth_m.items()}
    items: list[Item] = [_table("trials", groups), _INTERVALS]
    if result.components_arcmin is not None:
        found = result.components_arcmin
        items.append(
            f"Standard deviation of wearers' mean errors {found.between:.2f} arcmin, of the errors "
            f"of one wearer {found.within:.2f} arcmin (analysis of variance)."
        )
    trials = [trial for record in test.sessions.values() for trial in record.trials.values()]
    figure = Figure(
        "errors",
        "Boxes: quartiles and median; whiskers: the farthest within 1.5 interquartile ranges.",
        lambda axes: draw_trial_errors(axes, trials),
        test.corners,
        height_mm=62.0,
        columns=2,
    )
    return Section("Reprojection error", [*items, figure])


def _wearers(test: UserTest, result: UserTestResult) -> Section:
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


def _corners(test: UserTest) -> Section:
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


def _published(result: UserTestResult) -> Section:
    found = result.total.arcmin
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


def _sessions(test: UserTest) -> Section:
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
        Column("corners"),
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
            str(group.corners),
            mean_sd(group.px),
            mean_sd(group.arcmin),
            interval_ends(group.interval_arcmin),
            median_quartiles(group.arcmin),
            extremes(group.arcmin),
        ]
        for name, group in groups.items()
    ]
    return Table(columns, rows, "The interval is that of the mean.")


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
