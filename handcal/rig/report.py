"""Report on a rig: the checks of an expert, beyond plausibility."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from handcal.core.display import arcmin_from_px, view_of_eye
from handcal.core.geometry import image_points, invert, transform
from handcal.core.types import (
    EYES,
    PART_NAMES,
    RIG_PARTS,
    DepthCheck,
    DisplayCheck,
    Eye,
    EyeDisplay,
    Float64,
    Rig,
    RigPart,
)
from handcal.hand.edges import edges_of
from handcal.report.cells import signed

_EYE_DISTANCE_M = 0.050, 0.075
_FOCAL_DISTANCE_M = 0.3, 10.0
_LARGEST_FOCAL_DIFFERENCE = 0.25
"""Dioptres; both eyes' screens are made to be equally far."""
_LARGEST_OFFSET_M = 0.02
_LARGEST_REACH_M = 0.25
_LEAST_SEEN = 0.95
_HAND_DEPTHS_M = (0.4, 0.5, 0.6)
_LARGEST_BIAS_M = 0.005


@dataclass(frozen=True, slots=True)
class RigFinding:
    """One statement about a rig."""

    what: str
    found: str
    is_fine: bool = True
    expected: str = ""
    """The expected value; empty if any value is."""
    is_known: bool = True
    """False if the file does not contain it: neither fine nor doubtful."""
    has_failed: bool = False
    """True if it is a test that failed, which is worse than doubtful."""
    command: str = ""
    """The command that makes what is missing; empty if there is none."""
    parts: tuple[RigPart, ...] = ()
    """Parts of the rig from which it was computed; empty if it is not about their values."""

    @property
    def is_judged(self) -> bool:
        """True if it was compared with an expected value; other findings are only stated."""
        return self.is_known and bool(self.expected)


def report_rig(rig: Rig) -> tuple[RigFinding, ...]:
    """Return the findings about a rig that `check_rig` accepts."""
    return tuple(_findings(rig))


def _findings(rig: Rig) -> Iterator[RigFinding]:
    left_m, right_m = (invert(view_of_eye(rig.eyes[eye], np.eye(4)))[:3, 3] for eye in EYES)
    apart_m = float(np.linalg.norm(right_m - left_m))
    yield _within("Distance of the viewpoints", apart_m, _EYE_DISTANCE_M, 1e3, "mm", EYES)
    facing = view_of_eye(rig.eyes["left"], np.eye(4))[:3, :3] @ (right_m - left_m)
    yield RigFinding(
        "Viewpoints",
        "right is to the right of left" if facing[0] > 0 else "left and right are exchanged",
        bool(facing[0] > 0),
        "right is to the right of left",
        parts=EYES,
    )
    for eye in EYES:
        yield from _display_findings(eye, rig.eyes[eye])
        seen = _seen_by_depth_camera(rig, rig.eyes[eye])
        yield RigFinding(
            f"{eye}: seen by the depth camera at 0.4 to 0.6 m",
            f"{100 * seen:.0f} % of the display",
            seen >= _LEAST_SEEN,
            f"{100 * _LEAST_SEEN:.0f} % or more",
            parts=(eye, "T_H_D"),
        )
    left, right = (1.0 / rig.eyes[eye].z_C0_S_m for eye in EYES)
    bounds, what = (0.0, _LARGEST_FOCAL_DIFFERENCE), "Difference of the virtual screens' distances"
    yield _within(what, abs(right - left), bounds, 1.0, "dioptres", EYES)
    reach_m = float(np.linalg.norm(rig.T_H_D[:3, 3]))
    what, bounds = "Depth camera from the headset rig", (0.0, _LARGEST_REACH_M)
    yield _within(what, reach_m, bounds, 1e3, "mm", ("T_H_D",))
    camera = rig.depth_camera
    yield RigFinding(
        "Depth camera",
        f"{camera.model or 'model not known'}, serial number {camera.serial_number or 'not known'}",
        is_known=bool(camera.model and camera.serial_number),
    )
    if rig.headset is None:
        yield RigFinding("Headset", "not known until a headset reports it", is_known=False)
    else:
        name, runtime = rig.headset.name or rig.headset.device_id, rig.headset.runtime
        found = f"{name}, {runtime or 'runtime not known'}"
        yield RigFinding("Headset", found, is_known=bool(runtime))
    yield depth_finding(rig.depth_check)
    yield edges_finding(rig)
    yield display_finding(rig.display_check)
    for part in RIG_PARTS:
        yield _origin_finding(rig, part)


def _display_findings(eye: Eye, display: EyeDisplay) -> Iterator[RigFinding]:
    arcmin = float(arcmin_from_px(display, 1.0))
    yield RigFinding(
        f"{eye}: display",
        f"{display.width_px}×{display.height_px} px, {arcmin:.2f}′ per pixel, "
        f"{_angle_deg(display):.0f}° across",
    )
    what = f"{eye}: distance of the virtual screen"
    yield _within(what, display.z_C0_S_m, _FOCAL_DISTANCE_M, 1.0, "m", (eye,))
    offset_m = float(np.linalg.norm(display.t_C0_V_m))
    what = f"{eye}: viewpoint from the rendering camera"
    yield _within(what, offset_m, (0.0, _LARGEST_OFFSET_M), 1e3, "mm", (eye,))


