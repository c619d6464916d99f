"""Cameras and poses as files: OpenCV's FileStorage, ROS camera_info, JSON, and other programs'.

Lengths are in metres. FileStorage uses the names of OpenCV's own calibration samples
(``camera_matrix``, ``distortion_coefficients``; ``R`` and ``T`` from the depth camera to the
headset's). ROS's camera_info holds one camera and no pose.

Cameras in the files of other programs are recognised by their fields, whose names vary: those of
OpenCV's samples (``camera_matrix``, ``Camera_Matrix``, ``cameraMatrix``, ``M1``, ``K``), ROS's
camera_info as a file and as echoed, Kalibr's and EuRoC's, librealsense's (``ppx``, ``coeffs``),
Open3D's (``intrinsic_matrix``, by columns), ORB-SLAM's (``Camera.fx``), and Azure Kinect's
``ModelParameters``, which are shares of the sensor's size.

Tracked poses of a board are JSON, one for each image that the viewpoint camera took of it:
``{"handcal_tracked": 1, "T_H_B": {"image.png": [[…], […], […], […]], …}}``, from the board to the
headset rig, at the moment of the image.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, astuple, dataclass
from dataclasses import fields as fields_of
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypeVar

import cv2
import numpy as np

from handcal.core.errors import FileError, HandcalError
from handcal.core.geometry import is_rigid, rigid
from handcal.core.types import CameraIdentity, Float64, Intrinsics
from handcal.io.files import read_json, read_limited, write_atomic, write_json
from handcal.io.settings import known_settings, read_settings
from handcal.rig.boards.views import MAX_VIEWS, WorstView
from handcal.rig.lens.camera import CameraCalibration
from handcal.rig.lens.fit import CalibrationVerdict
from handcal.rig.lens.lens import Camera, FisheyeIntrinsics, as_pinhole, camera_matrix_of
from handcal.rig.lens.stereo import StereoCalibration
from handcal.rig.plausible import check_intrinsics, identity_from_json, require
from handcal.rig.rig_file import parse_tree

CalibrationFormat: TypeAlias = Literal["opencv", "ros", "json"]
CALIBRATION_FORMATS: tuple[CalibrationFormat, ...] = ("opencv", "ros", "json")
JSON_VERSION = 1
MAX_BYTES = 2**20
_MAX_REACH_M = 1.0
_ROS_MODELS = ("plumb_bob", "rational_polynomial")
_ROS_FISHEYE = "equidistant"

_LOG = logging.getLogger(__name__)

Value = TypeVar("Value")


def read_intrinsics(path: Path) -> Intrinsics:
    """Read a pinhole camera's intrinsics, like `read_camera`.

    Raises
    ------
    FileError
        As `read_camera`, or if it is a fisheye.
    """
    try:
        return as_pinhole(read_camera(path), "the camera")
    except FileError:
        raise
    except HandcalError as error:
        raise FileError(f"{path}: {error}") from error


def read_camera(path: Path, name: str | None = None, size: tuple[int, int] | None = None) -> Camera:
    """Read a camera's intrinsics, in any of `CALIBRATION_FORMATS` or as other programs write them.

    Parameters
    ----------
    path : Path
        Recognised by its content.
    name : str, optional
        Which of its cameras; by default the first, with a warning if there are others.
    size : (width, height), optional
        Of the images, in pixels, where the file does not say it.

    Raises
    ------
    FileError
        If the file cannot be read or holds no such camera, a field is missing or implausible, or
        the lens model is not one of OpenCV's.
    """

    def convert(values: dict[str, Any]) -> Camera:
        if "handcal_camera" in values:
            return _camera_of_json(values)
        names = cameras_in(values)
        require(bool(names) or not _has_pose(values), "it holds a pose, but no camera")
        require(bool(names), no_camera(read_limited(path, MAX_BYTES)))
        if name is None and len(names) > 1:
            _LOG.warning("%s: camera %s is used, of %s", path, names[0], ", ".join(names))
        return camera_in(values, name, size)

    return _read(path, convert)


def has_pose(path: Path) -> bool:
    """Return whether a file holds a pose, and no camera; FileError if it cannot be read."""

    def is_pose(values: dict[str, Any]) -> bool:
        return "handcal_stereo" in values or (_has_pose(values) and not cameras_in(values))

    return _matrix_in(path) is not None or _read(path, is_pose)


def read_pose(path: Path) -> Float64:
    """Read a rigid transform: FileStorage, the JSON of a stereo pose, or 4 rows of 4 numbers.

    Raises
    ------
    FileError
        If the file cannot be read, or holds no rigid transform.
    """
    try:
        numbers = _matrix_in(path)
        if numbers is None:
            return _read(path, _pose_of)
        require(bool(numbers), "the file is empty")
        require(len(numbers) == 16, "a matrix must have 4 rows of 4 numbers")
        return _pose(np.array(numbers).reshape(4, 4))
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


def read_stereo(path: Path) -> StereoCalibration:
    """Read a whole stereo calibration from the JSON that `stereo_json` makes.

    Raises
    ------
    FileError
        If the file cannot be read, is not a stereo calibration, or a field is missing or
        implausible.
    """
    values = read_json(path)
    try:
        T_H_D = _pose_of_json(values)
        stored = _stored(_StoredStereo, values, "stereo")
        values = {field.name: getattr(stored, field.name) for field in fields_of(_StoredStereo)}
        cameras = {name: _camera(values[name], name) for name in ("depth", "headset")}
        return StereoCalibration(**values | cameras | {"T_H_D": T_H_D})
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


@dataclass(frozen=True, slots=True)
class _StoredCamera:
    """The fields of a camera's JSON that are read."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    lens: Literal["pinhole", "fisheye"] = "pinhole"


