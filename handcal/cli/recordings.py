"""``handcal replay, segment``: the hand in every frame of a recording, or in one image pair."""

from __future__ import annotations

import argparse
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handcal.camera.camera import Camera
from handcal.camera.images import DEPTH_SCALES_M
from handcal.cli.cameras import GATE, gate_of
from handcal.cli.output import console, save, table
from handcal.cli.terminal import arg, command, file_option, flag, folder_option, number, value
from handcal.core.errors import CameraEndError, HandError
from handcal.core.frozen import freeze
from handcal.core.geometry import image_points, transform
from handcal.core.types import Float64, Frame, HandCloud, UInt8
from handcal.hand.settings import Roi, SegmentSettings
from handcal.hand.shipped import make_finder
from handcal.io.files import make_folder, write_atomic, write_json, write_ply
from handcal.register.rigid import RigidSettings, register_rigid
from handcal.register.surface import Surface, describe_surface

_HAND_RGB = (0, 200, 80)
_CONTOUR_RGB = (0, 220, 255)
_CUT_RGB = (255, 40, 40)
_BOX_RGB = (255, 255, 255)


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


@command(
    arg("recording", type=Path, help=".db3 or .bag file, or a recorded folder"),
    flag("--real-time", "play at the recorded frame rate, dropping frames"),
    _ROI,
    GATE,
    example="handcal replay hand.db3 --json hand.json",
    json=True,
)
def replay(arguments: argparse.Namespace) -> None:
    """Play a recording and segment the hand in every frame."""
    from handcal.camera.playback import PlaybackSettings
    from handcal.camera.recordings import open_recording

    shown_table = table("frame", "points", "depth, m", "rotation, °", "shift, mm", "time, ms")
    rows: list[dict[str, Any]] = []
    playback = PlaybackSettings(real_time=arguments.real_time)
    with open_recording(arguments.recording, playback) as camera:
        segmenting = SegmentSettings(arguments.roi, *gate_of(arguments, camera))
        for step in replayed(camera, segmenting):
            rows.append(_replay_row(step))
            shown = list(rows[-1].values())[:-2]
            shown_table.add_row(*map(_cell, shown))
    console.print(shown_table)
    save(arguments.json, {"frames": rows, "notes": list(camera.notes)})
    for note in camera.notes:
        console.print(f"The recording: {note}")
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
    example="handcal segment --color color.png --depth depth.png --intrinsics camera.json "
    "--output hand",
)
def segment(arguments: argparse.Namespace) -> None:
    """Segment the hand in one image pair: cloud, contour, mask and overlay."""
    from handcal.camera.images import read_frame

    frame = read_frame(
        arguments.color, arguments.depth, arguments.intrinsics, arguments.depth_scale
    )
    cloud = make_finder(SegmentSettings(arguments.roi, *gate_of(arguments))).find(frame)
    write_segmentation(cloud, frame, make_folder(arguments.output))
    console.print(
        f"{len(cloud.points_m)} points at {cloud.median_depth_m:.3f} m, "
        f"box {', '.join(map(str, cloud.box_px))} px. Results: {arguments.output}"
    )


@dataclass(frozen=True, slots=True, eq=False)
class HandMotion:
    """The motion of the hand since the last frame in which it was found."""

    rotation_rad: Float64
    """(3,); rotation vector, frame D."""
    shift_m: Float64
    """(3,); displacement of the hand's centroid, frame D."""

    def __post_init__(self) -> None:
        freeze(self, "rotation_rad", np.float64, 3)
        freeze(self, "shift_m", np.float64, 3)


@dataclass(frozen=True, slots=True, eq=False)
class ReplayStep:
    """The result of one frame."""

    frame: Frame
    hand: HandCloud | None
    problem: str
    """The reason why no hand was found; empty if one was."""
    segment_s: float
    """Duration of the segmentation."""
    motion: HandMotion | None
    """None for the first hand."""


