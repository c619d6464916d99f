import pytest

pytest.importorskip("torch")
import torch

from handcal.train.model import HandNet, take_moments


@pytest.fixture(scope="module")
def images() -> torch.Tensor:
    torch.manual_seed(1)
    return 255.0 * torch.rand(3, 3, 64, 96)


def test_the_network_computes_what_it_did_but_with_the_images_moments(images: torch.Tensor) -> None:
    torch.manual_seed(0)
    net = HandNet().eval()
    for _, _, layer in net.normalised():
        for value in (layer.weight, layer.bias, layer.running_mean):
            assert value is not None
            torch.nn.init.normal_(value)
    with torch.inference_mode():
        before = net(images)
        take_moments(net, images)
        after, trained = net(images), net.train()(images)
    assert before.std() > 0.1
    assert after.numpy() == pytest.approx(before.numpy(), abs=1e-2)
    assert trained.numpy() == pytest.approx(after.numpy(), abs=1e-2)


def test_every_layer_that_is_trained_is_normalised_but_the_last() -> None:
    net = HandNet()
    normalised = {id(convolution.weight) for _, convolution, _ in net.normalised()}
    trained = {
        name: id(weight)
        for name, weight in net.named_parameters()
        if weight.ndim == 4 and weight.requires_grad
    }
    assert {name for name, number in trained.items() if number not in normalised} == {
        "predict.weight"
    }
