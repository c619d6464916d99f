"""A stored session to start from: a wearer who comes back, or a headset that has slipped.

The new session draws with the stored φ, which the wearer verifies first. The stored posterior,
widened by how differently a headset may sit, is the prior. So one verification of each eye may
be enough; if it is not, alignments follow.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from handcal.calibration.lab_prior import rig_numbers
from handcal.calibration.solve_again import solve_again, stored_solve_settings
from handcal.core.errors import FileError
from handcal.core.types import EYES, Eye, Float64, Rig
from handcal.register.prior import LearnedPrior, posterior, widened
from handcal.session.session import Session, SessionRecord

SLIP_M = (0.002, 0.0015, 0.003)
"""Change of a headset's fit when the same wearer puts it on again, standard deviation along
E's axes. As much as the simulated wearers differ; for a real headset it is not known."""
LONGEST_WORN = timedelta(hours=2)
"""Nobody can tell after this time without an event that the headset stayed where it was."""


@dataclass(frozen=True, slots=True, eq=False)
class Former:
    """The end of a stored session."""

    shift_m: Mapping[Eye, Float64] = field(default_factory=dict)
    """each (3,); φ that the headset rendered with last, solved or set by hand."""
    prior: LearnedPrior | None = None
    """Prior of the eyes after the headset was moved; None if there is no stored session."""


def may_still_be_worn(record: SessionRecord, now: datetime | None = None) -> bool:
    """Return whether the headset may still sit as when the session's last event was recorded.

    If it does not, φ is no longer that of the eyes: another session begins from this one.
    """
    last = datetime.fromisoformat(record.events[-1].time)
    return (now or datetime.now(UTC)) - last <= LONGEST_WORN


def end_former(path: Path) -> None:
    """Finish the session from which another one began; it is not offered to be resumed again."""
    with Session(path) as session:
        if not session.contents.is_finished:
            session.finish()


def read_former(path: Path, rig: Rig) -> Former:
    """Read the session that another one starts from.

    Raises
    ------
    FileError
        If the session cannot be read or solved, was contradicted, or is of another rig.
    """
    record = Session.open(path)
    if rig_numbers(record.rig) != rig_numbers(rig):
        raise FileError(f"{path} was calibrated with another rig", "start without it")
    results = solve_again(record, stored_solve_settings(record))
    if results is None:
        raise FileError(f"{path} has no alignment", "start without it")
    faulty = [one for one in results.verdicts.values() if one.name in _FAULTY]
    if faulty:
        raise FileError(f"{path} is not a calibration to start from: {faulty[0].reason}")
    fused = results.fused
    known = [one.at(fused.wearer_scale) for one in fused.all_observed]
    mean_m, covariance_m2 = posterior(fused.prior, known)
    shift_m = {eye: np.zeros(3) for eye in EYES} | dict(record.applied_shift_m)
    return Former(shift_m, widened(mean_m[:6], covariance_m2[:6, :6], SLIP_M))


_FAULTY = ("contradicted", "implausible")
