"""A cube with an ArUco marker on every face: description, file, detection, tracking, net to print.

As a file it is JSON with ``handcal_cube`` 1 and the fields of `Cube`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import MappingProxyType

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from handcal.core.errors import FileError, HandcalError
from handcal.core.frozen import freeze
from handcal.core.geometry import camera_matrix, image_points, interpolate_pose, rigid, transform
from handcal.core.types import Float32, Float64, Intrinsics, UInt8
from handcal.io.files import read_json, write_json
from handcal.io.settings import read_settings
from handcal.rig.boards.board import DICTIONARIES
from handcal.rig.boards.finder import light_trouble, shades_at
from handcal.rig.boards.printing import Paper, marker_cells_m, write_page
from handcal.rig.lens.fit import rms

FACES = ("front", "right", "back", "left", "top", "bottom")
MIN_FACES = 2
# x to the right and y down along each face's print, in the cube's frame.
_AXES: dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "front": ((1, 0, 0), (0, 1, 0)),
    "right": ((0, 0, 1), (0, 1, 0)),
    "back": ((-1, 0, 0), (0, 1, 0)),
    "left": ((0, 0, -1), (0, 1, 0)),
    "top": ((1, 0, 0), (0, 0, -1)),
    "bottom": ((1, 0, 0), (0, 0, 1)),
}
# From the middle of a face to its corners and its marker's, as OpenCV orders them.
_CORNERS = 0.5 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
# In marker sides: corners farther than this from their predicted place belong to another cube.
_MISFIT_SIDES = 0.05


class CubeError(HandcalError):
    """The cube was not found in an image; the text says why."""


_ALONG = np.linspace(0.1, 0.9, 40)  # the parts of an edge next to the corners are blurred round
_STEP_PX, _MOST_PX = 0.25, 5.0
_CELLS = 0.4  # another edge is one cell away
_FAINT = 0.3  # slopes below this share of the steepest are noise


@dataclass(frozen=True, slots=True)
class Cube:
    """A cube with one marker in the middle of each face, upright in the printed net.

    Its frame has the origin in the cube's middle. Seen from the front, x points right, y down and z
    into the cube. The net is left, front, right and back side by side, top above the front, bottom
    below it.
    """

    side_m: float = 0.060
    marker_m: float = 0.045
    """Sides of a face and of a marker, as measured on the cube."""
    dictionary: str = "DICT_4X4_50"
    """OpenCV's name of the marker dictionary."""
    ids: tuple[int, int, int, int, int, int] = (0, 1, 2, 3, 4, 5)
    """Marker numbers on front, right, back, left, top and bottom."""

    def __post_init__(self) -> None:
        if not 0.01 <= self.side_m <= 1.0:
            raise ValueError("the side of the cube must lie between 10 mm and 1 m")
        if not 0.3 * self.side_m <= self.marker_m <= 0.9 * self.side_m:
            raise ValueError("the markers' side must be 0.3 to 0.9 of the cube's")
        if self.dictionary not in DICTIONARIES:
            raise ValueError(
                f"unknown dictionary {self.dictionary}; choose one such as DICT_4X4_50"
            )
        markers = len(self.marker_dictionary.bytesList)
        if len(set(self.ids)) != len(FACES) or not all(0 <= i < markers for i in self.ids):
            raise ValueError(
                f"the ids must be six different ones of the {markers} in {self.dictionary}"
            )

    @property
    def marker_dictionary(self) -> cv2.aruco.Dictionary:
        """The marker dictionary named by `dictionary`."""
        return cv2.aruco.getPredefinedDictionary(DICTIONARIES[self.dictionary])


def face_pose(cube: Cube, marker: int) -> Float64:
    """Return ``T_cube_face`` (4, 4): the face's middle, x right and y down along its print."""
    x, y = np.array(_AXES[FACES[cube.ids.index(marker)]], dtype=np.float64)
    inwards = np.cross(x, y)
    return rigid(np.column_stack([x, y, inwards]), -0.5 * cube.side_m * inwards)


def marker_corners_m(cube: Cube, markers: Iterable[int]) -> Float64:
    """Return the corners of markers, four each as OpenCV orders them, in the cube's frame."""
    flat = cube.marker_m * _CORNERS
    return np.concatenate([transform(face_pose(cube, marker), flat) for marker in markers])


