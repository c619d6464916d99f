"""Settings of the segmentation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

# About: fewer cannot be registered, and more than 50,000 not be sent to the headset.
_LEAST_POINTS, _MOST_POINTS = 200, 40_000

Roi = Literal["detector", "left", "right", "depth"]


@dataclass(frozen=True, slots=True)
class SegmentSettings:
    """How a hand is segmented.

    Raises
    ------
    ValueError
        If the gate is empty, or `points` is too few to register or too many to send.
    """

    roi: Roi = "detector"
    """Where to look: where the hand detector sees a hand in the colour image, if there is one (of
    several the nearest, the leftmost or the rightmost), or for the nearest hand-sized thing in the
    whole depth image."""
    depth_min_m: float = 0.35
    depth_max_m: float = 0.70
    """Depth gate: within arm's reach and the camera's range (paper, section on segmentation)."""
    edge_jump_m: float = 0.02
    """Neighbouring pixels this far apart in depth belong to different surfaces."""
    flying_m: float = 0.01
    """A point this far behind another two pixels away is taken for a flying pixel."""
    forearm_m: float = 0.02
    """How much of the forearm beyond the wrist counts as hand."""
    cut_band_m: float = 0.004
    """Points this close to a cut edge are marked as cut."""
    hole_area_m2: float = 1e-4
    """Holes in the hand up to this size are closed in the mask."""
    roi_margin: float = 0.4
    """By how much a given region of interest is widened on each side, as a share of its size: a
    detector's box ends at the wrist, but the way the arm leaves tells where the hand ends."""
    points: int = 5000
    """About how many points of the surface are kept."""

    def __post_init__(self) -> None:
        if not 0.0 < self.depth_min_m < self.depth_max_m:
            raise ValueError(
                f"the depth gate {self.depth_min_m} to {self.depth_max_m} m is empty; "
                "set 0 < depth_min_m < depth_max_m"
            )
        if not _LEAST_POINTS <= self.points <= _MOST_POINTS:
            raise ValueError(
                f"points is {self.points}; keep between {_LEAST_POINTS} and {_MOST_POINTS:,}"
            )
