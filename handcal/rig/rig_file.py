"""The rig file: the offline calibration in OpenCV's FileStorage YAML.

Anything that reads FileStorage reads it. Per eye: the display's size, T_V_H, and a named model with
its parameters; for the depth camera: identity, intrinsics, T_H_D and the check of its depth and
edges; the headset's identity and views; and how each part was calibrated. Numbers survive exactly.

Unknown fields are ignored.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

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
_CAMERA_TEXTS = ("model", "serial_number", "firmware")


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
    storage.write("handcal_rig", RIG_VERSION)
    storage.write("name", quoted(rig.name))
    for eye in EYES:
        _write_display(storage, eye, rig.eyes[eye])
    storage.write("T_H_D", rig.T_H_D)
    _write_depth_camera(storage, rig.depth_intrinsics, rig.depth_camera)
    _write_depth_check(storage, rig.depth_check)
    _write_depth_edges(storage, rig.depth_edges)
    _write_headset(storage, rig.headset)
    _write_display_check(storage, rig.display_check)
    _write_origins(storage, rig.origins)
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


@contextmanager
def _map(storage: cv2.FileStorage, name: str) -> Iterator[None]:
    """Write the fields written inside ``with`` as a map."""
    storage.startWriteStruct(name, cv2.FileNode_MAP)
    yield
    storage.endWriteStruct()


def _write_texts(storage: cv2.FileStorage, source: object, names: tuple[str, ...]) -> None:
    for name in names:
        storage.write(name, quoted(getattr(source, name)))


def _write_display(storage: cv2.FileStorage, eye: str, display: EyeDisplay) -> None:
    with _map(storage, eye):
        storage.write("width_px", display.width_px)
        storage.write("height_px", display.height_px)
        storage.write("T_V_H", display.T_V_H)
        with _map(storage, "model"):
            storage.write("name", quoted(DISPLAY_MODEL))
            storage.write("K", display.K)
            storage.write("H0", display.H0)
            storage.write("t_C0_V_m", display.t_C0_V_m[:, None])
            storage.write("z_C0_S_m", display.z_C0_S_m)


def _write_depth_camera(
    storage: cv2.FileStorage, intrinsics: Intrinsics, identity: CameraIdentity
) -> None:
    with _map(storage, "depth_camera"):
        _write_texts(storage, identity, _CAMERA_TEXTS)
        storage.write("width_px", intrinsics.width)
        storage.write("height_px", intrinsics.height)
        for name in ("fx", "fy", "cx", "cy"):
            storage.write(name, getattr(intrinsics, name))
        storage.startWriteStruct("distortion", cv2.FileNode_SEQ | cv2.FileNode_FLOW)
        for coefficient in intrinsics.distortion:
            storage.write("", coefficient)
        storage.endWriteStruct()


def _write_depth_check(storage: cv2.FileStorage, check: DepthCheck | None) -> None:
    if check is None:
        return
    with _map(storage, "depth_check"):
        storage.write("made", quoted(check.made))
        storage.write("views", check.views)
        storage.write("scale", check.scale)
        storage.write("offset_m", check.offset_m)
        storage.write("covariance", check.covariance)
        rows = [check.ranges_m, check.flatness_m[:, None], check.flatness_sigma_m[:, None]]
        storage.write("flatness", np.hstack(rows))


def _write_depth_edges(storage: cv2.FileStorage, edges: DepthEdges | None) -> None:
    if edges is None:
        return
    with _map(storage, "depth_edges"):
        storage.write("made", quoted(edges.made))
        storage.write("views", edges.views)
        storage.write("fatten_px", edges.fatten_px)
        storage.write("sigma_px", edges.sigma_px)


def _write_headset(storage: cv2.FileStorage, headset: HeadsetIdentity | None) -> None:
    if headset is None:
        return
    with _map(storage, "headset"):
        _write_texts(storage, headset, ("device_id", "name", "runtime", "app"))
        storage.write("protocol", headset.protocol)
        if headset.eye_distance_m is not None:
            storage.write("eye_distance_m", headset.eye_distance_m)
        if headset.moves_views:
            storage.write("moves_views", 1)
        for eye, view in headset.views.items():
            with _map(storage, eye):
                storage.write("width_px", view.width_px)
                storage.write("height_px", view.height_px)
                storage.write("tangents", view.tangents[:, None])
                storage.write("T_V_H", view.T_V_H)


def _write_display_check(storage: cv2.FileStorage, check: DisplayCheck | None) -> None:
    if check is None:
        return
    with _map(storage, "display_check"):
        _write_texts(storage, check, _CHECK_TEXTS)
        for eye, problem in check.problems.items():
            storage.write(eye, quoted(problem))


def _write_origins(storage: cv2.FileStorage, origins: Mapping[RigPart, Origin]) -> None:
    if not origins:
        return
    with _map(storage, "origins"):
        for part, origin in origins.items():
            with _map(storage, part):
                _write_texts(storage, origin, ("method", "made", "verdict", "reason"))
                storage.write("views", origin.views)
                storage.write("rms_px", origin.rms_px)
                storage.startWriteStruct("parameters", cv2.FileNode_SEQ | cv2.FileNode_FLOW)
                for parameter in origin.parameters:
                    storage.write("", quoted(parameter))
                storage.endWriteStruct()
                storage.write("covariance", origin.covariance)


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
        origins=_parse_origins(root),
        depth_camera=CameraIdentity(*map(depth_camera.text, _CAMERA_TEXTS)),
        headset=_parse_headset(root),
        depth_check=_parse_depth_check(root),
        depth_edges=_parse_depth_edges(root),
        display_check=_parse_display_check(root),
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
        fx=fields.number("fx"),
        fy=fields.number("fy"),
        cx=fields.number("cx"),
        cy=fields.number("cy"),
        distortion=fields.numbers("distortion"),
    )


def _parse_depth_check(root: Fields) -> DepthCheck | None:
    if not root.has("depth_check"):
        return None
    fields = root.section("depth_check")
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


def _parse_depth_edges(root: Fields) -> DepthEdges | None:
    if not root.has("depth_edges"):
        return None
    fields = root.section("depth_edges")
    return DepthEdges(
        fatten_px=fields.number("fatten_px"),
        sigma_px=fields.number("sigma_px"),
        source="measured",
        views=fields.integer("views"),
        made=fields.text("made"),
    )


def _parse_display_check(root: Fields) -> DisplayCheck | None:
    if not root.has("display_check"):
        return None
    fields = root.section("display_check")
    made, observer, device_id, runtime, app = map(fields.text, _CHECK_TEXTS)
    is_wearer = observer == "wearer"
    require(is_wearer or observer == "camera", "display_check.observer must be camera or wearer")
    problems = {eye: fields.text(eye) for eye in EYES if fields.has(eye)}
    return DisplayCheck(
        made, "wearer" if is_wearer else "camera", device_id, runtime, app, problems
    )


def _parse_headset(root: Fields) -> HeadsetIdentity | None:
    if not root.has("headset"):
        return None
    fields = root.section("headset")
    return HeadsetIdentity(
        device_id=fields.text("device_id"),
        name=fields.text("name"),
        runtime=fields.text("runtime"),
        app=fields.text("app"),
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
