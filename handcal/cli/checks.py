"""``handcal bench, doctor``: accuracy and speed, and the state of the installation."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from handcal.cli.output import console, save, show_progress, table
from handcal.cli.terminal import arg, command, fail
from handcal.errors import HandcalError


@command(
    arg("--quick", action="store_true", help="few repetitions: a smoke test"),
    arg("--only", metavar="PART", default="", help="run one part, such as offline (default: all)"),
    arg(
        "--gui",
        action="store_true",
        help="measure the desktop program instead: needs a display and 12 minutes",
    ),
    json=True,
)
def bench(arguments: argparse.Namespace) -> None:
    """Measure accuracy and speed, and compare them with targets and a baseline."""
    from handcal.lab.bench import PARTS, QUICK, BenchSettings, bench_table, run_bench

    if arguments.only not in ("", *PARTS):
        fail(f"unknown part {arguments.only!r}; choose from {', '.join(PARTS)}", 2)
    if arguments.gui:
        result = _bench_window(300 if arguments.quick else 20_000)
    else:
        with show_progress() as progress:
            result = run_bench(
                QUICK if arguments.quick else BenchSettings(), progress, arguments.only
            )
    save(arguments.json, result)
    shown_table = table("figure", "measured", "target", "met")
    for row in bench_table(result):
        shown_table.add_row(*row)
    console.print(shown_table)


@command(
    arg("--rig", type=Path, metavar="FILE", help="rig file to compare the connected cameras with"),
)
def doctor(arguments: argparse.Namespace) -> None:
    """Check the installation and the camera, with advice for each problem."""
    from handcal.station.doctor import Health, examine

    findings = examine(arguments.rig)
    for finding in findings:
        advice = f"\n         → {finding.advice}" if finding.advice else ""
        console.print(f"{finding.health.value:8} {finding.what}: {finding.found}{advice}")
    if any(finding.health is Health.BROKEN for finding in findings):
        raise HandcalError("fix the problems listed above and try again")


def _bench_window(frames: int) -> dict[str, Any]:
    """Measure the desktop program in a separate process, since the engine may not import it."""
    command = [sys.executable, "-m", "handcal_gui.benchmark", "--frames", str(frames)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no reason was given"])[-1]
        raise HandcalError(f"cannot measure the desktop program; it needs a display: {last}")
    measured: dict[str, Any] = json.loads(done.stdout)
    return measured
