"""The rig file: the offline calibration in OpenCV's FileStorage YAML.

Anything that reads FileStorage reads it. Per eye: the display's size, T_V_H, and a named model with
its parameters; for the depth camera: identity, intrinsics, T_H_D and the check of its depth and
edges; the headset's identity and views; and how each part was calibrated. Numbers survive exactly.

Unknown fields are ignored.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

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
    Float64,
    HeadsetIdentity,
    HeadsetView,
    Intrinsics,
    Origin,
    Rig,
    RigPart,
)
from handcal.io.files import read_limited, write_atomic
from handcal.rig.plausible import MAX_RANGES, check_rig, require

# OpenCV's parser recurses with the nesting and overflows the stack at 65 kB.
MAX_STORAGE_BYTES = 2**14

_NESTS = re.compile(rb"[\[{<:]|-\s")
"""Openings of a level of nesting in YAML or XML; deeper indentation takes ever more bytes."""
_DEEPEST = 12

Value = TypeVar("Value")


def parse_storage(data: bytes, convert: Callable[[Fields], Value]) -> Value:
    """Return the result of `convert` for FileStorage YAML of at most `MAX_STORAGE_BYTES`.

    Raises
    ------
    ValueError
        If it is not valid FileStorage YAML, or `convert` refuses a field.
    """
    require(data.startswith(b"%YAML"), "not a YAML file as OpenCV and handcal write it")
    try:
        storage = cv2.FileStorage(data.decode(), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        return convert(Fields("", storage.root()))
    except (UnicodeDecodeError, cv2.error, SystemError) as error:  # SystemError: not parsable
        raise ValueError("not valid FileStorage YAML") from error


def parse_tree(data: bytes) -> dict[str, Any]:
    """Return FileStorage YAML or XML, or simple YAML of other programs, as maps, lists and values.

    Of several YAML documents, as ``ros2 topic echo`` prints them, it is the first.

    Raises
    ------
    ValueError
        If it cannot be parsed, is no map of fields, or is nested as no calibration is.
    """
    data = data.replace(b"\r\n", b"\n").removeprefix(b"\xef\xbb\xbf").lstrip()
    if not data.startswith(b"<?xml"):
        data = _as_storage(data)
    require(len(_NESTS.findall(data)) <= MAX_STORAGE_BYTES, "it is nested too deeply")
    try:
        storage = cv2.FileStorage(data.decode(), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        tree = _tree(storage.root(), _DEEPEST)
    except (UnicodeDecodeError, cv2.error, SystemError) as error:
        raise ValueError("not valid YAML or XML") from error
    if not isinstance(tree, dict):
        raise ValueError("the file must be a map of fields")
    return tree


def _as_storage(data: bytes) -> bytes:
    """Return the first document of YAML in the dialect that OpenCV reads."""
    is_own = data.startswith(b"%YAML")
    documents = re.split(rb"(?m)^---.*$", re.sub(rb"(?m)^%YAML.*$", b"", data))
    first = next((one for one in documents if one.strip()), b"")
    if not is_own:
        first = re.sub(rb"!!python/\S+", b"", first)
        first = re.sub(rb",[ \t]*\n\s*", b", ", first)  # lists go on at any indentation
        # A key without a value is refused by OpenCV.
        first = re.sub(rb"(?m)^( *)([\w./]+):[ \t]*\n(?!\1 +\S|\1- )", rb'\1\2: ""\n', first)
        # PyYAML does not indent a list below its key; OpenCV requires it.
        first = re.sub(rb"(?m)^( *)- ", rb"\1  - ", first)
    return b"%YAML 1.2\n---\n" + first


def _tree(node: cv2.FileNode, levels: int) -> object:
    require(levels > 0, "it is nested too deeply")
    if node.isMap():
        return {key: _tree(node.getNode(key), levels - 1) for key in node.keys()}  # noqa: SIM118
    if node.isSeq():
        return [_tree(node.at(index), levels - 1) for index in range(node.size())]
    if node.isString():
        return node.string()
    return int(node.real()) if node.isInt() else node.real() if node.isReal() else None


class Fields:
    """A map node whose fields are fetched by kind, with a ValueError that names the bad one."""

    def __init__(self, name: str, node: cv2.FileNode) -> None:
        require(node.isMap(), f"{name or 'the file'} must be a map of fields")
        self._prefix = f"{name}." if name else ""
        self._node = node

    def has(self, name: str) -> bool:
        """Return whether the field exists."""
        return not self._node.getNode(name).empty()

    def section(self, name: str) -> Fields:
        """Return a map among the fields."""
        return Fields(self._prefix + name, self._node.getNode(name))

    def part(self, name: str, convert: Callable[[Fields], Value]) -> Value | None:
        """Return what `convert` makes of a map among the fields; None without it."""
        return convert(self.section(name)) if self.has(name) else None

    def text(self, name: str) -> str:
        """Return a text."""
        node = self._node.getNode(name)
        require(node.isString(), f"{self._prefix}{name} must be a text")
        return node.string()

    def number(self, name: str) -> float:
        """Return a number."""
        return _number(self._prefix + name, self._node.getNode(name))

    def integer(self, name: str) -> int:
        """Return a whole number."""
        node = self._node.getNode(name)
        require(node.isInt(), f"{self._prefix}{name} must be a whole number")
        return int(node.real())

    def numbers(self, name: str) -> tuple[float, ...]:
        """Return a list of numbers."""
        node = self._node.getNode(name)
        full_name = self._prefix + name
        require(node.isSeq(), f"{full_name} must be a list of numbers")
        return tuple(_number(full_name, node.at(index)) for index in range(node.size()))

    def texts(self, name: str) -> tuple[str, ...]:
        """Return the field's texts, one or more."""
        node = self._node.getNode(name)
        items = [node.at(index) for index in range(node.size())] if node.isSeq() else []
        require(
            bool(items) and all(item.isString() for item in items),
            f"{self._prefix}{name} must be a list of texts",
        )
        return tuple(item.string() for item in items)

    def matrix(self, name: str, rows: int, columns: int) -> Float64:
        """Return an opencv-matrix of doubles of the given size."""
        return self._matrix(name, rows, columns, str(rows))

    def rows(self, name: str, columns: int, most: int) -> Float64:
        """Return an opencv-matrix of doubles with 1 to `most` rows of `columns`."""
        rows = self._node.getNode(name).getNode("rows").real() if self.has(name) else 0
        return self._matrix(name, rows if rows in range(1, most + 1) else 0, columns, "N")

    def _matrix(self, name: str, rows: float, columns: int, rows_text: str) -> Float64:
        node = self._node.getNode(name)
        # The size is checked before OpenCV allocates memory for it.
        require(
            node.isMap()
            and rows > 0
            and node.getNode("rows").real() == rows
            and node.getNode("cols").real() == columns
            and node.getNode("dt").string() == "d"
            and node.getNode("data").size() == rows * columns,
            f"{self._prefix}{name} must be a {rows_text}×{columns} opencv-matrix of type d",
        )
        return np.asarray(node.mat(), dtype=np.float64)


def _number(name: str, node: cv2.FileNode) -> float:
    require(node.isReal() or node.isInt(), f"{name} must be a number")
    return node.real()


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
    >>> rig = handcal.example_rig()
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
    >>> rig = handcal.read_rig(handcal.example_session().path / "rig.yaml")
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
