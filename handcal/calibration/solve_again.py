"""Solve a stored session again, with its own or another method, without changing it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from os import PathLike
from pathlib import Path

import numpy as np

from handcal.calibration.lab_prior import rig_numbers
from handcal.calibration.states import CalibrationSettings
from handcal.core.errors import FileError, HandError
from handcal.core.progress import Progress
from handcal.core.types import EYES, METHODS, Eye, EyeDistance, Float64, Method, Rig
from handcal.io.settings import known_settings, read_settings
from handcal.register.prior import LearnedPrior, posterior, widened
from handcal.register.results import Results, SolveSettings, solve_session
from handcal.session.journal import Damage
from handcal.session.repair import SessionCheck, check_session, without_unsolvable
from handcal.session.session import Session, SessionRecord, open_session


def solve(
    session: SessionRecord | str | PathLike[str],
    *,
    method: Method | None = None,
    eye_distance: EyeDistance | None = None,
) -> Results:
    """Solve a stored session's alignments, fuse them and judge the result.

    Parameters
    ----------
    session : SessionRecord or path
        From `handcal.open_session`, or the session's folder; it stays as it is.
    method : {"consistent", "paper", "linear", "icp", "icp-open3d"}, optional
        Solver of each alignment, the session's own if not given. ``paper``: Hu et al. 2021 as
        published. ``linear``: its model with all three rows of each pair. ``consistent``: exact
        factor, and robust to cuts, sampling and a turned hand. ``icp``: rigid, the paper's
        baseline. Its other settings are the session's own.
    eye_distance : EyeDistance, optional
        The wearer's, in place of the one measured in the session, if any.

    Returns
    -------
    Results
        `eyes` holds φ of each solved eye, from C0 to C1 in E's axes, metres, fused from all
        alignments. Equal input gives equal output, bit for bit.

    Raises
    ------
    FileError
        If the folder is not a session, the session has no alignments, none of them can be solved,
        or its settings cannot be read. Those that cannot be solved are left out.
    ValueError
        If the method is unknown.

    Examples
    --------
    >>> import handcal
    >>> session = handcal.example_session()
    >>> results = handcal.solve(session)
    >>> print(results.eyes["left"])
    φ = (+4.20 ± 1.14, -4.39 ± 0.96, +0.91 ± 2.54) mm; rms 1.55 mm, 97 % inliers, converged
    >>> results.verdicts["left"].name
    'accept'
    """
    if method is not None and method not in METHODS:
        raise ValueError(f"unknown method {method!r}: choose from {', '.join(METHODS)}")
    if not isinstance(session, SessionRecord):
        session = open_session(session)
    settings = stored_solve_settings(session)
    if method is not None:
        settings = replace(settings, method=method)
    results = solve_again(session, settings, eye_distance=eye_distance)
    if results is None:
        why = f"; {session.left_out}" if session.left_out else ""
        raise FileError(f"{session.path} holds no alignment to solve{why}")
    return results


def stored_solve_settings(record: SessionRecord) -> SolveSettings:
    """Return the solve settings of a session; FileError if they cannot be read."""
    where = f"{record.path / 'settings.json'}: calibration"
    stored = known_settings(CalibrationSettings, record.settings.get("calibration", {}))
    return read_settings(CalibrationSettings, stored, where).solve


def solve_again(
    record: SessionRecord,
    settings: SolveSettings,
    progress: Progress = Progress(),
    eye_distance: EyeDistance | None = None,
) -> Results | None:
    """Return the results of `solve_sound`, with its parameters and errors."""
    return solve_sound(record, settings, progress, eye_distance)[1]


def solve_sound(
    record: SessionRecord,
    settings: SolveSettings,
    progress: Progress = Progress(),
    eye_distance: EyeDistance | None = None,
) -> tuple[SessionRecord, Results | None]:
    """Solve the alignments of a session that can be solved.

    Parameters
    ----------
    record : SessionRecord
    settings : SolveSettings
    progress : Progress
        As in `solve_session`.
    eye_distance : EyeDistance, optional
        The wearer's, in place of the session's own.

    Returns
    -------
    SessionRecord
        Without the alignments that cannot be solved, which its `damaged` names.
    Results or None
        None if there is nothing to solve.

    Raises
    ------
    FileError
        If none of the alignments can be solved.
    CancelledError
        If it was cancelled.
    """
    if not record.is_solvable:
        return record, None
    try:
        return record, solve_contents(record, settings, progress, eye_distance)
    except (ValueError, HandError) as error:
        rest = without_unsolvable(record, settings, progress)
        if rest is record or not rest.is_solvable:
            raise FileError(f"{record.path} cannot be solved: {error}") from error
        return solve_sound(rest, settings, progress, eye_distance)


def check_solvable(path: Path) -> SessionCheck:
    """Return whether a session is sound and can be solved, with all that is not."""
    check = check_session(path)
    if check.state == "none":
        return check
    record = Session.open(path)
    try:
        damaged = solve_sound(record, stored_solve_settings(record))[0].damaged
    except FileError as error:
        damaged = (*check.damaged, Damage("results.json", None, f"there can be none: {error}"))
    return SessionCheck("damaged" if damaged else "sound", damaged)


def solve_contents(
    record: SessionRecord,
    settings: SolveSettings,
    progress: Progress = Progress(),
    eye_distance: EyeDistance | None = None,
) -> Results:
    """Return the results of all that a session holds; parameters as in `solve_again`.

    Raises
    ------
    ValueError
        If there is nothing to solve, or an alignment cannot be solved.
    CancelledError
        If it was cancelled.
    """
    return solve_session(
        record.alignments,
        record.rig,
        settings,
        progress,
        eye_distance=eye_distance or record.facts.eye_distance,
        contradictions=record.facts.contradictions,
        verified=record.facts.verified,
        plan="recommended" if record.facts.plan == "recommended" else None,
        usable_eyes=record.facts.usable_eyes,
    )


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
    faulty = [verdict for verdict in results.verdicts.values() if verdict.name in _FAULTY]
    if faulty:
        raise FileError(f"{path} is not a calibration to start from. {faulty[0].reason}")
    fused = results.fused
    known = [one.at(fused.wearer_scale) for one in fused.all_observed]
    mean_m, covariance_m2 = posterior(fused.prior, known)
    shift_m = {eye: np.zeros(3) for eye in EYES} | dict(record.applied_shift_m)
    return Former(shift_m, widened(mean_m[:6], covariance_m2[:6, :6], SLIP_M))


_FAULTY = ("contradicted", "implausible")
