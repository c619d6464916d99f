"""Playback of ROS 2 recordings (rosbag2: a folder with ``.mcap`` or ``.db3``), with rosbags.

Depth is ``16UC1`` in mm or ``32FC1`` in metres (REP 118), its camera ``camera_info`` beside it, and
the place of colour a chain of transforms on ``/tf_static`` or ``/tf``.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from handcal.camera.images import DISTORTION_COUNTS
from handcal.camera.playback import PlaybackSettings, PlayedCamera
from handcal.core.errors import CameraEndError, CameraError
from handcal.core.geometry import invert, is_rigid, rigid
from handcal.core.types import CameraIdentity, Float64, Frame, Intrinsics, UInt8, UInt16
from handcal.io.images import MAX_SIDE_PX

METADATA = "metadata.yaml"

_IMAGE, _INFO, _TF = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage"
_DEPTH_TYPES = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
_COLOR_CODES = {
    "rgb8": None,
    "bgr8": cv2.COLOR_BGR2RGB,
    "rgba8": cv2.COLOR_RGBA2RGB,
    "bgra8": cv2.COLOR_BGRA2RGB,
}
_MODELS = ("", "plumb_bob", "rational_polynomial")
_MM_SCALE_M, _FLOAT_SCALE_M = 1e-3, 1e-4
_APART_NS = 50_000_000
_REACH_M = 1.0
_MOST_TRANSFORMS = 10_000


def ros_recording(path: Path) -> Path | None:
    """Return the folder of the ROS 2 recording that a path names, itself or a file in it."""
    for folder in (path, path.parent):
        if (folder / METADATA).is_file() and (folder == path or path.suffix in (".mcap", ".db3")):
            return folder
    return None


class RosCamera(PlayedCamera):
    """Plays a ROS 2 recording, depth with the colour nearest in time; implements `Camera`.

    Depth comes as recorded; of several depth topics the one not aligned to colour is taken.

    Parameters
    ----------
    folder : Path
        With ``metadata.yaml`` and ``.mcap`` or ``.db3`` files.
    settings : PlaybackSettings

    Raises
    ------
    CameraError
        If rosbags is not installed, or the recording is damaged, or has no depth, no intrinsics of
        it, or no transform to colour.
    """

    def __init__(self, folder: Path, settings: PlaybackSettings | None = None) -> None:
        super().__init__(settings)
        try:
            from rosbags.highlevel import AnyReader
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise CameraError(
                "ROS 2 recordings need rosbags: pip install 'handcal[ros]'"
            ) from error
        self.name = f"Recording {folder.name}"
        self.identity = CameraIdentity()
        self._folder = folder
        self._index = 0
        self._reader: Any = None
        try:
            self._reader = AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
            self._reader.open()
            self._describe()
        except CameraError:
            self.close()
            raise
        except Exception as error:  # rosbags and the parsers below it raise many kinds
            self.close()
            raise CameraError(f"{folder} cannot be read as a ROS 2 recording: {error}") from error
        self._frames = self._play()

    def close(self) -> None:
        """Close the files; safe to call twice."""
        super().close()
        if self._reader is not None:
            with suppress(Exception):  # it may have failed to open
                self._reader.close()
            self._reader = None

    def _next(self, timeout_s: float) -> Frame:  # noqa: ARG002 (files do not keep one waiting)
        try:
            return next(self._frames)
        except StopIteration:
            raise CameraEndError(f"{self.name} has ended") from None
        except CameraError:
            raise
        except Exception as error:
            raise CameraError(f"{self._folder} is damaged: {error}") from error

    def _go_to(self, t_camera_ns: int) -> None:
        self._index = 0
        self._frames = (one for one in self._play() if one.t_camera_ns >= t_camera_ns)

    def _describe(self) -> None:
        """Find the topics, and read the cameras and the transform between them."""
        depth, color = {}, {}
        for topic in self._topics(_IMAGE):
            first = self._first(topic)
            if first is not None and first.encoding in _DEPTH_TYPES:
                depth[topic] = first
            elif first is not None and first.encoding in _COLOR_CODES:
                color[topic] = first
        if not depth:
            raise CameraError(
                f"{self._folder} has no depth images (16UC1 or 32FC1, not compressed); record the "
                "camera's raw depth topic"
            )
        self._depth_topic = min(depth, key=lambda topic: ("aligned" in topic, topic))
        self.depth_intrinsics = self._intrinsics(self._depth_topic)
        self._color_topic, self._color_intrinsics, self._T_C_D = None, None, np.eye(4)
        known = [topic for topic in sorted(color) if self._info_topic(topic) is not None]
        if known:
            self._color_topic = known[0]
            self._color_intrinsics = self._intrinsics(known[0])
            frames = (color[known[0]], depth[self._depth_topic])
            self._T_C_D = self._transform(*(one.header.frame_id for one in frames))

    def _topics(self, kind: str) -> list[str]:
        return [topic for topic, info in self._reader.topics.items() if info.msgtype == kind]

    def _messages(self, *topics: str) -> Iterator[tuple[str, Any]]:
        chosen = [one for one in self._reader.connections if one.topic in topics]
        # rosbags takes an empty choice for all.
        messages = self._reader.messages(connections=chosen) if chosen else ()
        for connection, _, data in messages:
            yield connection.topic, self._reader.deserialize(data, connection.msgtype)

    def _first(self, topic: str) -> Any | None:
        return next((message for _, message in self._messages(topic)), None)

    def _info_topic(self, topic: str) -> str | None:
        wanted = f"{topic.rpartition('/')[0]}/camera_info"
        return wanted if wanted in self._topics(_INFO) else None

    def _intrinsics(self, topic: str) -> Intrinsics:
        info_topic = self._info_topic(topic)
        info = None if info_topic is None else self._first(info_topic)
        if info is None:
            raise CameraError(f"{self._folder} has no camera_info for {topic}; record it as well")
        fx, skew, cx, _, fy, cy, *_ = (float(one) for one in info.k)
        values = np.array([fx, fy, cx, cy, *info.d])
        if not np.isfinite(values).all() or fx < 1.0 or fy < 1.0 or skew != 0.0:
            raise CameraError(
                f"{self._folder}: the intrinsics of {topic} are not those of a camera"
            )
        distortion = tuple(float(one) for one in info.d) if np.any(info.d) else ()
        if info.distortion_model not in _MODELS or len(distortion) not in DISTORTION_COUNTS:
            raise CameraError(
                f"{self._folder}: lens model {info.distortion_model!r} of {topic} is not known; "
                "record rectified images"
            )
        return Intrinsics(info.width, info.height, fx, fy, cx, cy, distortion)

    def _transform(self, dst: str, src: str) -> Float64:
        """Return T_dst_src from the recording's transforms between frames."""
        near: dict[str, dict[str, Float64]] = {}
        if dst != src:
            messages = (message for _, message in self._messages("/tf_static", "/tf"))
            stamped = (one for message in messages for one in message.transforms)
            for one, _ in zip(stamped, range(_MOST_TRANSFORMS), strict=False):
                parent, child, moved = one.header.frame_id, one.child_frame_id, one.transform
                turn, place = moved.rotation, moved.translation
                rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
                T_parent_child = rigid(rotation, [place.x, place.y, place.z])
                near.setdefault(child, {}).setdefault(parent, T_parent_child)
                near.setdefault(parent, {}).setdefault(child, invert(T_parent_child))
        found = {src: np.eye(4)}  # T_frame_src
        reached = [src]
        for frame in reached:
            for other, T_other_frame in near.get(frame, {}).items():
                if other not in found:
                    found[other] = T_other_frame @ found[frame]
                    reached.append(other)
        if dst not in found or not is_rigid(found[dst], _REACH_M):
            raise CameraError(
                f"{self._folder} has no transform between {src!r} and {dst!r}, the frames of depth "
                "and colour; record /tf_static as well"
            )
        return found[dst]

    def _play(self) -> Iterator[Frame]:
        """Yield frames, each once the colour after it has arrived."""
        topics = [one for one in (self._depth_topic, self._color_topic) if one is not None]
        waiting: list[Any] = []
        colors: list[Any] = []
        for topic, message in self._messages(*topics):
            if topic == self._color_topic:
                colors = [*colors[-1:], message]
            else:
                waiting.append(message)
            while waiting and self._is_settled(waiting[0], waiting[-1], colors):
                yield self._frame(waiting.pop(0), colors)
        for depth in waiting:
            yield self._frame(depth, colors)

    def _is_settled(self, depth: Any, newest: Any, colors: list[Any]) -> bool:
        """Return whether no nearer colour can come."""
        if self._color_topic is None or (colors and _stamp_ns(colors[-1]) >= _stamp_ns(depth)):
            return True
        return _stamp_ns(newest) - _stamp_ns(depth) > 2 * _APART_NS

    def _frame(self, message: Any, colors: list[Any]) -> Frame:
        t_ns = _stamp_ns(message)
        depth, scale_m = _depth(message, self.depth_intrinsics)
        nearest = min(colors, key=lambda one: abs(_stamp_ns(one) - t_ns), default=None)
        color = None
        if nearest is not None and abs(_stamp_ns(nearest) - t_ns) <= _APART_NS:
            assert self._color_intrinsics is not None
            color = _color(nearest, self._color_intrinsics)
        self._index += 1
        return Frame(
            index=self._index,
            t_camera_ns=t_ns,
            t_host_ns=0,
            depth=depth,
            depth_scale_m=scale_m,
            depth_intrinsics=self.depth_intrinsics,
            color=color,
            color_intrinsics=None if color is None else self._color_intrinsics,
            T_C_D=np.eye(4) if color is None else self._T_C_D,
        )


