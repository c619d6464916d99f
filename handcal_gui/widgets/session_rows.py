"""The contents of a session as table rows, and the deletions that can be undone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handcal.register.results import Results
from handcal.session.session import SessionRecord
from handcal.session.state import Kind, SessionEvent
from handcal.session.trial import ErrorStatistics, TrialStatistics
from handcal.types import EYES, Eye, EyeShift
from handcal_gui.widgets.number_table import Row
from handcal_gui.widgets.numbers import signed
from handcal_gui.widgets.record_table import RecordColumn
from handcal_gui.widgets.result_rows import EYE_NAMES, NOTHING
from handcal_gui.widgets.times import local_time

_PHI = (
    "φ1, φ2 and φ3 of the {} from this alignment alone: distance of the eye to the right of,\n"
    "below and in front of the rig's viewpoint, in millimetres"
)
ALIGNMENT_COLUMNS = (
    RecordColumn("No.", "Number of the alignment"),
    RecordColumn("Eyes", "Eyes open during the alignment", is_number=False),
    RecordColumn("Rotation °", "Angle between hand and cursor at the confirmation, in degrees"),
    RecordColumn("Left φ mm", _PHI.format("left eye")),
    RecordColumn("Right φ mm", _PHI.format("right eye")),
    RecordColumn("RMS mm", "Distance between hand and cursor after registration, in millimetres"),
    RecordColumn("Inliers %", "Percentage of the hand's points with a partner on the cursor"),
    RecordColumn("Time", "Time of the confirmation"),
)
TRIAL_COLUMNS = (
    RecordColumn("No.", "Number of the trial"),
    RecordColumn("Eye", "Eye that looked at the target", is_number=False),
    RecordColumn("Distance m", "Distance of the target, in metres"),
    RecordColumn("Error px", "Mean over the target's four corners, in pixels of the display"),
    RecordColumn("Error ′", "Mean over the target's four corners, in arcminutes"),
    RecordColumn("Time", "Time of the recording"),
)
STATISTICS_COLUMNS = ("n", "Mean ± SD ′", "Median ′", "Max ′", "Mean ± SD px")

_CLOCK = "%H:%M:%S"
_DELETED: dict[str, Kind] = {
    SessionEvent.ALIGNMENT_DELETED: "alignment",
    SessionEvent.TRIAL_DELETED: "trial",
}
_RESTORED: dict[str, Kind] = {
    SessionEvent.ALIGNMENT_RESTORED: "alignment",
    SessionEvent.TRIAL_RESTORED: "trial",
}


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


def alignment_rows(record: SessionRecord, results: Results | None) -> dict[int, tuple[str, ...]]:
    """Return cells for `ALIGNMENT_COLUMNS`, by the alignment's number.

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
    rows = {}
    for number, alignment in record.alignments.items():
        shifts = solved.get(number, {})
        angle_deg = np.degrees(np.linalg.norm(alignment.rotation_rad))
        alone = [shifts[eye] for eye in EYES if eye in shifts]
        rms = [f"{1e3 * shift.rms_m:.2f}" for shift in alone]
        inliers = [f"{100 * shift.inlier_ratio:.0f}" for shift in alone]
        rows[number] = (
            str(number),
            _eyes_text(alignment.eyes),
            f"{angle_deg:.1f}",
            *(_phi_text(shifts.get(eye)) for eye in EYES),
            " / ".join(rms) or NOTHING,
            " / ".join(inliers) or NOTHING,
            local_time(times[number], _CLOCK),
        )
    return rows


def trials_id(record: SessionRecord) -> tuple[Path, tuple[int, ...]]:
    """Return a key that identifies a session's set of trials; numbers are never reused."""
    return record.path, tuple(record.trials)


def trial_rows(record: SessionRecord) -> dict[int, tuple[str, ...]]:
    """Return cells for `TRIAL_COLUMNS`, by the trial's number."""
    return {
        number: (
            str(number),
            EYE_NAMES[trial.eye],
            f"{trial.target_depth_m:g}",
            f"{trial.error_px.mean():.1f}",
            f"{trial.error_arcmin.mean():.1f}",
            local_time(trial.time, _CLOCK),
        )
        for number, trial in record.trials.items()
    }


def statistics_rows(statistics: TrialStatistics) -> list[Row]:
    """Return rows for `STATISTICS_COLUMNS`: all trials, each eye, each distance."""
    groups: list[tuple[str, ErrorStatistics | None]] = [("All", statistics.total)]
    groups += [(EYE_NAMES[eye], errors) for eye, errors in statistics.by_eye.items()]
    groups += [(f"{depth_m:g} m", errors) for depth_m, errors in statistics.by_depth_m.items()]
    tooltip = "Over all corners of all targets, in arcminutes and in pixels of the display"
    return [
        Row(
            name,
            (
                str(errors.trials),
                f"{errors.arcmin.mean:.1f} ± {errors.arcmin.sd:.1f}",
                f"{errors.arcmin.median:.1f}",
                f"{errors.arcmin.max:.1f}",
                f"{errors.px.mean:.1f} ± {errors.px.sd:.1f}",
            ),
            tooltip,
        )
        for name, errors in groups
        if errors is not None
    ]


def statistics_text(statistics: TrialStatistics) -> str:
    """Return the errors of all trials in one line."""
    total = statistics.total
    if total is None:
        return "No trials yet"
    trials = "1 trial" if total.trials == 1 else f"{total.trials} trials"
    return (
        f"{trials}: {total.arcmin.mean:.1f} ± {total.arcmin.sd:.1f}′, "
        f"median {total.arcmin.median:.1f}′ ({total.px.mean:.1f} ± {total.px.sd:.1f} px)"
    )


def _eyes_text(eyes: Sequence[Eye]) -> str:
    """Return the name of one eye, or of both."""
    return EYE_NAMES[eyes[0]] if len(eyes) == 1 else "Both eyes"


def _phi_text(shift: EyeShift | None) -> str:
    if shift is None:
        return NOTHING
    return " ".join(f"{signed(1e3 * value_m, 2):>6}" for value_m in shift.shift_m)