@dataclass(frozen=True, slots=True)
class _StoredStereo:
    """The fields of a stereo calibration's JSON that are read, beside the pose."""

    covariance: Float64 | None
    depth: _StoredCamera
    headset: _StoredCamera
    rms_px: float
    residuals_px: Mapping[str, float]
    spread_rad: float
    spread_m: float
    dropped: tuple[str, ...]
    worst: WorstView
    verdict: CalibrationVerdict


def _stored(kind: type[Value], values: object, name: str) -> Value:
    """Return the fields of a kind in JSON values, without others; ValueError if one is wrong."""
    try:
        return read_settings(kind, known_settings(kind, values), name)
    except FileError as error:
        raise ValueError(str(error)) from error
    except TypeError as error:
        needed = ", ".join(field.name for field in fields_of(kind))  # type: ignore[arg-type]
        raise ValueError(f"{name} lacks one of the fields {needed}, or a camera in it") from error


def read_identity(path: Path) -> CameraIdentity:
    """Read the identity that `write_intrinsics` stored; empty if the file holds none.

    Raises
    ------
    FileError
        If the file cannot be read, or its identity is not three lines of text.
    """
    if not read_limited(path, MAX_BYTES).lstrip().startswith(b"{"):
        return CameraIdentity()
    values = read_json(path)
    if "handcal_camera" not in values:
        return CameraIdentity()  # another program's, whose "device" is something else
    try:
        return identity_from_json(values.get("device"), "device")
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


def write_intrinsics(
    path: Path,
    intrinsics: Camera,
    kind: CalibrationFormat,
    identity: CameraIdentity = CameraIdentity(),
) -> None:
    """Write a camera's intrinsics, and as JSON its identity, atomically.

    Raises
    ------
    ValueError
        If they are implausible.
    FileError
        If the file cannot be written.
    """
    check_intrinsics("camera", Intrinsics(**asdict(intrinsics)))
    if kind == "json":
        values = {"handcal_camera": JSON_VERSION, **camera_values(intrinsics)}
        write_json(path, values | ({"device": asdict(identity)} if any(astuple(identity)) else {}))
    elif kind == "ros":
        write_atomic(path, _ros_text(intrinsics, path.stem).encode())
    else:
        storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
        storage.write("image_width", intrinsics.width)
        storage.write("image_height", intrinsics.height)
        if isinstance(intrinsics, FisheyeIntrinsics):
            storage.write("distortion_model", _ROS_FISHEYE)
        storage.write("camera_matrix", camera_matrix_of(intrinsics))
        storage.write("distortion_coefficients", _coefficients(intrinsics)[:, None])
        write_atomic(path, storage.releaseAndGetString().encode())


