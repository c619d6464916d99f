"""``handcal study``: studies on simulated wearers, in many processes, with a report."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from handcal.cli.output import console, save, show_progress, table, until_interrupted
from handcal.cli.run import SENSOR_OPTIONS
from handcal.cli.terminal import (
    Option,
    arg,
    command,
    fail,
    flag,
    folder_option,
    number,
    seed,
    settings_of,
    value,
)

if TYPE_CHECKING:
    from handcal.core.progress import Progress
    from handcal.lab.study.studies import StudyResult

Result = TypeVar("Result")


_STUDY_OPTIONS: dict[str, Option] = {
    "--workers": value(
        "--workers",
        number(int, 1, 1024),
        "N",
        "number of processes, at most one per core (default)",
        dest="processes",
    ),
    "--scheduler": arg(
        "--scheduler",
        metavar="ADDRESS",
        help="Dask cluster to run on, such as tcp://HOST:PORT (default: this computer)",
    ),
    "--seed": seed("the whole study"),
    "--quick": arg(
        "--quick",
        dest="size",
        action="store_const",
        const="quick",
        help="few trials: do not report the figures",
    ),
}


def _study_options(name: str) -> tuple[Option, ...]:
    return (
        folder_option(
            "--output",
            "folder for this study only; an unfinished study is resumed",
            default=Path(f"results/study-{name}"),
        ),
        *_STUDY_OPTIONS.values(),
    )


@command(
    flag("--open3d", "solve by Open3D's ICP too, if it is installed"),
    *_study_options("noise"),
    example="handcal study noise --quick",
    json=True,
)
def noise(arguments: argparse.Namespace) -> None:
    """Repeat the paper's simulation, and add disturbances that it left out."""
    from handcal.lab.settings import NoiseStudySettings
    from handcal.lab.study.studies import run_noise_study

    settings = settings_of(NoiseStudySettings, arguments)
    _run(arguments, partial(run_noise_study, settings))


@command(
    value(
        "--wearers",
        number(int, 2, 10_000),
        "N",
        "simulated wearers in each population (default: the study's own number)",
    ),
    value(
        "--fit-noise",
        number(int, 2, 1000),
        "N",
        "first find the noise at which the paper's method has its published error, with N wearers",
        dest="noise_wearers",
    ),
    *_study_options("methods"),
    example="handcal study methods --quick",
    json=True,
)
def methods(arguments: argparse.Namespace) -> None:
    """Compare calibration methods on the same simulated wearers."""
    from handcal.lab.settings import MethodComparisonSettings
    from handcal.lab.study.methods import QUICK_METHODS, MethodSettings
    from handcal.lab.study.studies import run_method_comparison

    usual = QUICK_METHODS if arguments.size == "quick" else MethodSettings()
    settings = settings_of(
        MethodComparisonSettings,
        arguments,
        wearers=usual.wearers if arguments.wearers is None else arguments.wearers,
    )
    result = _run(arguments, partial(run_method_comparison, settings))
    for name, noise in (("method", result.noise), ("best iterate", result.best_noise)):
        if noise is not None:
            console.print(
                f"Noise {noise.scale:.2f}: the paper's {name} errs by "
                f"{noise.mean_arcmin:.1f} ± {noise.sd_arcmin:.1f}′ (± SD)"
            )


@command(
    value(
        "--wearers",
        number(int, 2, 10_000),
        "N",
        "simulated wearers for each plan, variant and scale",
        default=100,
    ),
    arg(
        "--plan",
        dest="plans",
        nargs="+",
        metavar="NAME",
        default=("paper", "recommended"),
        help="paper, recommended, recommended-unverified, or spaam-N with N alignments of each eye",
    ),
    arg(
        "--variant",
        dest="variants",
        nargs="+",
        metavar="NAME",
        default=("plain",),
        help="people: plain, fingers-only, palm-only, by-distance, heavy-tails, drift, "
        "late-presses, fits-at-once, opens, known-fat-2mm, unmeasured, fat-2mm, fat-1mm, "
        "constant-size, constant-direction",
    ),
    arg(
        "--scale",
        dest="scales",
        nargs="+",
        type=number(float, 0.0, 10.0),
        metavar="F",
        default=(1.33,),
        help="errors of the wearers, as multiples of the simulator's usual wearer",
    ),
    arg(
        "--eye-distance",
        choices=("none", "ruler", "headset"),
        default="none",
        help="source of the wearers' eye distance, ± 1 mm",
    ),
    arg(
        "--prior",
        choices=("none", "learned"),
        default="none",
        help="of the eyes; learned: from simulated earlier sessions",
    ),
    arg(
        "--wearer-prior",
        choices=("default", "learned"),
        default="default",
        help="of what wearers always see wrongly; learned: from 20 sittings of each of 30 others",
    ),
    *SENSOR_OPTIONS,
    *(option for name, option in _STUDY_OPTIONS.items() if name != "--quick"),
    folder_option(
        "--output",
        "folder for this study only; an unfinished study is resumed (default: none is kept)",
    ),
    example="handcal study procedures --wearers 10 --plan recommended spaam-20",
    json=True,
)
def procedures(arguments: argparse.Namespace) -> None:
    """Compare calibration procedures on the same simulated wearers."""
    from handcal.lab.settings import ProcedureStudySettings
    from handcal.lab.study.procedures import require_known
    from handcal.lab.study.studies import run_procedure_study

    settings = settings_of(ProcedureStudySettings, arguments)
    try:
        require_known(settings)
    except ValueError as error:
        fail(str(error), 2)
    rows = _unless_interrupted(partial(run_procedure_study, settings))
    save(arguments.json, {"rows": [asdict(row) for row in rows]})
    shown = table(
        "plan", "before", "after", "95 %", "time", "worse", "accepted", "both", "depth", "worse"
    )
    for row in rows:
        shown.add_row(
            f"{row.plan}, {row.variant}, errors × {row.scale:g}",
            *(f"{row.before_arcmin:.1f}′", f"{row.after_arcmin:.2f}′"),
            *(f"{row.after_p95_arcmin:.1f}′", f"{row.seconds:.1f} s"),
            *map(_percent, (row.worse_share, row.accepted_share, row.accepted_worse_share)),
            "" if row.depth_after_mm is None else f"{row.depth_after_mm:.1f} mm",
            _percent(row.depth_worse_share),
        )
    console.print(
        "Errors without the calibration, with it, and its 95th percentile; shares of eyes; the "
        "error in depth at 0.5 m."
    )
    console.print(shown)


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100.0 * share:.1f} %"


@command(
    arg("folder", type=Path, help="folder 'dataset' of github.com/YutaItoh/HMD-Calibration"),
    example="handcal study recorded HMD-Calibration/dataset",
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


def _run(arguments: argparse.Namespace, order: Callable[[Progress], StudyResult]) -> StudyResult:
    """Run a study until it is complete or Ctrl+C is pressed; print and save its results."""
    result = _unless_interrupted(order)
    figures = {figure.name: list(figure.rows) for figure in result.report.figures}
    save(arguments.json, {"figures": figures})
    console.print(result.report.lead)
    for file in result.files:
        console.print(str(file))
    return result


def _unless_interrupted(order: Callable[[Progress], Result]) -> Result:
    """Run a study; exit with code 130 after Ctrl+C."""
    with until_interrupted() as is_cancelled, show_progress(is_cancelled) as progress:
        return order(progress)
