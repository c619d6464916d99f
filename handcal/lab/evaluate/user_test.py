"""The user test of Hu et al. 2021 over the sessions of several wearers.

The reprojection error is the distance in the display between a corner of the target drawn with the
calibrated φ and with the φ that the wearer adjusted by hand; each corner counts once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.export.tables import corner_rows
from handcal.io.files import read_limited
from handcal.report.statistics import (
    MeanInterval,
    Summary,
    VarianceComponents,
    mean_interval,
    summarise,
    variance_components,
)
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
            "there is no trial of the user test to evaluate",
            f"record some first ({_reasons(left_out) or 'no folder'})",
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
    errors_arcmin = [row["error_arcmin"] for row in test.corners]
    return UserTestResult(
        total=_errors(test.corners, unit),
        by_wearer=_by(test.corners, "wearer", "calibration"),
        by_eye=_by(test.corners, "eye", unit),
        by_depth_m=_by(test.corners, "target_depth_m", unit),
        components_arcmin=(
            variance_components(errors_arcmin, wearers) if unit == "wearer" else None
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
        trials=len({(row["session"], row["trial"]) for row in rows}),
        corners=len(rows),
        px=summarise([row["error_px"] for row in rows]),
        arcmin=summarise(arcmin),
        unit=unit,
        interval_arcmin=mean_interval(arcmin, units) if len(set(units)) > 1 else None,
    )