def find_cube(image: UInt8, cube: Cube) -> Mapping[int, Float64]:
    """Find the cube's markers in an image.

    Parameters
    ----------
    image : (H, W) uint8
        Grey, not mirrored.
    cube : Cube

    Returns
    -------
    mapping of int to (4, 2) float64
        The corners of each marker seen, in pixels, by its number, in order.

    Raises
    ------
    CubeError
        If fewer than `MIN_FACES` are seen, or one twice.
    """
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    found, numbers, _ = cv2.aruco.ArucoDetector(cube.marker_dictionary, parameters).detectMarkers(
        image
    )
    ids = [] if numbers is None else [int(number) for number in numbers.ravel()]
    seen = sorted(set(ids) & set(cube.ids))
    if len(seen) < MIN_FACES:
        raise CubeError(_explain_missing(image, cube, ids))
    twice = [marker for marker in seen if ids.count(marker) > 1]
    if twice:
        raise CubeError(f"marker {twice[0]} is seen twice: remove other cubes and prints")
    cells = cube.marker_dictionary.markerSize + 2
    rough = {marker: found[ids.index(marker)].reshape(4, 2).astype(np.float64) for marker in seen}
    return MappingProxyType(
        {marker: refine_corners(image, px, cells) for marker, px in rough.items()}
    )


def cube_pose(corners_px: Mapping[int, Float64], cube: Cube, camera: Intrinsics) -> Float64:
    """Return ``T_camera_cube`` (4, 4), by PnP from the corners of at least two markers.

    Raises
    ------
    CubeError
        If the corners do not lie as on this cube.
    """
    points_m, pixels = marker_corners_m(cube, corners_px), np.concatenate([*corners_px.values()])
    K, distortion = camera_matrix(camera), np.array(camera.distortion)
    _, rotation, translation = cv2.solvePnP(
        points_m, pixels, K, distortion, flags=cv2.SOLVEPNP_SQPNP
    )
    rotation, translation = cv2.solvePnPRefineLM(
        points_m, pixels, K, distortion, rotation, translation
    )
    T = rigid(rotation.ravel(), translation.ravel())
    side_px = np.linalg.norm(np.diff(pixels.reshape(-1, 4, 2), axis=1), axis=2).max()
    off_px = rms(image_points(transform(T, points_m), camera) - pixels)
    if not off_px < _MISFIT_SIDES * side_px:
        raise CubeError(
            f"the corners are {off_px:.1f} px from their places on this cube: check its sides and "
            "which marker is on which face"
        )
    return T


def _explain_missing(image: UInt8, cube: Cube, ids: list[int]) -> str:
    light = light_trouble(image)
    if light:
        return light
    seen = sorted(set(ids) & set(cube.ids))
    if seen:
        return (
            f"only one face (marker {seen[0]}) is seen: turn the cube until two or three of its "
            "faces show, sharp and evenly lit"
        )
    if ids:
        return f"marker {ids[0]} is seen, which is not on this cube: show the cube described"
    return "no marker of the cube is seen: it must be in the image, sharp and evenly lit"


def refine_corners(gray: UInt8, corners_px: Float64, cells: int) -> Float64:
    """Return a marker's corners, (4, 2), refined by fitting a line to each of its edges.

    OpenCV's refinement pulls the corners of a marker inwards where the lens blurs: 0.3 px on
    rendered images, 0.05 px with this one. The marker then seems farther away than it is.

    Parameters
    ----------
    gray : (H, W) uint8
    corners_px : (4, 2) float64
        In order around the marker, accurate to about a pixel.
    cells : int
        Number of cells along each side of the marker, including its border.
    """
    exact = gray.astype(np.float32)  # interpolated grey values are not rounded
    edges = [_line(exact, np.roll(corners_px, -i, axis=0), cells) for i in range(4)]
    meeting = np.cross(np.roll(edges, 1, axis=0), edges)
    return np.asarray(meeting[:, :2] / meeting[:, 2:])


