"""Duration of the steps that a person waits for or that run at camera rate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, thread_time
from typing import TypeVar

import numpy as np

from handcal.core.errors import HandError
from handcal.core.geometry import rigid
from handcal.core.progress import Progress
from handcal.core.types import EYES, Alignment, Float64, Frame, HeadsetIdentity
from handcal.hand.roi import Detector, RoiFinder
from handcal.hand.segment import SegmentSettings, segment_hand
from handcal.hand.shipped import load_detector
from handcal.lab.bench.trials import BenchFigure, BenchSettings, Measured, trial_hand
from handcal.lab.study.noise import FLOOR, NoiseSettings, noise_study
from handcal.lab.study.run import Study, run_study
from handcal.lab.study.store import StudyRow
from handcal.link.client import HeadsetClient
from handcal.link.impair import Impairment
from handcal.link.pairing import new_device_id, new_pairing_key
from handcal.link.server import HeadsetServer
from handcal.register.guard import RotationGuard, rotation_between
from handcal.register.solve import solve_alignment
from handcal.rig.example import example_rig
from handcal.sim.camera import SyntheticCamera
from handcal.sim.hand import make_hand
from handcal.sim.overlay import overlay_by_eye
from handcal.sim.render import World, render
from handcal.sim.room import make_room
from handcal.sim.scene import SceneState
from handcal.sim.sensor import D415_FATTEN_PX, SensorSettings, sense_depth

Input = TypeVar("Input")

_SIGMA_M = 0.001
_SHIFT_M = 0.005
_PALM_H_M = np.array([0.0, 0.09, 0.5])
_ICP_REACH_M = 0.05
_SPEED_UP = 290.0
_SOLVE_MS, _GUARD_MS, _SEGMENT_MS, _ROI_MS = 15.0, 10.0, 6.0, 2.0
_FRAMES, _FRAME_NS = 120, 33_333_333


def measure_speed(settings: BenchSettings, progress: Progress) -> Measured:
    """Measure segmentation, registration and solving in turn, in one thread."""
    trials = range(settings.paper_repeats)
    alignments = [_noisy_alignment(trial, settings.points) for trial in trials]
    figures = _segmentation(settings.repeats)
    progress.at(0.1)
    figures += _registration(alignments, settings.repeats)
    progress.at(0.2)
    figures += _solving(alignments, settings.repeats)
    progress.at(1.0)
    return Measured(figures, {"points": settings.points, "alignments": len(alignments)})


def _noisy_alignment(trial: int, points: int) -> Alignment:
    rng = np.random.default_rng(trial)
    true_shift_m = {eye: rng.uniform(-_SHIFT_M, _SHIFT_M, 3) for eye in EYES}
    hand, rig = trial_hand(trial), example_rig()
    return overlay_by_eye(rng, hand, rig, true_shift_m, points, _SIGMA_M)


def _segmentation(repeats: int) -> list[BenchFigure]:
    """Time the segmentation of one simulated frame, 1280x720, and the tracking of its ROI."""
    frame = simulated_frame()
    segmenting = SegmentSettings()
    roi_px = segment_hand(frame, segmenting).box_px
    [with_roi_ms] = _medians_ms([frame] * repeats, lambda f: segment_hand(f, segmenting, roi_px))
    [alone_ms] = _medians_ms([frame] * repeats, lambda f: segment_hand(f, segmenting))
    roi_ms = following_ms(load_detector(), frame)
    return [
        BenchFigure("ROI of a followed hand, mean a frame", roi_ms, "ms", at_most=_ROI_MS),
        BenchFigure("segmentation, 1280x720, ROI given", with_roi_ms, "ms", at_most=_SEGMENT_MS),
        BenchFigure("segmentation, 1280x720, no ROI", alone_ms, "ms"),
    ]


def simulated_frame() -> Frame:
    """Return a frame of a hand in a room, 1280x720."""
    T_W_D, T_W_hand = example_rig().T_H_D, rigid(translation_m=_PALM_H_M)
    world = World(trial_hand(0), make_room(0))
    with SyntheticCamera(world, lambda: SceneState(0, T_W_D, T_W_hand)) as camera:
        return camera.read()


def noisy_frames(T_D_hand: Float64, count: int) -> list[Frame]:
    """Return frames of one view of a hand in a room that differ in the sensor's noise.

    Parameters
    ----------
    T_D_hand : (4, 4) float64
        From the hand's frame to the depth camera's.
    count : int
    """
    camera, sensor = example_rig().depth_intrinsics, SensorSettings(fatten_px=D415_FATTEN_PX)
    depth_m, color = render(World(make_hand(1), make_room(1)), np.eye(4), T_D_hand, camera)
    return [
        Frame(
            index=0,
            t_camera_ns=0,
            t_host_ns=0,
            depth=sense_depth(depth_m, camera.fx, np.random.default_rng(seed), sensor),
            depth_scale_m=sensor.depth_scale_m,
            depth_intrinsics=camera,
            color=color,
            color_intrinsics=camera,
        )
        for seed in range(count)
    ]


def following_ms(detector: Detector, frame: Frame) -> float:
    """Return the mean processor time per frame for tracking a hand at 30 frames per second.

    The detector's checks of the hand are included, but not its detection.

    Raises
    ------
    HandError
        If no hand is found in the frame, or it is lost.
    """
    finder = RoiFinder(detector, SegmentSettings())
    finder.find(frame)
    started_s = thread_time()
    for number in range(1, _FRAMES + 1):
        t_ns = frame.t_camera_ns + number * _FRAME_NS
        if finder.find(replace(frame, t_camera_ns=t_ns)) is None:
            raise HandError("the detector has lost the simulated hand")
    return 1e3 * (thread_time() - started_s) / _FRAMES


def _registration(alignments: Sequence[Alignment], repeats: int) -> list[BenchFigure]:
    """Time the guard, and a whole registration beside Open3D's if it is installed."""
    guards = [(RotationGuard(a.cursor_m, a.cursor_is_cut), a) for a in alignments]
    [guard_ms] = _medians_ms(
        guards * repeats, lambda pair: pair[0].rotation(pair[1].hand_m, pair[1].hand_is_cut)
    )
    icp = _open3d_icp()
    own_ms, *icp_ms = _medians_ms(
        [(a.cursor_m, a.hand_m) for a in alignments] * repeats,
        lambda clouds: rotation_between(*clouds),
        *([icp] if icp else []),
    )
    figures = [
        BenchFigure("guard update", guard_ms, "ms", at_most=_GUARD_MS),
        BenchFigure("rotation_between", own_ms, "ms"),
    ]
    for baseline_ms in icp_ms:
        figures += [
            BenchFigure("Open3D's ICP, same clouds", baseline_ms, "ms"),
            BenchFigure("rotation_between / Open3D's ICP", own_ms / baseline_ms, "", at_most=1.0),
        ]
    return figures


