"""Recordings as folders of images: handcal's own, Open3D's and those of the TUM RGB-D benchmark.

handcal's are PNG images with JSON and CSV files, which any program can read. Such a folder is
complete at any time, because a frame is listed after its images are written.

Depth is aligned to colour in the other two. Open3D: ``camera_intrinsic.json`` or
``intrinsic.json``, and images of equal names in ``depth`` and ``color``. TUM: ``depth.txt`` and
``rgb.txt`` with a time in seconds and the name of a file on each line.
"""

from __future__ import annotations

import os
from abc import abstractmethod
from collections import deque
from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from handcal.camera.images import (
    depth_scale_from,
    intrinsics_from,
    number_from,
    read_color,
    read_depth,
)
from handcal.camera.playback import PlaybackSettings, PlayedCamera, of_one_camera
from handcal.core.errors import CameraEndError, CameraError, FileError
from handcal.core.geometry import is_rigid
from handcal.core.types import CameraIdentity, Float64, Frame, Intrinsics
from handcal.io.files import make_folder, read_json, read_limited, write_json
from handcal.io.images import IMAGE_SUFFIXES
from handcal.rig.check import identity_from_json

DESCRIPTION = "recording.json"
LIST = "frames.csv"

_VERSION = 1
_COLUMNS = "index,t_camera_ns,has_color"
_POSED_COLUMNS = f"{_COLUMNS},T_W_D"
_MAX_LIST_BYTES = 64 * 2**20
_MOST_FRAMES = 1_000_000
_REACH_M = 1.0
_WORLD_M = 1000.0
_POSE_TOLERANCE = 1e-4  # a product of transforms, each of the accuracy of float32
_WRITERS = min(4, os.cpu_count() or 1)
_MOST_WAITING = 8
# Low compression, as compressing takes most of the time.
_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 1)


@dataclass(frozen=True, slots=True, eq=False)
class _Listed:
    """One frame of a folder, its images not yet read."""

    index: int
    t_camera_ns: int
    depth: Path
    color: Path | None
    T_W_D: Float64 | None = None


class _ListedCamera(PlayedCamera):
    """Plays the frames of a list; a subclass makes the list and describes the camera."""

    _frames: list[_Listed]
    _depth_scale_m: float
    _color_intrinsics: Intrinsics | None = None
    _T_C_D: Float64 = np.eye(4)

    def __init__(self, folder: Path, settings: PlaybackSettings | None = None) -> None:
        super().__init__(settings)
        self.name = f"Recording {folder.name}"
        self.identity = CameraIdentity()
        self._place = 0
        try:
            self._open(folder)
        except FileError as error:
            raise CameraError(*error.args) from error

    @abstractmethod
    def _open(self, folder: Path) -> None:
        """Describe the camera and list the frames; raises FileError or CameraError."""

    def _next(self, timeout_s: float) -> Frame:  # noqa: ARG002 (files do not keep one waiting)
        if self._place == len(self._frames):
            raise CameraEndError(f"{self.name} has ended")
        listed = self._frames[self._place]
        self._place += 1
        color, camera = None, None
        try:
            if listed.color is not None and self._color_intrinsics is not None:
                camera = self._color_intrinsics
                color = read_color(listed.color, camera)
            return Frame(
                index=listed.index,
                t_camera_ns=listed.t_camera_ns,
                t_host_ns=0,
                depth=read_depth(listed.depth, self.depth_intrinsics),
                depth_scale_m=self._depth_scale_m,
                depth_intrinsics=self.depth_intrinsics,
                color=color,
                color_intrinsics=camera,
                T_C_D=np.eye(4) if camera is None else self._T_C_D,
                T_W_D=listed.T_W_D,
            )
        except FileError as error:
            raise CameraError(*error.args) from error

    def _go_to(self, t_camera_ns: int) -> None:
        later = (i for i, frame in enumerate(self._frames) if frame.t_camera_ns >= t_camera_ns)
        self._place = next(later, len(self._frames))


