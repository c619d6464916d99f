import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from handcal.core.errors import FileError
from handcal.core.types import Float32, Float64, UInt8
from handcal.hand.detect import (
    STRIDES,
    Detections,
    DetectSettings,
    HandDetector,
    brightened,
    decode,
    letterbox,
    overlaps,
    points,
)
from handcal.io.images import read_image
from handcal.io.resources import resource_path

SHAPE = (64, 96)


def predictions(*found: tuple[int, float, list[float]]) -> Float32:
    """Return raw predictions in which only points given by index, logit and box see something."""
    places, strides = points(*SHAPE)
    raw = np.full((5, len(places)), -10.0, np.float32)
    for index, logit, (x0, y0, x1, y1) in found:
        x, y = places[index]
        raw[0, index] = logit
        raw[1:, index] = np.log(np.array([x - x0, y - y0, x1 - x, y1 - y]) / strides[index])
    return raw


def decoded(*found: tuple[int, float, list[float]]) -> tuple[Float64, Float64]:
    return decode(predictions(*found), SHAPE, DetectSettings(score_min=0.3))


@pytest.mark.parametrize("shape", [(720, 1280), (480, 640), (512, 300), (33, 47), (4, 3000)])
def test_the_canvas_holds_the_whole_image_and_suits_the_network(shape: tuple[int, int]) -> None:
    color = np.full((*shape, 3), 200, np.uint8)
    canvas, scale = letterbox(color, 92_160)
    height, width = canvas.shape[:2]
    assert height % STRIDES[-1] == width % STRIDES[-1] == 0
    assert height * width <= 92_160
    shown = (canvas == 200).all(2)
    assert shown.any(1).sum() == pytest.approx(scale * shape[0], abs=1)
    assert shown.any(0).sum() == pytest.approx(scale * shape[1], abs=1)
    assert shown[0, 0]


def test_a_smaller_canvas_is_taken_if_it_shows_the_image_nearly_as_large() -> None:
    canvas, scale = letterbox(np.zeros((720, 1280, 3), np.uint8), 110_592)
    largest = 416 / 1280  # in 416x256, the lower strip of which were gray
    assert canvas.shape == (224, 416, 3)
    assert 0.95 * largest <= scale < largest


def test_the_canvas_shows_things_in_their_place() -> None:
    color = np.zeros((720, 1280, 3), np.uint8)
    color[400:500, 900:1000] = 255
    canvas, scale = letterbox(color, 92_160)
    rows, columns = np.nonzero(canvas[: round(720 * scale), :, 0] > 128)
    assert np.mean(rows) / scale == pytest.approx(449.5, abs=2.5)
    assert np.mean(columns) / scale == pytest.approx(949.5, abs=2.5)


def test_boxes_come_back_the_surest_first() -> None:
    boxes, scores = decoded((30, 0.0, [1, 2, 90, 40]), (60, 2.0, [-5, 30, 40, 63]))
    assert boxes == pytest.approx(np.array([[-5, 30, 40, 63], [1, 2, 90, 40]]), abs=1e-3)
    assert scores == pytest.approx([1 / (1 + np.exp(-2)), 0.5])


def test_boxes_that_agree_are_averaged_by_their_scores() -> None:
    boxes, scores = decoded((30, 1.0, [0, 5, 50, 40]), (29, 2.0, [0, 5, 52, 40]))
    less, more = 1 / (1 + np.exp(-1)), 1 / (1 + np.exp(-2))
    mean = (less * 50 + more * 52) / (less + more)
    assert boxes == pytest.approx(np.array([[0, 5, mean, 40]]), abs=1e-3)
    assert scores == pytest.approx([more])


def test_a_doubtful_candidate_has_its_say_but_is_no_hand() -> None:
    boxes, scores = decoded((30, -1.0, [0, 5, 50, 40]), (29, 2.0, [0, 5, 52, 40]))
    less, more = 1 / (1 + np.exp(1)), 1 / (1 + np.exp(-2))
    mean = (less * 50 + more * 52) / (less + more)
    assert boxes == pytest.approx(np.array([[0, 5, mean, 40]]), abs=1e-3)
    assert len(scores) == 1


def test_of_two_boxes_that_share_half_the_surer_remains() -> None:
    boxes, scores = decoded((30, 1.0, [0, 5, 50, 40]), (29, 2.0, [0, 5, 90, 40]))
    assert boxes == pytest.approx(np.array([[0, 5, 90, 40]]), abs=1e-3)
    assert len(scores) == 1


def test_overlap_is_intersection_over_union() -> None:
    box = np.array([[0.0, 0.0, 2.0, 2.0]])
    others = np.array([[0.0, 0.0, 2.0, 2.0], [1.0, 0.0, 3.0, 2.0], [5.0, 5.0, 6.0, 6.0]])
    assert overlaps(box, others) == pytest.approx(np.array([[1.0, 1 / 3, 0.0]]))


def test_says_that_onnxruntime_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(FileError, match="onnxruntime"):
        HandDetector(tmp_path / "any.onnx")


def test_says_which_model_cannot_be_loaded(tmp_path: Path) -> None:
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"not a model")
    with pytest.raises(FileError, match=r"broken\.onnx"):
        HandDetector(broken)


