"""Playback of recordings of ROS, with rosbags.

They are folders with ``.mcap`` or ``.db3`` files (ROS 2), or ``.bag`` files (ROS 1). Depth is
``16UC1`` in mm or ``32FC1`` in metres (REP 118), its camera ``camera_info`` beside it, and the
place of colour a chain of transforms on ``/tf_static`` or ``/tf``. Images may be compressed as
image_transport does: PNG or JPEG, and ``compressedDepth`` with PNG.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import suppress
from itertools import chain, islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handcal.camera.images import DISTORTION_COUNTS
from handcal.camera.playback import PlaybackSettings, PlayedCamera
from handcal.core.errors import CameraEndError, CameraError, FileError, extra_advice
from handcal.core.geometry import invert, is_rigid, rigid
from handcal.core.types import CameraIdentity, Float64, Frame, Intrinsics, UInt8, UInt16
from handcal.io.images import MAX_SIDE_PX, decode_image

METADATA = "metadata.yaml"

_IMAGE, _COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
_INFO = "sensor_msgs/msg/CameraInfo"
_DEPTH_TYPES = {"16UC1": "u2", "mono16": "u2", "32FC1": "f4"}
_COLOR_CODES = {
    "rgb8": None,
    "bgr8": cv2.COLOR_BGR2RGB,
    "rgba8": cv2.COLOR_RGBA2RGB,
    "bgra8": cv2.COLOR_BGRA2RGB,
}
_FILES = "jpeg", "jpg", "png"
_DEPTH_HEADER = struct.Struct("<iff")
"""Of compressedDepth: format, and a and b of depths a / (value - b) in metres."""
_MODELS = ("", "plumb_bob", "rational_polynomial")
_MM_SCALE_M, _FLOAT_SCALE_M = 1e-3, 1e-4
_APART_NS = 50_000_000
_REACH_M = 1.0
_MOST_TRANSFORMS = 10_000
_MOST_IGNORED = 10
_BAG = b"#ROSBAG V2.0\n"
_INDEX_AT = b"index_pos="
_SDK_TOPIC = b"/file_version"
_LOOKED_BYTES = 2**20


def ros_recording(path: Path) -> Path | None:
    """Return the recording of ROS that a path names: itself, or the folder of a ROS 2 file."""
    if path.suffix == ".bag" and path.is_file():
        return path if _is_ros1(path) else None
    for folder in (path, path.parent):
        if (folder / METADATA).is_file() and (folder == path or path.suffix in (".mcap", ".db3")):
            return folder
    return None


def _is_ros1(path: Path) -> bool:
    """Return whether a ``.bag`` file is of ROS 1, not of librealsense, which uses its format."""
    with path.open("rb") as file:
        start = file.read(_LOOKED_BYTES)
        at = start.find(_INDEX_AT) + len(_INDEX_AT)
        index = int.from_bytes(start[at : at + 8], "little")
        if not start.startswith(_BAG) or not len(start) <= index < path.stat().st_size:
            return start.startswith(_BAG) and _SDK_TOPIC not in start
        file.seek(index)  # the list of topics
        return _SDK_TOPIC not in start + file.read(_LOOKED_BYTES)


class RosCamera(PlayedCamera):
    """Plays a recording of ROS, depth with the colour nearest in time; implements `Camera`.

    Depth comes as recorded; of several depth topics the one not aligned to colour is taken.

    Parameters
    ----------
    folder : Path
        With ``metadata.yaml`` and ``.mcap`` or ``.db3`` files; or a ``.bag`` file of ROS 1.
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
            raise CameraError("recordings of ROS need rosbags", extra_advice("ros")) from error
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
            raise CameraError(f"{folder} cannot be read as a recording of ROS: {error}") from error
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
        self._frames = (frame for frame in self._play() if frame.t_camera_ns >= t_camera_ns)

    def _describe(self) -> None:
        """Find the topics, and read the cameras and the transform between them."""
        firsts = {topic: self._first(topic) for topic in self._topics(_IMAGE, _COMPRESSED)}
        kinds = {topic: "" if image is None else _kind(image) for topic, image in firsts.items()}
        depth = [topic for topic, kind in kinds.items() if kind == "depth"]
        color = [topic for topic, kind in kinds.items() if kind == "color"]
        if not depth:
            found = "; ".join(self._ignored(kinds, firsts)) or "it has no images"
            raise CameraError(
                f"{self._folder} has no depth images (16UC1 or 32FC1, or of these compressedDepth "
                f"with PNG): {found}",
                "record the camera's depth topic",
            )
        raw_first = set(self._topics(_COMPRESSED))
        self._depth_topic = min(
            depth, key=lambda topic: ("aligned" in topic, topic in raw_first, topic)
        )
        self.depth_intrinsics = self._intrinsics(self._depth_topic)
        self._color_topic, self._color_intrinsics, self._T_C_D = None, None, np.eye(4)
        known = [topic for topic in color if self._info_topic(topic) is not None]
        if known:
            self._color_topic = min(known, key=lambda topic: (topic in raw_first, topic))
            self._color_intrinsics = self._intrinsics(self._color_topic)
            images: tuple[Any, Any] = firsts[self._color_topic], firsts[self._depth_topic]
            self._T_C_D = self._transform(*(image.header.frame_id for image in images))
        unused = self._ignored(kinds, firsts, self._depth_topic, self._color_topic)
        self.notes = tuple(f"not played: {topic}" for topic in unused)

    def _ignored(
        self, kinds: dict[str, str], firsts: dict[str, Any], *played: str | None
    ) -> Iterator[str]:
        """Yield the topics that are not played, each with the reason."""
        others = [
            topic
            for topic, info in self._reader.topics.items()
            if topic not in (*played, "/tf", "/tf_static") and info.msgtype != _INFO
        ]
        for topic in sorted(others, key=lambda topic: (topic not in kinds, topic))[:_MOST_IGNORED]:
            first = firsts.get(topic)
            if topic not in kinds:
                kind = self._reader.topics[topic].msgtype
                yield f"{topic} ({kind} is not read)"
            elif first is None:
                yield f"{topic} (empty)"
            elif not kinds[topic]:
                yield f"{topic} ({_encoding(first)!r} is not read)"
            elif self._info_topic(topic) is None:
                yield f"{topic} (no camera_info for it)"
            else:
                yield f"{topic} (another {'colour' if kinds[topic] == 'color' else 'depth'})"
        if len(others) > _MOST_IGNORED:
            yield f"{len(others) - _MOST_IGNORED} more topics"

    def _topics(self, *kinds: str) -> list[str]:
        return [topic for topic, info in self._reader.topics.items() if info.msgtype in kinds]

    def _messages(self, *topics: str) -> Iterator[tuple[str, Any]]:
        chosen = [link for link in self._reader.connections if link.topic in topics]
        # rosbags takes an empty choice for all.
        messages = self._reader.messages(connections=chosen) if chosen else ()
        for connection, _, data in messages:
            yield connection.topic, self._reader.deserialize(data, connection.msgtype)

    def _first(self, topic: str) -> Any | None:
        return next((message for _, message in self._messages(topic)), None)

    def _info_topic(self, topic: str) -> str | None:
        image = topic.rpartition("/")[0] if topic in self._topics(_COMPRESSED) else topic
        wanted = f"{image.rpartition('/')[0]}/camera_info"
        return wanted if wanted in self._topics(_INFO) else None

    def _intrinsics(self, topic: str) -> Intrinsics:
        info_topic = self._info_topic(topic)
        info = None if info_topic is None else self._first(info_topic)
        if info is None:
            raise CameraError(
                f"{self._folder} has no camera_info for {topic}",
                "record it as well",
            )
        k, d = (info.k, info.d) if hasattr(info, "k") else (info.K, info.D)  # ROS 1
        fx, skew, cx, _, fy, cy, *_ = map(float, k)
        values = np.array([fx, fy, cx, cy, *d])
        if not np.isfinite(values).all() or fx < 1.0 or fy < 1.0 or skew != 0.0:
            raise CameraError(
                f"{self._folder}: the intrinsics of {topic} are not those of a camera"
            )
        distortion = tuple(map(float, d)) if np.any(d) else ()
        if info.distortion_model not in _MODELS or len(distortion) not in DISTORTION_COUNTS:
            raise CameraError(
                f"{self._folder}: lens model {info.distortion_model!r} of {topic} is not known",
                "record rectified images",
            )
        return Intrinsics(info.width, info.height, fx, fy, cx, cy, distortion)

    def _transform(self, dst: str, src: str) -> Float64:
        """Return T_dst_src from the recording's transforms between frames."""
        near: dict[str, dict[str, Float64]] = {}
        if dst != src:
            messages = (message for _, message in self._messages("/tf_static", "/tf"))
            transforms = chain.from_iterable(message.transforms for message in messages)
            for stamped in islice(transforms, _MOST_TRANSFORMS):
                parent, child = stamped.header.frame_id, stamped.child_frame_id
                turn, place = stamped.transform.rotation, stamped.transform.translation
                values = [turn.x, turn.y, turn.z, turn.w, place.x, place.y, place.z]
                if not np.isfinite(values).all() or not np.any(values[:4]):
                    raise CameraError(
                        f"{self._folder}: the transform between {parent!r} and {child!r} is not "
                        "made of finite numbers",
                        "record /tf_static again",
                    )
                T_parent_child = rigid(Rotation.from_quat(values[:4]).as_matrix(), values[4:])
                near.setdefault(child, {}).setdefault(parent, T_parent_child)
                near.setdefault(parent, {}).setdefault(child, invert(T_parent_child))
        T_frame_src = {src: np.eye(4)}
        reached = [src]
        for frame in reached:  # breadth first, along the shortest chain of transforms
            for other, T_other_frame in near.get(frame, {}).items():
                if other not in T_frame_src:
                    T_frame_src[other] = T_other_frame @ T_frame_src[frame]
                    reached.append(other)
        if dst not in T_frame_src or not is_rigid(T_frame_src[dst], _REACH_M):
            raise CameraError(
                f"{self._folder} has no transform between {src!r} and {dst!r}, the frames of depth "
                "and colour",
                "record /tf_static as well",
            )
        return T_frame_src[dst]

    def _play(self) -> Iterator[Frame]:
        """Yield frames, each once the colour after it has arrived."""
        topics = filter(None, (self._depth_topic, self._color_topic))
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
        nearest = min(colors, key=lambda image: abs(_stamp_ns(image) - t_ns), default=None)
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


