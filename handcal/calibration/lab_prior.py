"""The priors learned from a lab's finished sessions with one rig.

Where wearers' eyes are, and what wearers see wrongly in a whole sitting, are two things.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path

import numpy as np

from handcal.core.errors import FileError
from handcal.core.progress import Progress
from handcal.core.types import EYES, EyeDistance, Float64, Rig
from handcal.io.files import modified_s
from handcal.register.prior import (
    LearnedPrior,
    Observed,
    PriorSettings,
    learn_prior,
    observe_eye_distance,
)
from handcal.register.results import RESULTS_VERSION
from handcal.register.sitting import SittingSettings, sitting_prior
from handcal.rig.rig_file import read_rig
from handcal.session.journal import find_journals
from handcal.session.record import replay
from handcal.session.state import read_facts

MAX_SESSIONS = 300
"""Only the newest sessions count: a headset's fit and a lab's wearers change."""
_MAX_OBSERVATIONS = 100
_OBSERVED_SHAPES = {"H": (3, 12), "seen_m": (3,), "covariance_m2": (3, 3)}


@dataclass(frozen=True, slots=True)
class LabPrior:
    """A prior learned from the sessions in a folder."""

    learned: LearnedPrior | None
    """None if there are too few sessions."""
    repeated: tuple[tuple[list[Observed], ...], ...]
    """The observations of each sitting of each person with more than one, from which
    `handcal.register.prior` learns."""
    used: int
    """Number of sessions that `learned` was, or would be, learned from."""
    left_out: Mapping[str, int]
    """Number of other sessions by the reason why they do not count."""


def run_learn_prior(
    folder: Path, rig: Rig, settings: PriorSettings, progress: Progress = Progress()
) -> LabPrior:
    """Learn the prior from the finished sessions in a folder that used one rig.

    A session counts once, with its newest results. For where eyes are, a wearer with several
    sessions counts with the newest only; what wearers see wrongly is learned from all sessions of
    wearers with several. A session whose result was contradicted or implausible does not count.

    Parameters
    ----------
    folder : Path
        It holds a folder for each session; it may be missing.
    rig : Rig
        Its numbers must be those of the session's own rig.
    settings : PriorSettings
    progress : Progress
        Reported to before each session.

    Raises
    ------
    CancelledError
        If it was cancelled.
    """
    journals = sorted(find_journals(folder), key=modified_s, reverse=True)[:MAX_SESSIONS]
    sittings_read: list[tuple[str, str, list[Observed]]] = []
    left_out: Counter[str] = Counter()
    for number, journal in enumerate(journals):
        progress.at(number / len(journals), f"Reading session {number + 1} of {len(journals)}")
        try:
            sittings_read.append(_read_session(journal, rig))
        except _NotUsableError as reason:
            left_out[str(reason)] += 1
    # By their start: a corrected name or saved notes change a journal later.
    newest = {wearer: observed for _, wearer, observed in sorted(sittings_read, key=itemgetter(0))}
    if len(newest) < len(sittings_read):
        left_out["earlier sessions of the same wearer"] = len(sittings_read) - len(newest)
    by_person: dict[str, list[list[Observed]]] = {}
    for _, wearer, observed in sittings_read:
        by_person.setdefault(wearer, []).append(observed)
    return LabPrior(
        learn_prior(list(newest.values()), settings, sitting_prior(rig, SittingSettings())),
        tuple(tuple(sittings) for sittings in by_person.values() if len(sittings) > 1),
        len(newest),
        left_out,
    )


class _NotUsableError(Exception):
    """A session that does not count; the text says why."""


def _read_session(journal: Path, rig: Rig) -> tuple[str, str, list[Observed]]:
    """Return a session's start, its wearer, and its observations with a measured eye distance.

    A wearer without a name is known by the start, which a repaired copy has in common.
    """
    try:
        replayed = replay(journal.parent)
        is_same_rig = rig_numbers(read_rig(journal.with_name("rig.yaml"))) == rig_numbers(rig)
    except FileError:
        raise _NotUsableError("not readable") from None
    state, started = replayed.state, replayed.journal.events[0].time
    if not is_same_rig:
        raise _NotUsableError("of another rig")
    if not state.is_finished:
        raise _NotUsableError("not finished")
    if state.results is None or not state.is_solved:
        raise _NotUsableError("not solved")
    if state.results.get("version") != RESULTS_VERSION:
        raise _NotUsableError("solved by another version")
    eyes = state.results.get("eyes")
    verdicts = [eye.get("verdict") for eye in eyes.values()] if isinstance(eyes, dict) else []
    if "contradicted" in verdicts or "implausible" in verdicts:
        raise _NotUsableError("contradicted or implausible")
    observed = _observations(state.results.get("observed"))
    if (eye_distance := _eye_distance(state.results.get("measured_eye_distance"))) is not None:
        observed.append(observe_eye_distance(rig, eye_distance, np.zeros(6)))
    return started, state.wearer or started, observed


def rig_numbers(rig: Rig) -> list[list[float]]:
    """Return the numbers of a rig that an eye shift depends on."""
    arrays: list[Float64] = [rig.T_H_D]
    for eye in EYES:
        display = rig.eyes[eye]
        arrays += [display.K, display.H0, display.t_C0_V_m, display.T_V_H]
        arrays.append(np.array([display.z_C0_S_m]))
    return [np.round(array, 9).ravel().tolist() for array in arrays]


def _eye_distance(stored: object) -> EyeDistance | None:
    """Return an eye distance from JSON, if there is one; `_NotUsableError` if it is damaged."""
    if stored is None:
        return None
    try:
        return read_facts(EyeDistance, stored)
    except ValueError:
        raise _NotUsableError("not readable") from None


def _observations(stored: object) -> list[Observed]:
    """Return observations from JSON; `_NotUsableError` if they are missing or damaged."""
    if not isinstance(stored, list) or not 0 < len(stored) <= _MAX_OBSERVATIONS:
        raise _NotUsableError("not readable")
    try:
        observed = [
            tuple(np.array(row[name], dtype=np.float64) for name in _OBSERVED_SHAPES)
            for row in stored
        ]
    except (KeyError, TypeError, ValueError):
        raise _NotUsableError("not readable") from None
    for H, seen_m, covariance_m2 in observed:
        shapes = tuple(part.shape for part in (H, seen_m, covariance_m2))
        if (
            shapes != tuple(_OBSERVED_SHAPES.values())
            or not all(np.isfinite(part).all() for part in (H, seen_m, covariance_m2))
            or np.linalg.eigvalsh(covariance_m2)[0] <= 0.0
        ):
            raise _NotUsableError("not readable")
    return [(H, seen_m, covariance_m2) for H, seen_m, covariance_m2 in observed]
