"""Recordings of ROS 2, written by rosbags as a camera's node would fill them."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from handcal.core.geometry import invert
from handcal.core.types import Float64, Frame, Intrinsics

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = STORE.types
ROS1 = get_typestore(Stores.ROS1_NOETIC)
_TF = "tf2_msgs/msg/TFMessage"
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", _TF))
DEPTH, COLOR = "/camera/depth/image_rect_raw", "/camera/color/image_raw"


def header(t_ns: int, frame_id: str) -> Any:
    stamp = TYPES["builtin_interfaces/msg/Time"](*divmod(t_ns, 1_000_000_000))
    return TYPES["std_msgs/msg/Header"](stamp, frame_id)


def image(t_ns: int, frame_id: str, encoding: str, pixels: Any, pad_bytes: int = 0) -> Any:
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
    rows = np.pad(rows, ((0, 0), (0, pad_bytes)))
    return TYPES["sensor_msgs/msg/Image"](
        header(t_ns, frame_id), *pixels.shape[:2], encoding, int(pixels.dtype.byteorder == ">"),
        rows.shape[1], rows.ravel(),
    )  # fmt: skip


def info(camera: Intrinsics, frame_id: str, model: str = "plumb_bob") -> Any:
    k = np.array([camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0])
    roi = TYPES["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    d = np.array(camera.distortion or [0.0] * 5)
    return TYPES["sensor_msgs/msg/CameraInfo"](
        header(0, frame_id), camera.height, camera.width, model, d, k, np.eye(3).ravel(),
        np.zeros(12), 0, 0, roi,
    )  # fmt: skip


def transforms(*moves: tuple[str, str, Float64]) -> Any:
    """Return a message of poses of children in their parents."""
    stamped = []
    for parent, child, T in moves:
        place = TYPES["geometry_msgs/msg/Vector3"](*T[:3, 3])
        turn = TYPES["geometry_msgs/msg/Quaternion"](*Rotation.from_matrix(T[:3, :3]).as_quat())
        move = TYPES["geometry_msgs/msg/Transform"](place, turn)
        kind = TYPES["geometry_msgs/msg/TransformStamped"]
        stamped.append(kind(header(0, parent), child, move))
    return TYPES["tf2_msgs/msg/TFMessage"](stamped)


def write_messages(
    folder: Path, messages: Iterable[tuple[str, int, Any]], is_mcap: bool = True
) -> None:
    """Write messages, each with its topic and time of recording."""
    plugin = StoragePlugin.MCAP if is_mcap else StoragePlugin.SQLITE3
    topics: dict[str, Any] = {}
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        for topic, t_ns, message in messages:
            kind = message.__msgtype__
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(topics[topic], t_ns, STORE.serialize_cdr(message, kind))


def frame_messages(frames: Iterable[Frame]) -> Iterable[tuple[str, int, Any]]:
    """Yield what a camera's node publishes: depth in mm, colour, both infos and /tf_static."""
    for number, frame in enumerate(frames):
        t_ns = frame.t_camera_ns
        if number == 0:
            yield (
                "/camera/depth/camera_info", t_ns, info(frame.depth_intrinsics, "depth")
            )  # fmt: skip
            if frame.color_intrinsics is not None:
                yield "/camera/color/camera_info", t_ns, info(frame.color_intrinsics, "color")
                # The pose of colour in the link, of which depth is the child by another way.
                T_D_C = invert(frame.T_C_D)
                yield (
                    "/tf_static",
                    t_ns,
                    transforms(("link", "depth", np.eye(4)), ("link", "color", T_D_C)),
                )
        yield DEPTH, t_ns, image(t_ns, "depth", "16UC1", frame.depth)
        if frame.color is not None:
            yield COLOR, t_ns + 1000, image(t_ns + 1000, "color", "rgb8", frame.color)


def write_rosbag(folder: Path, frames: Iterable[Frame], is_mcap: bool = True) -> None:
    """Write frames of one camera as a ROS 2 recording."""
    write_messages(folder, frame_messages(frames), is_mcap)


def compressed(message: Any, a: float = 0.0, b: float = 0.0) -> Any:
    """Return an image as image_transport compresses it: JPEG, and compressedDepth with PNG.

    With a and b depth is in metres, stored as a / depth + b.
    """
    height, width = message.height, message.width
    if message.encoding == "rgb8":
        pixels = message.data.reshape(height, width, 3)[..., ::-1]
        text, data = "rgb8; jpeg compressed bgr8", cv2.imencode(".jpg", pixels)[1].tobytes()
    else:
        values = message.data.view({"16UC1": np.uint16, "32FC1": np.float32}[message.encoding])
        values = values.reshape(height, width)
        if a:
            with np.errstate(all="ignore"):
                values = np.where(np.isfinite(values), a / values + b, 0.0).astype(np.uint16)
        text = f"{message.encoding}; compressedDepth png"
        data = struct.pack("<iff", 0, a, b) + cv2.imencode(".png", values)[1].tobytes()
    kind = TYPES["sensor_msgs/msg/CompressedImage"]
    return kind(message.header, text, np.frombuffer(data, np.uint8).copy())


def write_ros1(path: Path, messages: Iterable[tuple[str, int, Any]]) -> None:
    """Write messages of ROS 2 as a bag of ROS 1."""
    topics: dict[str, Any] = {}
    with Ros1Writer(path) as writer:
        for topic, t_ns, message in messages:
            kind = message.__msgtype__
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=ROS1)
            writer.write(topics[topic], t_ns, ROS1.serialize_ros1(_as_ros1(message), kind))


def _as_ros1(value: Any) -> Any:
    """Return a message with the fields of ROS 1: `seq` in headers, `D`, `K`, `R` and `P`."""
    if isinstance(value, list):
        return [_as_ros1(one) for one in value]
    kind = getattr(value, "__msgtype__", None)
    if kind is None:
        return value
    fields = {name: _as_ros1(one) for name, one in vars(value).items() if name != "__msgtype__"}
    if kind.endswith("CameraInfo"):
        fields = {name.upper() if name in "dkrp" else name: one for name, one in fields.items()}
    if kind.endswith("Header"):
        fields["seq"] = 0
    return ROS1.types[kind](**fields)
