"""The command line: ``handcal COMMAND``; exit code 0 for success, 1 for failure, 2 for misuse.

Commands import what they need when they run, so that ``handcal --help`` answers at once.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import click
import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from handcal.errors import FileError, HandcalError
from handcal.files import make_folder, write_json

app = typer.Typer(
    help="Calibrate an optical see-through headset with the wearer's bare hand.",
    no_args_is_help=True,
    rich_markup_mode=None,
    add_completion=False,
)
console = Console(soft_wrap=True)

Json = Annotated[Path | None, typer.Option("--json", help="Also write the result to this file.")]
RigFile = Annotated[
    Path | None, typer.Option("--rig", help="Rig file; without it, the shipped example.")
]
Probability = typer.Option(min=0.0, max=1.0)


class EyePlan(StrEnum):
    """Which eyes align at a time."""

    BOTH = "both"
    EACH = "each"


class MethodName(StrEnum):
    """How alignments are solved."""

    CONSISTENT = "consistent"
    PAPER = "paper"
    LINEAR = "linear"
    ICP = "icp"


@app.command()
def demo(
    output: Annotated[Path, typer.Option(help="Folder for the session.")] = Path("results/demo"),
    seed: Annotated[int, typer.Option(min=0, help="Of wearer, hand, room and noise.")] = 1,
    alignments: Annotated[int, typer.Option(min=1, max=20, help="How often to align.")] = 1,
    eyes: Annotated[EyePlan, typer.Option(help="Both at once, or one at a time.")] = EyePlan.BOTH,
    loss: Annotated[float, Probability] = 0.0,
    reorder: Annotated[float, Probability] = 0.0,
    rig: RigFile = None,
    json: Json = None,
) -> None:
    """Calibrate a simulated wearer from start to end, and judge the result by the truth."""
    from handcal.demo import DemoSettings, run_demo

    settings = DemoSettings(
        seed=seed, alignments=alignments, eyes=eyes.value, loss=loss, reorder=reorder
    )
    with _progress() as report:
        result = run_demo(settings, _rig_path(rig), make_folder(output), report)
    _save(json, result)
    table = Table("eye", "φ solved, mm", "± σ", "true φ", "error, mm", "verdict")
    for eye, found in result["eyes"].items():
        triples = [
            " ".join(f"{value:.1f}" for value in found[key])
            for key in ("shift_mm", "sigma_mm", "true_shift_mm")
        ]
        table.add_row(eye, *triples, f"{found['error_mm']:.2f}", found["verdict"])
    console.print(table)
    error = result["reprojection_arcmin"]
    console.print(
        f"Reprojection error: {error['before']:.1f}′ before, {error['after']:.1f}′ after. "
        f"Confirmations refused: {result['guard']['rejected']}."
    )
    console.print(f"Session: {result['session']}")


@app.command()
def segment(
    color: Annotated[Path, typer.Option(help="Colour image.")],
    depth: Annotated[Path, typer.Option(help="16-bit PNG aligned to it.")],
    intrinsics: Annotated[
        Path, typer.Option(help="JSON: width, height, fx, fy, cx, cy, depth_scale (m a unit).")
    ],
    output: Annotated[Path, typer.Option(help="Folder for the results.")],
) -> None:
    """Segment the hand in one image pair: clouds, mask, overlay and hand.json."""
    from handcal.camera.images import read_frame, write_segmentation
    from handcal.hand.segment import SegmentSettings, segment_hand

    frame = read_frame(color, depth, intrinsics)
    cloud = segment_hand(frame, SegmentSettings())
    write_segmentation(cloud, frame, make_folder(output))
    console.print(
        f"{len(cloud.points_m)} points at {cloud.median_depth_m:.3f} m, box {cloud.box_px}. "
        f"Results: {output}"
    )


@app.command()
def solve(
    session: Annotated[Path, typer.Argument(help="A session's folder.")],
    method: Annotated[MethodName, typer.Option(help="How to solve.")] = MethodName.CONSISTENT,
    json: Json = None,
) -> None:
    """Solve a session's alignments again; the session itself stays as it is."""
    from handcal.results import SolveSettings, results_json, solve_session
    from handcal.session import Session

    record = Session.open(session)
    if not record.alignments:
        raise FileError(f"{session} holds no alignment to solve")
    results = solve_session(record.alignments, record.rig, SolveSettings(method.value))
    _save(json, results_json(results))
    stored = (record.results or {}).get("eyes", {})
    table = Table("eye", "φ, mm", "± σ", "RMS, mm", "inliers", "verdict", "φ stored, mm")
    for eye, shift in results.shifts.items():
        before = stored.get(eye, {}).get("shift_m")
        table.add_row(
            eye,
            _millimetres(shift.shift_m),
            _millimetres(np.sqrt(np.diag(shift.covariance_m2))),
            f"{1e3 * shift.rms_m:.2f}",
            f"{100 * shift.inlier_ratio:.0f} %",
            results.verdicts[eye].name,
            _millimetres(before) if before else "–",
        )
    console.print(table)
    if results.eye_distance_m is not None:
        console.print(f"Eye distance: {1e3 * results.eye_distance_m:.1f} mm")
    for eye, verdict in results.verdicts.items():
        console.print(f"{eye}: {verdict.name}: {verdict.reason}")