def _line(gray: Float32, corners_px: Float64, cells: int) -> Float64:
    """Return the edge between the first two corners as a line (a, b, c): a x + b y + c = 0."""
    start_px = corners_px[0]
    along = corners_px[1] - start_px
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    height_px = np.abs((corners_px[2:] - start_px) @ across).min()
    reach_px = min(_MOST_PX, _CELLS * height_px / cells)
    offsets_px = np.arange(-reach_px, reach_px + _STEP_PX, _STEP_PX)
    on_edge = start_px + _ALONG[:, None] * along
    places = on_edge[:, None] + offsets_px[:, None] * across
    slopes = np.abs(np.diff(shades_at(gray, places), axis=1))
    slopes[slopes <= _FAINT * slopes.max(axis=1, keepdims=True)] = 0.0
    middles_px = offsets_px[:-1] + 0.5 * _STEP_PX
    steepest_px = slopes @ middles_px / np.maximum(slopes.sum(axis=1), 1e-9)
    points = on_edge + steepest_px[:, None] * across
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle)[2][1]
    return np.array([*normal, -normal @ middle])


CUBE_VERSION = 1


def read_cube(path: Path) -> Cube:
    """Read a cube's description.

    Raises
    ------
    FileError
        If the file cannot be read, is not a cube description, or a field is unknown or wrong.
    """
    values = read_json(path)
    if values.pop("handcal_cube", None) != CUBE_VERSION:
        raise FileError(f"{path}: handcal_cube must be {CUBE_VERSION}, the version known")
    return read_settings(Cube, values, str(path))


def write_cube(path: Path, cube: Cube) -> None:
    """Write a cube's description, atomically; FileError if it cannot be written."""
    write_json(path, {"handcal_cube": CUBE_VERSION, **asdict(cube)})


# Column and row of each face in the net.
_PLACES = {
    "left": (0, 1),
    "front": (1, 1),
    "right": (2, 1),
    "back": (3, 1),
    "top": (1, 0),
    "bottom": (1, 2),
}
_LINE_M, _MARK_SHARE = 0.0002, 0.15
_TAB_M = 0.008


def write_cube_pdf(path: Path, cube: Cube, paper: Paper = "a4") -> None:
    """Write the cube's net as a PDF page at its true size, with marks for cutting and folding.

    Raises
    ------
    ValueError
        If the net does not fit on the paper.
    FileError
        If `path` does not end in ``.pdf``, or cannot be written.
    """
    size_m = np.array([4.0, 3.0]) * cube.side_m + [_TAB_M, 0.0]
    caption = (
        f"cube {1e3 * cube.side_m:g} mm, marker {1e3 * cube.marker_m:g} mm, {cube.dictionary}, "
        f"{', '.join(f'{face} {marker}' for face, marker in zip(FACES, cube.ids, strict=True))}"
    )
    write_page(path, size_m, net_rectangles_m(cube), caption, paper)


def net_rectangles_m(cube: Cube) -> Float64:
    """Return the black rectangles of the net: (N, 4) left, top, right, bottom."""
    margin_m = 0.5 * (cube.side_m - cube.marker_m)
    parts = []
    for face, marker in zip(FACES, cube.ids, strict=True):
        corner_m = cube.side_m * np.array(_PLACES[face])
        parts.append(_outline(corner_m, corner_m + cube.side_m))
        parts.append(
            marker_cells_m(cube.marker_dictionary, marker, corner_m + margin_m, cube.marker_m)
        )
    parts += [_outline(*corners) for corners in _tabs(cube.side_m)]
    return np.vstack(parts)


def _tabs(side_m: float) -> list[Float64]:
    """Return the tabs to glue, (2, 2) each: above, below and beside the middle row."""
    tabs = [
        [[column * side_m, y], [(column + 1) * side_m, y + _TAB_M]]
        for column in (0, 2, 3)
        for y in (side_m - _TAB_M, 2 * side_m)
    ]
    tabs.append([[4 * side_m, side_m], [4 * side_m + _TAB_M, 2 * side_m]])
    return [np.array(tab) for tab in tabs]


