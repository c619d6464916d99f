"""Values that packages pass on: frozen, with read-only arrays and units and frames in their names.

Frames are named as in the paper (Hu, Rodriguez y Baena, Cutolo, ISMAR 2021): ``W`` world,
``H`` headset camera rig, ``D`` depth camera, ``C0`` viewpoint of the offline calibration,
``C1`` the wearer's eye, ``E`` ideal on-axis eye-display camera at C0, ``V`` the headset's
rendering camera. ``T_dst_src`` maps column vectors from ``src`` to ``dst``. Axes are OpenCV's:
x right, y down, z forward. The last part is the rig: the offline calibration of a headset, as the
rig file holds it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from handcal.core.frozen import brief, freeze, html_table, readonly

Float64: TypeAlias = NDArray[np.float64]
Float32: TypeAlias = NDArray[np.float32]
Bool: TypeAlias = NDArray[np.bool_]
UInt8: TypeAlias = NDArray[np.uint8]
UInt16: TypeAlias = NDArray[np.uint16]

Eye: TypeAlias = Literal["left", "right"]
EYES: tuple[Eye, Eye] = ("left", "right")
EyePlan: TypeAlias = Literal["both", "each", "left", "right"]
PlanName: TypeAlias = Literal["paper", "recommended"]
PLAN_WORDS: Mapping[EyePlan | PlanName | None, str] = MappingProxyType(
    {
        "recommended": "Recommended",
        "paper": "As in the paper",
        "both": "As in the paper, both eyes at once",
        "each": "As in the paper, one eye after the other",
        "left": "As in the paper, the left eye",
        "right": "As in the paper, the right eye",
        None: "not recorded",
    }
)
"""A session's plan in the words that people read."""
Method: TypeAlias = Literal["paper", "linear", "consistent", "icp", "icp-open3d"]
METHODS: tuple[Method, ...] = ("paper", "linear", "consistent", "icp", "icp-open3d")
"""The last needs the extra ``3d``; studies leave it out unless it is requested."""
VerdictName: TypeAlias = Literal["accept", "repeat", "keep", "implausible", "contradicted"]

LOOK_AROUND = "Look slowly to the left and to the right, and back."
"""Prompt for the wearer while the camera's delay is not known."""

EYE_DISTANCES_M = 0.045, 0.085
"""Eye distances of adults, with room to spare (Gordon et al. 2014, ANSUR II: 52 to 78 mm)."""


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A pinhole camera in pixels, with OpenCV's distortion.

    Attributes
    ----------
    width, height
        Size of the image, px.
    fx, fy
        Focal lengths, px.
    cx, cy
        Principal point, px; the centres of pixels are at whole numbers.
    distortion
        OpenCV's coefficients; empty if there is none.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class CameraIdentity:
    """The depth camera that gave the frames, as its driver reports it; empty texts if unknown."""

    model: str = ""
    serial_number: str = ""
    firmware: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class HeadsetView:
    """One eye's rendering camera V, as the headset's runtime reports it."""

    T_V_H: Float64
    """(4, 4); from the headset rig to V."""
    tangents: Float64
    """(4,); left, right, up and down edge of the field of view: x/z or y/z in V."""
    width_px: int
    height_px: int

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "T_V_H", np.float64, 4, 4)
        freeze(self, "tangents", np.float64, 4)


@dataclass(frozen=True, slots=True, eq=False)
class HeadsetIdentity:
    """A headset, as it introduces itself on the link; empty texts and None if unknown."""

    device_id: str
    """Identity of this one device, in hexadecimal; it never changes."""
    name: str = ""
    """Name given by its owner, only for display."""
    runtime: str = ""
    app: str = ""
    """Name and version of the headset's runtime, and of the app that speaks the link."""
    protocol: int = 0
    """Version of the link's protocol."""
    views: Mapping[Eye, HeadsetView] = field(default_factory=dict)
    eye_distance_m: float | None = None
    """The wearer's eye distance as the headset measures it."""
    moves_views: bool = False
    """Its runtime moves V with the wearer's eyes; only a rig file says so."""

    __repr__ = brief

    def __post_init__(self) -> None:
        object.__setattr__(self, "views", MappingProxyType(dict(self.views)))


