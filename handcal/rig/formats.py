"""Intrinsics and the stereo pose as files: OpenCV's FileStorage, ROS camera_info, handcal's JSON.

Lengths are in metres. FileStorage uses the names of OpenCV's own calibration samples
(``camera_matrix``, ``distortion_coefficients``; ``R`` and ``T`` from the depth camera to the
headset's). ROS's camera_info holds one camera and no pose. Intrinsics by other programs are read,
too (`handcal.rig.foreign`).
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from dataclasses import asdict, astuple
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypeVar, cast, get_args

import cv2
import numpy as np

from handcal.core.errors import FileError, HandcalError
from handcal.core.geometry import is_rigid, rigid
from handcal.core.types import CameraIdentity, Float64, Intrinsics
from handcal.io.files import read_json, read_limited, write_atomic, write_json
from handcal.rig.boards.views import WorstView
from handcal.rig.check import check_intrinsics, identity_from_json, require
from handcal.rig.foreign import array_of, camera_in, cameras_in, no_camera
from handcal.rig.lens.camera import CameraCalibration
from handcal.rig.lens.lens import Camera, FisheyeIntrinsics, as_pinhole, camera_matrix_of
from handcal.rig.lens.stereo import StereoCalibration
from handcal.rig.storage import parse_tree
from handcal.rig.verdict import CalibrationVerdict, CalibrationVerdictName

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
        covariance = values.get("covariance")
        worst, verdict = (_object(values, key) for key in ("worst", "verdict"))
        residuals_px = _object(values, "residuals_px")
        name = verdict.get("name")
        require(name in get_args(CalibrationVerdictName), "verdict.name must be a known one")
        return StereoCalibration(
            T_H_D=T_H_D,
            covariance=None if covariance is None else _numbers(covariance, "covariance", 2),
            depth=_camera(_object(values, "depth"), "depth"),
            headset=_camera(_object(values, "headset"), "headset"),
            rms_px=_number(values, "rms_px"),
            residuals_px={key: _number(residuals_px, key) for key in residuals_px},
            spread_rad=_number(values, "spread_rad"),
            spread_m=_number(values, "spread_m"),
            dropped=tuple(map(str, _list(values, "dropped"))),
            worst=WorstView(
                str(worst.get("name")), _number(worst, "rms_px"), str(worst.get("why"))
            ),
            verdict=CalibrationVerdict(
                cast(CalibrationVerdictName, name), str(verdict.get("reason"))
            ),
        )
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


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
    return _camera(values, "camera")


def _camera(values: dict[str, Any], name: str) -> Camera:
    width, height, fx, fy, cx, cy = (
        _number(values, key) for key in ("width", "height", "fx", "fy", "cx", "cy")
    )
    require(width == int(width) and height == int(height), f"{name}: the size must be whole")
    distortion = _numbers(values.get("distortion", []), "distortion", 1)
    intrinsics = Intrinsics(int(width), int(height), fx, fy, cx, cy, tuple(distortion.tolist()))
    check_intrinsics(name, intrinsics)
    lens = values.get("lens", "pinhole")
    require(lens in ("pinhole", "fisheye"), f"{name}: the lens {lens} is not known")
    if lens == "pinhole":
        return intrinsics
    require(len(distortion) == 4, f"{name}: a fisheye has 4 coefficients")
    return FisheyeIntrinsics(**asdict(intrinsics))


def _pose_of_json(values: dict[str, Any]) -> Float64:
    _check_version(values, "handcal_stereo")
    return _pose(_numbers(values.get("T_H_D"), "T_H_D", 2))


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


def _object(values: dict[str, Any], key: str) -> dict[str, Any]:
    value = values.get(key)
    if not isinstance(value, dict):
        raise ValueError(f"{key} must be an object")
    return value


def _list(values: dict[str, Any], key: str) -> list[Any]:
    value = values.get(key)
    if not isinstance(value, list):
        raise ValueError(f"{key} must be a list")
    return value


def _number(values: dict[str, Any], key: str) -> float:
    return float(_numbers(values.get(key), key, 0))


def _numbers(values: object, name: str, dimensions: int) -> Float64:
    """Return nested lists of finite JSON numbers as an array; their depth is `dimensions`."""
    try:
        array = np.array(values)
    except ValueError:  # lists of different lengths
        array = np.array(None)
    is_empty = array.shape == (0,) and dimensions == 1
    require(
        array.ndim == dimensions
        and (is_empty or (array.dtype.kind in "if" and bool(np.isfinite(array).all()))),
        f"{name} must hold finite numbers" if dimensions else f"{name} must be a finite number",
    )
    return array.astype(np.float64)


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
