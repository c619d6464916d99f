"""A hand held up in front of a fixed camera: a scene without a headset."""

from __future__ import annotations

import math
import time

import numpy as np

from handcal.core.geometry import rigid
from handcal.sim.scene import SceneState

_SWAY_M = 0.03
_SWAY_RAD = 0.1
_PERIOD_S = 4.0


def swaying_hand() -> SceneState:
    """Return the present scene: 0.5 m away, a hand sways 3 cm sideways and rotates by 6°."""
    t_ns = time.monotonic_ns()
    swing = math.sin(2.0 * math.pi * (t_ns * 1e-9 % _PERIOD_S) / _PERIOD_S)
    T_W_hand = rigid([0.1, 0.1, _SWAY_RAD * swing], [_SWAY_M * swing, 0.02, 0.5])
    return SceneState(t_ns, np.eye(4), T_W_hand)