class FolderCamera(_ListedCamera):
    """Plays a folder of frames back; implements `Camera`.

    Parameters
    ----------
    folder : Path
        A folder written by `record_folder`.
    settings : PlaybackSettings

    Raises
    ------
    CameraError
        If it is not such a folder, or its version is unknown.
    """

    def _open(self, folder: Path) -> None:
        path = folder / DESCRIPTION
        if not path.is_file():
            raise CameraError(
                f"{folder} is not a recording: it has no {DESCRIPTION} (handcal), no "
                "camera_intrinsic.json beside color and depth (Open3D), no depth.txt (TUM RGB-D) "
                "and no metadata.yaml (ROS 2)"
            )
        values = read_json(path)
        if values.get("handcal_recording") != _VERSION:
            raise FileError(f"{path} is not a handcal recording of version {_VERSION}")
        depth, color = values.get("depth"), values.get("color")
        if not isinstance(depth, dict) or not isinstance(color, dict | None):
            raise FileError(f"{path} must describe depth and, unless it is null, color")
        self.depth_intrinsics = intrinsics_from(depth, path)
        self._color_intrinsics = None if color is None else intrinsics_from(color, path)
        self._depth_scale_m = depth_scale_from(values, path)
        if (gate := values.get("gate_m")) is not None:
            is_pair = isinstance(gate, list) and len(gate) == 2
            near, far = gate if is_pair else (None, None)
            near_m = number_from({"gate_m": near}, path, "gate_m", 0.01, 100.0)
            self.gate_m = near_m, number_from({"gate_m": far}, path, "gate_m", near_m, 100.0)
        self._T_C_D = _rigid_from(values.get("T_C_D"), path)
        try:
            self.identity = identity_from_json(values.get("device"), "device")
        except ValueError as error:
            raise FileError(f"{path}: {error}") from error
        self._frames = _read_list(folder)


def record_folder(
    folder: Path,
    frames: Iterable[Frame],
    identity: CameraIdentity = CameraIdentity(),
    gate_m: tuple[float, float] | None = None,
) -> int:
    """Record frames of one camera as a folder of images, without loss.

    Parameters
    ----------
    folder : Path
        Created if needed; it must be empty.
    frames : iterable of Frame
        Frames of one camera, with the same intrinsics, depth scale and extrinsics. If the first has
        colour or a pose, later ones may lack it.
    identity : CameraIdentity
        Of that camera, where it is known.
    gate_m : (float, float), optional
        Depth gate for those who look for the hand in the recording.

    Returns
    -------
    int
        Number of frames recorded.

    Raises
    ------
    FileError
        If the folder is not empty or cannot be written; the listed frames are complete.
    ValueError
        If there is no frame, or frames differ in camera.
    """
    first, frames = of_one_camera(frames)
    make_folder(folder)
    if any(folder.iterdir()):
        raise FileError(f"{folder} is not empty", "choose a new folder")
    write_json(
        folder / DESCRIPTION,
        {
            "handcal_recording": _VERSION,
            "depth_scale": first.depth_scale_m,
            "depth": asdict(first.depth_intrinsics),
            "color": None if first.color_intrinsics is None else asdict(first.color_intrinsics),
            "T_C_D": first.T_C_D.tolist(),
            "device": asdict(identity),
        }
        | ({} if gate_m is None else {"gate_m": gate_m}),
    )
    try:
        return _write_frames(folder, frames, first.T_W_D is not None)
    except OSError as error:
        raise FileError(f"cannot write {folder}: {error.strerror or error}") from error


def _write_frames(folder: Path, frames: Iterable[Frame], is_posed: bool) -> int:
    """Write images in several threads, as compression takes longer than a frame lasts."""
    number = 0
    waiting: deque[tuple[Frame, Future[None]]] = deque()
    # Without newline, Windows would write line ends that are not those read.
    with (
        (folder / LIST).open("x", encoding="ascii", newline="\n") as file,
        ThreadPoolExecutor(_WRITERS) as pool,
    ):

        def list_oldest() -> None:
            frame, written = waiting.popleft()
            written.result()
            line = f"{frame.index},{frame.t_camera_ns},{int(frame.color is not None)}"
            file.write(f"{line},{_pose_text(frame.T_W_D)}\n" if is_posed else f"{line}\n")
            file.flush()

        file.write(f"{_POSED_COLUMNS if is_posed else _COLUMNS}\n")
        for number, frame in enumerate(frames, start=1):
            waiting.append((frame, pool.submit(_write_images, folder, number, frame)))
            if len(waiting) > _MOST_WAITING:
                list_oldest()
        while waiting:
            list_oldest()
    return number