@dataclass(frozen=True, slots=True)
class EyeDistance:
    """A measured distance between the wearer's pupils.

    Attributes
    ----------
    value_m
        Distance between the pupils.
    sigma_m
        Standard deviation: 1 mm for a ruler or a pupillometer.
    source
        ``typed`` by the operator, or measured by the ``headset``.

    Raises
    ------
    ValueError
        If the value is not in `EYE_DISTANCES_M`, or the standard deviation is not from 0 to 20 mm.
    """

    value_m: float
    sigma_m: float = 0.001
    source: Literal["typed", "headset"] = "typed"

    def __post_init__(self) -> None:
        low_m, high_m = EYE_DISTANCES_M
        if not low_m <= self.value_m <= high_m:
            raise ValueError(
                f"nobody has an eye distance of {1e3 * self.value_m:.1f} mm; "
                f"enter {1e3 * low_m:.0f} to {1e3 * high_m:.0f} mm"
            )
        if not 0.0 < self.sigma_m <= 0.02:
            raise ValueError("the eye distance's standard deviation must be from 0 to 20 mm")

    def __str__(self) -> str:
        return f"{1e3 * self.value_m:.1f} ± {1e3 * self.sigma_m:.1f} mm"


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One depth image and, if the camera has one, its colour image.

    Attributes
    ----------
    index
        Running number from the camera; a gap means dropped frames.
    t_camera_ns
        Exposure time on the camera's clock.
    t_host_ns
        Time of arrival on the host's monotonic clock.
    depth
        (H, W); 0 where there is no measurement.
    depth_scale_m
        Metres per unit of `depth`.
    depth_intrinsics
        Of the depth camera.
    color
        (h, w, 3); RGB.
    color_intrinsics
        Of the colour camera; None without colour.
    T_C_D
        (4, 4); from the depth camera to the colour camera; identity for depth aligned to colour.
    T_W_D
        (4, 4); the camera's pose at the exposure, if it is the headset's own and reports it; None:
        follows from the headset's pose, which the app sends over the link.
    """

    index: int
    t_camera_ns: int
    t_host_ns: int
    depth: UInt16
    depth_scale_m: float
    depth_intrinsics: Intrinsics
    color: UInt8 | None = None
    color_intrinsics: Intrinsics | None = None
    T_C_D: Float64 = field(default_factory=lambda: np.eye(4))
    T_W_D: Float64 | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        intrinsics = self.depth_intrinsics
        freeze(self, "depth", np.uint16, intrinsics.height, intrinsics.width)
        freeze(self, "T_C_D", np.float64, 4, 4)
        freeze(self, "T_W_D", np.float64, 4, 4)
        if (self.color is None) != (self.color_intrinsics is None):
            raise ValueError("Frame: color and color_intrinsics go together")
        if self.color_intrinsics is not None:
            size = self.color_intrinsics.height, self.color_intrinsics.width
            freeze(self, "color", np.uint8, *size, 3)


UNKNOWN_OUTLINE_PX = 2.0
"""Standard deviation of an outline that nothing corrected: stereo shows hands 1 to 3 px too wide on
every side."""


@dataclass(frozen=True, slots=True, eq=False)
class HandCloud:
    """The segmented hand of one frame.

    Attributes
    ----------
    t_camera_ns
        Exposure time of the frame, on the camera's clock.
    t_host_ns
        Time of the frame's arrival, on the host's monotonic clock.
    points_m
        (N, 3); visible surface, frame D.
    is_cut
        (N,); True beside a cut: a forearm limit, or an edge of the ROI, the image or the depth
        gate, beyond which the hand continues.
    colors
        (N, 3); RGB of the points.
    contour_m
        (M, 3); outer contour in order around the hand, frame D.
    contour_is_cut
        (M,); True on a cut edge, False on the silhouette. Of the mask, and so of all that the depth
        camera measured: it may lie outside the hand (see `DepthEdges`).
    mask
        (H, W); 255 on the hand, in the depth image; 0 elsewhere.
    box_px
        (4,); x0, y0, x1, y1 of the mask in the depth image, x1 and y1 exclusive.
    median_depth_m
        Median distance of the hand along the depth camera's axis.
    outline_m
        (K, 3); the hand's silhouette as it is drawn, in order around the hand, frame D: the contour
        itself if not given.
    outline_is_cut
        (K,); as `contour_is_cut`.
    outline_sigma_px
        Standard deviation of the whole outline inwards or outwards, in pixels of the depth image.
    """

    t_camera_ns: int
    t_host_ns: int
    points_m: Float32
    is_cut: Bool
    colors: UInt8 | None
    contour_m: Float32
    contour_is_cut: Bool
    mask: UInt8
    box_px: tuple[int, int, int, int]
    median_depth_m: float
    outline_m: Float32 = field(default_factory=lambda: np.empty((0, 3), np.float32))
    outline_is_cut: Bool = field(default_factory=lambda: np.empty(0, np.bool_))
    outline_sigma_px: float = UNKNOWN_OUTLINE_PX

    __repr__ = brief

    def __post_init__(self) -> None:
        if not len(self.outline_m):
            object.__setattr__(self, "outline_m", self.contour_m)
            object.__setattr__(self, "outline_is_cut", self.contour_is_cut)
        freeze(self, "outline_m", np.float32, None, 3)
        freeze(self, "outline_is_cut", np.bool_, len(self.outline_m))
        freeze(self, "points_m", np.float32, None, 3)
        freeze(self, "is_cut", np.bool_, len(self.points_m))
        freeze(self, "colors", np.uint8, len(self.points_m), 3)
        freeze(self, "contour_m", np.float32, None, 3)
        freeze(self, "contour_is_cut", np.bool_, len(self.contour_m))
        freeze(self, "mask", np.uint8, None, None)


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """One confirmed alignment: the input of the solver.

    Attributes
    ----------
    cursor_m
        (N, 3); the hand at t_a, which was the cursor, frame W.
    hand_m
        (N, 3); the hand at t_b, frame W.
    cursor_is_cut
        (N,); points of the cursor beside a cut edge.
    hand_is_cut
        (N,); points of the hand beside a cut edge.
    T_E_W
        each (4, 4); world to each eye's E at t_b.
    eyes
        Eyes that were open during the alignment: both, or one.
    rotation_rad
        (3,); rotation vector from the cursor to the hand at t_b, measured by the guard, frame D.
    t_a_ns
        Camera time of the cursor's frame.
    t_b_ns
        Camera time of the confirmed frame.
    drawn_shift_m
        each (3,); φ with which the cursor was drawn at t_b; zero for the offline calibration.
    time_sigma_m
        Standard deviation of the hand's place because the times of frames and confirmation are not
        exact.
    outline_sigma_px
        `HandCloud.outline_sigma_px` of the cursor as drawn; None: as the rig's `DepthEdges` say.
    """

    cursor_m: Float64
    hand_m: Float64
    cursor_is_cut: Bool
    hand_is_cut: Bool
    T_E_W: Mapping[Eye, Float64]
    eyes: tuple[Eye, ...]
    rotation_rad: Float64
    t_a_ns: int
    t_b_ns: int
    drawn_shift_m: Mapping[Eye, Float64] = field(
        default_factory=lambda: {eye: np.zeros(3) for eye in EYES}
    )
    time_sigma_m: float = 0.0
    outline_sigma_px: float | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "cursor_m", np.float64, None, 3)
        freeze(self, "hand_m", np.float64, None, 3)
        freeze(self, "cursor_is_cut", np.bool_, len(self.cursor_m))
        freeze(self, "hand_is_cut", np.bool_, len(self.hand_m))
        freeze(self, "rotation_rad", np.float64, 3)
        if not 0.0 <= self.time_sigma_m < np.inf:
            raise ValueError(f"Alignment.time_sigma_m: {self.time_sigma_m} is no σ")
        if self.outline_sigma_px is not None and not 0.0 <= self.outline_sigma_px < np.inf:
            raise ValueError(f"Alignment.outline_sigma_px: {self.outline_sigma_px} is no σ")
        poses = {eye: readonly(T, np.float64, (4, 4)) for eye, T in self.T_E_W.items()}
        object.__setattr__(self, "T_E_W", MappingProxyType(poses))
        shifts = {eye: readonly(m, np.float64, (3,)) for eye, m in self.drawn_shift_m.items()}
        object.__setattr__(self, "drawn_shift_m", MappingProxyType(shifts))
        if not self.eyes or len(set(self.eyes)) < len(self.eyes) or set(self.eyes) - set(EYES):
            raise ValueError(f"Alignment.eyes: one eye, or each of both once, not {self.eyes}")


@dataclass(frozen=True, slots=True, eq=False)
class EyeShift:
    """A solved eye shift φ from C0 to C1, in E's axes, with its uncertainty and residuals.

    Attributes
    ----------
    shift_m
        (3,); φ1, φ2, φ3.
    covariance_m2
        (3, 3); covariance of φ.
    rms_m
        Root mean square distance of the inlier pairs after registration.
    residuals_m
        (M,); distance of each hand point to its partner after registration; NaN for an outlier.
    inlier_ratio
        Number of inlier pairs over number of hand points.
    iterations
        Number of iterations; of fused alignments, of all together.
    converged
        True if the last step was small enough, False at the limit of iterations; of fused
        alignments, True if all converged.
    stop_reason
        Why the iterations ended.
    history_m2
        (iterations,); mean squared pair distance at each iteration. ``consistent`` measures it
        along normals and outlines, or, where it fits φ to pairs of the same points, in full.
    method
        One of `METHODS`, or ``"fused"``.
    """

    shift_m: Float64
    covariance_m2: Float64
    rms_m: float
    residuals_m: Float64
    inlier_ratio: float
    iterations: int
    converged: bool
    stop_reason: str
    history_m2: Float64
    method: str

    def __post_init__(self) -> None:
        freeze(self, "shift_m", np.float64, 3)
        freeze(self, "covariance_m2", np.float64, 3, 3)
        freeze(self, "residuals_m", np.float64, None)
        freeze(self, "history_m2", np.float64, None)

    @property
    def sigma_m(self) -> Float64:
        """(3,); one standard deviation of each coordinate of φ, from the covariance's diagonal."""
        return np.sqrt(np.diag(self.covariance_m2))

    def __str__(self) -> str:
        state = "converged" if self.converged else f"not converged ({self.stop_reason})"
        return (
            f"{phi_text(self)}; rms {1e3 * self.rms_m:.2f} mm, "
            f"{100 * self.inlier_ratio:.0f} % inliers, {state}"
        )

    def __repr__(self) -> str:
        return f"<EyeShift {self}>"

    def _repr_html_(self) -> str:
        return html_table([["", self.method], *shift_rows([self])])


