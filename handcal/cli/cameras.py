"""``handcal record, replay, segment``: cameras, recordings and single images."""

from __future__ import annotations

import argparse
import re
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from handcal.camera.images import DEPTH_SCALES_M
from handcal.camera.settings import Preset, Profile, RealSenseSettings
from handcal.cli.output import console, save, show_progress, table, until_interrupted
from handcal.cli.terminal import (
    arg,
    command,
    fail,
    file_option,
    flag,
    folder_option,
    number,
    seed,
    value,
)
from handcal.core.errors import HandcalError
from handcal.hand.settings import Roi
from handcal.io.files import make_folder

if TYPE_CHECKING:
    from handcal.camera.camera import Camera
    from handcal.camera.playback import PlayedCamera
    from handcal.cli.replay import ReplayStep


_POSITIVE = number(float, 0.0, 1e6)
REALSENSE_OPTIONS = (
    arg("--serial", default="", help="serial number of the RealSense (default: the first found)"),
    arg(
        "--profile",
        choices=get_args(Profile),
        default="auto",
        help="size of the RealSense's images; auto: the largest available",
    ),
    arg(
        "--preset",
        choices=get_args(Preset),
        help="visual preset of the SDK (default: unchanged)",
    ),
    value(
        "--exposure-us", _POSITIVE, "US", "exposure time of the depth camera (default: automatic)"
    ),
    value("--laser-power-mw", _POSITIVE, "MW", "power of the projector (default: unchanged)"),
    flag("--expose-whole-image", "set the exposure of colour by the whole image, not by the hand"),
    flag("--spatial-filter", "apply the SDK's spatial filter to depth"),
    flag("--temporal-filter", "apply the SDK's temporal filter to depth"),
    flag("--hole-filling", "apply the SDK's hole filling to depth"),
)
"""One for every field of `RealSenseSettings`."""


def _depth_scale(text: str) -> float:
    """Convert metres per unit; units per metre, as Open3D and TUM give them, get a hint."""
    try:
        return number(float, *DEPTH_SCALES_M)(text)
    except argparse.ArgumentTypeError as error:
        if not re.fullmatch(r"[1-9]\d{2,5}(\.0*)?", text):
            raise
        hint = f"enter {1.0 / float(text):g} if a metre is {text} units"
        raise argparse.ArgumentTypeError(f"{error}; {hint}") from error


_ROI = arg(
    "--roi",
    choices=get_args(Roi),
    default="detector",
    help="search region: detector, the hand that the detector finds in the colour image (the "
    "nearest of several); left or right, the leftmost or rightmost of them; depth, the nearest "
    "hand-sized object, without the detector",
)
GATE = arg(
    "--gate",
    nargs=2,
    type=number(float, 0.05, 5.0),
    metavar=("NEAR_M", "FAR_M"),
    help="distances between which a hand is looked for (default: those kept in a recorded folder, "
    "or else 0.35 0.70, of a HoloLens 2's camera for hands 0.20 0.70)",
)


@command(
    arg("output", type=Path, help="a .db3 file, or a new folder"),
    arg(
        "--source",
        default="realsense",
        help="realsense, hololens2:HOST, oak, orbbec, simulator, or a recording to convert",
    ),
    value("--seconds", number(float, 0.01, 86_400.0), "S", "stop after this time", default=60.0),
    value("--frames", number(int, 1, 100_000), "N", "stop after this many frames", default=100_000),
    seed("the simulated hand and room"),
    GATE,
    *REALSENSE_OPTIONS,
    json=True,
)
def record(arguments: argparse.Namespace) -> None:
    """Record a camera into a .db3 file or a folder of images."""
    from handcal.camera.record import RecordSettings
    from handcal.camera.record import record as record_camera

    settings = RecordSettings(
        duration_s=arguments.seconds,
        frames=arguments.frames,
        gate_m=None if arguments.gate is None else gate_of(arguments),
    )
    with (
        open_source(arguments.source, realsense_of(arguments), arguments.seed) as camera,
        until_interrupted() as is_stopped,
    ):
        said = f"Recording {camera.name}; press Ctrl+C to stop and keep the recording."
        console.print(said, markup=False)
        try:
            with show_progress(is_stopped) as progress:
                recorded = record_camera(camera, arguments.output, settings, progress)
        except ValueError as error:
            raise HandcalError(str(error)) from error
    save(arguments.json, asdict(recorded))
    console.print(
        f"{recorded.frames} frames, {recorded.duration_s:.1f} s, {recorded.dropped} dropped; "
        f"ended: {recorded.stop_reason}. Recording: {arguments.output}"
    )