def _within(
    what: str,
    value: float,
    bounds: tuple[float, float],
    scale: float,
    unit: str,
    parts: tuple[RigPart, ...],
) -> RigFinding:
    low, high = bounds
    return RigFinding(
        what,
        f"{scale * value:.3g} {unit}",
        low <= value <= high,
        f"{scale * low:g} to {scale * high:g} {unit}",
        parts=parts,
    )


def _angle_deg(display: EyeDisplay) -> float:
    middle = (display.height_px - 1) / 2.0
    ends_px = np.array([[-0.5, middle, 1.0], [display.width_px - 0.5, middle, 1.0]])
    a, b = np.linalg.solve(display.K @ display.H0, ends_px.T).T
    return float(np.degrees(np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))))


def _seen_by_depth_camera(rig: Rig, display: EyeDisplay) -> float:
    """Return the share of the display's pixels at which the depth camera can see a hand."""
    x = np.linspace(0.0, display.width_px - 1.0, 15)
    y = np.linspace(0.0, display.height_px - 1.0, 9)
    pixels = np.dstack([*np.meshgrid(x, y), np.ones((9, 15))]).reshape(-1, 3)
    rays = np.linalg.solve(display.K @ display.H0, pixels.T).T
    rays /= rays[:, 2:]
    points_E_m: Float64 = np.concatenate([depth_m * rays for depth_m in _HAND_DEPTHS_M])
    T_D_E = invert(view_of_eye(display, np.eye(4)) @ rig.T_H_D)
    points_D_m = transform(T_D_E, points_E_m)
    camera = rig.depth_intrinsics
    places_px = image_points(points_D_m, camera)
    size = camera.width - 0.5, camera.height - 0.5
    seen = (points_D_m[:, 2] > 0) & ((places_px > -0.5) & (places_px < size)).all(axis=1)
    return float(seen.mean())


def depth_finding(check: DepthCheck | None) -> RigFinding:
    """Return the largest bias of depth where hands are held; it is fine if certainly small."""
    what = "Depth check"
    if check is None:
        return RigFinding(what, "not made yet", is_known=False, command="handcal rig depth")
    bias_m, sigma_m = np.transpose([check.bias_m(depth_m) for depth_m in _HAND_DEPTHS_M])
    worst = int(np.argmax(np.abs(bias_m) + 2.0 * sigma_m))
    return RigFinding(
        what,
        f"{signed(1e3 * bias_m[worst], 1)} ± {1e3 * sigma_m[worst]:.1f} mm at "
        f"{_HAND_DEPTHS_M[worst]} m; flat to {1e3 * check.flatness_m.max():.1f} mm "
        f"({check.views} views, {check.made})",
        bool(abs(bias_m[worst]) + 2.0 * sigma_m[worst] <= _LARGEST_BIAS_M),
        f"within {1e3 * _LARGEST_BIAS_M:g} mm, including twice its standard deviation",
    )


def edges_finding(rig: Rig) -> RigFinding:
    """Return how far a depth camera's edges lie outside the true ones, measured or assumed."""
    what, edges = "Depth edges outside the true ones", edges_of(rig)
    far = f"{signed(edges.fatten_px, 1)} ± {edges.sigma_px:.1f} px"
    if edges.source == "measured":
        return RigFinding(what, f"{far} ({edges.views} views, {edges.made})")
    found = f"not measured, {far} assumed"
    return RigFinding(what, found, is_known=False, command="handcal rig depth")


def display_finding(check: DisplayCheck | None) -> RigFinding:
    """Return what the check of the displays has found."""
    what, expected = "Display check", "what is drawn moves as the projections say"
    if check is None:
        return RigFinding(what, "not made yet", is_known=False, command="handcal rig display-check")
    found = "; ".join(
        f"{' and '.join(eye for eye in check.problems if check.problems[eye] == text)}: {text}"
        for text in dict.fromkeys(check.problems.values())
        if text
    )
    by = f"by {check.observer}, {check.app or 'app not known'}, {check.made}"
    found = found or f"{' and '.join(check.problems)} as sent"
    unseen = [eye for eye in EYES if eye not in check.problems]
    if unseen:
        found += f"; {' and '.join(unseen)} not checked"
    is_fine = not any(check.problems.values())
    is_known = not is_fine or not unseen
    return RigFinding(what, f"{found} ({by})", is_fine, expected, is_known)


def _origin_finding(rig: Rig, part: RigPart) -> RigFinding:
    origin = next((origin for name, origin in rig.origins.items() if name == part), None)
    what = f"Calibration of the {PART_NAMES[part]}"
    if origin is None:
        return RigFinding(what, "not calibrated by handcal", is_known=False)
    return RigFinding(
        what,
        f"{origin.verdict}: {origin.reason} ({origin.method}, {origin.made})",
        origin.verdict == "good",
        "good",
    )
