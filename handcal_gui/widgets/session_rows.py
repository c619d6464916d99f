"""The contents of a session as table rows, and the deletions that can be undone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handcal.core.types import EYES, PLAN_WORDS
from handcal.register.results import Results
from handcal.report.cells import signed
from handcal.session.session import SessionRecord
from handcal.session.state import Kind, SessionEvent
from handcal.session.trial import (
    Trial,
    TrialSpread,
    count_comparisons,
    read_comparisons,
    trial_spread,
)
from handcal_gui.app.translation import tr
from handcal_gui.widgets.numbers import pluralize
from handcal_gui.widgets.result_rows import EYE_NAMES, NOTHING, eyes_text
from handcal_gui.widgets.table import Column, Row
from handcal_gui.widgets.times import local_time

_PHI = tr(
    "φ1, φ2 and φ3 of the eye from this alignment alone: its distance to the right of, below\n"
    "and in front of the rig's viewpoint, in millimetres; the left eye above the right one"
)
RESUME_HELP = tr("Open camera and headset to add alignments, fine-tuning or trials")
"""Of any session that can be read, finished or not."""
ALIGNMENT_COLUMNS = (
    Column(tr("No."), tr("Number of the alignment")),
    Column(tr("Eyes"), tr("Eyes open during the alignment"), is_number=False),
    Column(
        tr("Rotation °"),
        tr("Angle between hand and cursor at the confirmation, in degrees"),
        rank=2,
    ),
    Column(tr("φ1 mm"), _PHI, rank=1),
    Column(tr("φ2 mm"), _PHI, rank=1),
    Column(tr("φ3 mm"), _PHI, rank=1),
    Column(
        tr("Point RMS mm"),
        tr("Distance from the hand's points to their partners on the cursor, in millimetres"),
        rank=3,
    ),
    Column(
        tr("Inliers %"),
        tr("Percentage of the hand's points with a partner on the cursor"),
        rank=4,
    ),
    Column(tr("Time"), tr("Time of the confirmation"), rank=5),
)
TRIAL_COLUMNS = (
    Column(tr("No."), tr("Number of the trial")),
    Column(tr("Eye"), tr("Eye that looked at the target"), is_number=False),
    Column(tr("Distance m"), tr("Distance of the target, in metres"), rank=1),
    Column(
        tr("Error px"),
        tr("Mean over the target's four corners, in pixels of the display"),
        rank=2,
    ),
    Column(tr("Error ′"), tr("Mean over the target's four corners, in arcminutes")),
    Column(tr("Time"), tr("Time of the recording"), rank=3),
)
STATISTICS_COLUMNS = (
    Column(tr("Trials")),
    Column(tr("Mean ′")),
    Column(tr("SD of trials ′")),
    Column(tr("Calibrations"), rank=2),
    Column(tr("SD of calibrations ′"), rank=1),
    Column(tr("Median ′"), rank=3),
    Column(tr("Max ′"), rank=4),
)
_SPREAD_HELP = tr(
    "Each trial counts once, with the mean of its corners, in arcminutes. Trials of one\n"
    "calibration are not independent: only the spread between calibrations tells how the next\n"
    "one turns out."
)

_CLOCK = "%H:%M:%S"
_DELETED: dict[str, Kind] = {
    SessionEvent.ALIGNMENT_DELETED: "alignment",
    SessionEvent.TRIAL_DELETED: "trial",
}
_RESTORED: dict[str, Kind] = {
    SessionEvent.ALIGNMENT_RESTORED: "alignment",
    SessionEvent.TRIAL_RESTORED: "trial",
}


def session_facts(record: SessionRecord) -> dict[str, str]:
    """Return how a session was made: facts that a result is to be cited with."""
    compared = count_comparisons(read_comparisons(record.events))
    answers = compared.applied, compared.offline, compared.neither
    facts = {
        tr("Started"): local_time(record.events[0].time, "%Y-%m-%d %H:%M UTC%z"),
        tr("Rig"): record.rig.name,
        tr("Plan"): PLAN_WORDS[record.facts.plan] if record.facts.plan else "",
        tr("Method"): str((record.results or {}).get("method", "")),
        tr("Simulated"): record.simulated,
        tr("Compared blindly"): tr("better with the calibration {}, without {}, neither {}").format(
            *answers
        )
        if any(answers)
        else "",
    }
    return {name: fact for name, fact in facts.items() if fact}


@dataclass(frozen=True, slots=True)
class Deletion:
    """A deleted item that can be restored."""

    kind: Kind
    number: int


def deletions(record: SessionRecord) -> list[Deletion]:
    """Return the deleted items, in the order of their deletion."""
    found: list[Deletion] = []
    for event in record.events:
        if event.name in _DELETED:
            found.append(Deletion(_DELETED[event.name], event.data["number"]))
        elif event.name in _RESTORED:
            found.remove(Deletion(_RESTORED[event.name], event.data["number"]))
    return found


def alignment_rows(record: SessionRecord, results: Results | None) -> list[Row]:
    """Return rows for `ALIGNMENT_COLUMNS`, by the alignment's number; a line for each open eye.

    Parameters
    ----------
    record : SessionRecord
    results : Results or None
        Results of all the record's alignments; ignored if they are for a different set.
    """
    solved = results.alignments if results else {}
    if set(solved) != set(record.alignments):
        solved = {}
    saved = SessionEvent.ALIGNMENT_SAVED
    times = {event.data["number"]: event.time for event in record.events if event.name == saved}
    rows = []
    for number, alignment in record.alignments.items():
        shifts = solved.get(number, {})
        angle_deg = np.degrees(np.linalg.norm(alignment.rotation_rad))
        alone = [shifts[eye] for eye in EYES if eye in shifts]
        phi = ([signed(1e3 * shift.shift_m[axis], 2) for shift in alone] for axis in range(3))
        rms = (f"{1e3 * shift.rms_m:.2f}" for shift in alone)
        inliers = (f"{100 * shift.inlier_ratio:.0f}" for shift in alone)
        measured = ("\n".join(lines) for lines in (*phi, rms, inliers))
        cells = (
            str(number),
            eyes_text(alignment.eyes),
            f"{angle_deg:.1f}",
            *(text or NOTHING for text in measured),
            local_time(times[number], _CLOCK),
        )
        rows.append(Row("", cells, key=number))
    return rows


def trials_id(record: SessionRecord) -> tuple[Path, tuple[int, ...]]:
    """Return a key that identifies a session's set of trials; numbers are never reused."""
    return record.path, tuple(record.trials)


