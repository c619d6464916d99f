"""Studies on simulated wearers: run or resumed, and reported."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

from handcal.core.progress import Progress
from handcal.io.files import make_folder
from handcal.lab.settings import (
    MethodComparisonSettings,
    NoiseStudySettings,
    ProcedureStudySettings,
    output_folder,
)
from handcal.lab.study.methods import (
    QUICK_METHODS,
    MethodSettings,
    NoiseFit,
    fit_noise,
    methods_study,
)
from handcal.lab.study.methods_report import methods_report
from handcal.lab.study.noise import QUICK_NOISE, NoiseSettings, noise_study
from handcal.lab.study.noise_report import noise_report
from handcal.lab.study.procedures import (
    ProcedureRow,
    learn_sittings,
    procedure_cases,
    procedure_rows,
    sitting_cases,
)
from handcal.lab.study.run import Study, resumable, run_study
from handcal.lab.study.store import StudyRow
from handcal.lab.study.trials import BEST_ITERATE
from handcal.report.document import Report
from handcal.report.write import write_report
from handcal.sim.people import Variant

_OTHERS = 2_000_003
"""Added to the seed for people who are not judged."""
STUDY_SHARE = 0.95
"""Share of the time that the cases take; the rest is the report."""


@dataclass(frozen=True, slots=True, eq=False)
class StudyResult:
    """The report of a study, as it was written."""

    report: Report
    files: tuple[Path, ...]
    """The report as PDF and as HTML."""
    noise: NoiseFit | None = None
    """Result of the search for the noise; None without a search."""
    best_noise: NoiseFit | None = None
    """The same, by the best iterate of the paper's method."""


def run_noise_study(settings: NoiseStudySettings, progress: Progress) -> StudyResult:
    """Run or resume a noise study and write its report; as `run_and_report`."""
    return run_and_report(noise_cases(settings), noise_report, settings, progress)


def run_method_comparison(settings: MethodComparisonSettings, progress: Progress) -> StudyResult:
    """Run or resume a method comparison and write its report; as `run_and_report`.

    Raises
    ------
    HandcalError
        If the paper's method has its published error at no noise.
    """
    study = method_cases(settings)
    if not settings.noise_wearers:
        return run_and_report(study, methods_report, settings, progress)
    searching = study.settings, settings.noise_wearers, progress.part(0.0, 0.0)
    noise, best = fit_noise(*searching), fit_noise(*searching, BEST_ITERATE)
    study = methods_study(replace(study.settings, noise_scale=noise.scale))
    result = run_and_report(study, methods_report, settings, progress)
    return replace(result, noise=noise, best_noise=best)


def run_procedure_study(settings: ProcedureStudySettings, progress: Progress) -> list[ProcedureRow]:
    """Run or resume a study of procedures.

    Raises
    ------
    HandcalError
        If a plan, variant or scale is unknown; otherwise as `run_study`.
    """
    study = procedure_cases(settings, progress)
    with TemporaryDirectory() as scratch:
        folder = output_folder(settings.output) if settings.output else Path(scratch)
        run = partial(
            run_study,
            workers=settings.processes or None,
            scheduler=settings.scheduler or None,
        )
        if settings.wearer_prior == "learned":
            progress, learning = progress.part(0.5, 1.0), progress.part(0.0, 0.5)
            sittings = {}
            for variant in dict.fromkeys(cast("Variant", case["variant"]) for case in study.cases):
                others = sitting_cases(
                    replace(study.settings, seed=settings.seed + _OTHERS),
                    variant,
                    settings.scales[0],
                )
                rows = run(
                    others, make_folder(folder / f"sittings-{variant}", folder), progress=learning
                )
                sittings[variant] = learn_sittings(rows)
            study = replace(study, settings=replace(study.settings, sittings=sittings))
        rows = run(study, make_folder(folder / "procedures", folder), progress=progress)
    return procedure_rows(rows)


def noise_cases(settings: NoiseStudySettings) -> Study:
    """Return the noise study that the settings describe."""
    chosen = QUICK_NOISE if settings.size == "quick" else NoiseSettings()
    return noise_study(replace(chosen, seed=settings.seed, open3d=settings.open3d))


def method_cases(settings: MethodComparisonSettings) -> Study:
    """Return the method comparison that the settings describe, with the usual noise."""
    chosen = QUICK_METHODS if settings.size == "quick" else MethodSettings()
    return methods_study(replace(chosen, wearers=settings.wearers, seed=settings.seed))


def run_and_report(
    study: Study,
    report_of: Callable[[Any, Sequence[StudyRow]], Report],
    settings: NoiseStudySettings | MethodComparisonSettings,
    progress: Progress,
) -> StudyResult:
    """Run a study, or what is left of it, and write its report.

    Parameters
    ----------
    study : Study
    report_of : callable
        Makes the report from the study's settings and rows.
    settings : NoiseStudySettings or MethodComparisonSettings
        Only `processes`, `scheduler` and `output` are used.
    progress : Progress

    Raises
    ------
    CancelledError
        If the study is to end; completed chunks of cases are kept.
    FileError
        If the folder holds another study, or cannot be read or written.
    HandcalError
        If the cluster cannot be reached, or a worker died.
    """
    folder = output_folder(settings.output)
    rows = run_study(
        study,
        folder,
        workers=settings.processes or None,
        scheduler=settings.scheduler or None,
        progress=progress.part(0.0, STUDY_SHARE),
    )
    report = report_of(study.settings, rows)
    if settings.size == "quick":
        report = replace(report, lead="A quick look: too few trials for figures to report.")
    writing = progress.part(STUDY_SHARE, 1.0, "Writing the report")
    with resumable():
        files = write_report(folder, report, writing)
    return StudyResult(report, files)
