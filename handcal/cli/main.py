"""The command line: ``handcal COMMAND``; exit code 0 for success, 1 for failure, 2 for misuse.

Commands import what they need when they run, so that ``handcal --help`` answers at once.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from handcal.cli.camera_options import add_realsense_options, realsense_of
from handcal.cli.evaluate import add_evaluate_commands
from handcal.cli.rig import add_rig_commands
from handcal.cli.rig_files import add_rig_file_commands
from handcal.cli.study import add_study_commands
from handcal.cli.terminal import (
    Parser,
    add_command,
    console,
    errors_in_one_line,
    fail,
    number,
    progress,
    save,
    table,
    until_interrupted,
)
from handcal.errors import FileError, HandcalError
from handcal.export.formats import FORMATS
from handcal.hand.settings import Roi
from handcal.io.configuration import keep_font_list_in_configuration
from handcal.io.files import make_folder
from handcal.types import METHODS

if TYPE_CHECKING:
    from handcal.camera.camera import Camera
    from handcal.cli.replay import ReplayStep


def demo(arguments: argparse.Namespace) -> None:
    """Calibrate a simulated wearer from start to end, and judge the result by the truth."""
    from handcal.cli.demo import DemoSettings, run_demo

    settings = DemoSettings(
        seed=arguments.seed,
        alignments=arguments.alignments,
        eyes=arguments.eyes,
        loss=arguments.loss,
        reorder=arguments.reorder,
        worn_rig=str(arguments.worn_rig or ""),
    )
    with progress() as report:
        result = run_demo(settings, _rig_path(arguments.rig), make_folder(arguments.output), report)
    save(arguments.json, result)
    shown_table = table("eye", "φ solved, mm", "± σ, mm", "true φ, mm", "off by", "verdict")
    for eye, found in result["eyes"].items():
        triples = [_triple(found[key]) for key in ("shift_mm", "sigma_mm", "true_shift_mm")]
        shown_table.add_row(eye, *triples, f"{found['error_mm']:.1f}", found["verdict"])
    console.print(shown_table)
    for eye, found in result["eyes"].items():
        console.print(f"{eye}: {found['verdict']}: {found['reason']}")
    error, guard = result["reprojection_arcmin"], result["guard"]
    console.print(
        f"Reprojection error: {error['before']:.1f}′ before, {error['after']:.1f}′ after\n"
        f"Confirmations refused for a turned hand: {guard['rejected']}; "
        f"accepted at up to {guard['accepted_deg']:.1f}°\n"
        f"Session: {result['session']}"
    )


def segment(arguments: argparse.Namespace) -> None:
    """Segment the hand in one image pair: hand.ply, contour.ply, mask, overlay and hand.json."""
    from handcal.camera.images import read_frame
    from handcal.cli.segmentation_file import write_segmentation
    from handcal.hand.settings import SegmentSettings
    from handcal.hand.shipped import make_finder

    frame = read_frame(arguments.color, arguments.depth, arguments.intrinsics)
    cloud = make_finder(SegmentSettings(roi=arguments.roi)).find(frame)
    write_segmentation(cloud, frame, make_folder(arguments.output))
    console.print(
        f"{len(cloud.points_m)} points at {cloud.median_depth_m:.3f} m, "
        f"box {', '.join(map(str, cloud.box_px))} px. Results: {arguments.output}"
    )


def solve(arguments: argparse.Namespace) -> None:
    """Solve a session's alignments again; the session itself stays as it is."""
    import numpy as np

    from handcal.register.results import results_json
    from handcal.session.session import Session
    from handcal.station.solve_again import solve_again, stored_solve_settings

    record = Session.open(arguments.session)
    if record.torn_bytes:
        console.print("The journal's last line is unfinished, as after a crash, and left out.")
    settings = stored_solve_settings(record)
    if arguments.method:
        settings = replace(settings, method=arguments.method)
    results = solve_again(record, settings)
    if results is None:
        raise FileError(f"{arguments.session} holds no alignment to solve")
    save(arguments.json, results_json(results))
    shown_table = table("eye", "φ, mm", "± σ, mm", "RMS, mm", "inliers", "verdict")
    for eye, shift in results.shifts.items():
        shown_table.add_row(
            eye,
            _triple(1e3 * shift.shift_m),
            _triple(1e3 * np.sqrt(np.diag(shift.covariance_m2))),
            f"{1e3 * shift.rms_m:.2f}",
            f"{100 * shift.inlier_ratio:.0f} %",
            results.verdicts[eye].name,
        )
    console.print(shown_table)
    for eye, verdict in results.verdicts.items():
        console.print(f"{eye}: {verdict.name}: {verdict.reason}")
    if results.eye_distance_m is not None:
        console.print(f"Eye distance: {1e3 * results.eye_distance_m:.1f} mm")


