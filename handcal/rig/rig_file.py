"""The rig file: the offline calibration in OpenCV's FileStorage YAML.

Anything that reads FileStorage reads it. Per eye: K, H0, t_C0_V_m, z_C0_S_m, the display's size
and T_V_H; for the depth camera: T_H_D and its intrinsics; and how each was calibrated. Numbers
survive exactly. Version 1, without this history, can be read too; files are always written as
version 2.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import cv2

from handcal.errors import FileError
from handcal.io.files import read_limited, write_atomic
from handcal.rig.check import check_rig, require
from handcal.rig.storage import MAX_STORAGE_BYTES, Fields, parse_storage
from handcal.types import EYES, RIG_PARTS, EyeDisplay, Intrinsics, Origin, Rig, RigPart

RIG_VERSION = 2
MAX_RIG_BYTES = MAX_STORAGE_BYTES  # a rig takes 3 kB, and 8 kB with its calibration history


def write_rig(path: str | PathLike[str], rig: Rig) -> None:
    """Write a rig file, version 2, atomically.

    Parameters
    ----------
    path : path
        OpenCV FileStorage YAML; its folder exists.
    rig : Rig

    Raises
    ------
    ValueError
        If `read_rig` would refuse the rig.
    FileError
        If the file cannot be written.

    Examples
    --------
    >>> import handcal
    >>> from dataclasses import replace
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> rig = handcal.read_rig("resources/example_rig.yaml")
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "rig.yaml"
    ...     handcal.write_rig(path, replace(rig, name="My headset"))
    ...     handcal.read_rig(path).name
    'My headset'
    """
    path = Path(path)
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
    _write_origins(storage, rig)
    data = storage.releaseAndGetString().encode()
    require(len(data) <= MAX_RIG_BYTES, f"the rig takes more than {MAX_RIG_BYTES:,} bytes")
    write_atomic(path, data)


def read_rig(path: str | PathLike[str]) -> Rig:
    """Read and check a rig file, version 1 or 2.

    Parameters
    ----------
    path : path
        OpenCV FileStorage YAML, as `write_rig` and ``handcal rig`` write it.

    Returns
    -------
    Rig
        Both eyes' displays, K in pixels and distances in metres, and T_H_D, the depth camera's
        place on the headset.

    Raises
    ------
    FileError
        If the file cannot be read, is not a rig file or of an unknown version, or a field is
        missing or implausible; the text names the field and what is expected.

    Examples
    --------
    >>> import handcal
    >>> rig = handcal.read_rig("resources/example_rig.yaml")
    >>> rig.eyes["left"].K.shape, rig.eyes["left"].z_C0_S_m
    ((3, 3), 2.0)
    """
    path = Path(path)
    data = read_limited(path, MAX_RIG_BYTES)
    try:
        return parse_rig(data)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


def parse_rig(data: bytes) -> Rig:
    """Return the rig in the content of a rig file; ValueError as `read_rig`."""
    return parse_storage(data, _parse)


def quoted(text: str) -> str:
    """Quote a text: OpenCV does not quote plain words, and would read ``true`` as a boolean."""
    escaped = text.replace("\\", r"\\").replace('"', r"\"")
    return f'"{escaped}"'


def _write_origins(storage: cv2.FileStorage, rig: Rig) -> None:
    if not rig.origins:
        return
    storage.startWriteStruct("origins", cv2.FileNode_MAP)
    for part, origin in rig.origins.items():
        storage.startWriteStruct(part, cv2.FileNode_MAP)
        for name in ("method", "made", "verdict", "reason"):
            storage.write(name, quoted(getattr(origin, name)))
        storage.write("views", origin.views)
        storage.write("rms_px", origin.rms_px)
        storage.startWriteStruct("parameters", cv2.FileNode_SEQ | cv2.FileNode_FLOW)
        for parameter in origin.parameters:
            storage.write("", quoted(parameter))
        storage.endWriteStruct()
        storage.write("covariance", origin.covariance)
        storage.endWriteStruct()
    storage.endWriteStruct()


def _parse(root: Fields) -> Rig:
    version = root.integer("handcal_rig")
    require(
        1 <= version <= RIG_VERSION,
        f"rig version {version} is unknown; versions 1 to {RIG_VERSION} can be read",
    )
    eyes = {eye: _parse_display(root.section(eye)) for eye in EYES}
    rig = Rig(
        name=root.text("name"),
        eyes=eyes,
        T_H_D=root.matrix("T_H_D", 4, 4),
        depth_intrinsics=_parse_depth_camera(root.section("depth_camera")),
        origins=_parse_origins(root),
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


def _parse_origins(root: Fields) -> dict[RigPart, Origin]:
    if not root.has("origins"):
        return {}
    origins = root.section("origins")
    return {part: _parse_origin(origins.section(part)) for part in RIG_PARTS if origins.has(part)}


def _parse_origin(fields: Fields) -> Origin:
    parameters = fields.texts("parameters")
    return Origin(
        method=fields.text("method"),
        made=fields.text("made"),
        views=fields.integer("views"),
        rms_px=fields.number("rms_px"),
        verdict=fields.text("verdict"),
        reason=fields.text("reason"),
        parameters=parameters,
        covariance=fields.matrix("covariance", len(parameters), len(parameters)),
    )
