"""Speed of a study, with one and with two processes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from handcal.core.progress import Progress
from handcal.lab.bench.figure import BenchFigure
from handcal.lab.bench.settings import BenchSettings
from handcal.lab.bench.trials import Measured
from handcal.lab.study.noise import FLOOR, NoiseSettings, noise_study
from handcal.lab.study.run import Study, run_study
from handcal.lab.study.store import StudyRow

# Each process makes its own hands; in a whole study this time is negligible.
_HANDS = 2
_SPEED_UP = 1.7
_PER_MINUTE = 2000.0


def measure_scale(settings: BenchSettings, progress: Progress) -> Measured:
    """Run a small noise study in this process, then in two, including their start."""
    if not settings.study_trials:
        progress.at(1.0)
        return Measured([], {})
    study = noise_study(
        replace(
            NoiseSettings(),
            trials=settings.study_trials,
            hands=_HANDS,
            shapes=0,
            linear_trials=1,
            paper_trials=0,
        )
    )
    alone_s, _ = _timed(study, 1, progress.part(0.0, 0.6))
    together_s, rows = _timed(study, 2, progress.part(0.6, 1.0))
    solved = sum(row["method"] != FLOOR for row in rows)
    return Measured(
        [
            BenchFigure(
                "noise study: alignments solved a minute, two workers",
                60.0 * solved / together_s,
                "",
                at_least=_PER_MINUTE,
            ),
            BenchFigure(
                "noise study: two workers / one", alone_s / together_s, "", at_least=_SPEED_UP
            ),
        ],
        {
            "alignments": len(study.cases),
            "solved": solved,
            "one_worker_s": alone_s,
            "two_workers_s": together_s,
        },
    )


def _timed(study: Study, workers: int, progress: Progress) -> tuple[float, list[StudyRow]]:
    with TemporaryDirectory() as folder:
        start_s = perf_counter()
        rows = run_study(study, Path(folder), workers=workers, progress=progress)
        return perf_counter() - start_s, rows
