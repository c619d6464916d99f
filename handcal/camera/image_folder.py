"""Playback of folders of images as Open3D's recorders and the TUM RGB-D benchmark store them.

Depth is aligned to colour in both. Open3D: ``camera_intrinsic.json`` or ``intrinsic.json``, and
images of equal names in ``depth`` and ``color``. TUM: ``depth.txt`` and ``rgb.txt`` with a time in
seconds and the name of a file on each line.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from handcal.camera.images import intrinsics_from, number_from, read_color, read_depth
from handcal.camera.playback import PlaybackSettings, PlayedCamera
from handcal.core.errors import CameraEndError, CameraError, FileError
from handcal.core.types import CameraIdentity, Frame, Intrinsics
from handcal.io.files import read_json, read_limited
from handcal.io.images import IMAGE_SUFFIXES

_INTRINSICS = "camera_intrinsic.json", "intrinsic.json"
_TUM_DEPTH, _TUM_COLOR = "depth.txt", "rgb.txt"
_TUM_CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
"""As TUM's own tools assume (their page on file formats)."""
_TUM_PER_M, _PER_M, _FPS = 5000.0, 1000.0, 30.0
_APART_NS = 20_000_000  # as TUM's associate.py
_MAX_LIST_BYTES, _MOST_FRAMES = 16 * 2**20, 1_000_000


def is_image_folder(folder: Path) -> bool:
    """Return whether a folder looks like one of Open3D or TUM."""
    return (folder / _TUM_DEPTH).is_file() or (
        (folder / "depth").is_dir() and any((folder / name).is_file() for name in _INTRINSICS)
    )


class ImageFolderCamera(PlayedCamera):
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

    def __init__(self, folder: Path, settings: PlaybackSettings | None = None) -> None:
        super().__init__(settings)
        self.name = f"Recording {folder.name}"
        self.identity = CameraIdentity()
        self._place = 0
        is_tum = (folder / _TUM_DEPTH).is_file()
        try:
            path = next((folder / one for one in _INTRINSICS if (folder / one).is_file()), None)
            values = {} if path is None else read_json(path)
            if path is None:
                self.depth_intrinsics = _TUM_CAMERA
                self.notes = (f"no {_INTRINSICS[0]}: TUM's usual intrinsics, 525 px, are taken",)
            else:
                self.depth_intrinsics = _intrinsics(values, path)
            values = {"depth_scale": _TUM_PER_M if is_tum else _PER_M, "fps": _FPS} | values
            path = path or folder
            self._depth_scale_m = 1.0 / number_from(values, path, "depth_scale", 10.0, 1e6)
            self._frames = (
                _tum_frames(folder)
                if is_tum
                else _open3d_frames(folder, number_from(values, path, "fps", 0.1, 1000.0))
            )
        except FileError as error:
            raise CameraError(str(error)) from error
        if not 0 < len(self._frames) <= _MOST_FRAMES:
            raise CameraError(f"{folder} has {len(self._frames)} depth images")

    def _next(self, timeout_s: float) -> Frame:  # noqa: ARG002 (files do not keep one waiting)
        if self._place == len(self._frames):
            raise CameraEndError(f"{self.name} has ended")
        t_ns, depth, color = self._frames[self._place]
        self._place += 1
        camera = self.depth_intrinsics
        try:
            return Frame(
                index=self._place,
                t_camera_ns=t_ns,
                t_host_ns=0,
                depth=read_depth(depth, camera),
                depth_scale_m=self._depth_scale_m,
                depth_intrinsics=camera,
                color=None if color is None else read_color(color, camera),
                color_intrinsics=None if color is None else camera,
            )
        except FileError as error:
            raise CameraError(str(error)) from error

    def _go_to(self, t_camera_ns: int) -> None:
        later = (place for place, one in enumerate(self._frames) if one[0] >= t_camera_ns)
        self._place = next(later, len(self._frames))


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


def _open3d_frames(folder: Path, fps: float) -> list[tuple[int, Path, Path | None]]:
    """Return time, depth and colour of each frame; the images are numbered, not timed."""
    depths, colors = (
        {
            path.stem: path
            for path in sorted(folder.joinpath(name).glob("*"))
            if path.suffix.lower() in IMAGE_SUFFIXES
        }
        for name in ("depth", "color")
    )
    return [
        (round(number * 1e9 / fps), path, colors.get(stem))
        for number, (stem, path) in enumerate(depths.items())
    ]


def _tum_frames(folder: Path) -> list[tuple[int, Path, Path | None]]:
    """Return time, depth and colour of each frame: the colour nearest in time."""
    colors = _tum_list(folder / _TUM_COLOR) if (folder / _TUM_COLOR).is_file() else []
    times_ns = np.array([t_ns for t_ns, _ in colors], np.int64)
    frames: list[tuple[int, Path, Path | None]] = []
    for t_ns, depth in _tum_list(folder / _TUM_DEPTH):
        after = int(np.searchsorted(times_ns, t_ns))
        near = colors[max(0, after - 1) : after + 1]
        nearest = min(near, key=lambda one: abs(one[0] - t_ns), default=None)
        is_near = nearest is not None and abs(nearest[0] - t_ns) <= _APART_NS
        frames.append((t_ns, depth, nearest[1] if nearest is not None and is_near else None))
    return frames


def _tum_list(path: Path) -> list[tuple[int, Path]]:
    """Read times and paths of images, in order of time; a path must not leave the folder."""
    listed = []
    for line in read_limited(path, _MAX_LIST_BYTES).decode(errors="replace").splitlines():
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
