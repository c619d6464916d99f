"""The outcome of a session, computed once for all formats: results and applied calibrations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from handcal.calibration.solve_again import solve_sound, stored_solve_settings
from handcal.core.display import projection_matrix
from handcal.core.progress import Progress
from handcal.core.types import EYES, Eye, Float64, Projection
from handcal.register.results import Results, SolveSettings
from handcal.session.session import SessionRecord
from handcal.session.trial import SAME_SHIFT_M

ShiftOrigin: TypeAlias = Literal["fine_tuned", "solved", "offline"]

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
    shifts_m: Mapping[Eye, Mapping[ShiftOrigin, Float64]]
    """each (3,); every known φ of an eye, the final one first: fine-tuned by hand if that changed
    it, solved, and the zero of the offline calibration, which precedes the solved one if the
    verdict is *keep*."""

    @property
    def name(self) -> str:
        """The name of the session's folder."""
        return printable(self.record.path.absolute().name)

    @property
    def started(self) -> str:
        """Time of the session's creation, UTC, ISO 8601."""
        return printable(self.record.events[0].time)

    def final(self, eye: Eye) -> ShiftOrigin:
        """Return the origin of the eye's final φ."""
        return next(iter(self.shifts_m[eye]))

    def final_shift_m(self, eye: Eye) -> Float64:
        """Return the eye's final φ, (3,)."""
        return self.shifts_m[eye][self.final(eye)]

    def is_applied(self, eye: Eye, origin: ShiftOrigin) -> bool:
        """Return whether the headset rendered with this φ of the eye at the end."""
        last_m = self.record.applied_shift_m.get(eye, np.zeros(3))
        return bool(np.abs(last_m - self.shifts_m[eye][origin]).max() < SAME_SHIFT_M)

    def projection(self, eye: Eye, origin: ShiftOrigin) -> Projection:
        """Return the projection of an eye for one of its φ."""
        display = self.record.rig.eyes[eye]
        P = projection_matrix(display, self.shifts_m[eye][origin])
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
    return SessionOutcome(
        record, settings, results, {eye: _shifts_m(record, results, eye) for eye in EYES}
    )


def printable(text: str) -> str:
    """Return an untrusted text as one line that is valid in every format."""
    return "".join(char if char.isprintable() else "\ufffd" for char in text[:_MAX_CHARACTERS])


def _shifts_m(
    record: SessionRecord, results: Results | None, eye: Eye
) -> dict[ShiftOrigin, Float64]:
    shifts_m: dict[ShiftOrigin, Float64] = {}
    if results is not None and eye in results.eyes:
        if results.verdicts[eye].name == "keep":
            shifts_m["offline"] = np.zeros(3)
        shifts_m["solved"] = results.eyes[eye].shift_m
    shifts_m.setdefault("offline", np.zeros(3))
    if record.fine_tuned is not None and eye in record.fine_tuned:
        tuned_m = record.fine_tuned[eye]  # recorded of both eyes, and after an undo
        if np.abs(tuned_m - next(iter(shifts_m.values()))).max() >= SAME_SHIFT_M:
            return {"fine_tuned": tuned_m, **shifts_m}
    return shifts_m