def write_pose(path: Path, T_H_D: Float64, kind: CalibrationFormat) -> None:
    """Write T_H_D, atomically.

    Raises
    ------
    ValueError
        If it is not rigid, or the format is ROS: camera_info holds no pose.
    FileError
        If the file cannot be written.
    """
    require(is_rigid(T_H_D, _MAX_REACH_M), "T_H_D must be a rigid transform")
    if kind == "json":
        write_json(path, {"handcal_stereo": JSON_VERSION, "T_H_D": T_H_D.tolist()})
    elif kind == "opencv":
        storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
        storage.write("R", np.ascontiguousarray(T_H_D[:3, :3]))
        storage.write("T", np.ascontiguousarray(T_H_D[:3, 3:]))
        write_atomic(path, storage.releaseAndGetString().encode())
    else:
        raise ValueError("ROS's camera_info holds no pose between cameras: use opencv or json")


def camera_json(calibration: CameraCalibration) -> dict[str, Any]:
    """Return a camera's calibration as JSON values; `read_intrinsics` reads them."""
    return {
        "handcal_camera": JSON_VERSION,
        **camera_values(calibration.intrinsics),
        "covariance": _listed(calibration.covariance),
        "rms_px": calibration.rms_px,
        "arcmin_per_px": calibration.arcmin_per_px,
        "coverage": calibration.coverage.share,
        "board": calibration.board.words,
        "residuals_px": dict(calibration.residuals_px),
        "dropped": list(calibration.dropped),
        "worst": asdict(calibration.worst),
        "verdict": asdict(calibration.verdict),
    }


def stereo_json(calibration: StereoCalibration) -> dict[str, Any]:
    """Return a stereo calibration as JSON values; `read_pose` and `read_stereo` read them."""
    return {
        "handcal_stereo": JSON_VERSION,
        "T_H_D": calibration.T_H_D.tolist(),
        "covariance": _listed(calibration.covariance),
        "depth": camera_values(calibration.depth),
        "headset": camera_values(calibration.headset),
        "rms_px": calibration.rms_px,
        "residuals_px": dict(calibration.residuals_px),
        "board": calibration.board.words,
        "spread_rad": calibration.spread_rad,
        "spread_m": calibration.spread_m,
        "dropped": list(calibration.dropped),
        "worst": asdict(calibration.worst),
        "verdict": asdict(calibration.verdict),
    }


def camera_values(camera: Camera) -> dict[str, Any]:
    """Return a camera as JSON values; a fisheye has ``"lens": "fisheye"``."""
    is_fisheye = isinstance(camera, FisheyeIntrinsics)
    return asdict(camera) | ({"lens": "fisheye"} if is_fisheye else {})


def _listed(covariance: Float64 | None) -> list[list[float]] | None:
    return None if covariance is None else covariance.tolist()


def read_fields(path: Path) -> dict[str, Any]:
    """Return the fields of JSON, YAML or XML; FileError if it cannot be read."""
    return _read(path, dict)


def _read(path: Path, convert: Callable[[dict[str, Any]], Value]) -> Value:
    """Return the result of `convert` for the fields of JSON, YAML or XML."""
    data = read_limited(path, MAX_BYTES)
    try:
        if data.lstrip().startswith(b"{"):
            return convert(read_json(path))
        try:
            values = parse_tree(data)
        except ValueError as error:
            raise ValueError(f"{error}: {no_camera(data)}") from error
        return convert(values)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


def _matrix_in(path: Path) -> list[float] | None:
    """Return the numbers of a file that holds nothing else; None if it does."""
    words = re.split(rb"[\s,\[\]]+", read_limited(path, MAX_BYTES))
    try:
        return [float(word) for word in words if word]
    except ValueError:
        return None


def _camera_of_json(values: dict[str, Any]) -> Camera:
    _check_version(values, "handcal_camera")
    return _camera(_stored(_StoredCamera, values, "camera"), "camera")


def _camera(stored: _StoredCamera, name: str) -> Camera:
    values = asdict(stored)
    lens = values.pop("lens")
    check_intrinsics(name, Intrinsics(**values))
    if lens == "pinhole":
        return Intrinsics(**values)
    require(len(stored.distortion) == 4, f"{name}: a fisheye has 4 coefficients")
    return FisheyeIntrinsics(**values)


def _pose_of_json(values: dict[str, Any]) -> Float64:
    _check_version(values, "handcal_stereo")
    T = array_of(values.get("T_H_D"), "T_H_D")
    require(len(T) == 16, "T_H_D must have 4 rows of 4 numbers")
    return _pose(T.reshape(4, 4))


