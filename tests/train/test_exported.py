from pathlib import Path

import pytest

pytest.importorskip("torch")
pytest.importorskip("onnx")
import torch

from handcal.errors import FileError
from handcal.resources import resource_path
from handcal.train.export import export_float
from handcal.train.exported import load_exported
from handcal.train.model import HandNet


@pytest.fixture(scope="module")
def images() -> torch.Tensor:
    torch.manual_seed(1)
    return 255.0 * torch.rand(2, 3, 64, 96)


@pytest.fixture(scope="module")
def net(images: torch.Tensor) -> HandNet:
    """Return a network with weights, moments and signs of its own in every layer."""
    torch.manual_seed(0)
    net = HandNet()
    for module in net.modules():
        if isinstance(module, torch.nn.Conv2d):
            torch.nn.init.kaiming_normal_(module.weight)
        if isinstance(module, torch.nn.BatchNorm2d):
            module.momentum = None
            torch.nn.init.normal_(module.weight)
            torch.nn.init.normal_(module.bias)
    net.train()(images)
    net.bake()
    return net.eval()


@pytest.fixture(scope="module")
def again(net: HandNet, tmp_path_factory: pytest.TempPathFactory) -> HandNet:
    path = tmp_path_factory.mktemp("models") / "float.onnx"
    export_float(net, path)
    again = HandNet()
    load_exported(again, path)
    return again.eval()


def test_what_was_exported_computes_the_same_again(
    net: HandNet, again: HandNet, images: torch.Tensor
) -> None:
    with torch.inference_mode():
        expected, other, found = net(images), net(images.flip(1)), again(images)
    assert found.numpy() == pytest.approx(expected.numpy(), abs=1e-2)
    assert (expected - other).abs().mean() > 0.1  # with red and blue exchanged


def test_levels_go_on_sharing_their_convolutions(again: HandNet) -> None:
    first, other, _ = (dict(tower.named_parameters()) for tower in again.towers)
    assert other["0.0.weight"] is first["0.0.weight"]


@pytest.mark.parametrize("content", [b"", b"no model", b"\x08\x07"])
def test_a_file_of_something_else_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.onnx"
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"other\.onnx holds another network"):
        load_exported(HandNet(), path)


def test_the_model_of_integers_is_refused() -> None:
    with pytest.raises(FileError, match="holds another network"):
        load_exported(HandNet(), resource_path("hand_detector_int8.onnx"))