@command(
    arg("recording", type=Path, help=".db3 or .bag file, or a recorded folder"),
    flag("--real-time", "play at the recorded frame rate, dropping frames"),
    _ROI,
    GATE,
    json=True,
)
def replay(arguments: argparse.Namespace) -> None:
    """Play a recording and segment the hand in every frame."""
    from handcal.camera.playback import PlaybackSettings
    from handcal.camera.recordings import open_recording
    from handcal.cli.replay import replay as play
    from handcal.hand.settings import SegmentSettings

    shown_table = table("frame", "points", "depth, m", "rotation, °", "shift, mm", "time, ms")
    rows: list[dict[str, Any]] = []
    playback = PlaybackSettings(real_time=arguments.real_time)
    with open_recording(arguments.recording, playback) as camera:
        segmenting = SegmentSettings(arguments.roi, *gate_of(arguments, camera))
        for step in play(camera, segmenting):
            rows.append(_replay_row(step))
            shown = list(rows[-1].values())[:-2]
            shown_table.add_row(*map(_cell, shown))
    console.print(shown_table)
    save(arguments.json, {"frames": rows, "notes": list(camera.notes)})
    for note in camera.notes:
        console.print(f"The recording: {note}", markup=False)
    without = sum(not row["color"] for row in rows)
    if without:
        console.print(f"{without} of {len(rows)} frames have no colour: found by depth alone.")
    for row in rows:
        if row["problem"]:
            console.print(f"Frame {row['frame']}: {row['problem']}")
    found = sum(not row["problem"] for row in rows)
    console.print(f"{found} of {len(rows)} frames show a hand.")


@command(
    file_option("--color", "colour image", required=True),
    file_option("--depth", "16-bit PNG, TIFF or PGM, aligned to the colour image", required=True),
    file_option(
        "--intrinsics",
        "JSON with width, height, fx, fy, cx, cy, and depth_scale in metres per unit; or a file of "
        "another program",
        required=True,
    ),
    value(
        "--depth-scale",
        _depth_scale,
        "M",
        "metres per unit of depth (default: as the file of intrinsics says)",
    ),
    folder_option("--output", "folder for the results", required=True),
    _ROI,
    GATE,
)
def segment(arguments: argparse.Namespace) -> None:
    """Segment the hand in one image pair: cloud, contour, mask and overlay."""
    from handcal.camera.images import read_frame
    from handcal.cli.segmentation_file import write_segmentation
    from handcal.hand.settings import SegmentSettings
    from handcal.hand.shipped import make_finder

    frame = read_frame(
        arguments.color, arguments.depth, arguments.intrinsics, arguments.depth_scale
    )
    cloud = make_finder(SegmentSettings(arguments.roi, *gate_of(arguments))).find(frame)
    write_segmentation(cloud, frame, make_folder(arguments.output))
    console.print(
        f"{len(cloud.points_m)} points at {cloud.median_depth_m:.3f} m, "
        f"box {', '.join(map(str, cloud.box_px))} px. Results: {arguments.output}"
    )


def realsense_of(arguments: argparse.Namespace) -> RealSenseSettings:
    """Return the settings that the options describe."""
    names = [field.name for field in fields(RealSenseSettings)]
    return RealSenseSettings(**{name: getattr(arguments, name) for name in names})


def gate_of(
    arguments: argparse.Namespace, recording: PlayedCamera | None = None
) -> tuple[float, float]:
    """Return the depth gate of the options, or else of a recording or usual for its camera."""
    from handcal.hand.settings import usual_gate_m

    if arguments.gate is None:
        kept_m = None if recording is None else recording.gate_m
        return kept_m or usual_gate_m("" if recording is None else recording.identity.model)
    near_m, far_m = arguments.gate
    if near_m >= far_m:
        fail(f"--gate: NEAR_M, {near_m:g}, must be less than FAR_M, {far_m:g}", 2)
    return near_m, far_m


def open_source(
    source: str, realsense: RealSenseSettings, seed: int = 1, *, keeps_wrapped: bool = False
) -> Camera:
    """Open the camera that an option names: of a kind, or the path of a recording."""
    from handcal.camera.hololens2 import hololens2_settings
    from handcal.camera.live import is_live, open_hololens2, open_live
    from handcal.camera.realsense import RealSenseCamera
    from handcal.camera.recordings import open_recording
    from handcal.sim.camera import SyntheticCamera
    from handcal.sim.hand import make_hand
    from handcal.sim.render import World
    from handcal.sim.room import make_room
    from handcal.sim.scene import swaying_hand

    match source:
        case "simulator":
            world = World(make_hand(seed), make_room(seed))
            return SyntheticCamera(world, swaying_hand, seed=seed)
        case "realsense":
            return RealSenseCamera(realsense)
        case other:
            if (hololens2 := hololens2_settings(other)) is not None:
                return open_hololens2(replace(hololens2, keeps_wrapped=keeps_wrapped))
            return open_live(other) if is_live(other) else open_recording(Path(other))


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
        "color": step.frame.color is not None,
        "problem": step.problem,
    }


def _cell(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