def _encoding(message: Any) -> str:
    """Return an image's encoding; of a compressed one that before, or the kind of file."""
    text = message.format if message.__msgtype__ == _COMPRESSED else message.encoding
    return str(text).partition(";")[0].strip()


def _kind(message: Any) -> str:
    """Return whether an image is ``depth`` or ``color``; empty if it is neither."""
    encoding = _encoding(message)
    if encoding in _DEPTH_TYPES:
        return "" if "rvl" in getattr(message, "format", "") else "depth"
    is_file = message.__msgtype__ == _COMPRESSED and encoding in _FILES
    if is_file and _unpacked(message, cv2.IMREAD_UNCHANGED).ndim < 3:
        return ""  # infrared
    return "color" if is_file or encoding in _COLOR_CODES else ""


def _unpacked(message: Any, flags: int, skip: int = 0) -> NDArray[Any]:
    """Decode a compressed image, beginning behind so many bytes."""
    try:
        return decode_image(bytes(message.data[skip:]), message.format, flags)
    except FileError as error:
        raise CameraError(f"an image of the recording: {error}") from error


def _depth(message: Any, camera: Intrinsics) -> tuple[UInt16, float]:
    encoding = _encoding(message)
    if _kind(message) != "depth":
        raise CameraError(f"depth images changed to {encoding!r} within the recording")
    if message.__msgtype__ != _COMPRESSED:
        values = _pixels(message, _DEPTH_TYPES[encoding], 1, camera)[..., 0]
    else:
        has_header = "compressedDepth" in message.format
        values = _unpacked(message, cv2.IMREAD_UNCHANGED, _DEPTH_HEADER.size * has_header)
        if values.dtype != np.uint16 or values.shape != (camera.height, camera.width):
            raise CameraError("an image of the recording is not of its camera's size and depth")
        if encoding == "32FC1":
            _, a, b = _DEPTH_HEADER.unpack(bytes(message.data[: _DEPTH_HEADER.size]))
            with np.errstate(divide="ignore", invalid="ignore"):
                values = np.where(values > 0, a / (values - np.float64(b)), 0.0)
    if encoding != "32FC1":
        return values.astype(np.uint16), _MM_SCALE_M
    units = np.nan_to_num(
        values.astype(np.float64) / _FLOAT_SCALE_M, nan=0.0, posinf=0.0, neginf=0.0
    )
    return np.where((units > 0) & (units < 65535.5), np.rint(units), 0).astype(
        np.uint16
    ), _FLOAT_SCALE_M


def _color(message: Any, camera: Intrinsics) -> UInt8:
    encoding = _encoding(message)
    if _kind(message) != "color":
        raise CameraError(f"colour images changed to {encoding!r} within the recording")
    if message.__msgtype__ == _COMPRESSED:
        image = _unpacked(message, cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION)
        if image.shape[:2] != (camera.height, camera.width):
            raise CameraError("an image of the recording is not of its camera's size")
        # Files hold blue first; those packed as red first have both exchanged.
        is_swapped = message.format.rpartition("compressed")[2].strip().startswith("rgb")
        return np.ascontiguousarray(image[..., ::-1] if is_swapped else image)
    code = _COLOR_CODES[encoding]
    values = _pixels(message, "u1", 4 if "a" in encoding else 3, camera)
    rgb = values if code is None else cv2.cvtColor(values, code)
    return np.asarray(rgb, dtype=np.uint8)
