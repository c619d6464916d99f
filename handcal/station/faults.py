"""Faults of the simulated camera and headset, on demand."""

from __future__ import annotations

from typing import Literal, TypeAlias

Fault: TypeAlias = Literal[
    "",
    "stale-headset",
    "lost-start",
    "frozen-camera",
    "other-camera",
    "late-camera",
    "depth-bias",
    "clock-step",
]
