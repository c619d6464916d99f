"""The results of several sessions together: their numbers over wearers, and a report of them."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from handcal.core.types import EYES, Eye
from handcal.export.tables import TableRow
from handcal.register.verdict_words import VERDICT_WORDS
from handcal.report.cells import NOTHING
from handcal.report.document import (
    Column,
    Figure,
    FigureRow,
    Report,
    Section,
    Table,
    at_minute,
    facts,
    made_with,
)
from handcal.report.statistics import summarise

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_QUANTITIES = {
    "before_arcmin": "expected without the calibration",
    "verification_found_arcmin": "found by the wearers' verifications",
    "expected_error_arcmin": "expected with the final φ",
    "trials_error_arcmin": "in user-test trials, of the φ calibrated then",
}
_DEFINED = "mean over the corners of an 8 cm square at 0.4, 0.5 and 0.6 m"


@dataclass(frozen=True, slots=True)
class Spread:
    """One quantity over wearers, each wearer counting once with the mean of their values."""

    quantity: str
    wearers: int
    values: int
    """Eyes, or trials."""
    mean: float
    sd_between: float | None
    """Standard deviation of the wearers' means; None for a single wearer."""
    sd_within: float | None
    """Pooled standard deviation of the values about the wearers' means; None without several
    values of any wearer."""


@dataclass(frozen=True, slots=True)
class WearersSummary:
    """The numbers over wearers in the tables of several sessions."""

    wearers: int
    sessions: int
    eyes: int
    """Solved eyes, of all sessions."""
    accepted: int
    verified: int
    """Eyes whose final φ has the verdict *accept*, and those whose final φ the wearer verified."""
    trials: int
    comparisons: int
    better_with: int
    better_without: int
    """Blinded comparisons, and those in which one of the two drawings was better."""
    simulated: int
    """Sessions that were simulated, at least in part."""
    spreads: Mapping[str, Spread]
    """By the name of the quantity; those without any value are missing."""

    @property
    def sentence(self) -> str:
        """The results as a paper would state them, with every n."""
        text = (
            f"{_count(self.wearers, 'wearer')} were calibrated ({_count(self.sessions, 'session')}"
            f", {_count(self.eyes, 'eye')}); {self.accepted} of {_count(self.eyes, 'eye')} were "
            f"accepted and {self.verified} verified by the wearer."
        )
        if self.wearers == 1:
            text = text.replace("were", "was", 1)
        before, after, trials = (
            self.spreads.get(name)
            for name in ("before_arcmin", "expected_error_arcmin", "trials_error_arcmin")
        )
        if before and after:
            text += (
                f" The expected error in the display ({_DEFINED}) was {_mean_sd(before)} without "
                f"the calibration and {_mean_sd(after)} with the final φ of each eye."
            )
        if trials:
            text += (
                f" In {_count(trials.values, 'user-test trial')} the mean reprojection error of "
                f"the φ calibrated then was {_mean_sd(trials)}."
            )
        if self.comparisons:
            text += (
                f" In {_count(self.comparisons, 'blinded comparison')} the drawing with the "
                f"calibration fitted better in {self.better_with}, that without it in "
                f"{self.better_without}."
            )
        if self.simulated:
            text += f" Simulated: {self.simulated} of {_count(self.sessions, 'session')}."
        return text


