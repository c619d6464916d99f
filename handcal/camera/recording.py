"""librealsense's recordings, played and written through librealsense."""

from __future__ import annotations

import re
import sqlite3
import time
from collections.abc import Iterable
from contextlib import closing, suppress
from dataclasses import astuple
from pathlib import Path
from typing import Any

import numpy as np

from handcal.camera.playback import PlaybackSettings, PlayedCamera, of_one_camera
from handcal.camera.sdk_devices import describe_device, librealsense
from handcal.camera.sdk_frames import (
    apart_ms,
    extrinsics_between,
    frame_of,
    intrinsics_of,
    with_color,
)
from handcal.core.errors import CameraEndError, CameraError, CameraTimeoutError
from handcal.core.types import CameraIdentity, Float64, Frame, Intrinsics
from handcal.io.files import sync_folder

_BEGINNINGS = (b"SQLite format 3\0", b"#ROSBAG V")  # .db3, .bag
_OPTION = re.compile(r"/option/([^/]*)/")
_MOST_TOPICS = 10_000
_POLL_MS = 100
_COLOR_TIMEOUT_S = 5.0
_SKIP_TIMEOUT_S = 10.0
_SETTLE_S = 0.2  # of a thread of librealsense
_ROUNDING_MS = 1e-3  # of the SDK's times, which are floating-point numbers


def check_recording(path: Path) -> None:
    """Raise CameraError unless a file has the signature of a librealsense recording."""
    if not path.is_file():
        raise CameraError(f"there is no recording {path}")
    try:
        with path.open("rb") as file:
            begin = file.read(len(_BEGINNINGS[0]))
    except OSError as error:
        raise CameraError(f"cannot read {path}: {error.strerror or error}") from error
    if not begin.startswith(_BEGINNINGS):
        raise CameraError(
            f"{path} is not a recording",
            "choose a .db3 or .bag file of a RealSense or of ROS, or "
            "a folder by handcal, ROS 2, Open3D or TUM RGB-D",
        )


class RecordingCamera(PlayedCamera):
    """Plays a recording, depth with colour if it has any; implements `Camera`.

    Depth is delivered as recorded, not aligned to colour, with the colour nearest in time.
    librealsense stores the times of writing, not those of the frames, and its own seeking leaves
    frames queued. So pace and position follow the frames' times, and seeking backward reads from
    the beginning.

    Parameters
    ----------
    path : Path
        A ``.db3`` or ``.bag`` recording.
    settings : PlaybackSettings

    Raises
    ------
    CameraError
        If librealsense is not installed, or the file is missing, of another kind, damaged or
        without depth.
    """

    def __init__(self, path: Path, settings: PlaybackSettings | None = None) -> None:
        super().__init__(settings)
        self.name = f"Recording {path.name}"
        self._path = path
        self._depth: _Playback | None = None
        self._color: _ColorTrack | None = None
        check_recording(path)
        self._open()

    def close(self) -> None:
        """Stop the playback; safe to call twice."""
        super().close()
        self._stop()

    def _open(self) -> None:
        rs = librealsense()
        try:
            _require_known_options(rs, self._path)
            self._depth = _Playback(rs, self._path, rs.stream.depth)
            color = self._depth.recorded_profile(rs.stream.color)
            if color is not None:
                T_C_D = extrinsics_between(self._depth.profile, color)
                self._color = _ColorTrack(_Playback(rs, self._path, rs.stream.color), T_C_D)
            self.depth_intrinsics = intrinsics_of(self._depth.profile)
            self.identity = self._depth.identity()
        except (CameraError, RuntimeError, sqlite3.Error) as error:
            self.close()
            raise CameraError(
                f"{self._path} cannot be played as a RealSense recording with depth: {error}"
            ) from error

    def _stop(self) -> None:
        color = None if self._color is None else self._color.playback
        playing = [playback for playback in (color, self._depth) if playback is not None]
        self._depth = self._color = None
        if not playing:
            return
        # A reading thread that has reached the end stops, and librealsense aborts the program
        # if it is stopped at that moment. One that has not runs on after the stop, and must not
        # outlive its objects. (Pausing it takes 10 s where nobody takes its frames.)
        time.sleep(_SETTLE_S)
        for playback in playing:
            playback.close()
        time.sleep(_SETTLE_S)

    def _next(self, timeout_s: float) -> Frame:
        assert self._depth is not None
        depth = self._depth.read(timeout_s).get_depth_frame()
        frame = frame_of(depth, self.depth_intrinsics)
        return frame if self._color is None else self._color.add_to(frame, depth)

    def _go_to(self, t_camera_ns: int) -> None:
        assert self._depth is not None
        self._stop()
        self._open()
        self._depth.skip_to(t_camera_ns * 1e-6 - _ROUNDING_MS)


