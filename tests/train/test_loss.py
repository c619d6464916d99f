import numpy as np
import pytest

pytest.importorskip("torch")
import torch
from torch import Tensor

from handcal.core.types import Float32
from handcal.hand.detect import points
from handcal.train.loop import Grid, detection_loss

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


def test_grid_turns_predictions_into_boxes() -> None:
    inside = np.flatnonzero(raw_for(HAND, 9.0).detach().numpy()[0, 0] > 0)
    boxes = GRID.boxes(raw_for(HAND, 9.0)[:, 1:])[0, inside]
    assert boxes.detach().numpy() == pytest.approx(np.tile(HAND, (len(inside), 1)), abs=1e-3)


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


def test_a_hand_smaller_than_the_grid_still_has_a_point() -> None:
    small = [9.0, 9.0, 14.0, 14.0]
    raw = raw_for(HAND, -8.0)
    score_loss, _ = detection_loss(raw, target(small), GRID)
    assert (gradient(score_loss, raw)[0] < 0).any()


def test_two_hands_get_points_of_their_own() -> None:
    other = [40.0, 40.0, 60.0, 60.0]
    raw = raw_for(HAND, -8.0)
    score_loss, _ = detection_loss(raw, target(HAND, other), GRID)
    taught = PLACES[gradient(score_loss, raw)[0] < 0]
    for x0, y0, x1, y1 in (HAND, other):
        assert ((taught > [x0, y0]) & (taught < [x1, y1])).all(1).any()
