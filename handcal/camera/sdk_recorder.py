"""Recording of any camera's frames as a file that librealsense plays."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np

from handcal.camera.one_camera import of_one_camera
from handcal.camera.sdk_devices import librealsense
from handcal.core.errors import CameraError
from handcal.core.types import CameraIdentity, Float64, Frame, Intrinsics
from handcal.io.files import sync_folder

_RATE_HZ = 30
_COEFFICIENTS = 5
_IDENTITY = ("name", "serial_number", "firmware_version")
_BACKLOG_BYTES = 64 * 2**20
_DISK_TIMEOUT_S = 10.0


def record_db3(
    path: Path, frames: Iterable[Frame], identity: CameraIdentity = CameraIdentity()
) -> int:
    """Record frames of one camera as a ``.db3`` file that librealsense plays.

    Parameters
    ----------
    path : Path
        Ends in ``.db3``; written under another name until complete.
    frames : iterable of Frame
        Frames of one camera, with the same intrinsics, depth scale and extrinsics. If the first has
        colour, later ones may lack it.
    identity : CameraIdentity
        Of that camera, where it is known.

    Returns
    -------
    int
        Number of frames recorded.

    Raises
    ------
    CameraError
        If librealsense is not installed or cannot write the file.
    ValueError
        If there is no frame, frames differ in camera or carry its pose, or `path` does not end in
        ``.db3``.
    """
    if path.suffix != ".db3":
        raise ValueError(f"librealsense records only .db3 files, not {path.name}")
    unfinished = path.with_name(f".{path.stem}.unfinished.db3")
    unfinished.unlink(missing_ok=True)
    try:
        count = _record(unfinished, frames, identity)
        unfinished.replace(path)
        sync_folder(path.parent)
    except (RuntimeError, OSError) as error:
        raise CameraError(f"{path} cannot be recorded: {error}") from error
    finally:
        unfinished.unlink(missing_ok=True)
    return count


def _record(path: Path, frames: Iterable[Frame], identity: CameraIdentity) -> int:
    rs = librealsense()
    first, frames = of_one_camera(frames)
    if first.T_W_D is not None:
        raise ValueError("a .db3 file holds no poses; record this camera into a folder")
    device = rs.software_device()
    for what, text in zip(_IDENTITY, astuple(identity), strict=True):
        if text:
            device.register_info(getattr(rs.camera_info, what), text)
    outlets = [_Outlet(rs, device, "Stereo Module", rs.stream.depth, first.depth_intrinsics)]
    outlets[0].sensor.add_read_only_option(rs.option.depth_units, first.depth_scale_m)
    if first.color_intrinsics is not None:
        outlets.append(_Outlet(rs, device, "RGB Camera", rs.stream.color, first.color_intrinsics))
        outlets[0].profile.register_extrinsics_to(
            outlets[1].profile, _rs_extrinsics(rs, first.T_C_D)
        )
    recorder = rs.recorder(str(path), device, False)  # compressed, it would play at only 16 Hz
    sensors = recorder.query_sensors()
    for sensor in sensors:
        sensor.open(sensor.get_stream_profiles())
        sensor.start(lambda _: None)
    count = written = 0
    try:
        for frame in frames:
            for outlet in outlets if frame.color is not None else outlets[:1]:
                written += outlet.push(frame)
            _wait_for_disk(path, written)
            count += 1
    finally:
        for sensor in sensors:
            sensor.stop()
            sensor.close()
    return count


class _Outlet:
    """One stream of a software device."""

    def __init__(self, rs: Any, device: Any, name: str, stream: Any, camera: Intrinsics) -> None:
        self._rs = rs
        self._is_depth = stream == rs.stream.depth
        self.sensor = device.add_sensor(name)
        video = rs.video_stream()
        video.type, video.index, video.uid = stream, 0, int(not self._is_depth)
        video.width, video.height, video.fps = camera.width, camera.height, _RATE_HZ
        video.bpp, video.fmt = (2, rs.format.z16) if self._is_depth else (3, rs.format.rgb8)
        video.intrinsics = _rs_intrinsics(rs, camera)
        self._bytes_per_pixel, self._stride = video.bpp, video.bpp * camera.width
        self.profile = self.sensor.add_video_stream(video)

    def push(self, frame: Frame) -> int:
        """Pass this stream's image of a frame to the recorder; return its size in bytes."""
        rs = self._rs
        image = np.ascontiguousarray(frame.depth if self._is_depth else frame.color)
        # Without the rate, in mHz, the syncer never pairs frames of two streams.
        self.sensor.set_metadata(rs.frame_metadata_value.actual_fps, 1000 * _RATE_HZ)
        packet = rs.software_video_frame()
        packet.pixels = image
        packet.stride, packet.bpp = self._stride, self._bytes_per_pixel
        packet.timestamp = frame.t_camera_ns * 1e-6
        packet.domain = rs.timestamp_domain.hardware_clock
        packet.frame_number = frame.index
        packet.profile = self.profile.as_video_stream_profile()
        if self._is_depth:
            packet.depth_units = frame.depth_scale_m
        self.sensor.on_video_frame(packet)
        return image.nbytes


def _wait_for_disk(path: Path, written: int) -> None:
    """Wait until the recorder has nearly caught up; it drops frames when 250 MB behind."""
    deadline_s = time.monotonic() + _DISK_TIMEOUT_S
    while written - path.stat().st_size > _BACKLOG_BYTES:
        if time.monotonic() > deadline_s:
            raise CameraError(
                f"{path.parent} accepts no more data",
                "check that the disk is not full",
            )
        time.sleep(0.001)


def _rs_intrinsics(rs: Any, camera: Intrinsics) -> Any:
    if any(camera.distortion[_COEFFICIENTS:]):
        raise ValueError(
            f"librealsense records {_COEFFICIENTS} distortion coefficients, not "
            f"{len(camera.distortion)}; record into a folder"
        )
    intrinsics = rs.intrinsics()
    intrinsics.width, intrinsics.height = camera.width, camera.height
    intrinsics.fx, intrinsics.fy = camera.fx, camera.fy
    intrinsics.ppx, intrinsics.ppy = camera.cx, camera.cy
    intrinsics.model = rs.distortion.brown_conrady
    intrinsics.coeffs = [*camera.distortion, *[0.0] * _COEFFICIENTS][:_COEFFICIENTS]
    return intrinsics


def _rs_extrinsics(rs: Any, T_target_source: Float64) -> Any:
    extrinsics = rs.extrinsics()
    extrinsics.rotation = T_target_source[:3, :3].T.ravel().tolist()
    extrinsics.translation = T_target_source[:3, 3].tolist()
    return extrinsics
