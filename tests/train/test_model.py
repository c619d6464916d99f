"""The network, and the weights from which its training starts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("onnx")

import torch
from torch.nn import functional

from handcal.core.errors import FileError
from handcal.core.types import UInt8
from handcal.hand.detect import points
from handcal.train.model import HandNet, load_backbone, load_exported, take_moments


def test_one_prediction_for_every_point() -> None:
    net = HandNet().eval()
    with torch.inference_mode():
        raw = net(torch.zeros(2, 3, 64, 96))
    assert raw.shape == (2, 5, len(points(64, 96)[0]))


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


@pytest.fixture(scope="module")
def again(float_model: Path) -> HandNet:
    again = HandNet()
    load_exported(again, float_model)
    return again.eval()


def test_what_was_exported_computes_the_same_again(
    net: HandNet, again: HandNet, noise: UInt8
) -> None:
    images = torch.from_numpy(noise).permute(0, 3, 1, 2).float()
    with torch.inference_mode():
        expected, other, found = net(images), net(images.flip(1)), again(images)
    assert found.numpy() == pytest.approx(expected.numpy(), abs=1e-2)
    assert (expected - other).abs().mean() > 0.1  # with red and blue exchanged


@pytest.mark.parametrize("content", [b"", b"no model", b"\x08\x07"])
def test_a_file_of_something_else_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.onnx"
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"other\.onnx holds another network"):
        load_exported(HandNet(), path)


EPSILON = 0.001
# Channels in and out of MobileNetV1's blocks.
BLOCKS = (
    *((32, 64), (64, 128), (128, 128), (128, 256), (256, 256), (256, 512)),
    *((512, 512),) * 5,
    *((512, 1024), (1024, 1024)),
)


def shapes() -> dict[str, tuple[int, ...]]:
    """Return the package's tensors, in TensorFlow's order of axes."""
    root = "MobilenetV1/Conv2d_"
    found: dict[str, tuple[int, ...]] = {
        f"{root}0_pointwise/weights": (3, 3, 3, 32),
        f"{root}0_pointwise/convolution_bn_offset": (32,),
    }
    for number, (inputs, outputs) in enumerate(BLOCKS, 1):
        found[f"{root}{number}_depthwise/depthwise_weights"] = (3, 3, inputs, 1)
        for name in ("gamma", "beta", "moving_mean", "moving_variance"):
            found[f"{root}{number}_depthwise/BatchNorm/{name}"] = (inputs,)
        found[f"{root}{number}_pointwise/weights"] = (1, 1, inputs, outputs)
        found[f"{root}{number}_pointwise/convolution_bn_offset"] = (outputs,)
    return found


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Write random weights as the package does, and return them dequantised."""
    folder = tmp_path_factory.mktemp("model")
    rng = np.random.default_rng(0)
    data, entries, tensors = b"", [], {}
    for name, shape in shapes().items():
        values = rng.integers(0, 256, shape, np.uint8)
        scale, low = 0.004, 0.1 if name.endswith("variance") else -0.5
        data += values.tobytes()
        quantization = {"scale": scale, "min": low, "dtype": "uint8"}
        entries.append({"name": name, "shape": list(shape), "quantization": quantization})
        tensors[name] = values * scale + low
    entries.append({"name": "Output/extra_dim", "shape": [1, 2, 4], "dtype": "float32"})
    manifest = [{"weights": entries, "paths": ["ssd_mobilenetv1_model.bin"]}]
    (folder / "ssd_mobilenetv1_model.bin").write_bytes(data + bytes(32))
    (folder / "ssd_mobilenetv1_model-weights_manifest.json").write_text(json.dumps(manifest))
    return folder, tensors


def kept(tensors: dict[str, Any], number: int) -> list[int]:
    """Return which channels the block of that number gets: those it makes the most of."""
    root = f"MobilenetV1/Conv2d_{number}_"
    gamma, weights = (
        tensors[f"{root}depthwise/BatchNorm/gamma"],
        tensors[f"{root}pointwise/weights"],
    )
    makes = np.abs(gamma) * np.sqrt((weights**2).sum((0, 1, 3)))
    count = len(HandNet().blocks[number - 1].get_parameter("0.0.weight"))
    return sorted(np.argsort(-makes)[:count].tolist())


@pytest.mark.parametrize(("number", "stride"), [(2, 2), (10, 1)], ids=["folded", "normalised"])
def test_a_block_computes_what_the_packages_layers_do(
    number: int, stride: int, package: tuple[Path, dict[str, Any]]
) -> None:
    folder, tensors = package
    net = HandNet().eval()
    load_backbone(net, folder)
    depthwise, pointwise = net.blocks[number - 1].children()
    inputs, outputs = kept(tensors, number), kept(tensors, number + 1)
    root = f"MobilenetV1/Conv2d_{number}_"
    kernel, gamma, beta, mean, variance, mixed, offset = (
        torch.tensor(tensors[root + name], dtype=torch.float32)
        for name in (
            "depthwise/depthwise_weights",
            "depthwise/BatchNorm/gamma",
            "depthwise/BatchNorm/beta",
            "depthwise/BatchNorm/moving_mean",
            "depthwise/BatchNorm/moving_variance",
            "pointwise/weights",
            "pointwise/convolution_bn_offset",
        )
    )
    features = torch.rand(1, len(inputs), 9, 9)
    kernel = kernel.permute(2, 3, 0, 1)[inputs]
    expected = functional.conv2d(features, kernel, stride=stride, padding=1, groups=len(inputs))
    moments = mean[inputs], variance[inputs], gamma[inputs], beta[inputs]
    expected = functional.relu6(functional.batch_norm(expected, *moments, eps=EPSILON))
    mixed = mixed.permute(3, 2, 0, 1)[outputs][:, inputs]
    expected = functional.conv2d(expected, mixed, offset[outputs])

    for layer in (depthwise, pointwise):
        layer.get_submodule("0")._is_baked = True  # type: ignore[assignment]  # not to round
    with torch.inference_mode():
        computed = pointwise(depthwise(features))
    assert computed.numpy() == pytest.approx(functional.relu6(expected).numpy(), abs=1e-4)


@pytest.mark.parametrize("manifest", ["{", "[]", '{"a": 1}', '[{"weights": []}]'])
def test_refuses_another_network(manifest: str, tmp_path: Path) -> None:
    (tmp_path / "ssd_mobilenetv1_model.bin").write_bytes(b"")
    (tmp_path / "ssd_mobilenetv1_model-weights_manifest.json").write_text(manifest)
    with pytest.raises(FileError, match="another network"):
        load_backbone(HandNet(), tmp_path)
