"""``handcal record``, and the cameras and recordings that other commands open."""

from __future__ import annotations

import argparse
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from handcal.camera.settings import Preset, Profile, RealSenseSettings
from handcal.cli.output import console, save, show_progress, until_interrupted
from handcal.cli.terminal import arg, command, fail, flag, number, seed, settings_of, value
from handcal.core.errors import HandcalError

if TYPE_CHECKING:
    from handcal.camera.camera import Camera
    from handcal.camera.playback import PlayedCamera

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
    example="handcal record hand.db3 --seconds 20",
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
        console.print(said)
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


def realsense_of(arguments: argparse.Namespace) -> RealSenseSettings:
    """Return the settings that the options describe."""
    return settings_of(RealSenseSettings, arguments)


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