def phi_text(shift: EyeShift) -> str:
    """Return φ ± σ in one line: ``φ = (+4.20 ± 1.14, -4.39 ± 0.96, +0.91 ± 2.54) mm``."""
    return f"φ = ({', '.join(_coordinates_mm(shift))}) mm"


def shift_rows(shifts: Sequence[EyeShift]) -> list[list[str]]:
    """Return a summary of eye shifts as rows of a table, with a column for each shift."""
    coordinates = zip(*map(_coordinates_mm, shifts), strict=True)
    names = ("φ1 (right), mm", "φ2 (down), mm", "φ3 (forward), mm")
    return [
        *([name, *cells] for name, cells in zip(names, coordinates, strict=True)),
        ["rms, mm", *(f"{1e3 * shift.rms_m:.2f}" for shift in shifts)],
        ["inliers, %", *(f"{100 * shift.inlier_ratio:.0f}" for shift in shifts)],
        ["converged", *("yes" if shift.converged else shift.stop_reason for shift in shifts)],
    ]


def _coordinates_mm(shift: EyeShift) -> list[str]:
    pairs = zip(1e3 * shift.shift_m, 1e3 * shift.sigma_m, strict=True)
    return [f"{value:+.2f} ± {sigma:.2f}" for value, sigma in pairs]