def export(arguments: argparse.Namespace) -> None:
    """Export a session: report, tables, calibration, clouds, and the session as one file."""
    from handcal.export.export import ExportSettings, export_session
    from handcal.session.session import Session

    try:
        settings = ExportSettings(
            tuple(arguments.format or FORMATS), arguments.near_m, arguments.far_m
        )
    except ValueError as error:
        fail(str(error), 2)
    record = Session.open(arguments.session)
    folder = arguments.output or Path("results/export") / record.path.absolute().name
    with progress() as report:
        files = export_session(record, folder, settings, report, lambda: False)
    for file in files:
        console.print(str(file))


def replay(arguments: argparse.Namespace) -> None:
    """Play a recording and segment the hand in every frame."""
    from handcal.camera.playback import PlaybackSettings
    from handcal.camera.recordings import open_recording
    from handcal.cli.replay import replay as play
    from handcal.hand.settings import SegmentSettings

    shown_table = table("frame", "points", "depth, m", "turned, °", "moved, mm", "took, ms")
    rows: list[dict[str, Any]] = []
    playback = PlaybackSettings(real_time=arguments.real_time)
    with open_recording(arguments.recording, playback) as camera:
        for step in play(camera, SegmentSettings(roi=arguments.roi)):
            rows.append(_replay_row(step))
            shown = list(rows[-1].values())[:-1]
            shown_table.add_row(*map(_cell, shown))
    console.print(shown_table)
    save(arguments.json, {"frames": rows})
    for row in rows:
        if row["problem"]:
            console.print(f"Frame {row['frame']}: {row['problem']}")
    found = sum(not row["problem"] for row in rows)
    console.print(f"{found} of {len(rows)} frames show a hand.")


def record(arguments: argparse.Namespace) -> None:
    """Record a camera: into a .db3 file through librealsense, or into a folder of images."""
    from handcal.camera.record import RecordSettings
    from handcal.camera.record import record as record_camera

    settings = RecordSettings(duration_s=arguments.seconds, frames=arguments.frames)
    with _open_source(arguments) as camera, until_interrupted() as is_stopped:
        said = f"Recording {camera.name}; Ctrl+C ends it and keeps what there is."
        console.print(said, markup=False)
        try:
            with progress() as report:
                recorded = record_camera(camera, arguments.output, settings, report, is_stopped)
        except ValueError as error:
            raise HandcalError(str(error)) from error
    save(arguments.json, asdict(recorded))
    console.print(
        f"{recorded.frames} frames, {recorded.duration_s:.1f} s, {recorded.dropped} dropped; "
        f"ended: {recorded.stop_reason}. Recording: {arguments.output}"
    )


def headset(arguments: argparse.Namespace) -> None:
    """Wear the virtual headset: a process that speaks the real datagrams, with a wearer in it."""
    from handcal.link.impair import Impairment
    from handcal.link.pairing import read_pairing_key
    from handcal.sim.headset import HeadsetSettings, run_headset, until_terminated

    settings = HeadsetSettings(
        rig_path=str(_rig_path(arguments.rig)),
        worn_rig_path=str(arguments.worn_rig or ""),
        host=arguments.host,
        port=arguments.port,
        scene_port=arguments.scene_port,
        seed=arguments.seed,
        impairment=Impairment(
            loss=arguments.loss,
            duplicate=arguments.duplicate,
            reorder=arguments.reorder,
            delay_s=arguments.delay_ms / 1e3,
            seed=arguments.seed,
        ),
        clock_offset_s=arguments.clock_offset_ms / 1e3,
        duration_s=arguments.duration_s,
    )
    run_headset(settings, read_pairing_key(arguments.key_file), until_terminated())


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


