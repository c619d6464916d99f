"""Which view fits worst, and what about it stands out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from handcal.rig.board import BoardView
from handcal.types import Float64

_STANDS_OUT = 1.5


@dataclass(frozen=True, slots=True)
class WorstView:
    """The view with the largest residual, in pixels, and why."""

    name: str
    rms_px: float
    why: str


def rms(off_px: Float64) -> float:
    """Return the root mean square length of (N, 2) residuals, as OpenCV counts it."""
    return float(np.sqrt(np.mean(np.sum(off_px**2, axis=1))))


def worst_view(
    found: Mapping[str, BoardView], off_px: Mapping[str, Float64], tilt_rad: Mapping[str, float]
) -> WorstView:
    """Return the view with the largest residual, and what it is likely to come from.

    Parameters
    ----------
    found : mapping of name to BoardView
    off_px : mapping of name to (N, 2) float64
        Seen less expected pixels.
    tilt_rad : mapping of name to float
        Angle between the board's normal and the line of sight.
    """
    residuals_px = {name: rms(off) for name, off in off_px.items()}
    name = max(residuals_px, key=lambda one: residuals_px[one])
    others = [one for one in found if one != name] or [name]
    usual_px = float(np.median([residuals_px[one] for one in others]))
    reasons = [
        *_stray_corners(found[name], off_px[name], usual_px),
        *_unlike(found, tilt_rad, name, others),
    ]
    if _alike_beside(found[name], off_px[name]) > 0.5:
        reasons.append(
            "neighbouring corners are off the same way: the board bent or moved, or the lens "
            "model does not hold there"
        )
    why = "; ".join(reasons) or "nothing else about it stands out"
    if residuals_px[name] < _STANDS_OUT * usual_px:
        why = f"hardly more than the others' {usual_px:.2f} px; {why}"
    return WorstView(name, residuals_px[name], why)


def _stray_corners(seen: BoardView, off_px: Float64, usual_px: float) -> list[str]:
    lengths_px = np.linalg.norm(off_px, axis=1)
    stray = lengths_px > 4 * max(usual_px, float(np.median(lengths_px)))
    if not 0 < stray.sum() <= 0.3 * len(stray):
        return []
    x, y = seen.pixels[np.argmax(lengths_px)]
    return [
        f"{stray.sum()} of {len(stray)} corners are off by up to {lengths_px.max():.1f} px, most "
        f"at ({x:.0f}, {y:.0f}): glare, a finger or a mistaken corner"
    ]


def _unlike(
    found: Mapping[str, BoardView], tilt_rad: Mapping[str, float], name: str, others: list[str]
) -> list[str]:
    """Return in what the view differs from the others: blur, size, tilt, place."""

    def compare(values: Mapping[str, float]) -> tuple[float, float]:
        return values[name], float(np.median([values[one] for one in others]))

    reasons = []
    blur, usual = compare({one: seen.blur_px for one, seen in found.items()})
    if blur > 1.3 * usual:
        reasons.append(f"it is blurred: edges {blur:.1f} px wide, {usual:.1f} in others")
    square, usual = compare({one: _square_px(seen) for one, seen in found.items()})
    if square < 0.7 * usual:
        reasons.append(
            f"the board is small in it: squares of {square:.0f} px, {usual:.0f} in others"
        )
    tilt, usual = np.degrees(compare(tilt_rad))
    if tilt > max(40.0, usual + 10.0):
        reasons.append(f"the board is steep in it: {tilt:.0f}°, {usual:.0f}° in others")
    reach, usual = compare({one: _reach(seen) for one, seen in found.items()})
    if reach > max(0.8, 1.15 * usual):
        reasons.append("it reaches into a corner of the image, where the lens bends most")
    return reasons


def _square_px(seen: BoardView) -> float:
    distances = np.asarray(cKDTree(seen.pixels).query(seen.pixels, k=2)[0])
    return float(np.median(distances[:, 1]))


def _reach(seen: BoardView) -> float:
    """Return how far out the corners lie: 1 in a corner of the image."""
    half = np.array(seen.size) / 2
    return float(np.linalg.norm(seen.pixels - half, axis=1).max() / np.linalg.norm(half))


def _alike_beside(seen: BoardView, off_px: Float64) -> float:
    """Return the correlation of residuals between nearest corners: 1 if alike, 0 if by chance."""
    beside = np.asarray(cKDTree(seen.pixels).query(seen.pixels, k=2)[1])[:, 1]
    square = float(np.sum(off_px**2))
    return float(np.sum(off_px * off_px[beside])) / square if square > 0 else 0.0