def _open3d_icp() -> Callable[[tuple[Float64, Float64]], object] | None:
    """Return Open3D's ICP of two clouds with its defaults; None if it is not installed."""
    try:
        import open3d as o3d
    except ImportError:
        return None

    def cloud(points_m: Float64) -> o3d.geometry.PointCloud:
        return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(points_m)))

    def register(clouds: tuple[Float64, Float64]) -> object:
        cursor, hand = map(cloud, clouds)
        return o3d.pipelines.registration.registration_icp(cursor, hand, _ICP_REACH_M)

    return register


def _solving(alignments: Sequence[Alignment], repeats: int) -> list[BenchFigure]:
    """Time solving both eyes by the default and the published method, on the same alignments."""
    rig = example_rig()
    [consistent_ms] = _medians_ms([*alignments] * repeats, lambda a: solve_alignment(a, rig))
    [paper_ms] = _medians_ms(alignments, lambda a: solve_alignment(a, rig, "paper"))
    speed_up = paper_ms / consistent_ms
    return [
        BenchFigure("solve both eyes", consistent_ms, "ms", at_most=_SOLVE_MS),
        BenchFigure("solve both eyes, paper", paper_ms, "ms"),
        BenchFigure("solve both eyes: paper / consistent", speed_up, "", at_least=_SPEED_UP),
    ]


