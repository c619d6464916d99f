"""Solve a stored session again, with its own or another method, without changing it."""

from __future__ import annotations

from handcal.errors import FileError
from handcal.io.settings import read_settings
from handcal.progress import Progress
from handcal.register.results import Results, SolveSettings, solve_session
from handcal.session.session import SessionRecord
from handcal.station.procedure import CalibrationSettings


def stored_solve_settings(record: SessionRecord) -> SolveSettings:
    """Return the solve settings of a session; FileError if they cannot be read."""
    where = f"{record.path / 'settings.json'}: calibration"
    return read_settings(CalibrationSettings, record.settings.get("calibration", {}), where).solve


def solve_again(
    record: SessionRecord, settings: SolveSettings, progress: Progress = Progress()
) -> Results | None:
    """Return the results of a session's alignments; None if there are none.

    Parameters
    ----------
    record : SessionRecord
    settings : SolveSettings
    progress : Progress
        As in `solve_session`.

    Raises
    ------
    FileError
        If an alignment cannot be solved.
    CancelledError
        If it was cancelled.
    """
    if not record.alignments:
        return None
    try:
        return solve_session(record.alignments, record.rig, settings, progress)
    except ValueError as error:
        raise FileError(f"{record.path} cannot be solved: {error}") from error