def _require_known_options(rs: Any, path: Path) -> None:
    """Raise CameraError if a .db3 file has an option that librealsense does not know.

    librealsense 2.58 never finishes reading it.
    """
    if path.suffix.lower() != ".db3":
        return
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as file:
        topics = file.execute("SELECT name FROM topics LIMIT ?", (_MOST_TOPICS,)).fetchall()
    known = {str(option).replace(" ", "_") for option in rs.option.__members__.values()}
    recorded = {name for (topic,) in topics for name in _OPTION.findall(str(topic))}
    if unknown := sorted(recorded - known):
        raise CameraError(
            f"it has the option {unknown[0][:40]!r}, which this pyrealsense2 does not know",
            "install the version with which it was recorded",
        )


class _Playback:
    """One stream of a recording; librealsense loses frames under load when it pairs several."""

    def __init__(self, rs: Any, path: Path, stream: Any) -> None:
        self._name = path.name
        self._stopped = rs.playback_status.stopped
        self._waiting: Any | None = None
        self._has_read = False
        self._pipeline = rs.pipeline()
        config = rs.config()
        config.enable_device_from_file(str(path), repeat_playback=False)
        config.enable_stream(stream)
        self._device = config.resolve(rs.pipeline_wrapper(self._pipeline)).get_device()
        self._playback = self._device.as_playback()
        self._playback.set_real_time(False)  # before it starts, or the first frames are lost
        self._active = self._pipeline.start(config)  # owns the profile, also after the end
        self.profile = self._active.get_stream(stream)

    def identity(self) -> CameraIdentity:
        """Return the recorded device's identity, with empty texts for what is missing."""
        return describe_device(self._device).identity

    def recorded_profile(self, stream: Any) -> Any | None:
        """Return the profile of any stream in the recording."""
        for sensor in self._device.query_sensors():
            for profile in sensor.get_stream_profiles():
                if profile.stream_type() == stream:
                    return profile
        return None

    def read(self, timeout_s: float) -> Any:
        """Return the next frame set, of one frame."""
        if self._waiting is not None:
            frames, self._waiting = self._waiting, None
            return frames
        deadline_s = time.monotonic() + timeout_s
        while True:
            ended = self._playback.current_status() == self._stopped
            arrived, frames = self._pipeline.try_wait_for_frames(_POLL_MS)
            if arrived:
                self._has_read = True
                return frames
            is_late = time.monotonic() > deadline_s
            # On a busy computer a short recording has ended before its first frame is ready.
            if ended and (self._has_read or is_late):
                raise CameraEndError(f"recording {self._name} has ended")
            if is_late:
                raise CameraTimeoutError(f"recording {self._name}: no frame for {timeout_s:g} s")

    def skip_to(self, t_ms: float) -> None:
        """Seek to the first frame at or after a time, if there is one."""
        with suppress(CameraEndError):
            while self._waiting is None:
                frames = self.read(_SKIP_TIMEOUT_S)
                self._waiting = frames if frames.get_timestamp() >= t_ms else None

    def close(self) -> None:
        """Stop the pipeline."""
        self._pipeline.stop()


class _ColorTrack:
    """The colour images of a recording, found by time."""

    def __init__(self, playback: _Playback, T_C_D: Float64) -> None:
        self.playback = playback
        self._T_C_D = T_C_D
        self._period_ms = 1000.0 / playback.profile.fps()
        self._around: list[Any] = []  # the last image before the depth, and the first after
        self._ended = False

    def add_to(self, frame: Frame, depth: Any) -> Frame:
        """Return a frame with the colour nearest in time, if there is any."""
        color = self._nearest(depth)
        return frame if color is None else with_color(frame, color, self._T_C_D)

    def _nearest(self, depth: Any) -> Any | None:
        """Return the colour nearest in time within its period, if their clock is the same."""
        self._advance(depth.get_timestamp())
        nearest = min(self._around, key=lambda color: apart_ms(color, depth), default=None)
        is_near = nearest is not None and apart_ms(nearest, depth) <= self._period_ms
        return nearest if is_near else None

    def _advance(self, t_ms: float) -> None:
        while not self._ended and (not self._around or self._around[-1].get_timestamp() < t_ms):
            try:
                color = self.playback.read(_COLOR_TIMEOUT_S).get_color_frame()
            except CameraTimeoutError:
                return
            except CameraEndError:
                self._ended = True
                return
            self._around = [*self._around[-1:], color]


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
        raise ValueError("a .db3 file holds no poses: record this camera into a folder")
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
