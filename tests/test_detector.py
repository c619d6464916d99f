import json
from pathlib import Path

import numpy as np
import pytest

from handcal import detector
from handcal.detector import load_detector
from handcal.evaluate.annotations import read_image
from handcal.hand.detect import HandDetector, overlaps
from handcal.types import UInt8


@pytest.mark.parametrize(
    ("integer_s", "expected"), [(0.01, "integers"), (0.019, "floats"), (0.03, "floats")]
)
def test_integers_only_where_they_are_clearly_faster(
    monkeypatch: pytest.MonkeyPatch, integer_s: float, expected: str
) -> None:
    names = {detector.FLOAT_MODEL: "floats", detector.INTEGER_MODEL: "integers"}
    seconds = {"floats": 0.02, "integers": integer_s}
    monkeypatch.setattr(detector, "resource_path", lambda name: name)
    monkeypatch.setattr(detector, "HandDetector", lambda name, _: names[name])
    monkeypatch.setattr(detector, "_seconds", lambda model: seconds[model])
    assert load_detector() == expected  # type: ignore[comparison-overlap]


@pytest.fixture(scope="module")
def hands() -> HandDetector:
    return load_detector()


def test_both_models_ship_and_nothing_is_seen_in_nothing(hands: HandDetector) -> None:
    gray: UInt8 = np.full((720, 1280, 3), 127, np.uint8)
    assert len(hands.detect(gray).scores) == 0


def test_real_hands_are_found(hands: HandDetector, shared_data: Path) -> None:
    folder = shared_data / "rgbd" / "color_aligned_640"
    shots = json.loads((folder / "meta.json").read_text())
    for name, shot in shots.items():
        found = hands.detect(read_image(folder / f"{name}_color.jpg")).boxes_px
        assert overlaps(found, np.array([shot["hand_box"]])).max() >= 0.5