def _outline(first_m: Float64, last_m: Float64) -> Float64:
    """Return the ends of four thin lines just within a rectangle.

    Complete lines around a marker would form a square that OpenCV may mistake for the marker.
    """
    (left, top), (right, bottom) = first_m, last_m
    across, down = (_MARK_SHARE * (last_m - first_m)).tolist()
    return np.array(
        [
            [x, y, x + length, y + height]
            for length, height in ((across, _LINE_M), (_LINE_M, down))
            for x in (left, right - length)
            for y in (top, bottom - height)
        ]
    )


_SMOOTHING_S = 0.3
"""Time constant while the cube moves slowly, and at most that many seconds at rest."""
_JUMP_M, _JUMP_RAD = 0.01, 0.07
"""A measured pose this far from the filtered one starts the filter again."""
_REST_NS = 600_000_000
"""The cube is at rest if its measured poses stayed together for this time."""
_REST_M, _REST_RAD = 0.004, 0.03
"""Largest distance of a measured pose from the filtered one at rest."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackedCube:
    """The filtered pose of the cube at the time of one frame."""

    t_ns: int
    """On the camera's clock, whose intervals do not change while its latency is estimated."""
    T_W_T: Float64
    """(4, 4); from the cube's frame to the world."""
    is_at_rest: bool
    frames: int
    """Number of frames since the filter started."""

    def __post_init__(self) -> None:
        freeze(self, "T_W_T", np.float64, 4, 4)


class CubeFilter:
    """An exponential filter of poses that starts again when the cube has been moved.

    The n-th pose after a start has the weight 1/n, or that of the time constant if it is larger: a
    mean first, which then forgets.
    """

    def __init__(self) -> None:
        self._newest: TrackedCube | None = None
        self._recent: deque[tuple[int, Float64]] = deque()

    def take(self, T_W_T: Float64, t_ns: int) -> TrackedCube:
        """Return the filtered pose after a measured one, (4, 4); the time is the camera's."""
        before = self._newest
        if (
            before is None
            or t_ns < before.t_ns  # the camera has started again
            or not _near(T_W_T, before.T_W_T, _JUMP_M, _JUMP_RAD)
        ):
            self._recent.clear()
            filtered = TrackedCube(t_ns, T_W_T, False, 1)
        else:
            passed_s = 1e-9 * (t_ns - before.t_ns)
            weight = max(1.0 / (before.frames + 1), 1.0 - float(np.exp(-passed_s / _SMOOTHING_S)))
            pose = interpolate_pose(before.T_W_T, T_W_T, min(weight, 1.0))
            filtered = TrackedCube(t_ns, pose, False, before.frames + 1)
        self._recent.append((t_ns, T_W_T))
        while len(self._recent) > 1 and self._recent[1][0] <= t_ns - _REST_NS:
            self._recent.popleft()
        is_at_rest = t_ns - self._recent[0][0] >= _REST_NS and all(
            _near(T, filtered.T_W_T, _REST_M, _REST_RAD) for _, T in self._recent
        )
        self._newest = replace(filtered, is_at_rest=is_at_rest)
        return self._newest


def cube_corners_m(cube: Cube) -> Float64:
    """Return the cube's vertices, (8, 3) in its frame: the front face, then the back behind it."""
    around_m, inwards_m = cube.side_m * _CORNERS, np.array([0.0, 0.0, 0.5 * cube.side_m])
    return np.concatenate([around_m - inwards_m, around_m + inwards_m])


def facing_corners_m(cube: Cube, T_E_T: Float64) -> Float64:
    """Return the vertices of the face that faces the origin of E most, (4, 3) in the cube's frame.

    In order around the face, from the upper left of its print.
    """

    def facing(marker: int) -> float:
        T_E_face = T_E_T @ face_pose(cube, marker)
        return float(T_E_face[:3, 2] @ T_E_face[:3, 3] / np.linalg.norm(T_E_face[:3, 3]))

    return transform(face_pose(cube, max(cube.ids, key=facing)), cube.side_m * _CORNERS)


def _near(a: Float64, b: Float64, apart_m: float, apart_rad: float) -> bool:
    turned_rad = Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).magnitude()
    return bool(np.linalg.norm(a[:3, 3] - b[:3, 3]) <= apart_m and turned_rad <= apart_rad)