def _stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def _pixels(message: Any, kind: str, channels: int, camera: Intrinsics) -> Any:
    """Return an image's (H, W, channels) values; CameraError if it is not of the camera's size."""
    dtype = np.dtype(f"{'>' if message.is_bigendian else '<'}{kind}")
    size = camera.height, camera.width
    row_bytes = camera.width * channels * dtype.itemsize
    if (
        (message.height, message.width) != size
        or max(size) > MAX_SIDE_PX
        or message.step < row_bytes
        or len(message.data) != message.step * message.height
    ):
        raise CameraError("an image of the recording is not of its camera's size")
    rows = np.asarray(message.data, dtype=np.uint8).reshape(camera.height, message.step)
    packed = np.ascontiguousarray(rows[:, :row_bytes])
    return packed.view(dtype).reshape(*size, channels)


def _depth(message: Any, camera: Intrinsics) -> tuple[UInt16, float]:
    kind = _DEPTH_TYPES.get(message.encoding)
    if kind is None:
        raise CameraError(f"depth images changed to {message.encoding!r} within the recording")
    values = _pixels(message, kind, 1, camera)[..., 0]
    if kind == "u2":
        return values.astype(np.uint16), _MM_SCALE_M
    units = np.nan_to_num(
        values.astype(np.float64) / _FLOAT_SCALE_M, nan=0.0, posinf=0.0, neginf=0.0
    )
    return np.where((units > 0) & (units < 65535.5), np.rint(units), 0).astype(
        np.uint16
    ), _FLOAT_SCALE_M


def _color(message: Any, camera: Intrinsics) -> UInt8:
    if message.encoding not in _COLOR_CODES:
        raise CameraError(f"colour images changed to {message.encoding!r} within the recording")
    code = _COLOR_CODES[message.encoding]
    values = _pixels(message, "u1", 4 if "a" in message.encoding else 3, camera)
    rgb = values if code is None else cv2.cvtColor(values, code)
    return np.asarray(rgb, dtype=np.uint8)
