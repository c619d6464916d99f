"""The check that a display obeys: what is shown, what a camera finds of it, and the judgement."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from handcal.core.geometry import project
from handcal.core.types import EYES, Eye, Float64, UInt8
from handcal.rig.displays.display_check import (
    PROBES,
    SHIFT_PX,
    Probe,
    Shown,
    UnseenError,
    displays,
    find_square,
    judge_display,
    shares_seen,
)
from handcal.rig.example import example_rig


@pytest.mark.parametrize("eye", EYES)
def test_every_probe_moves_the_square_by_its_own_width(eye: Eye) -> None:
    shown = displays(example_rig(), eye, "rig")
    centres = {}
    for what, display in shown.items():
        if display.target is not None:
            corners = project(display.projections[eye].P, display.target.corners_V_m)
            centres[what] = corners.mean(axis=0)
            assert np.ptp(corners[:, 0]) == pytest.approx(SHIFT_PX, rel=0.03)
    assert shown["nothing"].target is None
    for probe in ("control", "shift", "eye shift"):
        assert centres[probe] - centres["rest"] == pytest.approx([SHIFT_PX, 0.0], abs=1.0)
    assert centres["other eye"] == pytest.approx(centres["rest"])
    assert {one.projections[eye].rig for one in shown.values()} == {"rig"}


def picture(x_px: float | None, rng: np.random.Generator) -> UInt8:
    image = rng.normal(20.0, 2.0, (120, 200))
    if x_px is not None:
        left = round(x_px)
        image[40:70, left : left + 30] += 60.0
        image[44:66, left + 4 : left + 26] -= 60.0
    return np.rint(image).clip(0, 255).astype(np.uint8)


def found(places_px: Mapping[Shown, float]) -> dict[Shown, tuple[Float64, int]]:
    rng = np.random.default_rng(1)
    dark = picture(None, rng), picture(None, rng)
    return {what: find_square(dark, picture(x_px, rng)) for what, x_px in places_px.items()}


def test_shares_are_measured_against_the_control() -> None:
    shares = shares_seen(
        found({"rest": 50, "control": 90, "shift": 90, "eye shift": 60, "other eye": 50})
    )
    expected = {"control": 1.0, "shift": 1.0, "eye shift": 0.25, "other eye": 0.0}
    assert shares == pytest.approx(expected, abs=0.02)


def test_a_square_that_does_not_move_has_no_shares() -> None:
    same = dict.fromkeys(("rest", *PROBES), 50.0)
    assert set(shares_seen(found(same)).values()) == {0.0}  # type: ignore[arg-type]


def test_what_the_camera_does_not_see_is_said() -> None:
    rng = np.random.default_rng(1)
    dark = picture(None, rng), picture(None, rng)
    with pytest.raises(UnseenError, match="darken the room"):
        find_square(dark, picture(None, rng))
    seen = found({"rest": 50, "control": 90, "shift": 90, "eye shift": 60, "other eye": 50})
    lit = {**seen, "shift": (seen["shift"][0], 10 * seen["shift"][1])}
    with pytest.raises(UnseenError, match="keep the camera"):
        shares_seen(lit)


@pytest.mark.parametrize(
    ("shift", "eye_shift", "causes"),
    [
        (1.0, 1.0, ()),
        (0.9, 1.1, ()),
        (0.0, 0.0, ("multi-pass", "depth reprojection")),
        (0.0, 1.0, ("submit the runtime's own view",)),
        (0.0, 1.25, ("focus plane at another distance",)),
        (0.0, 0.5, ("focus plane at another distance",)),
        (1.0, 0.6, ("focus plane to the virtual image's distance",)),
        (0.5, 0.5, ("undoes a part",)),
    ],
)
def test_a_failure_names_the_likely_cause(
    shift: float, eye_shift: float, causes: tuple[str, ...]
) -> None:
    shares: dict[Probe, float] = {
        "control": 1.0, "shift": shift, "eye shift": eye_shift, "other eye": 0.0
    }  # fmt: skip
    reason = judge_display(shares)
    assert bool(reason) == bool(causes)
    assert all(cause in reason for cause in causes)
    assert len(reason) <= 500
    assert "single-pass" in judge_display({**shares, "other eye": 1.0})
    assert "does not follow its position" in judge_display({**shares, "control": 0.0})
