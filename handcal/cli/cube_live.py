"""``handcal evaluate cube track, trials``: a cube that stands in the room."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from handcal.cli.cameras import REALSENSE_OPTIONS, open_source, realsense_of
from handcal.cli.display_check import network_server
from handcal.cli.output import console, save, show_progress, table, until_interrupted
from handcal.cli.run import KEYS, LISTEN
from handcal.cli.terminal import arg, command, number
from handcal.errors import HandcalError
from handcal.types import EYES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from handcal.link.server import HeadsetServer
    from handcal.rig_types import Rig
    from handcal.sim.cube_bench import CubeBench
    from handcal.station.cube_tracking import CubeTracker
    from handcal.types import Eye, Float64

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
    arg(
        "--cube",
        type=Path,
        metavar="FILE",
        help="description of the cube, with the measured sides (default: a 60 mm cube)",
    ),
    arg(
        "--camera",
        metavar="SOURCE",
        default="realsense",
        help="realsense; simulator; or the path of a recording with colour",
    ),
    arg(
        "--patience-s",
        type=number(float, 1.0, 86_400.0),
        metavar="S",
        default=120.0,
        help="longest time until the headset connects, and until the cube is in its place",
    ),
    *LISTEN,
    KEYS,
)


class _Setup(NamedTuple):
    server: HeadsetServer | None
    tracker: CubeTracker
    bench: CubeBench | None


@command(
    arg("--rig", type=Path, metavar="FILE", help="rig file (default: the shipped example)"),
    arg(
        "--no-headset",
        action="store_true",
        help="only track, for a camera that does not move; nothing is drawn",
    ),
    arg(
        "--seconds",
        type=number(float, 0.1, 86_400.0),
        metavar="S",
        default=30.0,
        help="stop after this time",
    ),
    *_CUBE,
    *REALSENSE_OPTIONS,
    json=True,
)
def track(arguments: argparse.Namespace) -> None:
    """Track a cube with the depth camera, and have the headset draw it where it is."""
    import numpy as np

    from handcal.rig.example import example_rig
    from handcal.rig.rig_file import read_rig
    from handcal.station.cube_tracking import run_cube_tracking
    from handcal.station.drawing import Drawing

    rig = example_rig() if arguments.rig is None else read_rig(arguments.rig)
    with (
        _setup(arguments, rig, not arguments.no_headset) as setup,
        until_interrupted() as is_stopped,
        show_progress(is_stopped) as progress,
    ):
        if setup.server is not None:
            offline_m = {eye: np.zeros(3) for eye in EYES}
            Drawing(rig, setup.server, "").send(offline_m)
        found = run_cube_tracking(setup.tracker, setup.server, arguments.seconds, progress)
        pose = found.tracked[-1].T_W_T if found.tracked else None
        error_mm = None
        if pose is not None and setup.bench is not None:
            error_mm = 1e3 * _apart_m(pose, setup.bench.T_W_T)
    jitter_m = found.jitter_m
    result = {
        "frames": found.frames,
        "tracked": len(found.tracked),
        "rate_hz": found.rate_hz,
        "jitter_mm": None if jitter_m is None else 1e3 * jitter_m,
        "is_at_rest": bool(found.tracked and found.tracked[-1].is_at_rest),
        "T_W_T": None if pose is None else pose.tolist(),
        "error_mm": error_mm,
    }
    save(arguments.json, result)
    console.print(f"{len(found.tracked)} poses in {found.frames} frames")
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
    arg("--eyes", choices=("both", *EYES), default="both", help="eyes with a trial each"),
    *_CUBE,
    *REALSENSE_OPTIONS,
    json=True,
)
def trials(arguments: argparse.Namespace) -> None:
    """Record the user test's trials with a cube in the room, for a calibrated session."""
    from handcal.session.trial import trial_json
    from handcal.station.user_test import (
        StudyLeader,
        TrialOrder,
        TrialSettings,
        record_user_trials,
    )

    if (arguments.headset == "virtual") != (arguments.camera == "simulator"):
        raise HandcalError("--headset virtual and --camera simulator go together")
    settings = TrialSettings(
        EYES if arguments.eyes == "both" else (arguments.eyes,), patience_s=arguments.patience_s
    )
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


@contextmanager
def _setup(arguments: argparse.Namespace, rig: Rig, has_headset: bool) -> Iterator[_Setup]:
    """Yield the link, the tracker and, with the simulator, the simulated wearer."""
    import numpy as np

    from handcal.rig.cube import Cube
    from handcal.rig.cube_file import read_cube
    from handcal.sim.cube_bench import simulated_wearer
    from handcal.station.cube_tracking import CubeTracker

    cube = Cube() if arguments.cube is None else read_cube(arguments.cube)
    if arguments.camera == "simulator":
        with simulated_wearer(rig, cube, 1) as (server, bench):
            tracker = CubeTracker(bench, cube, rig.T_H_D, server.pose_at_host_ns)
            yield _Setup(server, tracker, bench)
        return
    with open_source(arguments.camera, realsense_of(arguments)) as camera:
        if not has_headset:
            yield _Setup(None, CubeTracker(camera, cube, rig.T_H_D, lambda _: np.eye(4)), None)
            return
        with network_server(arguments) as server:
            yield _Setup(server, CubeTracker(camera, cube, rig.T_H_D, server.pose_at_host_ns), None)


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


def _apart_m(a: Float64, b: Float64) -> float:
    return float(((a[:3, 3] - b[:3, 3]) ** 2).sum() ** 0.5)
