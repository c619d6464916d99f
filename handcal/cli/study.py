"""``handcal study …``: studies on simulated wearers, in many processes, with a report.

Commands import what they need when they run.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.cli.output import console, progress, save, table, until_interrupted
from handcal.cli.terminal import Commands, add_command, fail, number
from handcal.errors import CancelledError

if TYPE_CHECKING:
    from handcal.lab.study.run import Study
    from handcal.lab.study.store import Row
    from handcal.report.document import Report


def noise(arguments: argparse.Namespace) -> None:
    """Repeat the paper's simulation, and disturb the solvers by what it left out."""
    from handcal.lab.study.noise import QUICK_NOISE, NoiseSettings, noise_study
    from handcal.lab.study.noise_report import noise_report

    chosen = QUICK_NOISE if arguments.quick else NoiseSettings()
    settings = replace(chosen, seed=arguments.seed)
    _run(arguments, noise_study(settings), lambda rows: noise_report(settings, rows))


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


def add_study_commands(commands: Commands) -> None:
    """Add ``handcal study …``."""
    data = add_command(commands, recorded)
    data.add_argument("folder", type=Path, help="of github.com/YutaItoh/HMD-Calibration: dataset")
    for command in (noise, methods):
        one = add_command(commands, command)
        if command is methods:
            one.add_argument(
                "--wearers", type=number(int, 2, 10_000), metavar="N", help="of each population"
            )
            one.add_argument(
                "--fit-noise",
                type=number(int, 2, 1000),
                metavar="N",
                help="search first, with so many wearers, for the noise at which the paper's "
                "method errs as published",
            )
        one.add_argument(
            "--output",
            type=Path,
            default=Path(f"results/study-{command.__name__}"),
            help="folder of this study alone; one that is not done is gone on with",
        )
        one.add_argument(
            "--workers",
            type=number(int, 1, 1024),
            metavar="N",
            help="processes; one a core if absent",
        )
        one.add_argument(
            "--scheduler", metavar="ADDRESS", help="of a Dask cluster to run on: tcp://HOST:PORT"
        )
        one.add_argument(
            "--seed", type=number(int, 0, 2**32 - 1), default=1, help="of all that is random"
        )
        one.add_argument("--quick", action="store_true", help="few trials: only a look")


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