class Solved(Protocol):
    """Anything with solved eye shifts, such as `handcal.Results`."""

    @property
    def eyes(self) -> Mapping[Eye, EyeShift]:
        """φ of each solved eye."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The decision whether a solved eye shift may be used, with its reason."""

    name: VerdictName
    reason: str


_MOST_VERIFIED = 1e5  # arcmin, more than a whole turn; beyond, the fused numbers overflow


@dataclass(frozen=True, slots=True)
class Verification:
    """The verification of one eye by the wearer, who moves the drawing until it covers the hand."""

    before_m: tuple[float, float, float]
    """φ with which the hand's outline was first drawn."""
    nudge_arcmin: tuple[float, float]
    """Movement of the drawing by the wearer, to the right and down."""
    after_m: tuple[float, float, float]
    """φ with which the drawing covered the hand."""
    nudge_size: float = 0.0
    """Relative growth of the drawing by the wearer."""
    hand_E_m: tuple[float, float, float] | None = None
    """Centre of the hand then, in the eye's E; None if unknown: it is then not fused."""
    offset_arcmin: tuple[float, float] = (0.0, 0.0)
    offset_size: float = 0.0
    """Movement and growth by the program, for the wearer to bring the drawing back."""
    outline_sigma_px: float | None = None
    """Of the outline as drawn; as in `Alignment`."""
    earlier: tuple[Verification, ...] = ()
    """Verifications of the same eye before this one, oldest first; each is fused as well."""

    def __post_init__(self) -> None:
        places = (*self.before_m, *self.after_m, *(self.hand_E_m or ()))
        moves = *self.nudge_arcmin, *self.offset_arcmin, self.nudge_size, self.offset_size
        if not all(abs(number) < _MOST_VERIFIED for number in (*places, *moves)):
            raise ValueError("a verification's numbers are too large")
        if self.outline_sigma_px is not None and not 0.0 <= self.outline_sigma_px < _MOST_VERIFIED:
            raise ValueError(f"Verification.outline_sigma_px: {self.outline_sigma_px} is no σ")

    @property
    def was_moved(self) -> bool:
        """False if the wearer moved nothing: this says nothing about the eye."""
        return any(self.nudge_arcmin) or self.nudge_size != 0.0

    def after(self, former: Verification | None) -> Verification:
        """Return this verification with a former one, if any, among the earlier ones."""
        if former is None:
            return self
        return replace(self, earlier=(*former.earlier, replace(former, earlier=())))


