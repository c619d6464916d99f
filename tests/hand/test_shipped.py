import numpy as np
import pytest

from handcal.core.errors import FileError, HandError
from handcal.core.types import Frame, Intrinsics, UInt8
from handcal.hand import shipped as detector
from handcal.hand.detect import Detections, HandDetector
from handcal.hand.settings import Roi, SegmentSettings
from handcal.hand.shipped import load_detector, make_finder


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


class Eyes:
    """A detector that sees nothing, and counts its looks."""

    looks = 0

    def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
        self.looks += 1
        return Detections(np.empty((0, 4)), np.empty(0))


def look(settings: SegmentSettings) -> None:
    camera = Intrinsics(width=64, height=36, fx=50.0, fy=50.0, cx=31.5, cy=17.5)
    depth, color = np.full((36, 64), 2000, np.uint16), np.zeros((36, 64, 3), np.uint8)
    with pytest.raises(HandError, match="no hand"):
        make_finder(settings).find(Frame(0, 0, 0, depth, 0.001, camera, color, camera))


@pytest.mark.parametrize(("roi", "looks"), [("detector", 1), ("depth", 0)])
def test_the_detector_is_asked_where_the_settings_say_so(
    monkeypatch: pytest.MonkeyPatch, roi: Roi, looks: int
) -> None:
    eyes = Eyes()
    monkeypatch.setattr(detector, "_shipped", lambda: eyes)
    look(SegmentSettings(roi=roi))
    assert eyes.looks == looks


def test_depth_decides_where_the_detector_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []

    def missing() -> HandDetector:
        tried.append(1)
        raise FileError("no model")

    monkeypatch.setattr(detector, "_shipped", missing)
    look(SegmentSettings())
    assert tried
