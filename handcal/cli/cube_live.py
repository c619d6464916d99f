"""``handcal evaluate cube track, trials``: a cube that stands in the room."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from handcal.cli.cameras import REALSENSE_OPTIONS, open_source, realsense_of
from handcal.cli.display_check import network_server
from handcal.cli.output import console, save, show_progress, table, until_interrupted
from handcal.cli.run import KEYS, LISTEN
from handcal.cli.terminal import (
    arg,
    command,
    eyes_of,
    eyes_option,
    fail,
    file_option,
    flag,
    number,
    patience,
    value,
)
from handcal.core.errors import HandcalError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from handcal.core.types import Eye, Float64

_STEP_MM = 0.25
_KEYS: Mapping[str, tuple[int, float]] = {
    "r": (0, 1.0),
    "l": (0, -1.0),
    "d": (1, 1.0),
    "u": (1, -1.0),
    "f": (2, 1.0),
    "b": (2, -1.0),
}
_CUBE = (
    file_option(
        "--cube", "description of the cube, with the measured sides (default: a 60 mm cube)"
    ),
    arg(
        "--camera",
        metavar="SOURCE",
        default="realsense",
        help="realsense; simulator; or the path of a recording with colour",
    ),
    patience("until the headset connects, and until the cube is in its place"),
    *LISTEN,
    KEYS,
)


@command(
    file_option("--rig", "rig file (default: the shipped example)"),
    flag("--no-headset", "only track, for a camera that does not move; nothing is drawn"),
    value("--seconds", number(float, 0.1, 86_400.0), "S", "stop after this time", default=30.0),
    *_CUBE,
    *REALSENSE_OPTIONS,
    example="handcal evaluate cube track --camera simulator --no-headset --seconds 5",
    json=True,
)
def track(arguments: argparse.Namespace) -> None:
    """Track a cube with the depth camera, and have the headset draw it where it is."""
    from handcal.station.user_test.cube import TrackingOrder, track_cube

    with until_interrupted() as is_stopped, show_progress(is_stopped) as progress:
        found = track_cube(
            TrackingOrder(arguments.rig, arguments.cube, arguments.seconds),
            None if arguments.no_headset else lambda: network_server(arguments),
            None
            if arguments.camera == "simulator"
            else lambda: open_source(arguments.camera, realsense_of(arguments)),
            progress=progress,
        )
    pose = found.tracked[-1].T_W_T if found.tracked else None
    error_mm = None if found.error_m is None else 1e3 * found.error_m
    jitter_m = found.jitter_m
    result = {
        "frames": found.frames,
        "tracked": found.poses,
        "rate_hz": found.rate_hz,
        "jitter_mm": None if jitter_m is None else 1e3 * jitter_m,
        "is_at_rest": bool(found.tracked and found.tracked[-1].is_at_rest),
        "T_W_T": None if pose is None else pose.tolist(),
        "error_mm": error_mm,
    }
    save(arguments.json, result)
    console.print(f"{found.poses} poses in {found.frames} frames")
    if jitter_m is not None:
        console.print(f"At rest it moves by {1e3 * jitter_m:.2f} mm RMS from frame to frame")
    if error_mm is not None:
        console.print(f"Distance from the true place: {error_mm:.2f} mm")
    if not found.tracked:
        raise HandcalError(f"the cube was not tracked: {found.problem or 'no frame'}")


@command(
    arg("session", type=Path, help="a calibrated session, in which the trials are stored"),
    arg(
        "--headset",
        choices=("network", "virtual"),
        default="network",
        help="a paired headset that connects; or a simulated one, with the simulator's wearer",
    ),
    eyes_option("eyes to record trials for"),
    *_CUBE,
    *REALSENSE_OPTIONS,
    example="handcal evaluate trials sessions/NAME --cube cube.json",
    json=True,
)
def trials(arguments: argparse.Namespace) -> None:
    """Record the user test's trials with a cube in the room, for a calibrated session."""
    from handcal.session.trial import trial_json
    from handcal.station.user_test.cube import (
        StudyLeader,
        TrialOrder,
        TrialSettings,
        record_user_trials,
    )

    if (arguments.headset == "virtual") != (arguments.camera == "simulator"):
        fail("--headset virtual and --camera simulator go together", 2)
    settings = TrialSettings(eyes_of(arguments), patience_s=arguments.patience_s)
    made = record_user_trials(
        TrialOrder(arguments.session, arguments.cube, settings),
        None if arguments.headset == "virtual" else lambda: network_server(arguments),
        lambda: open_source(arguments.camera, realsense_of(arguments)),
        StudyLeader(_ask_to_place, _adjust),
    )
    save(arguments.json, {"trials": [trial_json(trial) for trial in made]})
    shown = table("eye", "distance, m", "error, arcmin", "error, px")
    for trial in made:
        shown.add_row(
            trial.eye,
            f"{trial.target_depth_m:g}",
            f"{trial.error_arcmin.mean():.1f}",
            f"{trial.error_px.mean():.1f}",
        )
    console.print(shown)


def _ask_to_place(depth_m: float) -> None:
    console.input(
        f"Put the cube {depth_m:g} m from the eyes, with two or three faces towards them, then "
        "press Enter "
    )


def _adjust(eye: Eye, shift_m: Float64, draw: Callable[[Float64], None]) -> Float64:
    """Ask for keys until the drawn corners cover the cube's."""
    console.print(
        f"{eye} eye: move φ by {_STEP_MM} mm with l r u d (left, right, up, down) and f b "
        "(forward, back), as many as you like, then Enter; an empty line when the corners coincide"
    )
    while typed := console.input("> ").strip().lower():
        moved = shift_m.copy()
        for key in typed:
            axis, sign = _KEYS.get(key, (0, 0.0))
            moved[axis] += sign * _STEP_MM / 1e3
        shift_m = moved
        draw(shift_m)
    return shift_m