@app.command()
def replay(
    recording: Annotated[Path, typer.Argument(help="RealSense recording, .db3 or .bag.")],
    real_time: Annotated[bool, typer.Option(help="At the recorded pace.")] = False,
    json: Json = None,
) -> None:
    """Play a recording through librealsense and segment the hand in every frame."""
    from handcal.camera.recording import RecordingCamera
    from handcal.hand.segment import SegmentSettings
    from handcal.replay import replay as play

    table = Table("frame", "points", "depth, m", "turned, °", "moved, mm", "segmented, ms")
    rows: list[dict[str, Any]] = []
    with RecordingCamera(recording, real_time=real_time) as camera:
        for step in play(camera, SegmentSettings()):
            row = _replay_row(step)
            rows.append(row)
            if step.hand is None:
                table.add_row(str(step.frame.index), step.problem)
            else:
                table.add_row(
                    *(f"{value:.4g}" if value is not None else "" for value in row.values())
                )
    console.print(table)
    _save(json, {"frames": rows})
    found = sum(row["points"] is not None for row in rows)
    console.print(f"{found} of {len(rows)} frames show a hand.")


@app.command()
def headset(
    port: Annotated[int, typer.Option(min=1, max=65535, help="Where the PC listens.")],
    scene_port: Annotated[
        int, typer.Option(min=1, max=65535, help="Where the simulated camera listens.")
    ],
    host: Annotated[str, typer.Option(help="The PC.")] = "127.0.0.1",
    key_file: Annotated[
        Path | None, typer.Option(help="Pairing key; else from HANDCAL_PAIRING_KEY.")
    ] = None,
    rig: RigFile = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the wearer.")] = 1,
    loss: Annotated[float, Probability] = 0.0,
    reorder: Annotated[float, Probability] = 0.0,
    duplicate: Annotated[float, Probability] = 0.0,
    delay_ms: Annotated[float, typer.Option(min=0.0, max=10_000.0)] = 0.0,
    clock_offset_ms: Annotated[
        float, typer.Option(help="Headset's clock less the PC's.")
    ] = 12345.0,
    duration_s: Annotated[float | None, typer.Option(min=0.0, help="When to end.")] = None,
) -> None:
    """Wear the virtual headset: a process that speaks the real datagrams, with a wearer in it."""
    from handcal.link.impair import Impairment
    from handcal.link.pairing import read_pairing_key
    from handcal.sim.headset import HeadsetSettings, run_headset, until_terminated

    settings = HeadsetSettings(
        rig_path=str(_rig_path(rig)),
        host=host,
        port=port,
        scene_port=scene_port,
        seed=seed,
        impairment=Impairment(
            loss=loss, duplicate=duplicate, reorder=reorder, delay_s=delay_ms / 1e3, seed=seed
        ),
        clock_offset_s=clock_offset_ms / 1e3,
        duration_s=duration_s,
    )
    run_headset(settings, read_pairing_key(key_file), until_terminated())


@app.command()
def bench(
    quick: Annotated[bool, typer.Option(help="Few repetitions: a look, not a figure.")] = False,
    json: Json = None,
) -> None:
    """Measure accuracy and speed, each beside its target and a baseline of the same run."""
    from handcal.bench import BenchSettings, bench_table, run_bench

    with _progress() as report:
        result = run_bench(BenchSettings(quick=quick), report)
    _save(json, result)
    table = Table("what", "measured", "target", "met")
    for row in bench_table(result):
        table.add_row(*row)
    console.print(table)


@app.command()
def doctor() -> None:
    """Tell what is installed, which camera is there, and what to do about each problem."""
    from handcal.doctor import Health, examine

    findings = examine()
    table = Table("", "what", "found", "what to do")
    for finding in findings:
        table.add_row(finding.health.value, finding.what, finding.found, finding.advice)
    console.print(table)
    if any(finding.health is Health.BROKEN for finding in findings):
        raise typer.Exit(1)


def main() -> None:
    """Run a command; every foreseen error is one line."""
    try:
        code = app(standalone_mode=False)
    except click.ClickException as error:
        _fail(error.format_message(), error.exit_code)
    except HandcalError as error:
        _fail(str(error), 1)
    except (click.Abort, KeyboardInterrupt):
        _fail("interrupted", 130)
    sys.exit(code if isinstance(code, int) else 0)


def _fail(message: str, code: int) -> None:
    line = " ".join(message.split())
    sys.stderr.write(f"handcal: {line}\n")
    sys.exit(code)


def _rig_path(rig: Path | None) -> Path:
    from handcal.resources import resource_path

    return rig or resource_path("example_rig.yaml")


def _save(path: Path | None, result: dict[str, Any]) -> None:
    if path is not None:
        make_folder(path.parent)
        write_json(path, result)


def _millimetres(values_m: Any) -> str:
    return " ".join(f"{1e3 * value:7.3f}" for value in values_m)


def _replay_row(step: Any) -> dict[str, Any]:
    hand, motion = step.hand, step.motion
    return {
        "frame": step.frame.index,
        "points": len(hand.points_m) if hand else None,
        "median_depth_m": hand.median_depth_m if hand else None,
        "turned_deg": float(np.degrees(np.linalg.norm(motion.rotation_rad))) if motion else None,
        "moved_mm": float(1e3 * np.linalg.norm(motion.shift_m)) if motion else None,
        "segment_ms": 1e3 * step.segment_s,
    }


@contextmanager
def _progress() -> Iterator[Any]:
    """Yield a function that shows what is going on: a bar on a terminal, else plain lines."""
    if not console.is_terminal:
        yield lambda what, share: console.print(f"[{100 * share:3.0f} %] {what}", markup=False)
        return
    columns = TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda what, share: bar.update(task, description=what, completed=share)


if __name__ == "__main__":
    main()