def _has_pose(values: dict[str, Any]) -> bool:
    return "handcal_stereo" in values or {"R", "T"} <= values.keys()


def _pose_of(values: dict[str, Any]) -> Float64:
    if "handcal_stereo" in values:
        return _pose_of_json(values)
    require(_has_pose(values), "it holds no pose: R and T are missing")
    R, T = (array_of(values[key], key) for key in ("R", "T"))
    require(len(R) in (3, 9) and len(T) == 3, "R must have 3×3 numbers, and T 3")
    return _pose(rigid(R.reshape(3, 3) if len(R) == 9 else cv2.Rodrigues(R)[0], T))


def _pose(T: Float64) -> Float64:
    is_affine = T.shape == (4, 4) and bool(np.isfinite(T).all())
    if is_affine and np.linalg.det(T[:3, :3]) < 0:
        raise ValueError(
            "the rotation is a mirrored one, as with the axes of Unity or OpenGL: use OpenCV's "
            "(x right, y down, z forward)"
        )
    far = float(np.linalg.norm(T[:3, 3])) if is_affine else 0.0
    require(
        far < _MAX_REACH_M,
        f"the translation is {far:.4g} m long, more than a headset's {_MAX_REACH_M:g} m: if it is "
        "in millimetres, divide it by 1000",
    )
    require(
        is_affine and is_rigid(T, _MAX_REACH_M),
        "the pose must be rigid: an orthonormal, right-handed rotation, and metres",
    )
    return T


def _check_version(values: dict[str, Any], key: str) -> None:
    require(values.get(key) == JSON_VERSION, f"{key} must be {JSON_VERSION}, the version known")


def _coefficients(intrinsics: Camera) -> Float64:
    """Return the coefficients, those of a pinhole padded to OpenCV's usual five."""
    given = intrinsics.distortion
    if isinstance(intrinsics, FisheyeIntrinsics):
        return np.array(given)
    return np.array([*given, *[0.0] * (5 - len(given))])


def _ros_text(intrinsics: Camera, name: str) -> str:
    """Return a file as ROS's camera_calibration_parsers write it."""
    coefficients = _coefficients(intrinsics)
    is_fisheye = isinstance(intrinsics, FisheyeIntrinsics)
    require(
        is_fisheye or len(coefficients) in (5, 8), "ROS's pinhole models have 5 or 8 coefficients"
    )
    model = _ROS_FISHEYE if is_fisheye else _ROS_MODELS[len(coefficients) == 8]
    K = camera_matrix_of(intrinsics)
    matrices = {
        "camera_matrix": K,
        "distortion_coefficients": coefficients[None],
        "rectification_matrix": np.eye(3),
        "projection_matrix": np.hstack([K, np.zeros((3, 1))]),
    }
    lines = [
        f"image_width: {intrinsics.width}",
        f"image_height: {intrinsics.height}",
        f"camera_name: {re.sub('[^A-Za-z0-9_]', '_', name) or 'camera'}",
        f"distortion_model: {model}",
    ]
    for key, matrix in matrices.items():
        rows, columns = matrix.shape
        data = ", ".join(repr(float(number)) for number in matrix.ravel())
        lines += [f"{key}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{data}]"]
    return "\n".join(lines) + "\n"