def _medians_ms(inputs: Sequence[Input], *actions: Callable[[Input], object]) -> list[float]:
    """Return the median duration of each action over the inputs.

    The actions alternate, so that a busy moment of the machine affects all of them.
    """
    durations_s: list[list[float]] = [[] for _ in actions]
    for value in inputs:
        for action, durations in zip(actions, durations_s, strict=True):
            start_s = perf_counter()
            action(value)
            durations.append(perf_counter() - start_s)
    return [1e3 * float(np.median(durations)) for durations in durations_s]


# Latency of sending a cursor to the headset, on a good network and on a bad one.

_LOSSES = 0.0, 0.3
_PATIENCE_S = 5.0


def measure_delivery(settings: BenchSettings, progress: Progress) -> Measured:
    """Measure the time until a cursor is acknowledged over loopback."""
    figures = []
    worst_ms = {}
    for done, loss in enumerate(_LOSSES, 1):
        durations_ms = _cursor_durations_ms(loss, settings)
        median_ms = float(np.median(durations_ms))
        figures.append(BenchFigure(f"cursor acknowledged, {loss:.0%} loss", median_ms, "ms"))
        worst_ms[f"{loss:g}"] = max(durations_ms)
        progress.at(done / len(_LOSSES))
    return Measured(figures, {"worst_ms_at_loss": worst_ms})


def _cursor_durations_ms(loss: float, settings: BenchSettings) -> list[float]:
    """Time successive cursors, with datagrams lost and reordered with probability `loss`."""
    rng = np.random.default_rng(0)
    key = new_pairing_key().encode()
    identity = HeadsetIdentity(new_device_id())
    impairment = Impairment(loss, reorder=loss)
    durations_ms = []
    with (
        HeadsetServer(key) as server,
        HeadsetClient(server.address, key, identity, impairment=impairment),
    ):
        server.wait_connected(_PATIENCE_S)
        for number in range(1, settings.repeats + 1):
            cursor_m = rng.uniform(-0.1, 0.1, (settings.points, 3))
            start_s = perf_counter()
            server.wait_acked(server.send_cursor(cursor_m, number), _PATIENCE_S)
            durations_ms.append(1e3 * (perf_counter() - start_s))
    return durations_ms


# Speed of a study, with one and with two processes.

# Each process makes its own hands; in a whole study this time is negligible.
_HANDS = 2
_WORKERS_SPEED_UP = 1.7
_PER_MINUTE = 2000.0


def measure_scale(settings: BenchSettings, progress: Progress) -> Measured:
    """Run a small noise study in this process, then in two, including their start."""
    if not settings.study_trials:
        progress.at(1.0)
        return Measured([], {})
    study = noise_study(
        replace(
            NoiseSettings(),
            trials=settings.study_trials,
            hands=_HANDS,
            shapes=0,
            linear_trials=1,
            paper_trials=0,
        )
    )
    alone_s, _ = _timed(study, 1, progress.part(0.0, 0.6))
    together_s, rows = _timed(study, 2, progress.part(0.6, 1.0))
    solved = sum(row["method"] != FLOOR for row in rows)
    return Measured(
        [
            BenchFigure(
                "noise study: alignments solved a minute, two workers",
                60.0 * solved / together_s,
                "",
                at_least=_PER_MINUTE,
            ),
            BenchFigure(
                "noise study: two workers / one",
                alone_s / together_s,
                "",
                at_least=_WORKERS_SPEED_UP,
            ),
        ],
        {
            "alignments": len(study.cases),
            "solved": solved,
            "one_worker_s": alone_s,
            "two_workers_s": together_s,
        },
    )


def _timed(study: Study, workers: int, progress: Progress) -> tuple[float, list[StudyRow]]:
    with TemporaryDirectory() as folder:
        start_s = perf_counter()
        rows = run_study(study, Path(folder), workers=workers, progress=progress)
        return perf_counter() - start_s, rows
