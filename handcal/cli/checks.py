"""``handcal bench, doctor``: accuracy and speed, and the state of the installation."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from typing import Any

from handcal.cli.output import console, progress, save, table
from handcal.cli.terminal import fail
from handcal.errors import HandcalError


def bench(arguments: argparse.Namespace) -> None:
    """Measure accuracy and speed, each beside its target and a baseline of the same run."""
    from handcal.lab.bench import PARTS, QUICK, BenchSettings, bench_table, run_bench

    if arguments.only not in ("", *PARTS):
        fail(f"there is no part {arguments.only}; there are {', '.join(PARTS)}", 2)
    if arguments.gui:
        result = _bench_window(300 if arguments.quick else 20_000)
    else:
        with progress() as report:
            result = run_bench(
                QUICK if arguments.quick else BenchSettings(), report, arguments.only
            )
    save(arguments.json, result)
    shown_table = table("what", "measured", "target", "met")
    for row in bench_table(result):
        shown_table.add_row(*row)
    console.print(shown_table)


def doctor(_arguments: argparse.Namespace) -> None:
    """Tell what is installed, which camera is there, and what to do about each problem."""
    from handcal.station.doctor import Health, examine

    findings = examine()
    for finding in findings:
        advice = f"\n         → {finding.advice}" if finding.advice else ""
        console.print(f"{finding.health.value:8} {finding.what}: {finding.found}{advice}")
    if any(finding.health is Health.BROKEN for finding in findings):
        raise HandcalError("something must be mended first; see above")


def _bench_window(frames: int) -> dict[str, Any]:
    """Measure the desktop program, which the engine does not know, as a process of its own."""
    command = [sys.executable, "-m", "handcal_gui.benchmark", "--frames", str(frames)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no reason was given"])[-1]
        raise HandcalError(f"the window cannot be measured; is there a display? {last}")
    measured: dict[str, Any] = json.loads(done.stdout)
    return measured
