"""The training loop and its loss."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("torch")

import torch
from torch import Tensor

from handcal.core.types import Float32
from handcal.hand.detect import points
from handcal.io.files import make_folder, write_json
from handcal.lab.evaluate.annotations import Photo
from handcal.train.loop import Grid, Pace, Training, TrainSettings, detection_loss, split
from handcal.train.model import HandNet
from handcal.train.samples import Samples, SampleSettings, collate

SETTINGS = TrainSettings(
    steps=4,
    batch=2,
    settled=2,
    validated=0.25,
    samples=SampleSettings(side_px=64, simulated=0.0, pasted=0.0),
)
PACE = Pace(checkpoint_s=0.0, validate_steps=100, workers=0)


@pytest.fixture(scope="module")
def photos(tmp_path_factory: pytest.TempPathFactory) -> list[Photo]:
    folder = tmp_path_factory.mktemp("photos")
    rng = np.random.default_rng(0)
    written = []
    for number in range(4):
        path = folder / f"{number}.png"
        cv2.imwrite(str(path), rng.integers(0, 256, (64, 96, 3), np.uint8))
        box = np.array([[10.0, 10.0, 50.0, 40.0]])
        quad = np.array([[[10.0, 10.0], [50.0, 10.0], [50.0, 40.0], [10.0, 40.0]]])
        written.append(Photo(path, 96, 64, box, quad, np.ones(1, bool)))
    write_json(folder / "boxes.json", {})
    return written


def training(folder: Path) -> Training:
    torch.manual_seed(0)
    return Training(HandNet(), make_folder(folder), SETTINGS, PACE)


def trained(folder: Path, photos: list[Photo]) -> dict[str, Any]:
    return training(folder).run(photos, photos[0].path.parent).state_dict()


def test_an_interrupted_training_ends_as_an_uninterrupted_one(
    tmp_path: Path, photos: list[Photo], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = trained(tmp_path / "whole", photos)

    learn, steps = Training._learn, list[int]()

    def interrupted(self: Training, *batch: Any) -> list[float]:
        if len(steps) == 2:
            raise KeyboardInterrupt
        steps.append(1)
        return learn(self, *batch)

    with monkeypatch.context() as patched:
        patched.setattr(Training, "_learn", interrupted)
        with pytest.raises(KeyboardInterrupt):
            trained(tmp_path / "parts", photos)
    resumed = trained(tmp_path / "parts", photos)
    assert all((resumed[name] == value).all() for name, value in whole.items())


def test_progress_is_logged(tmp_path: Path, photos: list[Photo]) -> None:
    trained(tmp_path, photos)
    lines = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert lines[-1]["step"] == 4
    assert 0.0 <= lines[-1]["ap50"] <= 1.0


def test_the_weights_that_are_trained_change(tmp_path: Path, photos: list[Photo]) -> None:
    torch.manual_seed(0)
    start = HandNet().state_dict()
    end = trained(tmp_path, photos)
    assert (start["blocks.12.1.0.weight"] != end["blocks.12.1.0.weight"]).any()
    assert (start["blocks.0.1.0.weight"] == end["blocks.0.1.0.weight"]).all()


def test_the_moments_are_those_of_the_averaged_weights(tmp_path: Path, photos: list[Photo]) -> None:
    done = training(tmp_path)
    net = done.run(photos, photos[0].path.parent)
    samples = Samples(
        split(photos, 0.25)[0], photos[0].path.parent, SETTINGS.samples, SETTINGS.seed
    )
    inputs = []
    hook = net.get_submodule("lateral.0.1").register_forward_hook(
        lambda module, arguments, result: inputs.append(arguments[0])
    )
    # What follows the samples trained on: 4 steps of 2.
    for first in (8, 10):
        net.train()(collate([samples[first], samples[first + 1]])[0].float())
    hook.remove()
    mean = torch.stack([features.mean((0, 2, 3)) for features in inputs]).mean(0)
    expected = Training(HandNet(), tmp_path, SETTINGS, PACE)._average.module.state_dict()
    assert expected["lateral.0.1.running_mean"].numpy() == pytest.approx(
        mean.detach().numpy(), abs=1e-4
    )


def test_the_same_tenth_is_kept_aside_every_time(photos: list[Photo]) -> None:
    many = photos * 10
    trained_on, aside = split(many, 0.1)
    assert (len(trained_on), len(aside)) == (36, 4)
    assert split(many, 0.1)[1] == aside


PLACES, STRIDES = points(64, 64)
GRID = Grid(torch.tensor(PLACES), torch.tensor(STRIDES))
HAND = [8.0, 12.0, 40.0, 44.0]


def raw_for(box: list[float], logit: float) -> Tensor:
    """Return predictions whose every point within the box predicts it, the others small boxes."""
    x0, y0, x1, y1 = box
    x, y = PLACES.T
    sides = np.stack([x - x0, y - y0, x1 - x, y1 - y])
    inside = sides.min(0) > 0
    raw = np.zeros((1, 5, len(PLACES)), np.float32)
    raw[:, 0] = -8.0
    raw[0, 0, inside] = logit
    raw[0, 1:, inside] = np.log(sides[:, inside] / STRIDES[inside]).T
    return torch.from_numpy(raw).requires_grad_()


def target(*boxes: list[float], left_out: float = 0.0) -> list[Tensor]:
    return [torch.tensor([[*box, left_out] for box in boxes]).reshape(-1, 5)]


def gradient(loss: Tensor, raw: Tensor) -> Float32:
    """Return what the loss does to the only image's predictions, (5, N)."""
    found: Float32 = torch.autograd.grad(loss, raw)[0][0].numpy()
    return found


def test_right_boxes_cost_nothing_and_wrong_ones_do() -> None:
    _, right = detection_loss(raw_for(HAND, 9.0), target(HAND), GRID)
    _, wrong = detection_loss(raw_for([8.0, 12.0, 24.0, 44.0], 9.0), target(HAND), GRID)
    assert right.item() == pytest.approx(0.0, abs=1e-4)
    assert wrong.item() > 0.5


def test_a_score_where_there_is_no_hand_costs() -> None:
    silent, _ = detection_loss(raw_for(HAND, -8.0), target(), GRID)
    sure, _ = detection_loss(raw_for(HAND, 3.0), target(), GRID)
    assert silent.item() < 1e-6
    assert sure.item() > 1.0


def test_a_hand_raises_the_scores_of_some_points_at_its_centre() -> None:
    raw = raw_for(HAND, -2.0)
    score_loss, _ = detection_loss(raw, target(HAND), GRID)
    raised = gradient(score_loss, raw)[0] < 0
    assert 1 <= raised.sum() <= 10
    away = np.abs(PLACES[raised] - [24.0, 28.0]).max(1) / STRIDES[raised]
    assert away.max() < 2.5


def test_what_is_left_out_teaches_nothing() -> None:
    raw = raw_for(HAND, 3.0)
    score_loss, box_loss = detection_loss(raw, target(HAND, left_out=1.0), GRID)
    inside = raw.detach()[0, 0].numpy() > 0
    assert not gradient(score_loss + box_loss, raw)[:, inside].any()


def test_two_hands_get_points_of_their_own() -> None:
    other = [40.0, 40.0, 60.0, 60.0]
    raw = raw_for(HAND, -8.0)
    score_loss, _ = detection_loss(raw, target(HAND, other), GRID)
    taught = PLACES[gradient(score_loss, raw)[0] < 0]
    for x0, y0, x1, y1 in (HAND, other):
        assert ((taught > [x0, y0]) & (taught < [x1, y1])).all(1).any()
