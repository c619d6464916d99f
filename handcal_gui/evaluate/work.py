"""Jobs of the evaluation window: checks of their inputs, their work and their results."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import cv2
import numpy as np

from handcal.core.progress import Progress
from handcal.core.types import UInt8
from handcal.io.files import require_writable
from handcal.io.images import read_image
from handcal.lab.settings import output_folder
from handcal.report.document import Report
from handcal.station.checks.doctor import Finding, Health
from handcal_gui.app.translation import tr

if TYPE_CHECKING:
    from handcal.lab.study.run import Study

_MINUTE_S = 60.0


@dataclass(frozen=True, slots=True)
class Readiness:
    """State of an evaluation for given entries, and the text of its button."""

    finding: Finding
    button: str = tr("Run")
    is_done: bool = False
    """True if a run would only show what is stored."""

    @property
    def can_run(self) -> bool:
        """True if the evaluation can be run."""
        return self.finding.health is not Health.BROKEN


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """The result of an evaluation."""

    folder: Path
    """Folder of all its files."""
    report: Report
    pictures: Sequence[UInt8]
    """The report's figures as written to file, each (h, w, 3), RGB."""


class HasReport(Protocol):
    """Result of an evaluation whose report was written to the entered folder."""

    @property
    def report(self) -> Report:
        """The report."""


class Evaluation(Protocol):
    """Interface of an evaluation; its entries are a dataclass with an `output` folder."""

    @property
    def kept(self) -> str:
        """Sentence that says what of a cancelled evaluation is kept."""

    def readiness(self, entries: Any) -> Readiness:
        """Check the entries; raise HandcalError if they are wrong."""

    def run(self, entries: Any, progress: Progress) -> Outcome:
        """Run the evaluation; raise HandcalError if it fails."""


@dataclass(frozen=True, slots=True, eq=False)
class StudyEvaluation:
    """A study on simulated wearers; entries are its settings."""

    study: Callable[[Any], Study]
    """Returns the cases for given settings."""
    order: Callable[[Any, Progress], HasReport]
    """Runs or resumes the study and writes its report."""
    kept: str = tr("If it is cancelled, its finished parts are kept.")

    def readiness(self, entries: Any) -> Readiness:
        """Return how much of the study the folder contains."""
        from handcal.lab.study.run import share_done

        folder = output_folder(entries.output)
        share = share_done(self.study(entries), folder)
        if share == 1.0:
            found = tr("{} contains the complete study").format(folder)
            return Readiness(Finding("", Health.GOOD, found), tr("Show results"), is_done=True)
        require_writable(folder)
        if share:
            advice = tr("completed trials are kept")
            return Readiness(
                _note(tr("{} holds {:.0f} % of this study").format(folder, 100 * share), advice),
                tr("Resume"),
            )
        return Readiness(_ready())

    def run(self, entries: Any, progress: Progress) -> Outcome:
        """Run or resume the study, and report its progress with the remaining time."""
        from handcal.lab.study.run import RUNNING, share_done
        from handcal.lab.study.studies import STUDY_SHARE

        study, folder = self.study(entries), output_folder(entries.output)
        count, begun, start_s = len(study.cases), share_done(study, folder), time.monotonic()

        def report(doing: str, share: float) -> None:
            if doing == RUNNING:
                done = share / STUDY_SHARE
                parts = (
                    tr("{:,} of {:,} cases").format(round(done * count), count),
                    time_left(time.monotonic() - start_s, done, begun),
                )
                doing = ", ".join(filter(None, parts))
            progress.report(doing, share)

        return _outcome(folder, self.order(entries, replace(progress, report=report)))


@dataclass(frozen=True, slots=True, eq=False)
class FileEvaluation:
    """An evaluation of data in files."""

    missing: Callable[[Any], str]
    """Returns a request for missing entries; empty if there are none."""
    order: Callable[[Any, Progress], HasReport]
    """Evaluates the files and writes the report."""
    kept: str = tr("If it is cancelled, the next run starts from the beginning.")

    def readiness(self, entries: Any) -> Readiness:
        """Return which entry is missing, or whether an earlier report will be replaced."""
        from handcal.lab.study.store import free_of_studies

        if missing := self.missing(entries):
            return Readiness(Finding("", Health.BROKEN, missing))
        folder = free_of_studies(output_folder(entries.output))
        require_writable(folder)
        if (folder / "report.pdf").exists():
            return Readiness(_note(tr("The report in {} will be replaced").format(folder)))
        return Readiness(_ready())

    def run(self, entries: Any, progress: Progress) -> Outcome:
        """Evaluate the files and write the report."""
        return _outcome(output_folder(entries.output), self.order(entries, progress))


def time_left(elapsed_s: float, share: float, begun: float = 0.0) -> str:
    """Return the remaining time in words; empty until more is done than when it began.

    Parameters
    ----------
    elapsed_s : float
    share, begun : float
        Share that is done now, and that was at the beginning.
    """
    if share <= begun:
        return ""
    left_s = elapsed_s * (1.0 - share) / (share - begun)
    if left_s < _MINUTE_S:
        return tr("less than a minute left")
    hours, minutes = divmod(round(left_s / _MINUTE_S), 60)
    if hours:
        return tr("about {} h {} min left").format(hours, minutes)
    return tr("about {} min left").format(minutes)


def _outcome(folder: Path, reported: HasReport) -> Outcome:
    figures = reported.report.figures
    files = [folder / "figures" / f"{figure.name}.png" for figure in figures]
    return Outcome(folder, reported.report, [_read(file) for file in files])


def _read(file: Path) -> UInt8:
    return np.asarray(read_image(file, cv2.IMREAD_COLOR)[..., ::-1], np.uint8)


def _note(found: str, advice: str = "") -> Finding:
    return Finding("", Health.LIMITED, found, advice)


def _ready() -> Finding:
    return Finding("", Health.GOOD, tr("Ready"))