READ = (
    "handcal reads calibrations by OpenCV (YAML, XML, JSON), ROS (camera_info), Kalibr, RealSense, "
    "Open3D and Azure Kinect, and its own"
)
_PINHOLE = ("plumb bob", "rational polynomial", "radtan", "radial tangential", "brown conrady")
_FISHEYE = ("equidistant", "equi", "fisheye", "kannala brandt", "kannala brandt4", "kannalabrandt8")
# librealsense's "inverse" model distorts as OpenCV's does, but for p·r²·(f²−1), 0.01 px of a D455.
_SAME = {
    "": "pinhole",
    "none": "pinhole",
    "opencv": "pinhole",
    "perspective": "pinhole",
    "opencv fisheye": "fisheye",
    "inverse brown conrady": "brown conrady",
    "modified brown conrady": "brown conrady",
}
_NAMES = {
    "K": "cameramatrix|intrinsicmatrix|intrinsics?|cameraintrinsics?|mtx|matrix|k|m",
    "D": "distortioncoefficients?|distortioncoeffs?|distcoeffs?|distortion|dist|coeffs|d",
    "width": "(?:image|img|frame|sensor)?width|w",
    "height": "(?:image|img|frame|sensor)?height|h",
    "size": "(?:image|img|frame|sensor)?(?:size|resolution)",
    "model": "distortionmodel|lensmodel|lens|model|modeltype",
    "camera_model": "cameramodel|cameratype",
    "fx": "fx|flx",
    "fy": "fy|fly",
    "p1": "p1",
    "p2": "p2",
    "cx": "cx|ppx",
    "cy": "cy|ppy",
}
_GROUPS = "projectionparameters|distortionparameters"
_SIDES = "left|right|l|r|[0-9]"
_FIELD = re.compile(
    f"(?P<before>left|right)?(?:{'|'.join(f'(?P<{n}>{p})' for n, p in _NAMES.items())})"
    f"(?P<after>{_SIDES})?"
)
_KINDS = (
    (rb"PK\x03\x04|\x93NUMPY", "a NumPy archive"),
    (rb"MATLAB 5|(?s:%.{,4000}?\bfc *=)", "a MATLAB file"),
    (rb'Intrinsic of "', "the text of rs-enumerate-devices: use JSON with width to coeffs"),
    (rb"# oST", "ROS's ost.txt: use the ost.yaml beside it"),
    (rb"# Camera list|\d+ [A-Z_]+ \d+ \d+( [-+.\de]+){3,}", "COLMAP's cameras.txt"),
    (rb"\x89PNG|\xff\xd8|BM|II\*\x00|MM\x00\*|P[2-6]\s", "an image"),
    (rb"\x80[\x02-\x05]", "a pickle of Python"),
    (rb"<", "XML of another kind"),
    (rb"%YAML", "a FileStorage without a camera"),
    (rb"[{\[]", "JSON of another kind"),
)
_LOCATION = "CALIBRATION_CameraLocation"
_DEEPEST = 6


