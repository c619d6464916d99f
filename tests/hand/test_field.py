"""Frames of the kinds that users report, with the right answer."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest

from handcal.camera.images import read_frame
from handcal.core.errors import FileError, HandError
from handcal.core.types import Frame
from handcal.hand.settings import Roi
from handcal.hand.shipped import segment
from handcal.io.images import read_image


def field_frame(folder: Path) -> Frame:
    return read_frame(folder / "color.png", folder / "depth.png", folder / "intrinsics.json")


@pytest.mark.parametrize("roi", ["detector", "depth"])
@pytest.mark.parametrize(
    ("name", "way"),
    [
        ("gate_inside_500", None),
        ("gate_far_690", "far"),
        ("gate_far_700", "far"),
        ("gate_near_310", "near"),
        ("gate_near_300", "near"),
    ],
)
def test_a_hand_at_the_gate_is_whole_or_refused(
    shared_data: Path, name: str, way: str | None, roi: Roi
) -> None:
    folder = shared_data / "field" / "gate" / name
    is_hand = read_image(folder / "full_hand_mask.png", cv2.IMREAD_GRAYSCALE) > 0
    try:
        mask = segment(field_frame(folder), roi=roi).mask > 0
    except HandError as error:
        if way is None:
            raise
        assert f"the hand is too {way}" in str(error)  # noqa: PT017 (or it is whole)
    else:
        assert mask[is_hand].mean() > 0.97


@pytest.mark.parametrize("roi", ["detector", "depth"])
@pytest.mark.parametrize(
    "name", ["tenth_mm_read_as_mm", "tum_5000_read_as_mm", "mm_read_as_tenth_mm"]
)
def test_a_wrong_unit_of_depth_is_named(shared_data: Path, name: str, roi: Roi) -> None:
    frame = field_frame(shared_data / "field" / "unit" / name)
    with pytest.raises(HandError, match=r"in a wrong unit|correct the unit of depth"):
        segment(frame, roi=roi)


def test_units_per_metre_are_asked_about(shared_data: Path) -> None:
    folder = shared_data / "field" / "unit"
    right, foreign = folder / "right", folder / "other_conventions/open3d_depth_scale_1000.json"
    with pytest.raises(FileError, match=r"enter 0\.001 if a metre is 1000 units"):
        read_frame(right / "color.png", right / "depth.png", foreign)
