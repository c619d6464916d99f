"""Faults of the simulated camera and headset, on demand."""

from __future__ import annotations

from typing import Literal, TypeAlias

Fault: TypeAlias = Literal["", "stale-headset", "frozen-camera", "other-camera", "depth-bias"]
