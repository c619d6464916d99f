"""Faults of the simulated camera and headset, on demand.

The command line offers them before it has imported anything of the station, which takes seconds.
"""

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