def _write_images(folder: Path, number: int, frame: Frame) -> None:
    depth_path, color_path = _image_paths(folder, number)
    depth_path.write_bytes(_png(frame.depth))
    if frame.color is not None:
        color_path.write_bytes(_png(frame.color[..., ::-1]))


def _png(image: NDArray[Any]) -> bytes:
    _, data = cv2.imencode(".png", image, _PNG)
    return data.tobytes()


def _image_paths(folder: Path, number: int) -> tuple[Path, Path]:
    """Return the paths of depth and colour for a line of the list, counted from 1."""
    return folder / f"depth-{number:06}.png", folder / f"color-{number:06}.png"


def _read_list(folder: Path) -> list[_Listed]:
    """Read the list of frames; an incomplete last line, as after a crash, is ignored."""
    path = folder / LIST
    text = read_limited(path, _MAX_LIST_BYTES).decode("ascii", errors="replace")
    # An editor on Windows ends lines with two characters.
    columns, *lines = text.replace("\r\n", "\n").split("\n")[:-1] or [""]
    if columns not in (_COLUMNS, _POSED_COLUMNS):
        raise FileError(f"{path} must begin with the line {_COLUMNS} or {_POSED_COLUMNS}")
    if len(lines) > _MOST_FRAMES:
        raise FileError(f"{path} lists more than {_MOST_FRAMES:,} frames")
    is_posed = columns == _POSED_COLUMNS
    wanted = "three 64-bit whole numbers" + ", and 12 numbers of a rigid transform" * is_posed
    frames = []
    for number, line in enumerate(lines, start=2):
        fields = line.split(",")
        try:
            if len(fields) != 3 + is_posed:
                raise ValueError("another number of fields")
            frames.append(_listed(*_image_paths(folder, number - 1), *fields))
        except ValueError as error:
            raise FileError(
                f"{path} must hold {wanted} on each line, but line {number} does not"
            ) from error
    return frames


def _listed(
    depth: Path, color: Path, index: str, t_camera_ns: str, has_color: str, pose: str = ""
) -> _Listed:
    images = depth, color if int(has_color) else None
    listed = _Listed(int(index), int(t_camera_ns), *images, _pose_from(pose))
    if max(abs(listed.index), abs(listed.t_camera_ns)) >= 2**63:
        raise ValueError("more than 64 bits")
    return listed


def _pose_text(T: Float64 | None) -> str:
    """Return the first 3 rows, so that they are read back exactly."""
    return "" if T is None else " ".join(map(repr, T[:3].ravel().tolist()))


def _pose_from(text: str) -> Float64 | None:
    if not text:
        return None
    T = np.eye(4)
    T[:3] = np.array([float(number) for number in text.split(" ")]).reshape(3, 4)
    if not is_rigid(T, _WORLD_M, _POSE_TOLERANCE):
        raise ValueError("no rigid transform")
    return T


def _rigid_from(value: object, path: Path) -> Float64:
    try:
        T = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        T = np.zeros(0)
    if T.shape != (4, 4) or not is_rigid(T, _REACH_M):
        raise FileError(f"{path}: T_C_D must be a rigid transform, 4 rows of 4 numbers")
    return T


_INTRINSICS = "camera_intrinsic.json", "intrinsic.json"
_TUM_DEPTH, _TUM_COLOR = "depth.txt", "rgb.txt"
_TUM_CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
"""As TUM's own tools assume (their page on file formats)."""
_TUM_PER_M, _PER_M, _FPS = 5000.0, 1000.0, 30.0
_APART_NS = 20_000_000  # as TUM's associate.py
_MAX_TUM_BYTES = 16 * 2**20


def is_image_folder(folder: Path) -> bool:
    """Return whether a folder looks like one of Open3D or TUM."""
    return (folder / _TUM_DEPTH).is_file() or (
        (folder / "depth").is_dir() and any((folder / name).is_file() for name in _INTRINSICS)
    )


