import numpy as np
import pytest

pytest.importorskip("torch")
import torch

from handcal.hand.detect import points
from handcal.train.model import HandNet


def test_one_prediction_for_every_point() -> None:
    net = HandNet().eval()
    with torch.inference_mode():
        raw = net(torch.zeros(2, 3, 64, 96))
    assert raw.shape == (2, 5, len(points(64, 96)[0]))


def test_at_first_nothing_is_a_hand() -> None:
    net = HandNet().eval()
    with torch.inference_mode():
        raw = net(255.0 * torch.rand(1, 3, 64, 64))
    assert raw[:, 0].sigmoid().numpy() == pytest.approx(np.full((1, 84), 0.01), abs=0.01)


def test_the_first_blocks_are_not_trained() -> None:
    net = HandNet()
    net(torch.rand(2, 3, 64, 64)).sum().backward()
    trained = {name for name, value in net.named_parameters() if value.grad is not None}
    assert "blocks.2.1.0.weight" not in trained
    assert "blocks.3.0.0.weight" in trained
    assert "predict.bias" in trained


def test_levels_share_what_they_look_for_but_not_how_they_are_normalised() -> None:
    first, *others = HandNet().towers
    for other in others:
        weights, other_weights = dict(first.named_parameters()), dict(other.named_parameters())
        assert other_weights["0.0.weight"] is weights["0.0.weight"]
        assert other_weights["0.1.weight"] is not weights["0.1.weight"]


def test_weights_are_rounded_as_the_export_to_integers_does() -> None:
    torch.manual_seed(0)
    net, image = HandNet().eval(), 255.0 * torch.rand(1, 3, 64, 64)
    layer = dict(net.named_parameters())["blocks.6.1.0.weight"]
    weights = layer.detach().clone()
    with torch.inference_mode():
        before = net(image)
        net.bake()
        after = net(image)
    assert torch.equal(before, after)
    baked = dict(net.named_parameters())["blocks.6.1.0.weight"].detach()
    assert not torch.equal(baked, weights)
    steps = baked / (weights.abs().amax((1, 2, 3), keepdim=True) / 64.0)
    assert steps.numpy() == pytest.approx(steps.round().numpy(), abs=1e-3)
    assert steps.abs().max() == pytest.approx(64.0)


def test_rounding_does_not_stop_gradients() -> None:
    net = HandNet()
    net(torch.rand(1, 3, 64, 64)).sum().backward()
    gradient = dict(net.named_parameters())["blocks.12.1.0.weight"].grad
    assert gradient is not None
    assert gradient.abs().max() > 0.0