def cameras_in(values: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of the cameras that a file's values hold; "" if it gives one no name."""
    return tuple(_found(values))


def camera_in(
    values: Mapping[str, Any], name: str | None = None, size: tuple[int, int] | None = None
) -> Camera:
    """Return a camera of a file's values.

    Parameters
    ----------
    values : mapping
    name : str, optional
        Which camera (`cameras_in`); by default the first.
    size : (width, height), optional
        Of the images, in pixels, where the values do not say it.

    Raises
    ------
    ValueError
        If there is none of that name, its size is missing, its lens model is not known, or a value
        is implausible.
    """
    found = _found(values)
    chosen = next(iter(found)) if name is None else name
    require(chosen in found, f"there is no camera {name}, but {', '.join(found)}")
    fields, label = found[chosen], chosen or "camera"
    width, height = _size({"size": size, **fields}, label)
    if "azure" in fields:
        return _azure(fields["azure"], width, height, label)
    model = _model(fields)
    fx, fy, cx, cy = _pinhole(fields, label)
    given = array_of(fields.get("D", _numbered(fields, model)), f"{label}: distortion")
    return _checked_camera(
        label, model, Intrinsics(width, height, fx, fy, cx, cy, tuple(given.tolist()))
    )


def no_camera(data: bytes) -> str:
    """Return a message for a file without a camera: what it seems to be, and what is read."""
    kind = next((what for start, what in _KINDS if re.match(start, data.lstrip())), "")
    return f"it holds no camera{f' and seems to be {kind}' if kind else ''}; {READ}"


def _checked_camera(label: str, model: str, camera: Intrinsics) -> Camera:
    if model in _FISHEYE:
        given = camera.distortion
        require(
            len(given) in (0, 4) or (len(given) == 5 and given[4] == 0),
            f"{label}: a fisheye has 4 coefficients, not {len(given)}",
        )
        camera = Intrinsics(**asdict(camera) | {"distortion": (*given, 0.0, 0.0, 0.0, 0.0)[:4]})
    check_intrinsics(label, camera)
    return FisheyeIntrinsics(**asdict(camera)) if model in _FISHEYE else camera


def _found(values: Mapping[str, Any], levels: int = _DEEPEST) -> dict[str, dict[str, Any]]:
    """Return the fields of each camera in maps and lists, by the names of `_NAMES`.

    Fields beside a part are also the part's.
    """
    by_side: dict[str, dict[str, Any]] = {}
    parts: list[tuple[str, Mapping[str, Any]]] = []
    for key, value in _level(values):
        match = _FIELD.fullmatch(_simple(key))
        is_map = isinstance(value, dict) and "data" not in value
        if match and not is_map and value != "":
            name = next(one for one in _NAMES if match[one] is not None)
            side = match["before"] or match["after"] or ""
            is_one = _count(value) == 1
            if name == "K" and match["K"] == "k" and is_one:
                name, side = f"k{side}", ""  # a coefficient
            if name in ("p1", "p2", "width", "height") and not is_one:
                continue  # OpenCV's projection of a rectified camera, or a homography H
            by_side.setdefault(side, {})[name] = value
        elif key == "Intrinsics" and is_map and "ModelParameters" in value:
            by_side.setdefault("", {})["azure"] = value
        elif is_map:
            parts.append((key, value))
        elif isinstance(value, list):
            parts += [
                (str(one.get("Location", f"{key}[{number}]")).removeprefix(_LOCATION), one)
                for number, one in enumerate(value[:100])
                if isinstance(one, dict)
            ]
    shared = by_side.pop("", {})
    sides = {side: shared | own for side, own in by_side.items() if _is_camera(own)}
    if sides or _is_camera(shared):
        return sides or {"": shared}
    found = {}
    for key, part in parts if levels else ():
        for name, fields in _found(part, levels - 1).items():
            found[name or key] = shared | fields
    return found


def _level(values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield the fields, and in place of a map of intrinsics or of coefficients what it holds."""
    for key, value in values.items():
        is_group = re.fullmatch(f"{_NAMES['K']}|{_NAMES['D']}|{_GROUPS}", _simple(key))
        if is_group and isinstance(value, dict) and not {"data", "ModelParameters"} & value.keys():
            yield from value.items()
        else:
            yield key, value


def _simple(key: str) -> str:
    return re.sub(r"[^a-z0-9]", "", re.sub(r"^camera\d?\.(?!type)", "", key.lower()))


def _is_camera(fields: Mapping[str, Any]) -> bool:
    has_numbers = _count(fields.get("K")) >= 4
    return has_numbers or "azure" in fields or {"fx", "cx"} <= fields.keys()


def _size(fields: Mapping[str, Any], label: str) -> tuple[int, int]:
    sides = [fields.get("width"), fields.get("height")]
    if None in sides and fields["size"] is not None:
        sides = np.ravel(_data(fields["size"])).tolist()
    require(
        len(sides) == 2 and None not in sides,
        f"{label}: the file has OpenCV's camera matrix, but not the size of the images: add "
        "image_width and image_height, or convert it with 'handcal rig convert --size'",
    )
    numbers = array_of(sides, f"{label}: width and height")
    require(bool((numbers == np.rint(numbers)).all()), f"{label}: width and height must be whole")
    return int(numbers[0]), int(numbers[1])


def _pinhole(fields: Mapping[str, Any], label: str) -> tuple[float, ...]:
    if "K" not in fields:
        keys = ("fx", "fy", "cx", "cy")
        return tuple(
            array_of([fields.get(key) for key in keys], f"{label}: {', '.join(keys)}").tolist()
        )
    K = array_of(fields["K"], f"{label}: the camera matrix")
    if len(K) == 4:  # Kalibr
        return tuple(K.tolist())
    require(len(K) == 9, f"{label}: the camera matrix must have 3×3 numbers")
    K = K.reshape(3, 3)
    K = K.T if K[0, 2] == 0 == K[1, 2] and K[2, 0] != 0 else K  # Open3D lists columns
    require(K[0, 1] == 0, f"{label}: the camera matrix must have no skew")
    require(
        bool((np.tril(K, -1) == 0).all()) and K[2, 2] == 1,
        f"{label}: the camera matrix must be fx 0 cx, 0 fy cy, 0 0 1",
    )
    return float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])


def _model(fields: Mapping[str, Any]) -> str:
    """Return the lens model, "pinhole" if the file names none."""
    names = []
    for key in ("model", "camera_model"):
        name = str(fields.get(key, "")).lower().removeprefix("distortion.")
        name = name.removeprefix("rs2_distortion_")
        name = re.sub(r"[-_\s]+", " ", name).strip()
        names.append(_SAME.get(name, name))
    for name in names:
        require(
            name in (*_PINHOLE, *_FISHEYE, "pinhole"),
            f"the lens model {name} is not known; OpenCV's radial-tangential and equidistant are",
        )
    return next((name for name in names if name != "pinhole"), "pinhole")


def _azure(values: Mapping[str, Any], width: int, height: int, label: str) -> Camera:
    """Return a camera of the Azure Kinect, by `mode_specific_calibration.c` of its SDK.

    The parameters are cx, cy, fx, fy as shares of the sensor's size, k1 to k6, the centre of
    distortion and p2, p1; the image begins half a pixel before the middle of its first pixel.
    """
    require(
        str(values.get("ModelType", "")).endswith("BrownConrady"),
        f"{label}: the lens model {values.get('ModelType')} is not known; BrownConrady is",
    )
    numbers = array_of(values["ModelParameters"], f"{label}: ModelParameters")
    require(len(numbers) >= 14, f"{label}: ModelParameters must hold 14 numbers")
    cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, x, y, p2, p1 = numbers[:14].tolist()
    require(x == 0 == y, f"{label}: the centre of distortion must be the principal point")
    size = (width, height, fx * width, fy * height, cx * width - 0.5, cy * height - 0.5)
    return _checked_camera(label, "pinhole", Intrinsics(*size, (k1, k2, p1, p2, k3, k4, k5, k6)))


def _numbered(fields: Mapping[str, Any], model: str) -> list[Any]:
    """Return coefficients given one by one, in OpenCV's order; empty without any."""
    names: tuple[str, ...] = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    if model in _FISHEYE:
        names = ("k1", "k2", "k3", "k4")
    elif not fields.keys() & set(names[5:]):
        names = names[:5]
    return [fields.get(one, 0.0) for one in names] if fields.keys() & set(names) else []


def _data(value: Any) -> Any:
    """Return the numbers of a matrix, which OpenCV and ROS write as rows, cols and data."""
    return value.get("data") if isinstance(value, dict) else value


def _count(value: Any) -> int:
    return int(np.array(_data(value), dtype=object).size)


def array_of(value: Any, name: str) -> Float64:
    """Return finite numbers, also those of an OpenCV matrix, as a flat array; else ValueError."""
    flat = np.array(_data(value), dtype=object).ravel().tolist()
    if isinstance(value, dict):
        rows, columns = value.get("rows"), value.get("cols")
        require(
            isinstance(rows, int) and isinstance(columns, int) and rows * columns == len(flat),
            f"{name} must have rows times cols numbers",
        )
    is_number = (isinstance(one, int | float) and not isinstance(one, bool) for one in flat)
    require(all(is_number) and bool(np.isfinite(flat).all()), f"{name} must be finite numbers")
    return np.array(flat, np.float64)


TRACKED_VERSION = 1
_REACH_M = 10.0
_ADVICE = "choose the file of tracked poses of the board"


def read_tracked(path: Path) -> dict[str, Float64]:
    """Read ``T_H_B`` (4, 4) by the image's name.

    Raises
    ------
    FileError
        If the file cannot be read, is not of this format, or a pose is not rigid.
    """
    try:
        values = read_json(path)
    except FileError as error:
        raise FileError(error.what, _ADVICE) from error
    if values.get("handcal_tracked") != TRACKED_VERSION:
        raise FileError(
            f"{path} holds no tracked poses that are known: handcal_tracked must be "
            f"{TRACKED_VERSION}",
            _ADVICE,
        )
    poses = values.get("T_H_B")
    if not isinstance(poses, dict) or not 0 < len(poses) <= MAX_VIEWS:
        raise FileError(f"{path}: T_H_B must hold 1 to {MAX_VIEWS} poses by image name")
    return {name: _tracked_pose(path, name, rows) for name, rows in poses.items()}


def write_tracked(path: Path, poses: Mapping[str, Float64]) -> None:
    """Write ``T_H_B`` by the image's name."""
    listed = {name: T_H_B.tolist() for name, T_H_B in poses.items()}
    write_json(path, {"handcal_tracked": TRACKED_VERSION, "T_H_B": listed})


def _tracked_pose(path: Path, name: str, rows: object) -> Float64:
    try:
        T = np.asarray(rows, dtype=np.float64)
    except (TypeError, ValueError):
        T = np.empty(0)
    if T.shape != (4, 4) or not is_rigid(T, _REACH_M):
        raise FileError(
            f"{path}: T_H_B of {name} must be a rigid 4×4 transform within {_REACH_M:g} m"
        )
    return T