def _bench_window(frames: int) -> dict[str, Any]:
    """Measure the desktop program, which the engine does not know, as a process of its own."""
    command = [sys.executable, "-m", "handcal_gui.benchmark", "--frames", str(frames)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["no reason was given"])[-1]
        raise HandcalError(f"the window cannot be measured; is there a display? {last}")
    measured: dict[str, Any] = json.loads(done.stdout)
    return measured


def doctor(_arguments: argparse.Namespace) -> None:
    """Tell what is installed, which camera is there, and what to do about each problem."""
    from handcal.station.doctor import Health, examine

    findings = examine()
    for finding in findings:
        advice = f"\n         → {finding.advice}" if finding.advice else ""
        console.print(f"{finding.health.value:8} {finding.what}: {finding.found}{advice}")
    if any(finding.health is Health.BROKEN for finding in findings):
        raise HandcalError("something must be mended first; see above")


def main() -> None:
    """Run a command; every foreseen error is one line."""
    with errors_in_one_line():
        keep_font_list_in_configuration()
        arguments = _parser().parse_args()
        arguments.command(arguments)


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="handcal",
        description="Calibrate an optical see-through headset with the wearer's bare hand.",
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)

    def add(command: Callable[[argparse.Namespace], None], *, json: bool = True) -> Parser:
        return add_command(commands, command, json=json)

    share, count, seed = number(float, 0.0, 1.0), number(int, 1, 20), number(int, 0, 2**32 - 1)
    milliseconds = number(float, 0.0, 10_000.0)

    one = add(demo)
    one.add_argument(
        "--output", type=Path, default=Path("results/demo"), help="where to put the session"
    )
    one.add_argument("--seed", type=seed, default=1, help="of wearer, hand, room and noise")
    one.add_argument(
        "--alignments", type=count, default=1, metavar="K", help="how often, each eye if apart"
    )
    one.add_argument(
        "--eyes", choices=("both", "each"), default="both", help="aligned at once, or apart"
    )
    one.add_argument("--loss", type=share, default=0.0, help="share of datagrams lost")
    one.add_argument("--reorder", type=share, default=0.0, help="share of datagrams reordered")
    one.add_argument("--rig", type=Path, help="rig file; the shipped example if absent")
    one.add_argument(
        "--worn-rig", type=Path, help="the true rig of the simulated headset, if it is another"
    )

    one = add(segment, json=False)
    one.add_argument("--color", type=Path, required=True, help="colour image")
    one.add_argument("--depth", type=Path, required=True, help="16-bit PNG aligned to it")
    one.add_argument(
        "--intrinsics",
        type=Path,
        required=True,
        help="JSON with width, height, fx, fy, cx, cy and depth_scale (metres a unit)",
    )
    one.add_argument("--output", type=Path, required=True, help="folder for the results")
    _add_roi(one)

    one = add(solve)
    one.add_argument("session", type=Path, help="a session's folder")
    one.add_argument("--method", choices=METHODS, help="solver; the session's own if absent")

    one = add(export, json=False)
    metres = number(float, 1e-3, 1e6)
    one.add_argument("session", type=Path, help="a session's folder")
    one.add_argument(
        "--output", type=Path, help="folder for the files; results/export/NAME if absent"
    )
    one.add_argument(
        "--format", action="append", choices=tuple(FORMATS), help="may be repeated; all if absent"
    )
    one.add_argument("--near-m", type=metres, default=0.1, help="OpenGL's near plane")
    one.add_argument("--far-m", type=metres, default=100.0, help="OpenGL's far plane")

    one = add(replay)
    one.add_argument("recording", type=Path, help=".db3 or .bag file, or a recorded folder")
    one.add_argument(
        "--real-time", action="store_true", help="at the recorded pace, dropping frames"
    )
    _add_roi(one)

    one = add(record)
    one.add_argument("output", type=Path, help="a .db3 file, or a new folder")
    one.add_argument(
        "--source", default="realsense", help="realsense, simulator, or a recording to convert"
    )
    one.add_argument(
        "--seconds", type=number(float, 0.01, 86_400.0), default=60.0, help="end after so long"
    )
    one.add_argument(
        "--frames", type=number(int, 1, 100_000), default=100_000, help="end after so many"
    )
    one.add_argument("--seed", type=seed, default=1, help="of the simulated hand and room")
    add_realsense_options(one)

    one = add(headset, json=False)
    port = number(int, 1, 65535)
    one.add_argument("--port", type=port, required=True, help="where the PC listens")
    one.add_argument(
        "--scene-port",
        type=port,
        help="where a simulated camera listens on this computer; without, none sees the wearer",
    )
    one.add_argument("--host", default="127.0.0.1", help="the PC")
    one.add_argument("--key-file", type=Path, help="pairing key; else in HANDCAL_PAIRING_KEY")
    one.add_argument("--rig", type=Path, help="rig file; the shipped example if absent")
    one.add_argument("--worn-rig", type=Path, help="the true rig, if it is another")
    one.add_argument("--seed", type=seed, default=1, help="of the wearer")
    one.add_argument("--loss", type=share, default=0.0, help="share of datagrams lost")
    one.add_argument("--reorder", type=share, default=0.0, help="share of datagrams reordered")
    one.add_argument("--duplicate", type=share, default=0.0, help="share of datagrams doubled")
    one.add_argument("--delay-ms", type=milliseconds, default=0.0, help="of every datagram")
    one.add_argument(
        "--clock-offset-ms",
        type=number(float, -1e9, 1e9),
        default=12345.0,
        help="headset's clock less the PC's",
    )
    one.add_argument("--duration-s", type=number(float, 0.0, 1e6), help="end after so long")

    one = add(bench)
    one.add_argument("--quick", action="store_true", help="few repetitions: only a look")
    one.add_argument("--only", metavar="PART", default="", help="one part, such as offline")
    one.add_argument(
        "--gui",
        action="store_true",
        help="the desktop program instead: needs a display, 12 minutes",
    )
    add(doctor, json=False)

    text = "How well handcal does on given data."
    judged = commands.add_parser("evaluate", help=text, description=text)
    add_evaluate_commands(judged.add_subparsers(metavar="WHAT", required=True, parser_class=Parser))

    text = "Studies on simulated wearers, in many processes, each with a report."
    study = commands.add_parser("study", help=text, description=text)
    add_study_commands(study.add_subparsers(metavar="STUDY", required=True, parser_class=Parser))

    text = "The offline calibration: boards, cameras, displays, and the rig file made of them."
    rig = commands.add_parser("rig", help=text, description=text)
    steps = rig.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    add_rig_commands(steps)
    add_rig_file_commands(steps)
    return parser


