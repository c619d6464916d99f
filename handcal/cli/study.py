"""``handcal study``: studies on simulated wearers, in many processes, with a report."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.cli.output import console, progress, save, table, until_interrupted
from handcal.cli.terminal import Option, arg, command, fail, number
from handcal.errors import CancelledError

if TYPE_CHECKING:
    from handcal.lab.study.run import Study
    from handcal.lab.study.store import Row
    from handcal.report.document import Report


def _study_options(name: str) -> tuple[Option, ...]:
    return (
        arg(
            "--output",
            type=Path,
            metavar="FOLDER",
            default=Path(f"results/study-{name}"),
            help="folder for this study only; an unfinished study is resumed",
        ),
        arg(
            "--workers",
            type=number(int, 1, 1024),
            metavar="N",
            help="number of processes (default: one per core)",
        ),
        arg(
            "--scheduler",
            metavar="ADDRESS",
            help="Dask cluster to run on, such as tcp://HOST:PORT (default: this computer)",
        ),
        arg(
            "--seed",
            type=number(int, 0, 2**32 - 1),
            metavar="N",
            default=1,
            help="random seed of the whole study",
        ),
        arg("--quick", action="store_true", help="few trials: do not report the figures"),
    )


@command(*_study_options("noise"), json=True)
def noise(arguments: argparse.Namespace) -> None:
    """Repeat the paper's simulation, and add disturbances that it left out."""
    from handcal.lab.study.noise import QUICK_NOISE, NoiseSettings, noise_study
    from handcal.lab.study.noise_report import noise_report

    chosen = QUICK_NOISE if arguments.quick else NoiseSettings()
    settings = replace(chosen, seed=arguments.seed)
    _run(arguments, noise_study(settings), lambda rows: noise_report(settings, rows))


@command(
    arg(
        "--wearers",
        type=number(int, 2, 10_000),
        metavar="N",
        help="simulated wearers in each population (default: the study's own number)",
    ),
    arg(
        "--fit-noise",
        type=number(int, 2, 1000),
        metavar="N",
        help="first find the noise at which the paper's method has its published error, with N "
        "wearers",
    ),
    *_study_options("methods"),
    json=True,
)
def methods(arguments: argparse.Namespace) -> None:
    """Compare calibration methods on the same simulated wearers."""
    from handcal.lab.study.methods import QUICK_METHODS, MethodSettings, methods_study
    from handcal.lab.study.methods_report import methods_report
    from handcal.lab.study.wearer_noise import fit_noise

    settings = replace(
        QUICK_METHODS if arguments.quick else MethodSettings(),
        seed=arguments.seed,
    )
    if arguments.wearers is not None:
        settings = replace(settings, wearers=arguments.wearers)
    if arguments.fit_noise is not None:
        with progress() as say:
            found = fit_noise(
                settings,
                arguments.fit_noise,
                lambda scale, mean_arcmin: say(f"Noise {scale:.2f}: {mean_arcmin:.1f}′", 0.0),
            )
        console.print(
            f"Noise {found.scale:.2f}: the paper's method errs by "
            f"{found.mean_arcmin:.1f} ± {found.sd_arcmin:.1f}′ (± SD)"
        )
        settings = replace(settings, noise_scale=found.scale)
    _run(arguments, methods_study(settings), lambda rows: methods_report(settings, rows))


@command(
    arg("folder", type=Path, help="folder 'dataset' of github.com/YutaItoh/HMD-Calibration"),
    json=True,
)
def recorded(arguments: argparse.Namespace) -> None:
    """Run SPAAM and INDICA on the public recordings of Itoh and Klinker."""
    from handcal.lab.study.recorded import evaluate_recordings, read_recordings

    results = evaluate_recordings(read_recordings(arguments.folder))
    save(arguments.json, {name: asdict(result) for name, result in results.items()})
    shown = table("", "SPAAM", "authors'", "apart", "recycled", "full", "pointing σ")
    for name, found in results.items():
        shown.add_row(
            name,
            *(f"{found.spaam_px:.2f}", f"{found.authors_spaam_px:.2f}"),
            f"{found.difference_px:.5f}",
            *(f"{found.recycled_px:.2f}", f"{found.full_px:.2f}"),
            f"{found.pointing_sigma_arcmin:.1f}′",
        )
    console.print("Mean errors of SPAAM, ours and the authors', and of INDICA's two setups, in px.")
    console.print(shown)


def _run(
    arguments: argparse.Namespace, study: Study, report_of: Callable[[Sequence[Row]], Report]
) -> None:
    """Run a study until it is done or Ctrl+C is pressed, and write its report."""
    from handcal.lab.study.run import run_study
    from handcal.report.write import write_report

    try:
        with until_interrupted() as is_cancelled, progress() as say:
            rows = run_study(
                study,
                arguments.output,
                workers=arguments.workers,
                scheduler=arguments.scheduler,
                progress=lambda share: say("Doing the trials", share),
                is_cancelled=is_cancelled,
            )
    except CancelledError as error:
        fail(str(error), 130)
    report = report_of(rows)
    with progress() as say:
        written = write_report(
            arguments.output, report, lambda share: say("Writing the report", share)
        )
    save(arguments.json, {"figures": {figure.name: list(figure.rows) for figure in report.figures}})
    console.print(report.lead)
    for file in written:
        console.print(str(file), markup=False)
