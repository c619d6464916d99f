"""The rig file: the offline calibration in OpenCV's FileStorage YAML.

Anything that reads FileStorage reads it. Per eye: the display's size, T_V_H, and a named model with
its parameters; for the depth camera: identity, intrinsics, T_H_D and the check of its depth and
edges; the headset's identity and views; and how each part was calibrated. Numbers survive exactly.

Unknown fields are ignored.
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from handcal.core.errors import FileError
from handcal.core.types import (
    EYES,
    RIG_PARTS,
    CameraIdentity,
    DepthCheck,
    DepthEdges,
    DisplayCheck,
    EyeDisplay,
    HeadsetIdentity,
    HeadsetView,
    Intrinsics,
    Origin,
    Rig,
    RigPart,
)
from handcal.io.files import read_limited, write_atomic
from handcal.rig.plausible import MAX_RANGES, check_rig, require
from handcal.rig.storage import MAX_STORAGE_BYTES, Fields, parse_storage

RIG_VERSION = 3
_CHECK_TEXTS = "made", "observer", "device_id", "runtime", "app"
DISPLAY_MODEL = "homography"
"""The display model of `EyeDisplay`, the only one so far: ``K H0 UQ`` and its parameters."""
MAX_RIG_BYTES = MAX_STORAGE_BYTES  # a rig takes 3 kB, and 10 kB with all that may be known
_CAMERA_TEXTS = "model", "serial_number", "firmware"
_ORIGIN_TEXTS = "method", "made", "verdict", "reason"
_ORIGIN = (*_ORIGIN_TEXTS, "views", "rms_px", "parameters", "covariance")


def write_rig(path: str | PathLike[str], rig: Rig) -> None:
    """Write a rig file, atomically.

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
    _write_fields(storage, _fields_of(rig))
    data = storage.releaseAndGetString().encode()
    require(len(data) <= MAX_RIG_BYTES, f"the rig takes more than {MAX_RIG_BYTES:,} bytes")
    write_atomic(path, data)


