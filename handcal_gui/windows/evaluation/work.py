"""What an evaluation's job does, and what it comes to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import cv2
import numpy as np

from handcal.errors import CancelledError, FileError
from handcal.io.images import read_image
from handcal.lab.study.run import Study, run_study, share_done
from handcal.lab.study.store import Row, free_of_studies
from handcal.report.document import Report
from handcal.report.write import write_report
from handcal.station.doctor import Finding, Health
from handcal.types import UInt8
from handcal_gui.engine.jobs import IsCancelled
from handcal_gui.engine.jobs import Report as Tell
from handcal_gui.windows.evaluation.time_left import TimeLeft

Checkpoint: TypeAlias = Callable[[str, float], None]
"""Told what is going on and the share done; raises CancelledError once it shall end."""

# Of the time that a study takes, and of that which reading takes.
_STUDY_SHARE, _READING_SHARE = 0.95, 0.7


@dataclass(frozen=True, slots=True)
class Standing:
    """How it stands with what was entered, and what the button does about it."""

    finding: Finding
    button: str = "Run"

    @property
    def can_run(self) -> bool:
        """Whether there is anything in the way."""
        return self.finding.health is not Health.BROKEN


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What an evaluation came to."""

    folder: Path
    """Of all its files."""
    report: Report
    pictures: Sequence[UInt8]
    """each (h, w, 3); the report's figures, RGB, as they were written."""


class Evaluation(Protocol):
    """What a page needs of an evaluation; entries are a dataclass with an `output` folder."""

    def standing(self, entries: Any) -> Standing:
        """Look at what was entered; HandcalError says what is wrong with it."""

    def run(self, entries: Any, tell: Tell, is_cancelled: IsCancelled) -> Outcome:
        """Do it; HandcalError says why not."""


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedStudy:
    """A study on simulated wearers; entries name processes and scheduler."""

    study: Callable[[Any], Study]
    """Makes the study of the entries."""
    describe: Callable[[Any, Sequence[Row]], Report]
    """Makes the report of the study's settings and rows."""

    def standing(self, entries: Any) -> Standing:
        """Tell how much of the study the folder holds."""
        folder = output_folder(entries.output)
        share = share_done(self.study(entries), folder)
        if share == 1.0:
            return Standing(_note(f"{folder} holds all of this study"), "Show results")
        if share:
            advice = "what is done is not done again"
            return Standing(
                _note(f"{folder} holds {100 * share:.0f} % of this study", advice), "Go on"
            )
        return Standing(_ready())

    def run(self, entries: Any, tell: Tell, is_cancelled: IsCancelled) -> Outcome:
        """Do what is not done yet, and write the report."""
        study, folder = self.study(entries), output_folder(entries.output)
        count = len(study.cases)
        begun = share_done(study, folder)
        left = TimeLeft(begun)

        def progress(share: float) -> None:
            parts = f"{round(share * count):,} of {count:,} cases", left.at(share)
            tell(", ".join(filter(None, parts)), _STUDY_SHARE * share)

        progress(begun)
        rows = run_study(
            study,
            folder,
            workers=entries.processes or None,
            scheduler=entries.scheduler or None,
            progress=progress,
            is_cancelled=is_cancelled,
        )
        report = self.describe(study.settings, rows)
        return _write(folder, report, _checkpoint(tell, is_cancelled), _STUDY_SHARE)


@dataclass(frozen=True, slots=True, eq=False)
class GivenData:
    """An evaluation of what is in files."""

    missing: Callable[[Any], str]
    """Says what has yet to be entered; empty if nothing has."""
    describe: Callable[[Any, Checkpoint], Report]
    """Reads the files and makes the report, telling a `Checkpoint`."""

    def standing(self, entries: Any) -> Standing:
        """Tell what is missing, and whether an earlier report will be replaced."""
        if missing := self.missing(entries):
            return Standing(Finding("", Health.BROKEN, missing))
        folder = free_of_studies(output_folder(entries.output))
        if (folder / "report.pdf").exists():
            return Standing(_note(f"The report in {folder} will be replaced"))
        return Standing(_ready())

    def run(self, entries: Any, tell: Tell, is_cancelled: IsCancelled) -> Outcome:
        """Read, evaluate, and write the report."""
        folder = free_of_studies(output_folder(entries.output))
        checkpoint = _checkpoint(tell, is_cancelled)
        report = self.describe(
            entries, lambda doing, share: checkpoint(doing, _READING_SHARE * share)
        )
        return _write(folder, report, checkpoint, _READING_SHARE)


def output_folder(text: str) -> Path:
    """Return the folder that was entered; FileError if there is none."""
    if not text:
        raise FileError("choose a folder for the results")
    return Path(text).expanduser().absolute()


def _checkpoint(tell: Tell, is_cancelled: IsCancelled) -> Checkpoint:
    def check(doing: str, share: float) -> None:
        if is_cancelled():
            raise CancelledError("the evaluation was cancelled")
        tell(doing, share)

    return check


def _write(folder: Path, report: Report, checkpoint: Checkpoint, begun: float) -> Outcome:
    def check(share: float) -> None:
        checkpoint("Writing the report", begun + (1.0 - begun) * share)

    write_report(folder, report, check)
    files = [folder / "figures" / f"{figure.name}.png" for figure in report.figures]
    return Outcome(folder, report, [_read(file) for file in files])


def _read(file: Path) -> UInt8:
    return np.asarray(read_image(file, cv2.IMREAD_COLOR)[..., ::-1], np.uint8)


def _note(found: str, advice: str = "") -> Finding:
    return Finding("", Health.LIMITED, found, advice)


def _ready() -> Finding:
    return Finding("", Health.GOOD, "Ready")