def test_refuses_another_network(tmp_path: Path) -> None:
    helper = pytest.importorskip("onnx").helper
    floats = [helper.make_tensor_value_info(name, 1, [1]) for name in ("x", "y")]
    graph = helper.make_graph(
        [helper.make_node("Identity", ["x"], ["y"])], "g", *[[f] for f in floats]
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path = tmp_path / "other.onnx"
    path.write_bytes(model.SerializeToString())
    with pytest.raises(FileError, match=r"not \[\(.image"):
        HandDetector(path)


def picture(brightest: int) -> UInt8:
    """Return values from 0 to a maximum, evenly spread."""
    values = np.linspace(0, brightest, 64 * 96).reshape(64, 96, 1).round()
    return np.repeat(values, 3, axis=2).astype(np.uint8)


def test_a_bright_image_is_not_changed() -> None:
    color = picture(255)
    assert brightened(color) is color


def test_a_dim_image_is_multiplied_until_it_is_bright() -> None:
    color = picture(100)
    bright = brightened(color)
    assert np.percentile(bright, 99) == pytest.approx(240, abs=2)
    middle = (color > 20) & (color < 80)
    assert bright[middle] / color[middle] == pytest.approx(240 / 99, abs=0.05)


def test_the_gain_has_a_limit_and_black_remains_black() -> None:
    assert brightened(picture(8)).max() == 32
    assert not brightened(np.zeros((64, 96, 3), np.uint8)).any()


def test_a_small_lamp_does_not_make_an_image_bright() -> None:
    color = picture(100)
    color[:6, :8] = 255  # under 1 %
    assert brightened(color)[40, 50, 0] > 2 * color[40, 50, 0]


class Twice(HandDetector):
    """A detector that sees given hands at its first look, and others at its second."""

    def __init__(self, *looks: tuple[list[list[float]], list[float]]) -> None:
        self._settings = DetectSettings()
        self._looks = [Detections(np.array(boxes), np.array(scores)) for boxes, scores in looks]
        self.shapes: list[tuple[int, ...]] = []

    def _look(self, color: UInt8, pixels: int) -> Detections:
        self.shapes.append(color.shape)
        return self._looks[len(self.shapes) - 1]


IMAGE: UInt8 = np.zeros((480, 640, 3), np.uint8)
PALM = [300.0, 200.0, 400.0, 300.0]


@pytest.mark.parametrize(
    ("box", "score"), [(PALM, 0.8), (PALM, 0.1), ([300.0, 200.0, 330.0, 230.0], 0.5)]
)
def test_a_sure_hand_a_doubtful_one_and_a_small_one_need_no_second_look(
    box: list[float], score: float
) -> None:
    eyes = Twice(([box], [score]))
    eyes.detect(IMAGE)
    assert eyes.shapes == [IMAGE.shape]


def test_the_second_look_adds_the_whole_hand_to_its_palm() -> None:
    margin = 50  # half of the palm's side
    whole = [20.0, 10.0, 180.0, 190.0]
    eyes = Twice(([PALM], [0.5]), ([whole], [0.6]))
    found = eyes.detect(IMAGE)
    assert eyes.shapes == [IMAGE.shape, (100 + 2 * margin, 100 + 2 * margin, 3)]
    assert found.boxes_px == pytest.approx(np.array([[270, 160, 430, 340], PALM]))
    assert found.scores == pytest.approx([0.6, 0.5])


def test_boxes_of_both_looks_that_agree_are_averaged() -> None:
    eyes = Twice(([PALM], [0.5]), ([[50.0, 50.0, 150.0, 160.0]], [0.25]))
    found = eyes.detect(IMAGE)
    assert found.boxes_px == pytest.approx(np.array([[300, 200, 400, 300 + 10 / 3]]))
    assert found.scores == pytest.approx([0.5])


def test_the_second_look_adds_no_other_hand_and_nothing_doubtful() -> None:
    other, doubtful = [0.0, 0.0, 40.0, 40.0], [50.0, 50.0, 100.0, 150.0]
    eyes = Twice(([PALM], [0.5]), ([other, doubtful], [0.9, 0.25]))
    assert eyes.detect(IMAGE).boxes_px.tolist() == [PALM]


@pytest.mark.parametrize("model", ["hand_detector.onnx", "hand_detector_int8.onnx"])
@pytest.mark.parametrize("skin", ["dark", "medium", "fair"])
def test_real_hands_are_found_in_dim_light(shared_data: Path, model: str, skin: str) -> None:
    folder = shared_data / "hand_photos" / "k11"
    if not folder.exists():
        pytest.skip(f"no {folder}: photographs that are not in the repository")
    entries = json.loads((folder / "annotations.json").read_text())
    chosen = [name for name in sorted(entries) if entries[name]["skin"] == skin][::6]
    hands = HandDetector(resource_path(model))
    hits = 0
    for name in chosen:
        color = read_image(folder / name, cv2.IMREAD_COLOR_RGB)
        boxes = hands.detect((0.3 * color).astype(np.uint8)).boxes_px
        [hand] = entries[name]["hands"]
        hits += int(overlaps(boxes, np.array([hand["box"]])).max(initial=0.0) >= 0.5)
    assert hits >= 0.85 * len(chosen)
