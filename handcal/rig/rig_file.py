"""The rig file: the offline calibration in OpenCV's FileStorage YAML.

Anything that reads FileStorage reads it. Per eye: K, H0, t_C0_V_m, z_C0_S_m, the display's size
and T_V_H; for the depth camera: T_H_D and its intrinsics. Numbers survive exactly.
"""

from __future__ import annotations

from pathlib import Path

import cv2

from handcal.errors import FileError
from handcal.files import read_limited, write_atomic
from handcal.rig.check import check_rig, require
from handcal.rig.storage import MAX_STORAGE_BYTES, Fields, parse_storage
from handcal.types import EYES, EyeDisplay, Intrinsics, Rig

RIG_VERSION = 1
MAX_RIG_BYTES = MAX_STORAGE_BYTES  # a rig takes 3 kB


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
        return parse_storage(data.decode(), _parse)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


def quoted(text: str) -> str:
    """Quote a text: OpenCV leaves plain words as they are, and reads ``true`` as no text."""
    escaped = text.replace("\\", r"\\").replace('"', r"\"")
    return f'"{escaped}"'


def _parse(root: Fields) -> Rig:
    version = root.integer("handcal_rig")
    require(version == RIG_VERSION, f"rig version {version} is not {RIG_VERSION}, the one known")
    eyes = {eye: _parse_display(root.section(eye)) for eye in EYES}
    rig = Rig(
        name=root.text("name"),
        eyes=eyes,
        T_H_D=root.matrix("T_H_D", 4, 4),
        depth_intrinsics=_parse_depth_camera(root.section("depth_camera")),
    )
    check_rig(rig)
    return rig


def _parse_display(fields: Fields) -> EyeDisplay:
    return EyeDisplay(
        K=fields.matrix("K", 3, 3),
        H0=fields.matrix("H0", 3, 3),
        t_C0_V_m=fields.matrix("t_C0_V_m", 3, 1)[:, 0],
        z_C0_S_m=fields.number("z_C0_S_m"),
        width_px=fields.integer("width_px"),
        height_px=fields.integer("height_px"),
        T_V_H=fields.matrix("T_V_H", 4, 4),
    )


def _parse_depth_camera(fields: Fields) -> Intrinsics:
    return Intrinsics(
        width=fields.integer("width_px"),
        height=fields.integer("height_px"),
        fx=fields.number("fx"),
        fy=fields.number("fy"),
        cx=fields.number("cx"),
        cy=fields.number("cy"),
        distortion=fields.numbers("distortion"),
    )
