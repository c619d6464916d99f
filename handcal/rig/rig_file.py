"""The rig file: the offline calibration in OpenCV's FileStorage YAML.

Anything that reads FileStorage reads it. Per eye: K, H0, t_C0_V_m, z_C0_S_m, the display's size
and T_V_H; for the depth camera: T_H_D and its intrinsics. Numbers survive exactly.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from handcal.errors import FileError
from handcal.files import read_limited, write_atomic
from handcal.rig.check import check_rig, require
from handcal.types import EYES, EyeDisplay, Float64, Intrinsics, Rig

RIG_VERSION = 1
# A rig takes 3 kB. OpenCV's parser recurses with the nesting and overflows the stack at 65 kB.
MAX_RIG_BYTES = 2**14


def write_rig(path: Path, rig: Rig) -> None:
    """Write `rig` to `path`, atomically.

    Raises
    ------
    ValueError
        If the rig would be refused by `read_rig`.
    FileError
        If the file cannot be written.
    """
    check_rig(rig)
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("handcal_rig", RIG_VERSION)
    storage.write("name", quoted(rig.name))
    for eye in EYES:
        display = rig.eyes[eye]
        storage.startWriteStruct(eye, cv2.FileNode_MAP)
        storage.write("K", display.K)
        storage.write("H0", display.H0)
        storage.write("t_C0_V_m", display.t_C0_V_m[:, None])
        storage.write("z_C0_S_m", display.z_C0_S_m)
        storage.write("width_px", display.width_px)
        storage.write("height_px", display.height_px)
        storage.write("T_V_H", display.T_V_H)
        storage.endWriteStruct()
    storage.write("T_H_D", rig.T_H_D)
    intrinsics = rig.depth_intrinsics
    storage.startWriteStruct("depth_camera", cv2.FileNode_MAP)
    storage.write("width_px", intrinsics.width)
    storage.write("height_px", intrinsics.height)
    for name in ("fx", "fy", "cx", "cy"):
        storage.write(name, getattr(intrinsics, name))
    storage.startWriteStruct("distortion", cv2.FileNode_SEQ | cv2.FileNode_FLOW)
    for coefficient in intrinsics.distortion:
        storage.write("", coefficient)
    storage.endWriteStruct()
    storage.endWriteStruct()
    write_atomic(path, storage.releaseAndGetString().encode())


def read_rig(path: Path) -> Rig:
    """Read and check a rig file.

    Raises
    ------
    FileError
        If the file cannot be read, is not a rig file or of an unknown version, or a field is
        missing or implausible; the text names the field and what is expected.
    """
    data = read_limited(path, MAX_RIG_BYTES)
    try:
        rig = _parse(data.decode())
        check_rig(rig)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error
    except (cv2.error, SystemError) as error:  # SystemError: how OpenCV reports unparsable text
        raise FileError(f"{path} is not valid FileStorage YAML") from error
    return rig


def quoted(text: str) -> str:
    """Quote a text: OpenCV leaves plain words as they are, and reads ``true`` as no text."""
    escaped = text.replace("\\", r"\\").replace('"', r"\"")
    return f'"{escaped}"'


def _parse(text: str) -> Rig:
    require(text.startswith("%YAML"), "not a FileStorage YAML file")
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    root = _Fields("", storage.root())
    version = root.integer("handcal_rig")
    require(version == RIG_VERSION, f"rig version {version} is not {RIG_VERSION}, the one known")
    eyes = {eye: _parse_display(root.section(eye)) for eye in EYES}
    return Rig(
        name=root.text("name"),
        eyes=eyes,
        T_H_D=root.matrix("T_H_D", 4, 4),
        depth_intrinsics=_parse_depth_camera(root.section("depth_camera")),
    )


def _parse_display(fields: _Fields) -> EyeDisplay:
    return EyeDisplay(
        K=fields.matrix("K", 3, 3),
        H0=fields.matrix("H0", 3, 3),
        t_C0_V_m=fields.matrix("t_C0_V_m", 3, 1)[:, 0],
        z_C0_S_m=fields.number("z_C0_S_m"),
        width_px=fields.integer("width_px"),
        height_px=fields.integer("height_px"),
        T_V_H=fields.matrix("T_V_H", 4, 4),
    )


def _parse_depth_camera(fields: _Fields) -> Intrinsics:
    return Intrinsics(
        width=fields.integer("width_px"),
        height=fields.integer("height_px"),
        fx=fields.number("fx"),
        fy=fields.number("fy"),
        cx=fields.number("cx"),
        cy=fields.number("cy"),
        distortion=fields.numbers("distortion"),
    )


class _Fields:
    """A map node whose fields are fetched by kind, with a ValueError that names the bad one."""

    def __init__(self, name: str, node: cv2.FileNode) -> None:
        require(node.isMap(), f"{name or 'the file'} must be a map of fields")
        self._prefix = f"{name}." if name else ""
        self._node = node

    def section(self, name: str) -> _Fields:
        return _Fields(self._prefix + name, self._node.getNode(name))

    def text(self, name: str) -> str:
        node = self._node.getNode(name)
        require(node.isString(), f"{self._prefix}{name} must be a text")
        return node.string()

    def number(self, name: str) -> float:
        return _number(self._prefix + name, self._node.getNode(name))

    def integer(self, name: str) -> int:
        node = self._node.getNode(name)
        require(node.isInt(), f"{self._prefix}{name} must be a whole number")
        return int(node.real())

    def numbers(self, name: str) -> tuple[float, ...]:
        node = self._node.getNode(name)
        full_name = self._prefix + name
        require(node.isSeq(), f"{full_name} must be a list of numbers")
        return tuple(_number(full_name, node.at(index)) for index in range(node.size()))

    def matrix(self, name: str, rows: int, columns: int) -> Float64:
        node = self._node.getNode(name)
        # The size is checked before OpenCV allocates what the file asks for.
        require(
            node.isMap()
            and node.getNode("rows").real() == rows
            and node.getNode("cols").real() == columns
            and node.getNode("dt").string() == "d"
            and node.getNode("data").size() == rows * columns,
            f"{self._prefix}{name} must be a {rows}×{columns} opencv-matrix of type d",
        )
        return np.asarray(node.mat(), dtype=np.float64)


def _number(name: str, node: cv2.FileNode) -> float:
    require(node.isReal() or node.isInt(), f"{name} must be a number")
    return node.real()
