"""Opening and writing recordings: files of librealsense and ROS, and folders of images."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from handcal.camera.folder import FolderCamera, ImageFolderCamera, is_image_folder, record_folder
from handcal.camera.playback import PlaybackSettings, PlayedCamera
from handcal.camera.recording import RecordingCamera, record_db3
from handcal.camera.ros import RosCamera, ros_recording
from handcal.core.types import CameraIdentity, Frame

RECORDING_SUFFIXES = (".db3", ".bag")
"""Suffixes of librealsense's recordings."""


def open_recording(path: Path, settings: PlaybackSettings | None = None) -> PlayedCamera:
    """Return a camera that plays a ``.db3`` or ``.bag`` file, a recording of ROS, or a folder.

    The folder is one of handcal, Open3D or TUM RGB-D.

    Raises
    ------
    CameraError
        If it cannot be played.
    """
    if (folder := ros_recording(path)) is not None:
        return RosCamera(folder, settings)
    if is_image_folder(path):
        return ImageFolderCamera(path, settings)
    return FolderCamera(path, settings) if path.is_dir() else RecordingCamera(path, settings)


def record_frames(
    path: Path,
    frames: Iterable[Frame],
    identity: CameraIdentity = CameraIdentity(),
    gate_m: tuple[float, float] | None = None,
) -> int:
    """Record frames as a ``.db3`` file or a folder, by the suffix of `path`; return their number.

    The recording keeps the camera's `identity`, a folder also the depth gate, `gate_m`.

    Raises
    ------
    CameraError, FileError
        If it cannot be written.
    ValueError
        If there is no frame, they are not all of one camera, or a file is to keep a depth gate.
    """
    if path.suffix == "":
        return record_folder(path, frames, identity, gate_m)
    if gate_m is not None:
        raise ValueError(f"{path.name} cannot keep a depth gate; record into a folder")
    return record_db3(path, frames, identity)
