"""Cameras in the calibration files of other programs, recognised by their fields.

The names of fields vary: those of OpenCV's samples (``camera_matrix``, ``Camera_Matrix``,
``cameraMatrix``, ``M1``, ``K``), ROS's camera_info as a file and as echoed, Kalibr's and EuRoC's,
librealsense's (``ppx``, ``coeffs``), Open3D's (``intrinsic_matrix``, by columns), ORB-SLAM's
(``Camera.fx``), and Azure Kinect's ``ModelParameters``, which are shares of the sensor's size.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from handcal.core.types import Float64, Intrinsics
from handcal.rig.check import check_intrinsics, require
from handcal.rig.lens.lens import Camera, FisheyeIntrinsics

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
    return _camera(label, model, Intrinsics(width, height, fx, fy, cx, cy, tuple(given.tolist())))


def no_camera(data: bytes) -> str:
    """Return a message for a file without a camera: what it seems to be, and what is read."""
    kind = next((what for start, what in _KINDS if re.match(start, data.lstrip())), "")
    return f"it holds no camera{f' and seems to be {kind}' if kind else ''}; {READ}"


def _camera(label: str, model: str, camera: Intrinsics) -> Camera:
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
    return _camera(label, "pinhole", Intrinsics(*size, (k1, k2, p1, p2, k3, k4, k5, k6)))


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
