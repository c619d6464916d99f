"""The whole benchmark: all parts in turn, and their figures with targets."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Mapping
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from handcal.core.progress import Progress
from handcal.lab.bench.accuracy import (
    measure_cameras,
    measure_covariance,
    measure_cuts,
    measure_offline,
    measure_paper_simulation,
    measure_wearer,
)
from handcal.lab.bench.registration import measure_peers, measure_spoiled_clouds
from handcal.lab.bench.speed import measure_delivery, measure_scale, measure_speed
from handcal.lab.bench.trials import BenchSettings, Measured

PARTS: dict[str, Callable[[BenchSettings, Progress], Measured]] = {
    "speed": measure_speed,
    "peers": measure_peers,
    "spoiled": measure_spoiled_clouds,
    "delivery": measure_delivery,
    "wearer": measure_wearer,
    "cuts": measure_cuts,
    "covariance": measure_covariance,
    "cameras": measure_cameras,
    "offline": measure_offline,
    "paper_simulation": measure_paper_simulation,
    "scale": measure_scale,
}
_LIBRARIES = (
    "handcal",
    "numpy",
    "scipy",
    "opencv-python-headless",
    "small_gicp",
    "open3d-cpu",
    "open3d",
)
_MET = {True: "met", False: "missed", None: ""}


def run_bench(
    settings: BenchSettings,
    progress: Progress = Progress(),
    only: str = "",
) -> dict[str, Any]:
    """Measure all of `PARTS` in turn, or only one.

    Parameters
    ----------
    settings : BenchSettings
    progress : Progress, optional
        Reports the name of the present part and the share of it that is done.
    only : str
        Name of a part; empty for all.

    Returns
    -------
    dict
        JSON-able: ``environment``, ``settings``, ``figures`` (what, value, unit, target, met or
        None without a target), and ``details`` by part.
    """
    measured: dict[str, Measured] = {}
    for name, measure in PARTS.items():
        if only not in ("", name):
            continue
        progress.at(0.0, name)
        measured[name] = measure(settings, progress.part(0.0, 1.0, name))
    return {
        "environment": _environment(),
        "settings": asdict(settings),
        "figures": [figure.to_json() for part in measured.values() for figure in part.figures],
        "details": {name: part.details for name, part in measured.items()},
    }


def bench_table(results: Mapping[str, Any]) -> list[tuple[str, str, str, str]]:
    """Return name, value, target and whether it is met for every figure of `run_bench`."""
    return [
        (
            figure["what"],
            f"{figure['value']:.3g} {figure['unit']}".rstrip(),
            figure["target"],
            _MET[figure["met"]],
        )
        for figure in results["figures"]
    ]


def _environment() -> dict[str, Any]:
    """Return the environment on which the figures depend."""
    versions: dict[str, str | None] = {}
    for name in _LIBRARIES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = None
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cores": os.cpu_count(),
        "omp_num_threads": os.environ.get("OMP_NUM_THREADS"),
        "versions": versions,
    }
