"""Intrinsics and the stereo pose as files: OpenCV's FileStorage, ROS camera_info, handcal's JSON.

Lengths are in metres. FileStorage uses the names of OpenCV's own calibration samples
(``camera_matrix``, ``distortion_coefficients``; ``R`` and ``T`` from the depth camera to the
headset's). ROS's camera_info holds one camera and no pose.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import asdict, astuple
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypeVar, cast, get_args

import cv2
import numpy as np

from handcal.core.errors import FileError, HandcalError
from handcal.core.geometry import camera_matrix, is_rigid, rigid
from handcal.core.types import CameraIdentity, Float64, Intrinsics
from handcal.io.files import read_json, read_limited, write_atomic, write_json
from handcal.rig.boards.views import WorstView
from handcal.rig.check import check_intrinsics, identity_from_json, require
from handcal.rig.lens.camera import CameraCalibration
from handcal.rig.lens.lens import Camera, FisheyeIntrinsics, as_pinhole
from handcal.rig.lens.stereo import StereoCalibration
from handcal.rig.storage import MAX_STORAGE_BYTES, Fields, parse_storage
from handcal.rig.verdict import CalibrationVerdict, CalibrationVerdictName

CalibrationFormat: TypeAlias = Literal["opencv", "ros", "json"]
CALIBRATION_FORMATS: tuple[CalibrationFormat, ...] = ("opencv", "ros", "json")
JSON_VERSION = 1
MAX_BYTES = 2**20
_MAX_REACH_M = 10.0
_ROS_MODELS = ("plumb_bob", "rational_polynomial")

Value = TypeVar("Value")


def read_intrinsics(path: Path) -> Intrinsics:
    """Read a camera's intrinsics in any of `CALIBRATION_FORMATS`, recognised by the file's content.

    Raises
    ------
    FileError
        If the file cannot be read or has another format, a field is missing or implausible, or the
        lens model is not OpenCV's pinhole.
    """
    try:
        return as_pinhole(read_camera(path), "the camera")
    except FileError:
        raise
    except HandcalError as error:
        raise FileError(f"{path}: {error}") from error


def read_camera(path: Path) -> Camera:
    """Read a camera's intrinsics, like `read_intrinsics`, or those of a fisheye from JSON.

    Raises
    ------
    FileError
        As `read_intrinsics`.
    """
    return _read(path, _camera_of_json, _intrinsics_of_yaml)


def read_pose(path: Path) -> Float64:
    """Read a rigid transform: FileStorage, the JSON of a stereo pose, or 4 rows of 4 numbers.

    Raises
    ------
    FileError
        If the file cannot be read, or holds no rigid transform.
    """
    try:
        words = re.split(rb"[\s,\[\]]+", read_limited(path, MAX_BYTES))
        numbers = [float(word) for word in words if word]
    except ValueError:
        return _read(path, _pose_of_json, _pose_of_yaml)
    try:
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
    try:
        return identity_from_json(read_json(path).get("device"), "device")
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


def write_intrinsics(
    path: Path,
    intrinsics: Intrinsics,
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
    check_intrinsics("camera", intrinsics)
    if kind == "json":
        values = {"handcal_camera": JSON_VERSION, **asdict(intrinsics)}
        write_json(path, values | ({"device": asdict(identity)} if any(astuple(identity)) else {}))
    elif kind == "ros":
        write_atomic(path, _ros_text(intrinsics, path.stem).encode())
    else:
        storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
        storage.write("image_width", intrinsics.width)
        storage.write("image_height", intrinsics.height)
        storage.write("camera_matrix", camera_matrix(intrinsics))
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


def _read(
    path: Path,
    of_json: Callable[[dict[str, Any]], Value],
    of_yaml: Callable[[Fields], Value],
) -> Value:
    data = read_limited(path, MAX_BYTES)
    try:
        if data.lstrip().startswith(b"{"):
            return of_json(read_json(path))
        require(len(data) <= MAX_STORAGE_BYTES, f"a YAML file may hold {MAX_STORAGE_BYTES:,} bytes")
        return parse_storage(_as_storage(data), of_yaml)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error


def _as_storage(data: bytes) -> bytes:
    """Return YAML from other programs in the dialect that OpenCV reads."""
    if data.startswith(b"%YAML"):
        return data
    # PyYAML does not indent a list below its key; OpenCV requires it.
    return b"%YAML 1.2\n---\n" + re.sub(rb"(?m)^( *)- ", rb"\1  - ", data)


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


def _pose(T: Float64) -> Float64:
    require(
        T.shape == (4, 4) and is_rigid(T, _MAX_REACH_M),
        "the pose must be rigid: an orthonormal, right-handed rotation, and metres below "
        f"{_MAX_REACH_M:g}",
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


def _intrinsics_of_yaml(root: Fields) -> Camera:
    if root.has("distortion_model"):
        model = root.text("distortion_model")
        require(
            model in _ROS_MODELS,
            f"the lens model {model} is not known; {' and '.join(_ROS_MODELS)} are",
        )
    K = _yaml_matrix(root, "camera_matrix", (3, 3))
    require(K[0, 1] == 0, "camera_matrix must have no skew")
    coefficients = _yaml_matrix(root, "distortion_coefficients", None).ravel()
    intrinsics = Intrinsics(
        root.integer("image_width"),
        root.integer("image_height"),
        fx=float(K[0, 0]),
        fy=float(K[1, 1]),
        cx=float(K[0, 2]),
        cy=float(K[1, 2]),
        distortion=tuple(coefficients.tolist()),
    )
    check_intrinsics("camera", intrinsics)
    return intrinsics


def _pose_of_yaml(root: Fields) -> Float64:
    return _pose(rigid(_yaml_matrix(root, "R", (3, 3)), _yaml_matrix(root, "T", (3, 1))[:, 0]))


def _yaml_matrix(root: Fields, name: str, shape: tuple[int, int] | None) -> Float64:
    """Return a matrix written as rows, cols and data, which both OpenCV and ROS do."""
    matrix = root.section(name)
    rows, columns = matrix.integer("rows"), matrix.integer("cols")
    data = matrix.numbers("data")
    require(
        rows * columns == len(data) and shape in (None, (rows, columns)),
        f"{name} must be a matrix" + (f" of {shape[0]}×{shape[1]}" if shape else ""),
    )
    return np.array(data, dtype=np.float64).reshape(rows, columns)


def _coefficients(intrinsics: Intrinsics) -> Float64:
    """Return the coefficients, padded to OpenCV's usual five."""
    given = intrinsics.distortion
    return np.array([*given, *[0.0] * (5 - len(given))])


def _ros_text(intrinsics: Intrinsics, name: str) -> str:
    """Return a file as ROS's camera_calibration_parsers write it."""
    coefficients = _coefficients(intrinsics)
    require(len(coefficients) in (5, 8), "ROS's models have 5 or 8 coefficients")
    K = camera_matrix(intrinsics)
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
        f"distortion_model: {_ROS_MODELS[len(coefficients) == 8]}",
    ]
    for key, matrix in matrices.items():
        rows, columns = matrix.shape
        data = ", ".join(repr(float(number)) for number in matrix.ravel())
        lines += [f"{key}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{data}]"]
    return "\n".join(lines) + "\n"
