"""Anatomy and behaviour of the simulated wearer."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WearerSettings:
    """Anatomy and behaviour of the wearer."""

    headset_sigma_m: tuple[float, float, float] = (0.002, 0.0015, 0.003)
    """Placement of the headset, common to both eyes, E axes: lateral, vertical, eye relief."""
    eye_distance_sigma_m: float = 0.002
    """Deviation of the eye distance from the rig's."""
    largest_shift_m: float = 0.010
    """Eye box, to which longer shifts are shortened."""
    slip_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Movement of both eyes in the headset since these were drawn, E axes: it has slipped."""
    raise_m: tuple[float, float, float] = (0.0, 0.048, 0.56)
    raise_spread_m: tuple[float, float, float] = (0.015, 0.006, 0.025)
    """Position of the raised palm relative to the midpoint of the viewpoints C0, in the head's
    axes, and its variation."""
    raise_turn_rad: float = 0.1
    """Rotation of the raised palm from facing the eyes, standard deviation about each axis."""
    reaction_s: float = 0.4
    movement_s: float = 0.8
    dwell_s: float = 0.6
    patience_s: float = 6.0
    """Times from a new cursor to the start of the movement, of the movement, of holding still
    before confirming, and of waiting for an answer before confirming again."""
    lateral_sigma_arcmin: float = 3.0
    """Error of the overlay about each of two axes."""
    depth_sigma: float = 0.003
    """Relative error of the overlay's size."""
    rotation_sigma_rad: float = 0.035
    """Rotation of the hand relative to the cursor, about a random axis."""
    novice: bool | None = None
    """A novice first overlays and confirms a rotated hand; None to choose by the seed."""
    head_sway_m: float = 0.003
    head_sway_rad: float = 0.005
    hand_sway_m: float = 0.0005
    hand_sway_rad: float = 0.003
    """Amplitudes of slow sway."""
    tremor_m: float = 0.0001
    """Amplitude of the hand's tremor, 8 to 12 Hz."""