def replayed(camera: Camera, settings: SegmentSettings) -> Iterator[ReplayStep]:
    """Segment each frame until the camera has no more.

    Parameters
    ----------
    camera : Camera
        Stays open.
    settings : SegmentSettings

    Yields
    ------
    ReplayStep

    Raises
    ------
    CameraError
        As `Camera.read`, except for the end of a recording.
    """
    finder = make_finder(settings)
    previous: Surface | None = None
    while True:
        try:
            frame = camera.read()
        except CameraEndError:
            return
        start_s = time.perf_counter()
        try:
            hand = finder.find(frame)
            segment_s = time.perf_counter() - start_s
            surface = describe_surface(
                hand.points_m.astype(np.float64), hand.is_cut, RigidSettings().max_points
            )
        except HandError as error:
            yield ReplayStep(frame, None, str(error), time.perf_counter() - start_s, None)
            continue
        motion = None if previous is None else _motion(previous, surface)
        yield ReplayStep(frame, hand, "", segment_s, motion)
        previous = surface


def _motion(previous: Surface, surface: Surface) -> HandMotion:
    T_now_then = register_rigid(previous, surface).T_target_source
    centroid_m = previous.points_m.mean(axis=0)
    return HandMotion(
        Rotation.from_matrix(T_now_then[:3, :3]).as_rotvec(),
        (transform(T_now_then, centroid_m[None]) - centroid_m)[0],
    )


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


def write_segmentation(cloud: HandCloud, frame: Frame, folder: Path) -> None:
    """Write ``hand.ply``, ``contour.ply``, ``mask.png``, ``overlay.png`` and ``hand.json``.

    Clouds are in metres in the depth camera's frame, the hand in its own colours, the contour in
    blue and, along cut edges, in red. The mask is 255 on the hand. The JSON file gives ``box``
    (x0, y0, x1, y1; x1 and y1 exclusive), ``points``, ``contour_points`` and ``median_depth_m``.

    Parameters
    ----------
    cloud : HandCloud
    frame : Frame
        The frame that `cloud` was segmented in.
    folder : Path
        Created if missing.

    Raises
    ------
    FileError
        If a file cannot be written.
    """
    make_folder(folder)
    write_ply(folder / "hand.ply", cloud.points_m, cloud.colors)
    write_ply(folder / "contour.ply", cloud.contour_m, _contour_colors(cloud))
    _write_png(folder / "mask.png", cloud.mask)
    _write_png(folder / "overlay.png", draw_overlay(cloud, frame)[..., ::-1])
    write_json(
        folder / "hand.json",
        {
            "box": list(cloud.box_px),
            "points": len(cloud.points_m),
            "contour_points": len(cloud.contour_m),
            "median_depth_m": cloud.median_depth_m,
        },
    )


def draw_overlay(cloud: HandCloud, frame: Frame) -> UInt8:
    """Draw box, mask and contour over the depth camera's image.

    Returns
    -------
    (H, W, 3) uint8
        RGB, of the depth image's size.
    """
    picture = _picture(frame)
    on_hand = cloud.mask > 0
    picture[on_hand] = picture[on_hand] // 2 + np.array(_HAND_RGB, np.uint8) // 2
    columns, rows = np.rint(image_points(cloud.contour_m, frame.depth_intrinsics)).astype(int).T
    picture[rows, columns] = _contour_colors(cloud)
    x0, y0, x1, y1 = cloud.box_px
    cv2.rectangle(picture, (x0, y0), (x1 - 1, y1 - 1), _BOX_RGB)
    return picture


def _picture(frame: Frame) -> UInt8:
    """Return the colour image if the depth is aligned to it, else the depth in grey."""
    is_aligned = frame.color_intrinsics == frame.depth_intrinsics and np.array_equal(
        frame.T_C_D, np.eye(4)
    )
    if frame.color is not None and is_aligned:
        return frame.color.copy()
    near = 1.0 - frame.depth * frame.depth_scale_m  # white at the camera, black from 1 m on
    grey = np.where(frame.depth > 0, 255.0 * np.clip(near, 0.0, 1.0), 0.0).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def _contour_colors(cloud: HandCloud) -> UInt8:
    colors = np.array([_CONTOUR_RGB, _CUT_RGB], np.uint8)
    return np.take(colors, cloud.contour_is_cut.astype(int), axis=0)


def _write_png(path: Path, image: NDArray[Any]) -> None:
    _, data = cv2.imencode(".png", image)
    write_atomic(path, data.tobytes())
