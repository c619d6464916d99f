"""``handcal study …``: studies on simulated wearers, in many processes, with a report.

Commands import what they need when they run.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.terminal import (
    Commands,
    add_command,
    console,
    number,
    progress,
    save,
    until_interrupted,
)

if TYPE_CHECKING:
    from handcal.report.document import Report
    from handcal.study.run import Study
    from handcal.study.store import Row


def noise(arguments: argparse.Namespace) -> None:
    """Repeat the paper's simulation, and disturb the solvers by what it left out."""
    from handcal.study.noise import QUICK_NOISE, NoiseSettings, noise_study
    from handcal.study.noise_report import noise_report

    chosen = QUICK_NOISE if arguments.quick else NoiseSettings()
    settings = replace(chosen, seed=arguments.seed)
    _run(arguments, noise_study(settings), lambda rows: noise_report(settings, rows))


def add_study_commands(commands: Commands) -> None:
    """Add ``handcal study …``."""
    for command in (noise,):
        one = add_command(commands, command)
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
    from handcal.report.write import write_report
    from handcal.study.run import run_study

    with until_interrupted() as is_cancelled, progress() as say:
        rows = run_study(
            study,
            arguments.output,
            workers=arguments.workers,
            scheduler=arguments.scheduler,
            progress=lambda share: say("Doing the trials", share),
            is_cancelled=is_cancelled,
        )
    report = report_of(rows)
    with progress() as say:
        written = write_report(
            arguments.output, report, lambda share: say("Writing the report", share)
        )
    save(arguments.json, {"figures": {figure.name: list(figure.rows) for figure in report.figures}})
    console.print(report.lead)
    for file in written:
        console.print(str(file), markup=False)
