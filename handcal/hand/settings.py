"""Settings of the segmentation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

# Fewer points cannot be registered; more than 50,000 cannot be sent to the headset.
_LEAST_POINTS, _MOST_POINTS = 200, 40_000

NEARER_M = 0.05
"""A hand that the detector has seen may be this much nearer than the depth gate."""

REACH_M = 0.20, 0.75
"""Distances from the depth camera at which wearers can hold a hand under a cursor."""

Roi = Literal["detector", "left", "right", "depth"]


@dataclass(frozen=True, slots=True)
class SegmentSettings:
    """Settings of the segmentation of the hand.

    Raises
    ------
    ValueError
        If the gate is empty, or `points` is too few to register or too many to send.
    """

    roi: Roi = "detector"
    """Region to search: a hand found by the detector in the colour image (of several, the nearest,
    leftmost or rightmost), or with "depth" the nearest hand-sized object in the whole depth
    image."""
    depth_min_m: float = 0.35
    depth_max_m: float = 0.70
    """Depth gate, within arm's reach and the camera's range (paper, section on segmentation)."""
    edge_jump_m: float = 0.02
    """Depth difference at which neighbouring pixels belong to different surfaces."""
    flying_m: float = 0.01
    """A point this far behind another one two pixels away counts as a flying pixel."""
    forearm_m: float = 0.02
    """Length of forearm beyond the wrist that counts as hand."""
    cut_band_m: float = 0.004
    """Distance from a cut edge within which points are marked as cut."""
    hole_area_m2: float = 1e-4
    """Largest hole in the hand that is closed in the mask."""
    roi_margin: float = 0.4
    """Margin added on each side of a region of interest, as a share of its size: a detector's box
    ends at the wrist, but part of the arm is needed to locate the wrist."""
    points: int = 5000
    """Approximate number of points of the cloud."""

    @property
    def reachable_m(self) -> tuple[float, float]:
        """The part of the depth gate in which a wearer can hold a hand; empty if none is."""
        return max(self.depth_min_m, REACH_M[0]), min(self.depth_max_m, REACH_M[1])

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


def usual_gate_m(model: str) -> tuple[float, float]:
    """Return the depth gate usual for a model of camera: a HoloLens 2's AHAT sees nearer hands."""
    return 0.20 if "AHAT" in model else SegmentSettings().depth_min_m, SegmentSettings().depth_max_m