def summarise_wearers(tables: Mapping[str, Sequence[TableRow]]) -> WearersSummary:
    """Return the numbers over wearers in the tables of several sessions.

    Parameters
    ----------
    tables : mapping of str to sequence of mapping
        As `table_rows` gives them, those of all sessions one after the other.
    """
    finals = [row for row in tables["parameters.csv"] if row.get("final") == "yes"]
    solved = [row for row in finals if row.get("before_arcmin") is not None]
    values: dict[str, list[tuple[str, float]]] = {
        name: [(_wearer(row), row[name]) for row in solved if row.get(name) is not None]
        for name in ("before_arcmin", "verification_found_arcmin", "expected_error_arcmin")
    }
    values["trials_error_arcmin"] = _trial_errors(tables["trials.csv"])
    better = [row["better"] for row in tables["comparisons.csv"]]
    return WearersSummary(
        wearers=len({_wearer(row) for row in finals}),
        sessions=len({row["session"] for row in finals}),
        eyes=len(solved),
        accepted=sum(row.get("verdict") == "accept" for row in solved),
        verified=sum(row.get("verified") == "yes" for row in solved),
        trials=len(values["trials_error_arcmin"]),
        comparisons=len(better),
        better_with=better.count("applied"),
        better_without=better.count("offline"),
        simulated=len({row["session"] for row in finals if row["simulated"]}),
        spreads={name: spread(name, pairs) for name, pairs in values.items() if pairs},
    )


def summary_rows(summary: WearersSummary) -> list[TableRow]:
    """Return the rows of summary.csv: counts, then the spread of each quantity."""
    counts = {name: getattr(summary, name) for name in WearersSummary.__slots__}
    del counts["spreads"]
    return [
        *({"quantity": name, "values": count} for name, count in counts.items()),
        *map(asdict, summary.spreads.values()),
    ]


def wearers_report(
    tables: Mapping[str, Sequence[TableRow]], left_out: Sequence[str] = ()
) -> Report:
    """Return the report of several sessions; `left_out`: those not in the tables, with reasons."""
    summary = summarise_wearers(tables)
    finals = [row for row in tables["parameters.csv"] if row.get("final") == "yes"]
    sections = [
        Section("", [_spreads_table(summary)]),
        Section("Wearers", [_errors_figure(finals), _eyes_table(finals)]),
        Section("Made", [facts(made_with())]),
    ]
    if left_out:
        sections.append(Section("Left out", list(left_out)))
    return Report(
        title="Calibrations",
        subject=f"{_count(summary.wearers, 'wearer')}, {_count(summary.sessions, 'session')}",
        lead=summary.sentence,
        sections=sections,
    )


def _spreads_table(summary: WearersSummary) -> Table:
    return Table(
        [
            Column("error, ′", "left"),
            Column("wearers"),
            Column("eyes or trials"),
            Column("mean"),
            Column("SD between wearers"),
            Column("SD within wearers"),
        ],
        [
            [
                _QUANTITIES[name],
                str(found.wearers),
                str(found.values),
                f"{found.mean:.2f}",
                *(
                    NOTHING if sd is None else f"{sd:.2f}"
                    for sd in (found.sd_between, found.sd_within)
                ),
            ]
            for name, found in summary.spreads.items()
        ],
        "Each wearer counts once, with the mean of their eyes, sessions or trials. Between: "
        "standard deviation of these means; within: of the values about them. Expected errors are "
        f"the {_DEFINED}.",
    )


def _eyes_table(finals: Sequence[TableRow]) -> Table:
    return Table(
        [
            Column("wearer", "left"),
            Column("begun", "left"),
            Column("eye", "left"),
            Column("verdict", "left"),
            Column("before, ′"),
            Column("found, ′"),
            Column("after, ′"),
            Column("verifications"),
            Column("trials"),
            Column("final φ", "left"),
        ],
        [
            [
                row["wearer"] or f"not named, {row['session']}",
                at_minute(row["begun_utc"]),
                row["eye"],
                _word(row),
                *(
                    NOTHING if row.get(name) is None else f"{row[name]:.1f}"
                    for name in (
                        "before_arcmin",
                        "verification_found_arcmin",
                        "expected_error_arcmin",
                    )
                ),
                str(row.get("verifications", 0)),
                str(row.get("trials", 0)),
                row["source"],
            ]
            for row in finals
        ],
    )