def _add_roi(command: Parser) -> None:
    command.add_argument(
        "--roi",
        choices=get_args(Roi),
        default="detector",
        help="look for the hand where the detector sees it in the colour image (of several the "
        "nearest, leftmost or rightmost), or by depth alone",
    )


def _open_source(arguments: argparse.Namespace) -> Camera:
    """Open the camera that a command's ``--source`` names."""
    from handcal.camera.realsense import RealSenseCamera
    from handcal.camera.recordings import open_recording
    from handcal.sim.camera import SyntheticCamera
    from handcal.sim.hand import make_hand
    from handcal.sim.render import World
    from handcal.sim.room import make_room
    from handcal.sim.sway import swaying_hand

    match arguments.source:
        case "simulator":
            world = World(make_hand(arguments.seed), make_room(arguments.seed))
            return SyntheticCamera(world, swaying_hand, seed=arguments.seed)
        case "realsense":
            return RealSenseCamera(realsense_of(arguments))
        case path:
            return open_recording(Path(path))


def _rig_path(rig: Path | None) -> Path:
    from handcal.io.resources import resource_path

    return rig or resource_path("example_rig.yaml")


def _triple(values: Iterable[float]) -> str:
    return " ".join(f"{value:.1f}" for value in values)


def _cell(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _replay_row(step: ReplayStep) -> dict[str, Any]:
    import numpy as np

    hand, motion = step.hand, step.motion
    return {
        "frame": step.frame.index,
        "points": len(hand.points_m) if hand else None,
        "median_depth_m": hand.median_depth_m if hand else None,
        "turned_deg": float(np.degrees(np.linalg.norm(motion.rotation_rad))) if motion else None,
        "moved_mm": float(1e3 * np.linalg.norm(motion.shift_m)) if motion else None,
        "segment_ms": 1e3 * step.segment_s,
        "problem": step.problem,
    }