def trial_rows(record: SessionRecord) -> list[Row]:
    """Return rows for `TRIAL_COLUMNS`, by the trial's number."""
    return [
        Row(
            "",
            (
                str(number),
                EYE_NAMES[trial.eye],
                f"{trial.target_depth_m:g}",
                f"{trial.error_px.mean():.1f}",
                f"{trial.error_arcmin.mean():.1f}",
                local_time(trial.time, _CLOCK),
            ),
            key=number,
        )
        for number, trial in record.trials.items()
    ]


def statistics_rows(trials: Mapping[int, Trial]) -> list[Row]:
    """Return rows for `STATISTICS_COLUMNS`: all trials, each eye, each distance."""
    groups = {tr("All"): list(trials)}
    for eye in EYES:
        groups[EYE_NAMES[eye]] = [number for number, one in trials.items() if one.eye == eye]
    for depth_m in sorted({one.target_depth_m for one in trials.values()}):
        groups[f"{depth_m:g} m"] = [
            number for number, one in trials.items() if one.target_depth_m == depth_m
        ]
    return [
        Row(name, _spread_cells(trial_spread(trials, chosen)), _SPREAD_HELP)
        for name, chosen in groups.items()
        if chosen
    ]


def statistics_text(trials: Mapping[int, Trial]) -> str:
    """Return the errors of all trials in one line, with what they cannot tell."""
    if not trials:
        return tr("No trials yet")
    spread = trial_spread(trials, list(trials))
    sd_arcmin = spread.trial_sd_arcmin
    between = "" if sd_arcmin is None else tr(", SD between trials {:.1f}′").format(sd_arcmin)
    calibrations = pluralize(spread.calibrations, tr("calibration"), tr("calibrations"))
    counts = tr("{} of {}").format(
        pluralize(spread.trials, tr("trial"), tr("trials")), calibrations
    )
    text = tr("{}: mean {:.1f}′{}.").format(counts, spread.mean_arcmin, between)
    if spread.calibration_sd_arcmin is None:
        return tr("{} One calibration cannot tell how the next one turns out.").format(text)
    return tr("{} SD between calibrations {:.1f}′.").format(text, spread.calibration_sd_arcmin)


def _spread_cells(spread: TrialSpread) -> tuple[str, ...]:
    def text(sd_arcmin: float | None) -> str:
        return NOTHING if sd_arcmin is None else f"{sd_arcmin:.1f}"

    return (
        str(spread.trials),
        f"{spread.mean_arcmin:.1f}",
        text(spread.trial_sd_arcmin),
        str(spread.calibrations),
        text(spread.calibration_sd_arcmin),
        f"{spread.median_arcmin:.1f}",
        f"{spread.max_arcmin:.1f}",
    )
