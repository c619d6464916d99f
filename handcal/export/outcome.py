"""The outcome of a session, computed once for all formats: results and applied calibrations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handcal.calibration.solve_again import solve_sound, stored_solve_settings
from handcal.core.display import projection_matrix
from handcal.core.progress import Progress
from handcal.core.types import Eye, Float64, Projection
from handcal.register.results import Results, SolveSettings
from handcal.session.drawn import (
    DrawnShift,
    ShiftKind,
    drawn_error_arcmin,
    drawn_shifts,
    is_verified,
)
from handcal.session.record import eye_trials
from handcal.session.session import SessionRecord
from handcal.session.trial import SAME_SHIFT_M, EyeTrials

_MAX_CHARACTERS = 1000


@dataclass(frozen=True, slots=True, eq=False)
class SessionOutcome:
    """A session and its results, including residuals and histories, which are not stored."""

    record: SessionRecord
    """Without alignments that cannot be solved."""
    settings: SolveSettings
    """The session's own."""
    results: Results | None
    """All alignments solved again; None without alignments."""
    drawn: Mapping[Eye, DrawnShift]
    """The final φ of each eye."""

    @property
    def shifts_m(self) -> dict[Eye, dict[ShiftKind, Float64]]:
        """Each (3,); every known φ of an eye: the final one first, then solved and offline."""
        shifts_m: dict[Eye, dict[ShiftKind, Float64]] = {}
        for eye, drawn in self.drawn.items():
            shifts_m[eye] = {drawn.kind: drawn.shift_m}
            if self.results is not None and eye in self.results.eyes:
                shifts_m[eye].setdefault("solved", self.results.eyes[eye].shift_m)
            shifts_m[eye].setdefault("offline", np.zeros(3))
        return shifts_m

    @property
    def trials(self) -> dict[Eye, EyeTrials]:
        """The user-test trials of the calibrated φ, of each eye that has some."""
        if self.results is None:
            return {}
        return eye_trials(self.results, self.record, self.settings.verdict.target_arcmin)

    @property
    def name(self) -> str:
        """The name of the session's folder."""
        return printable(self.record.path.absolute().name)

    @property
    def started(self) -> str:
        """Time of the session's creation, UTC, ISO 8601."""
        return printable(self.record.events[0].time)

    def is_applied(self, eye: Eye, kind: ShiftKind) -> bool:
        """Return whether the headset rendered with this φ of the eye at the end."""
        last_m = self.record.applied_shift_m.get(eye, np.zeros(3))
        return bool(np.abs(last_m - self.shifts_m[eye][kind]).max() < SAME_SHIFT_M)

    def is_verified(self, eye: Eye) -> bool:
        """Return whether the wearer verified what is final, with the present alignments."""
        return self.results is not None and is_verified(
            self.record, self.results, eye, self.drawn[eye].kind
        )

    def expected_arcmin(self, eye: Eye, kind: ShiftKind) -> float | None:
        """Return the error expected of drawing with a φ of the eye; None if nothing is solved."""
        if self.results is None or eye not in self.results.eyes:
            return None
        shift = DrawnShift(kind, self.shifts_m[eye][kind], is_drawn=self.is_applied(eye, kind))
        return drawn_error_arcmin(self.results, self.record.rig.eyes[eye], eye, shift)

    def projection(self, eye: Eye, kind: ShiftKind | None = None) -> Projection:
        """Return the projection of an eye for one of its φ, by default the final one."""
        display = self.record.rig.eyes[eye]
        P = projection_matrix(display, self.shifts_m[eye][kind or self.drawn[eye].kind])
        return Projection(eye, P, display.width_px, display.height_px)


def load_outcome(record: SessionRecord, progress: Progress = Progress()) -> SessionOutcome:
    """Solve a session's alignments again, with its own settings.

    Parameters
    ----------
    record : SessionRecord
    progress : Progress
        Reported to before each alignment.

    Raises
    ------
    FileError
        If its settings are unreadable or no alignment can be solved.
    """
    settings = stored_solve_settings(record)
    record, results = solve_sound(record, settings, progress)
    return SessionOutcome(record, settings, results, drawn_shifts(record, results))


def printable(text: str) -> str:
    """Return an untrusted text as one line that is valid in every format."""
    return "".join(char if char.isprintable() else "\ufffd" for char in text[:_MAX_CHARACTERS])
