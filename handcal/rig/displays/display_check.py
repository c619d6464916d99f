"""Check that a display obeys: what is drawn must move as the projections sent to it say.

A square is drawn for one eye. Moved in V by a known angle, it shows how far that is in the picture
(the control). Then the square stays and the projection changes: by a shift of the image, by an eye
that has moved, and by a shift of the other eye's projection. The share of the expected movement
that is seen shows which part of the headset's software undoes it: an app that submits the
calibrated view to its runtime asks it to show everything where the runtime's own view would. The
camera needs no calibration, and need not be at the rig's viewpoint.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias, get_args

import cv2
import numpy as np

from handcal.core.display import projection_matrix
from handcal.core.errors import HandcalError
from handcal.core.geometry import project
from handcal.core.types import Eye, Float64, Projection, Rig, UInt8
from handcal.link.shapes import Target

Probe: TypeAlias = Literal["control", "shift", "eye shift", "other eye"]
PROBES: tuple[Probe, ...] = get_args(Probe)
"""The change: of the square itself, the projection's image, its eye, the other eye's image."""
Shown: TypeAlias = Probe | Literal["nothing", "rest"]
SHIFT_PX = 40.0
"""Expected movement, which is also the side of the square."""
_DEPTH_M = 0.4
_TOLERANCE = 0.15
_LEAST_CONTRAST = 8.0
_NOISES = 6.0
_LEAST_PIXELS = 20
_AREA_RATIO = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Display:
    """Projections of both eyes, and the square of one."""

    projections: Mapping[Eye, Projection]
    target: Target | None


class UnseenError(HandcalError):
    """The camera does not see what it must."""


def displays(rig: Rig, eye: Eye, rig_name: str) -> dict[Shown, Display]:
    """Return what is shown for each probe of one eye, and before it.

    `rig_name` is the name of the rig by which headsets keep projections.
    """
    offline = {
        one: Projection(
            one,
            projection_matrix(display),
            display.width_px,
            display.height_px,
            display.T_V_H,
            rig=rig_name,
        )
        for one, display in rig.eyes.items()
    }
    display, P = rig.eyes[eye], offline[eye].P
    side_m = SHIFT_PX * _DEPTH_M / display.K[0, 0]
    square = side_m / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    corners_E_m = square + np.array([0.0, 0.0, _DEPTH_M])
    rest = Target(eye, corners_E_m - display.t_C0_V_m)
    right = np.array([side_m, 0.0, 0.0])
    side_px = _right_px(P, P, rest, Target(eye, rest.corners_V_m + right))
    moved = Target(eye, rest.corners_V_m + right * (SHIFT_PX / side_px))
    small = projection_matrix(display, [-0.001, 0.0, 0.0])
    shift_m = -0.001 * SHIFT_PX / _right_px(P, small, rest, rest)  # the movement is linear in it
    other: Eye = "left" if eye == "right" else "right"

    def with_projection(one: Eye, P: Float64) -> Display:
        return Display(offline | {one: replace(offline[one], P=P)}, rest)

    return {
        "nothing": Display(offline, None),
        "rest": Display(offline, rest),
        "control": Display(offline, moved),
        "shift": with_projection(eye, _shifted(P)),
        "eye shift": with_projection(eye, projection_matrix(display, [shift_m, 0.0, 0.0])),
        "other eye": with_projection(other, _shifted(offline[other].P)),
    }


def _shifted(P: Float64) -> Float64:
    """Return a projection whose image is shifted to the right."""
    shift = np.eye(3)
    shift[0, 2] = SHIFT_PX
    shifted: Float64 = shift @ P
    return shifted


def _right_px(P: Float64, P_moved: Float64, rest: Target, moved: Target) -> float:
    """Return how far the centre of a square moves to the right on the display."""
    before, after = (
        project(one, target.corners_V_m.mean(axis=0, keepdims=True))
        for one, target in ((P, rest), (P_moved, moved))
    )
    return float((after - before)[0, 0])


def find_square(dark: tuple[UInt8, UInt8], seen: UInt8) -> tuple[Float64, int]:
    """Return the centre of the drawn square in a picture, and the number of its pixels.

    Parameters
    ----------
    dark : two (H, W) uint8
        Pictures while nothing is drawn, which differ only by noise.
    seen : (H, W) uint8

    Raises
    ------
    UnseenError
        If no square stands out.
    """
    first, second, light = (
        cv2.GaussianBlur(image.astype(np.float32), (0, 0), 1.0) for image in (*dark, seen)
    )
    noise = float(np.std(first - second))
    added = light - (first + second) / 2
    mask = np.abs(added) > max(_LEAST_CONTRAST, _NOISES * noise)
    if np.count_nonzero(mask) < _LEAST_PIXELS:
        raise UnseenError(
            "the camera does not see the square that the headset draws",
            "darken the room, and put the camera behind this eye's display",
        )
    y, x = np.nonzero(mask)
    weights = np.abs(added[mask])
    centre = np.array([np.average(x, weights=weights), np.average(y, weights=weights)])
    return centre, len(x)


def shares_seen(found: Mapping[Shown, tuple[Float64, int]]) -> dict[Probe, float]:
    """Return the share of the expected movement that a camera saw, for each probe.

    Parameters
    ----------
    found : mapping
        Centre and pixels of the square (`find_square`) at rest and for every probe.

    Raises
    ------
    UnseenError
        If the square was not seen whole, or something else moved.
    """
    pixels = [count for _, count in found.values()]
    if max(pixels) > _AREA_RATIO * min(pixels):
        raise UnseenError(
            "something other than the square moved or lit up, or the square left the picture",
            "keep the camera and everything in front of it still, and check again",
        )
    control = found["control"][0] - found["rest"][0]
    length = float(control @ control)
    if length < 1.0:
        return dict.fromkeys(PROBES, 0.0)
    moved = {probe: found[probe][0] - found["rest"][0] for probe in PROBES}
    return {probe: float(one @ control) / length for probe, one in moved.items()}


def judge_display(shares: Mapping[Probe, float]) -> str:
    """Return why a display does not obey, with the likely cause and advice; empty if it does.

    Parameters
    ----------
    shares : mapping of probe to float
        Share of the expected movement that was seen; `other eye`: of the other eye's.
    """
    if not _is_full(shares["control"]):
        return (
            "the square does not follow its position in V; the app must draw the target with P, "
            "fixed to the display"
        )
    if abs(shares["other eye"]) > _TOLERANCE:
        return (
            "this eye follows the other eye's projection: one projection serves both eyes "
            "(single-pass rendering); set the app to multi-pass"
        )
    shift, eye_shift = shares["shift"], shares["eye shift"]
    if _is_full(shift) and _is_full(eye_shift):
        return ""
    seen = f"{_percent(shift)} of a shift of P and {_percent(eye_shift)} of an eye's shift arrive"
    if _is_none(shift) and _is_none(eye_shift):
        return (
            f"{seen}: the projection has no effect, as with single-pass rendering (set multi-pass),"
            " or the runtime undoes it by depth reprojection (submit the runtime's own view, or "
            "switch reprojection off)"
        )
    if _is_none(shift):
        plane = (
            "" if _is_full(eye_shift) else " and a focus plane at another distance than the rig's"
        )
        return (
            f"{seen}: the runtime undoes it, as with the calibrated view submitted to it{plane}; "
            "submit the runtime's own view, and set the focus plane to the virtual image's distance"
        )
    if _is_full(shift):
        return (
            f"{seen}: the runtime's reprojection moves what is drawn by its depth; set the focus "
            "plane to the virtual image's distance, and take the view from the projection"
        )
    return (
        f"{seen}: the runtime undoes a part; submit the runtime's own view, switch reprojection "
        "off, and check again"
    )


def _is_full(share: float) -> bool:
    return abs(share - 1.0) <= _TOLERANCE


def _is_none(share: float) -> bool:
    return abs(share) <= _TOLERANCE


def _percent(share: float) -> str:
    return f"{5 * round(20 * share)} %"
