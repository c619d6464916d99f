from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest

from handcal.core.frozen import readonly
from handcal.core.geometry import rigid
from handcal.core.types import Alignment, Eye, Frame, Intrinsics, Rig, Verification
from handcal.rig.example import example_rig

INTRINSICS = Intrinsics(4, 3, 5.0, 5.0, 1.5, 1.0)


def frame(**changes: object) -> Frame:
    fields: dict[str, object] = {
        "index": 0,
        "t_camera_ns": 1,
        "t_host_ns": 2,
        "depth": np.zeros((3, 4), np.uint16),
        "depth_scale_m": 0.001,
        "depth_intrinsics": INTRINSICS,
    }
    return Frame(**(fields | changes))  # type: ignore[arg-type]


def test_readonly_keeps_the_memory_of_a_fitting_array_and_leaves_the_original_writable() -> None:
    original = np.zeros((2, 3))
    frozen = readonly(original, np.float64, (None, 3))
    assert np.shares_memory(original, frozen)
    assert original.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        frozen[0, 0] = 1.0


@pytest.mark.parametrize("shape", [(3,), (2, 2), (1, 2, 3)])
def test_readonly_refuses_a_wrong_shape(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="expected an array of shape N×3, got"):
        readonly(np.zeros(shape), np.float64, (None, 3))


def test_values_are_frozen_and_their_arrays_read_only(alignment: Alignment) -> None:
    with pytest.raises(FrozenInstanceError):
        alignment.t_a_ns = 0  # type: ignore[misc]
    for array in (alignment.cursor_m, alignment.T_E_W["left"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1.0
    with pytest.raises(TypeError):
        alignment.T_E_W["left"] = np.eye(4)  # type: ignore[index]


@pytest.mark.parametrize("eyes", [(), ("left", "left"), ("right", "left", "right"), ("middle",)])
def test_an_alignment_is_of_one_eye_or_of_both(alignment: Alignment, eyes: tuple[Eye, ...]) -> None:
    with pytest.raises(ValueError, match=r"Alignment\.eyes: one eye, or each of both once"):
        replace(alignment, eyes=eyes)


def test_a_frame_must_fit_its_intrinsics() -> None:
    assert frame().depth.shape == (3, 4)
    with pytest.raises(ValueError, match=r"Frame\.depth: expected an array of shape 3×4, got 4×3"):
        frame(depth=np.zeros((4, 3), np.uint16))


def test_a_frame_needs_colour_and_its_intrinsics_together() -> None:
    color = np.zeros((3, 4, 3), np.uint8)
    assert frame(color=color, color_intrinsics=INTRINSICS).color is not None
    with pytest.raises(ValueError, match="go together"):
        frame(color=color)


def test_a_rig_needs_both_eyes() -> None:
    rig = example_rig()
    with pytest.raises(ValueError, match="both left and right"):
        Rig("one eye", {"left": rig.eyes["left"]}, rigid(), rig.depth_intrinsics)


@pytest.mark.parametrize("sigma", [-1e-9, np.nan, np.inf])
@pytest.mark.parametrize("name", ["time_sigma_m", "outline_sigma_px"])
def test_what_is_no_standard_deviation_is_refused(
    alignment: Alignment, name: str, sigma: float
) -> None:
    with pytest.raises(ValueError, match=f"{name}: .* is no σ"):
        replace(alignment, **{name: sigma})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "changed",
    [
        {"after_m": (0.0, np.nan, 0.0)},
        {"hand_E_m": (0.0, 0.0, 1e300)},
        {"nudge_size": -np.inf},
        {"outline_sigma_px": -1.0},
    ],
)
def test_an_impossible_verification_is_refused(changed: dict[str, Any]) -> None:
    verified = Verification((0.0, 0.0, 0.0), (1.0, 2.0), (0.001, 0.0, 0.0), hand_E_m=(0, 0, 0.5))
    with pytest.raises(ValueError, match=r"too large|is no σ"):
        replace(verified, **changed)