@dataclass(frozen=True, slots=True, eq=False)
class Projection:
    """One eye's projection, as the headset renders with it."""

    eye: Eye
    P: Float64
    """(3, 4); pixels from points in V: ``ζ m = P [p_V; 1]``, OpenCV axes."""
    width_px: int
    height_px: int
    """Size of the display."""
    T_V_H: Float64 = field(default_factory=lambda: np.eye(4))
    """(4, 4); from the headset rig to V, as in the rig file: the view that belongs to `P`."""
    P_offline: Float64 | None = None
    """(3, 4); the offline calibration, drawn with on request; None: `P`."""
    wearer: str = ""
    rig: str = ""
    """Wearer and rig for which `P` was solved."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "P", np.float64, 3, 4)
        freeze(self, "T_V_H", np.float64, 4, 4)
        freeze(self, "P_offline", np.float64, 3, 4)


RigPart: TypeAlias = Literal["left", "right", "T_H_D"]
RIG_PARTS: tuple[RigPart, ...] = ("left", "right", "T_H_D")
PART_NAMES: dict[RigPart, str] = {
    "left": "left display",
    "right": "right display",
    "T_H_D": "depth camera's pose",
}


@dataclass(frozen=True, slots=True, eq=False)
class EyeDisplay:
    """One eye's offline calibration."""

    K: Float64
    """(3, 3); on-axis intrinsics of E, px."""
    H0: Float64
    """(3, 3); homography correction of the viewpoint C0 (paper, eq. for H)."""
    t_C0_V_m: Float64
    """(3,); position of V from C0 in E's axes, so that ``p_E = p_V + t_C0_V_m``."""
    z_C0_S_m: float
    """Distance from C0 to the display's focal plane S."""
    width_px: int
    height_px: int
    T_V_H: Float64
    """(4, 4); from the headset rig to the rendering camera, as the headset reports it."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "K", np.float64, 3, 3)
        freeze(self, "H0", np.float64, 3, 3)
        freeze(self, "t_C0_V_m", np.float64, 3)
        freeze(self, "T_V_H", np.float64, 4, 4)


@dataclass(frozen=True, slots=True, eq=False)
class Origin:
    """The origin of one part of a rig: its method, date, data and uncertainty."""

    method: str
    """One line."""
    made: str
    """Date and time, ISO 8601."""
    views: int
    """Number of images, or pairs of images, used."""
    rms_px: float
    """Root mean square of the reprojection error."""
    verdict: str
    reason: str
    """One line each."""
    parameters: tuple[str, ...]
    """Names of the covariance's parameters, with units."""
    covariance: Float64
    """(n, n); covariance of the n `parameters`."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "covariance", np.float64, len(self.parameters), len(self.parameters))


@dataclass(frozen=True, slots=True, eq=False)
class DepthCheck:
    """Measured depth compared with that of a board whose pose is known from colour images.

    ``measured depth = scale * true depth + offset_m``, along the depth camera's axis.
    """

    made: str
    """Date and time, ISO 8601."""
    views: int
    """Number of views of the board."""
    scale: float
    offset_m: float
    covariance: Float64
    """(2, 2); of `scale` and `offset_m`, in 1, m and m²."""
    ranges_m: Float64
    """(N, 2); nearest and farthest true depth of each range, ascending."""
    flatness_m: Float64
    """(N,); RMS distance of the measured points from the plane through them, by range."""
    flatness_sigma_m: Float64
    """(N,); its standard deviation."""

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "covariance", np.float64, 2, 2)
        freeze(self, "ranges_m", np.float64, None, 2)
        freeze(self, "flatness_m", np.float64, len(self.ranges_m))
        freeze(self, "flatness_sigma_m", np.float64, len(self.ranges_m))

    def bias_m(self, depth_m: float) -> tuple[float, float]:
        """Return measured minus true depth at a true depth, and its standard deviation."""
        slope = np.array([depth_m, 1.0])
        variance_m2 = float(slope @ self.covariance @ slope)
        return (self.scale - 1.0) * depth_m + self.offset_m, float(np.sqrt(variance_m2))


@dataclass(frozen=True, slots=True)
class DepthEdges:
    """Distance by which the depth image's borders of near surfaces lie outside the true borders.

    The border is the centres of the outermost pixels, as in `HandCloud.contour_m`. Lengths are in
    pixels of the depth image: ``mm = px * z / f``.
    """

    fatten_px: float
    """Positive if surfaces appear too large, as to a stereo camera, whose matching windows extend
    them by about half a window."""
    sigma_px: float
    """Its standard deviation."""
    source: Literal["measured", "typical"]
    """Measured with this camera, or typical of cameras like it."""
    views: int = 0
    made: str = ""
    """Views of the board, and date and time, ISO 8601; 0 and empty if not measured."""


@dataclass(frozen=True, slots=True)
class DisplayCheck:
    """The check that a headset draws as its projections say, observed from outside."""

    made: str
    """Date and time, ISO 8601."""
    observer: Literal["camera", "wearer"]
    device_id: str
    runtime: str
    app: str
    """The headset that was checked, as it introduced itself."""
    problems: Mapping[Eye, str]
    """Fault of each eye that was checked, in one line; empty if it obeys."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "problems", MappingProxyType(dict(self.problems)))


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """The offline calibration: both eye displays and the pose of the depth camera.

    Attributes
    ----------
    name
        Name of the rig, for its users.
    eyes
        The display of each eye.
    T_H_D
        (4, 4); from the depth camera to the headset rig.
    depth_intrinsics
        Of the depth camera.
    origins
        Origin of each of `RIG_PARTS`, where it is known.
    depth_camera
        The device; empty texts if unknown.
    headset
        The device; None if unknown.
    depth_check
        The check of the camera's depth; None if there was none.
    depth_edges
        Measured with this depth camera; None if they never were.
    display_check
        The check that the headset draws what it is sent; None if there was none.
    """

    name: str
    eyes: Mapping[Eye, EyeDisplay]
    T_H_D: Float64
    depth_intrinsics: Intrinsics
    origins: Mapping[RigPart, Origin] = field(default_factory=dict)
    depth_camera: CameraIdentity = CameraIdentity()
    headset: HeadsetIdentity | None = None
    depth_check: DepthCheck | None = None
    depth_edges: DepthEdges | None = None
    display_check: DisplayCheck | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        freeze(self, "T_H_D", np.float64, 4, 4)
        object.__setattr__(self, "origins", MappingProxyType(dict(self.origins)))
        if set(self.eyes) != set(EYES):
            raise ValueError("Rig.eyes: both left and right are needed")
        object.__setattr__(self, "eyes", MappingProxyType(dict(self.eyes)))
