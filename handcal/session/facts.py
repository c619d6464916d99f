"""Facts about a session besides alignments and trials: devices, plan, verification."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np

from handcal.core.errors import FileError
from handcal.core.types import (
    EYES,
    CameraIdentity,
    Eye,
    EyeDistance,
    EyePlan,
    HeadsetIdentity,
    Intrinsics,
    PlanName,
    Verification,
)
from handcal.io.settings import read_settings

Facts = TypeVar("Facts")


@dataclass(frozen=True, slots=True)
class CameraUsed:
    """The depth camera of a session; ValueError if its intrinsics are not of an image."""

    identity: CameraIdentity
    depth_intrinsics: Intrinsics
    depth_scale_m: float
    """Metres per unit of the depth image."""

    def __post_init__(self) -> None:
        one = self.depth_intrinsics
        sizes = one.width, one.height, one.fx, one.fy, self.depth_scale_m
        if not all(0 < size < np.inf for size in sizes):
            raise ValueError("the camera's size, focal lengths and depth scale must be positive")


@dataclass(frozen=True, slots=True)
class AlignmentFacts:
    """Circumstances of one alignment; None where unknown. ValueError if a value is negative."""

    match_age_s: float | None = None
    """Time between the confirmation and the depth frame taken for it."""
    cursor_moved_m: float | None = None
    hand_moved_m: float | None = None
    """Movement of the hand while the cursor was frozen, and while the wearer confirmed."""
    shape_change_m: float | None = None
    """Root mean square change of the hand's shape from the cursor to the confirmation."""

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if value is not None and value < 0.0:
                raise ValueError(f"{one.name} must not be negative")


@dataclass(frozen=True, slots=True, eq=False)
class SessionFacts:
    """Facts about a session; None or empty where unknown."""

    camera: CameraUsed | None = None
    headset: HeadsetIdentity | None = None
    plan: EyePlan | PlanName | None = None
    """The plan that was followed, or only the order in which the eyes were aligned."""
    usable_eyes: tuple[Eye, ...] = EYES
    """The eyes that the plan calibrates: only one for a wearer who sees with one eye."""
    former: str = ""
    """Name of the session whose φ this one started from; empty if there is none."""
    eye_distance: EyeDistance | None = None
    """Measured; the results were solved with it."""
    verified: Mapping[Eye, Verification] = field(default_factory=dict)
    """Newest verification of each eye."""
    evidence: tuple[str, ...] = ()
    contradictions: tuple[str, ...] = ()
    """Names of what supports and what contradicts the results."""

    def __post_init__(self) -> None:
        if not self.usable_eyes or len(set(self.usable_eyes)) < len(self.usable_eyes):
            raise ValueError("usable_eyes must name one eye, or both once")
        object.__setattr__(self, "verified", MappingProxyType(dict(self.verified)))


def facts_json(facts: Any) -> Any:
    """Return a dataclass, or a mapping of facts by name, as JSON-able values."""
    if is_dataclass(facts):
        return {one.name: facts_json(getattr(facts, one.name)) for one in fields(facts)}
    if isinstance(facts, Mapping):
        return {name: facts_json(fact) for name, fact in facts.items()}
    if isinstance(facts, np.ndarray):
        return facts.tolist()
    if isinstance(facts, tuple | list):
        return [facts_json(fact) for fact in facts]
    return facts


def with_facts(before: SessionFacts, data: Mapping[str, Any]) -> SessionFacts:
    """Return facts with those in `data`, as `facts_json` gives them, in place of earlier ones.

    Raises
    ------
    ValueError
        If anything in `data` is missing, unknown or invalid.
    """
    facts = read_facts(SessionFacts, data)
    changes = {name: getattr(facts, name) for name in data}
    if "verified" in changes:
        changes["verified"] = {**before.verified, **changes["verified"]}
    return replace(before, **changes)


def read_facts(kind: type[Facts], data: object) -> Facts:
    """Return a dataclass from what `facts_json` gives; ValueError if it is invalid."""
    try:
        return read_settings(kind, data, "facts")
    except (FileError, TypeError) as error:  # TypeError: a field is missing
        raise ValueError(str(error)) from error
