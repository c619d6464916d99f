import dataclasses

import numpy as np

from handcal.core.geometry import rigid
from handcal.core.types import Float64, Intrinsics
from handcal.rig.boards.board import Board, BoardView
from handcal.rig.boards.views import worst_view
from handcal.rig.lens.fit import rms
from handcal.sim.boards import board_view

CAMERA = Intrinsics(640, 480, 500.0, 500.0, 319.5, 239.5)
NAMES = ("a", "b", "c", "d")


def _found(depth_m: float = 0.5, x_m: float = -0.125) -> BoardView:
    T_C_B = rigid(None, [x_m, -0.0875, depth_m])
    return board_view(Board(), T_C_B, CAMERA, np.random.default_rng(1), noise_px=0.0)


def _off(scale_px: float = 0.1) -> Float64:
    return np.random.default_rng(2).normal(scale=scale_px, size=(54, 2))


def _why(worst: BoardView, off_px: Float64, tilt_rad: float = 0.3) -> str:
    found = {**dict.fromkeys(NAMES, _found()), "c": worst}
    off = {**{name: _off() for name in NAMES}, "c": off_px}
    tilts = {**dict.fromkeys(NAMES, 0.3), "c": tilt_rad}
    result = worst_view(found, off, tilts)
    assert result.name == "c"
    assert result.rms_px == rms(off_px)
    return result.why


def test_rms_is_of_distances() -> None:
    assert rms(np.array([[3.0, 4.0], [0.0, 0.0]])) == np.sqrt(12.5)


def test_what_stands_out_is_named() -> None:
    off_px = _off(0.3)
    assert "blurred: edges 6.0 px" in _why(dataclasses.replace(_found(), blur_px=6.0), off_px)
    assert "small in it: squares of 10 px" in _why(_found(depth_m=1.25), off_px)
    assert "steep in it: 57°, 17° in others" in _why(_found(), off_px, tilt_rad=1.0)
    assert "corner of the image" in _why(_found(depth_m=0.37, x_m=-0.26), off_px)
    assert "bent or moved" in _why(_found(), np.full((54, 2), 0.5))
    assert _why(_found(), off_px) == "nothing else about it stands out"


def test_a_few_mistaken_corners_are_pointed_at() -> None:
    off_px = _off()
    off_px[10] = [5.0, 0.0]
    x, y = _found().pixels[10]
    assert f"1 of 54 corners are off by up to 5.0 px, most at ({x:.0f}, {y:.0f})" in _why(
        _found(), off_px
    )


def test_a_view_little_worse_than_the_others_is_said_to_be() -> None:
    assert _why(_found(), _off(0.12)).startswith("hardly more than the others' 0.14 px")
