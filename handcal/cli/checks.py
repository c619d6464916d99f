"""``handcal bench, doctor``: accuracy and speed, and the state of the installation."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from handcal.cli.output import console, save, show_progress, table, until_interrupted
from handcal.cli.run import KEYS, LISTEN, paired_headsets
from handcal.cli.terminal import (
    arg,
    command,
    fail,
    file_option,
    flag,
    folder_option,
    output_file,
    patience,
)
from handcal.core.errors import HandcalError

if TYPE_CHECKING:
    from handcal.core.progress import Progress
    from handcal.station.checks.doctor import Finding


@command(
    flag("--quick", "few repetitions: a smoke test"),
    arg("--only", metavar="PART", default="", help="run one part, such as offline (default: all)"),
    flag("--gui", "measure the desktop program instead: needs a display and 12 minutes at 30 Hz"),
    arg(
        "--rate",
        type=int,
        choices=(30, 60, 90),
        default=30,
        help="with --gui: frames per second of the replayed camera",
    ),
    example="handcal bench --quick --only offline",
    json=True,
)
def bench(arguments: argparse.Namespace) -> None:
    """Measure accuracy and speed, and compare them with targets and a baseline."""
    from handcal.lab.bench.run import PARTS, bench_table, run_bench
    from handcal.lab.bench.trials import QUICK, BenchSettings

    if arguments.only not in ("", *PARTS):
        fail(f"unknown part {arguments.only!r}; choose from {', '.join(PARTS)}", 2)
    if arguments.gui:
        with show_progress() as progress:
            frames = 300 if arguments.quick else 20_000
            result = _bench_window(frames, arguments.rate, progress)
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
    file_option("--rig", "rig file to compare the connected devices with"),
    flag("--headset", "wait for a paired headset, and report on it"),
    arg(
        "--stamps",
        metavar="SOURCE",
        help="with --headset and --rig: also measure with the depth camera (realsense) how far the "
        "stamps of poses are off; the wearer holds a hand still and turns the head",
    ),
    patience("until the headset connects", 20.0),
    *LISTEN,
    KEYS,
    example="handcal doctor --rig rig.yaml",
)
def doctor(arguments: argparse.Namespace) -> None:
    """Check the installation, the camera and the headset, with advice for each problem."""
    from handcal.station.checks.doctor import Health, examine

    if arguments.stamps and not (arguments.headset and arguments.rig):
        fail("--stamps needs --headset and --rig; see handcal doctor --help", 2)
    findings = examine(arguments.rig)
    if arguments.headset:
        findings += _headset_findings(arguments)
    for finding in findings:
        advice = f"\n         → {finding.advice}" if finding.advice else ""
        console.print(f"{finding.health.value:8} {finding.what}: {finding.found}{advice}")
    if any(finding.health is Health.BROKEN for finding in findings):
        raise HandcalError("fix the problems listed above and try again")


@command(
    output_file("--output", "ZIP file to write", default="handcal-support.zip"),
    folder_option(
        "--sessions",
        "further folder of sessions whose wearers' names are taken out; may be repeated",
        action="append",
    ),
    arg("--frames", type=Path, metavar="RECORDING", help="recording to add: a file or a folder"),
    example="handcal support --output report.zip --sessions sessions",
)
def support(arguments: argparse.Namespace) -> None:
    """Write one file for a bug report: doctor, versions, log without names, frames if wanted."""
    from handcal.station.checks.support import default_settings, run_support

    settings = default_settings()
    sessions = tuple(arguments.sessions or ())
    settings = replace(settings, sessions=sessions, frames=arguments.frames)
    with show_progress() as progress:
        written = run_support(arguments.output, settings, progress)
    console.print(f"{arguments.output}: {', '.join(written[:4])}")
    if len(written) > 4:
        console.print(f"and {len(written) - 4} more files")


def _headset_findings(arguments: argparse.Namespace) -> list[Finding]:
    from handcal.camera.settings import RealSenseSettings
    from handcal.cli.cameras import open_source
    from handcal.link.server import HeadsetServer
    from handcal.rig.rig_file import read_rig
    from handcal.station.checks.doctor import examine_headset

    pairings = paired_headsets(arguments.keys)
    rig = read_rig(arguments.rig) if arguments.rig else None
    with ExitStack() as stack:
        server = stack.enter_context(HeadsetServer(pairings, (arguments.host, arguments.port)))
        camera = None
        if arguments.stamps:
            source = open_source(arguments.stamps, RealSenseSettings())
            camera = stack.enter_context(source)
        is_stopped = stack.enter_context(until_interrupted())
        progress = stack.enter_context(show_progress(is_stopped))
        return examine_headset(server, rig, camera, arguments.patience_s, progress)


def _bench_window(frames: int, rate_hz: int, progress: Progress) -> dict[str, Any]:
    """Measure the desktop program in a separate process, since the engine may not import it."""
    command = [sys.executable, "-m", "handcal_gui.benchmark", "--frames", str(frames)]
    command += ["--rate", str(rate_hz)]
    last = "no reason was given"
    environment = {"OMP_NUM_THREADS": "1", **os.environ}  # as the program sets it
    with subprocess.Popen(  # noqa: S603
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        minutes = frames / rate_hz / 60
        progress.at(0.0, f"{frames:,} frames, {minutes:.1f} minutes at {rate_hz} frames per second")
        for line in process.stderr:
            last = line.strip() or last
            if (seen := last.removeprefix("frames seen: ")) != last:
                progress.at(int(seen) / frames, "frames of the window")
        output = process.stdout.read()  # a line, written at the end
    if process.returncode != 0:
        # Without a display, Qt ends it by a signal.
        advice = "; it needs a display" if process.returncode < 0 else ""
        raise HandcalError(f"cannot measure the desktop program{advice}: {last}")
    measured: dict[str, Any] = json.loads(output)
    return measured