def _errors_figure(finals: Sequence[TableRow]) -> Figure:
    rows: list[FigureRow] = [
        {
            "wearer": _wearer(row),
            "eye": row["eye"],
            "before_arcmin": row["before_arcmin"],
            "after_arcmin": row["expected_error_arcmin"],
        }
        for row in finals
        if row.get("before_arcmin") is not None
    ]
    return Figure(
        "errors",
        "Expected error of each eye; hollow: without the calibration, filled: with the final φ.",
        lambda axes: _draw_errors(axes[0], rows),
        rows,
        height_mm=40.0 + 5.0 * len({row["wearer"] for row in rows}),
        left_mm=34.0,
    )


def _draw_errors(ax: Axes, rows: Sequence[FigureRow]) -> None:
    from handcal.export.figures import COLORS, MARKERS, name_axes
    from handcal.report.page import families, plain

    wearers = list(dict.fromkeys(str(row["wearer"]) for row in rows))
    shown: Mapping[Eye, float] = {"left": -0.12, "right": 0.12}
    for eye in EYES:
        of_eye = [row for row in rows if row["eye"] == eye]
        places = [wearers.index(str(row["wearer"])) + shown[eye] for row in of_eye]
        for name, fill in (("before_arcmin", "none"), ("after_arcmin", COLORS[eye])):
            errors = [float(row[name] or 0.0) for row in of_eye]
            label = eye if name == "after_arcmin" else None
            ax.plot(errors, places, MARKERS[eye], color=COLORS[eye], mfc=fill, ms=4, label=label)
    names = [textwrap.shorten(plain(wearer), 24, placeholder="…") for wearer in wearers]
    ax.set_yticks(range(len(wearers)), names, parse_math=False, family=families("".join(names)))
    ax.set_ylim(len(wearers) - 0.4, -0.6)
    ax.set_xlim(left=0.0)
    name_axes(ax, "expected error", "arcmin", "")
    if rows:
        ax.legend(title="eye", fontsize=6.5, title_fontsize=6.5, frameon=False)


def _word(row: TableRow) -> str:
    """Return the verdict on the final φ of an eye in a word, or why there is none."""
    if row.get("verdict"):
        return VERDICT_WORDS[row["verdict"]]
    return "not solved" if row.get("before_arcmin") is None else "not judged"


def _wearer(row: TableRow) -> str:
    """Return whose row it is; a session without a name is of a wearer of its own."""
    return str(row["wearer"] or f"not named, {row['session']}")


def _trial_errors(corners: Sequence[TableRow]) -> list[tuple[str, float]]:
    """Return each trial's mean error over its corners, with its wearer."""
    trials: dict[tuple[str, int], list[float]] = {}
    wearers = {}
    for row in corners:
        key = row["session"], row["trial"]
        trials.setdefault(key, []).append(row["error_arcmin"])
        wearers[key] = _wearer(row)
    return [(wearers[key], sum(errors) / len(errors)) for key, errors in trials.items()]


def spread(quantity: str, pairs: Sequence[tuple[str, float]]) -> Spread:
    """Return the spread of values, each with its wearer; ValueError if there are none."""
    by_wearer: dict[str, list[float]] = {}
    for wearer, value in pairs:
        by_wearer.setdefault(wearer, []).append(value)
    each = [summarise(values) for values in by_wearer.values()]
    means = summarise([one.mean for one in each])
    freedom = len(pairs) - len(each)
    squares = sum((one.count - 1) * one.sd**2 for one in each)
    return Spread(
        quantity=quantity,
        wearers=len(each),
        values=len(pairs),
        mean=means.mean,
        sd_between=means.sd if len(each) > 1 else None,
        sd_within=(squares / freedom) ** 0.5 if freedom else None,
    )


def _mean_sd(spread: Spread) -> str:
    if spread.sd_between is None:
        return f"{spread.mean:.1f}′ (one wearer)"
    return (
        f"{spread.mean:.1f}′ ± {spread.sd_between:.1f}′ (mean ± SD between wearers, "
        f"n = {spread.wearers})"
    )


def _count(number: int, noun: str) -> str:
    return f"1 {noun}" if number == 1 else f"{number} {noun}s"