class ImageFolderCamera(_ListedCamera):
    """Plays a folder of Open3D or TUM; implements `Camera`.

    Parameters
    ----------
    folder : Path
    settings : PlaybackSettings

    Raises
    ------
    CameraError
        If its files are missing or malformed.
    """

    def _open(self, folder: Path) -> None:
        is_tum = (folder / _TUM_DEPTH).is_file()
        path = next((folder / name for name in _INTRINSICS if (folder / name).is_file()), None)
        values = {"depth_scale": _TUM_PER_M if is_tum else _PER_M, "fps": _FPS}
        if path is None:
            path, camera = folder, _TUM_CAMERA
            self.notes = (f"no {_INTRINSICS[0]}: TUM's usual intrinsics, 525 px, are taken",)
        else:
            values |= read_json(path)
            camera = _intrinsics(values, path)
        self.depth_intrinsics = self._color_intrinsics = camera
        self._depth_scale_m = 1.0 / number_from(values, path, "depth_scale", 10.0, 1e6)
        if is_tum:
            self._frames = _tum_frames(folder)
        else:
            self._frames = _open3d_frames(folder, number_from(values, path, "fps", 0.1, 1000.0))
        if not 0 < len(self._frames) <= _MOST_FRAMES:
            raise CameraError(f"{folder} has {len(self._frames)} depth images")


def _intrinsics(values: dict[str, Any], path: Path) -> Intrinsics:
    """Read Open3D's camera: width, height and intrinsic_matrix, a list by columns."""
    try:
        matrix = np.array(values["intrinsic_matrix"], np.float64).reshape(3, 3)
    except (KeyError, TypeError, ValueError):
        raise FileError(f"{path} must give intrinsic_matrix as 9 numbers") from None
    by_rows = matrix if matrix[0, 2] else matrix.T
    (fx, _, cx), (_, fy, cy), _ = by_rows.tolist()
    size = {key: values.get(key) for key in ("width", "height")}
    return intrinsics_from(size | {"fx": fx, "fy": fy, "cx": cx, "cy": cy}, path)


def _open3d_frames(folder: Path, fps: float) -> list[_Listed]:
    """Return the frames of images that are numbered, not timed."""
    depths, colors = (
        {
            path.stem: path
            for path in sorted(folder.joinpath(name).glob("*"))
            if path.suffix.lower() in IMAGE_SUFFIXES
        }
        for name in ("depth", "color")
    )
    return [
        _Listed(number + 1, round(number * 1e9 / fps), path, colors.get(stem))
        for number, (stem, path) in enumerate(depths.items())
    ]


def _tum_frames(folder: Path) -> list[_Listed]:
    """Return the frames, each with the colour nearest in time."""
    colors = _tum_list(folder / _TUM_COLOR) if (folder / _TUM_COLOR).is_file() else []
    times_ns = np.array([t_ns for t_ns, _ in colors], np.int64)
    frames = []
    for number, (t_ns, depth) in enumerate(_tum_list(folder / _TUM_DEPTH), start=1):
        after = int(np.searchsorted(times_ns, t_ns))
        around = colors[max(0, after - 1) : after + 1]
        near = [(color_ns, path) for color_ns, path in around if abs(color_ns - t_ns) <= _APART_NS]
        _, color = min(near, key=lambda image: abs(image[0] - t_ns), default=(t_ns, None))
        frames.append(_Listed(number, t_ns, depth, color))
    return frames


def _tum_list(path: Path) -> list[tuple[int, Path]]:
    """Read times and paths of images, in order of time; a path must not leave the folder."""
    listed = []
    for line in read_limited(path, _MAX_TUM_BYTES).decode(errors="replace").splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        try:
            time, name = line.split()
            t_ns = round(1e9 * float(time))
        except (ValueError, OverflowError):
            raise FileError(f"{path} must hold a time and a file's name on each line") from None
        if abs(t_ns) >= 2**63 or Path(name).is_absolute() or ".." in Path(name).parts:
            raise FileError(f"{path}: {line.strip()!r} is no image of this folder")
        listed.append((t_ns, path.parent / name))
    return sorted(listed)