def read_rig(path: str | PathLike[str]) -> Rig:
    """Read and check a rig file.

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
        If the file cannot be read, is not a rig file or of another version, or a field is
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


def _write_fields(storage: cv2.FileStorage, fields: Mapping[str, Any]) -> None:
    """Write fields in their order: maps, lists, texts, numbers and matrices; None is left out."""
    for name, value in fields.items():
        match value:
            case None:
                pass
            case Mapping():
                storage.startWriteStruct(name, cv2.FileNode_MAP)
                _write_fields(storage, value)
                storage.endWriteStruct()
            case tuple():
                storage.startWriteStruct(name, cv2.FileNode_SEQ | cv2.FileNode_FLOW)
                for item in value:
                    storage.write("", quoted(item) if isinstance(item, str) else item)
                storage.endWriteStruct()
            case str():
                storage.write(name, quoted(value))
            case _:
                storage.write(name, value)


def _fields_of(rig: Rig) -> dict[str, Any]:
    camera = rig.depth_intrinsics
    return {
        "handcal_rig": RIG_VERSION,
        "name": rig.name,
        **{eye: _fields_of_display(rig.eyes[eye]) for eye in EYES},
        "T_H_D": rig.T_H_D,
        "depth_camera": {
            **_attributes(rig.depth_camera, *_CAMERA_TEXTS),
            "width_px": camera.width,
            "height_px": camera.height,
            **_attributes(camera, "fx", "fy", "cx", "cy", "distortion"),
        },
        "depth_check": rig.depth_check and _fields_of_depth_check(rig.depth_check),
        "depth_edges": rig.depth_edges
        and _attributes(rig.depth_edges, "made", "views", "fatten_px", "sigma_px"),
        "headset": rig.headset and _fields_of_headset(rig.headset),
        "display_check": rig.display_check
        and {**_attributes(rig.display_check, *_CHECK_TEXTS), **rig.display_check.problems},
        "origins": {part: _attributes(one, *_ORIGIN) for part, one in rig.origins.items()} or None,
    }


def _attributes(source: object, *names: str) -> dict[str, Any]:
    return {name: getattr(source, name) for name in names}


def _fields_of_display(display: EyeDisplay) -> dict[str, Any]:
    model = {
        "name": DISPLAY_MODEL,
        "K": display.K,
        "H0": display.H0,
        "t_C0_V_m": display.t_C0_V_m[:, None],
        "z_C0_S_m": display.z_C0_S_m,
    }
    return {**_attributes(display, "width_px", "height_px", "T_V_H"), "model": model}


def _fields_of_depth_check(check: DepthCheck) -> dict[str, Any]:
    rows = [check.ranges_m, check.flatness_m[:, None], check.flatness_sigma_m[:, None]]
    named = _attributes(check, "made", "views", "scale", "offset_m", "covariance")
    return {**named, "flatness": np.hstack(rows)}


def _fields_of_headset(headset: HeadsetIdentity) -> dict[str, Any]:
    names = "device_id", "name", "runtime", "app", "protocol", "eye_distance_m"
    return {
        **_attributes(headset, *names),
        "moves_views": 1 if headset.moves_views else None,
        **{
            eye: {
                **_attributes(view, "width_px", "height_px"),
                "tangents": view.tangents[:, None],
                "T_V_H": view.T_V_H,
            }
            for eye, view in headset.views.items()
        },
    }


def _parse(root: Fields) -> Rig:
    version = root.integer("handcal_rig")
    require(
        version == RIG_VERSION,
        f"the rig's version is {version}, not {RIG_VERSION}: use the handcal that wrote this file, "
        "or calibrate the rig again",
    )
    depth_camera = root.section("depth_camera")
    rig = Rig(
        name=root.text("name"),
        eyes={eye: _parse_display(root.section(eye)) for eye in EYES},
        T_H_D=root.matrix("T_H_D", 4, 4),
        depth_intrinsics=_parse_intrinsics(depth_camera),
        origins=root.part("origins", _parse_origins) or {},
        depth_camera=CameraIdentity(*map(depth_camera.text, _CAMERA_TEXTS)),
        headset=root.part("headset", _parse_headset),
        depth_check=root.part("depth_check", _parse_depth_check),
        depth_edges=root.part("depth_edges", _parse_depth_edges),
        display_check=root.part("display_check", _parse_display_check),
    )
    check_rig(rig)
    return rig


def _parse_display(fields: Fields) -> EyeDisplay:
    model = fields.section("model")
    name = model.text("name")
    require(
        name == DISPLAY_MODEL,
        f"the display model {name[:40]!r} is not known, only {DISPLAY_MODEL!r}: use the version "
        "of handcal that wrote this file, or a newer one",
    )
    return EyeDisplay(
        K=model.matrix("K", 3, 3),
        H0=model.matrix("H0", 3, 3),
        t_C0_V_m=model.matrix("t_C0_V_m", 3, 1)[:, 0],
        z_C0_S_m=model.number("z_C0_S_m"),
        width_px=fields.integer("width_px"),
        height_px=fields.integer("height_px"),
        T_V_H=fields.matrix("T_V_H", 4, 4),
    )


def _parse_intrinsics(fields: Fields) -> Intrinsics:
    return Intrinsics(
        width=fields.integer("width_px"),
        height=fields.integer("height_px"),
        **{name: fields.number(name) for name in ("fx", "fy", "cx", "cy")},
        distortion=fields.numbers("distortion"),
    )


def _parse_depth_check(fields: Fields) -> DepthCheck:
    flatness = fields.rows("flatness", 4, MAX_RANGES)
    return DepthCheck(
        made=fields.text("made"),
        views=fields.integer("views"),
        scale=fields.number("scale"),
        offset_m=fields.number("offset_m"),
        covariance=fields.matrix("covariance", 2, 2),
        ranges_m=flatness[:, :2],
        flatness_m=flatness[:, 2],
        flatness_sigma_m=flatness[:, 3],
    )


def _parse_depth_edges(fields: Fields) -> DepthEdges:
    return DepthEdges(
        fatten_px=fields.number("fatten_px"),
        sigma_px=fields.number("sigma_px"),
        source="measured",
        views=fields.integer("views"),
        made=fields.text("made"),
    )


def _parse_display_check(fields: Fields) -> DisplayCheck:
    made, observer, device_id, runtime, app = map(fields.text, _CHECK_TEXTS)
    is_wearer = observer == "wearer"
    require(is_wearer or observer == "camera", "display_check.observer must be camera or wearer")
    problems = {eye: fields.text(eye) for eye in EYES if fields.has(eye)}
    return DisplayCheck(
        made, "wearer" if is_wearer else "camera", device_id, runtime, app, problems
    )


def _parse_headset(fields: Fields) -> HeadsetIdentity:
    return HeadsetIdentity(
        **{name: fields.text(name) for name in ("device_id", "name", "runtime", "app")},
        protocol=fields.integer("protocol"),
        views={eye: _parse_view(fields.section(eye)) for eye in EYES if fields.has(eye)},
        eye_distance_m=fields.number("eye_distance_m") if fields.has("eye_distance_m") else None,
        moves_views=fields.has("moves_views") and fields.integer("moves_views") != 0,
    )


def _parse_view(fields: Fields) -> HeadsetView:
    return HeadsetView(
        T_V_H=fields.matrix("T_V_H", 4, 4),
        tangents=fields.matrix("tangents", 4, 1)[:, 0],
        width_px=fields.integer("width_px"),
        height_px=fields.integer("height_px"),
    )


def _parse_origins(origins: Fields) -> dict[RigPart, Origin]:
    return {part: _parse_origin(origins.section(part)) for part in RIG_PARTS if origins.has(part)}


def _parse_origin(fields: Fields) -> Origin:
    parameters = fields.texts("parameters")
    return Origin(
        **{name: fields.text(name) for name in _ORIGIN_TEXTS},
        views=fields.integer("views"),
        rms_px=fields.number("rms_px"),
        parameters=parameters,
        covariance=fields.matrix("covariance", len(parameters), len(parameters)),
    )
