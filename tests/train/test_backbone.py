import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")
import torch
from torch.nn import functional

from handcal.core.errors import FileError
from handcal.train.model import HandNet, load_backbone

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


def test_names_the_file_that_is_missing(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"ssd_mobilenetv1_model\.bin"):
        load_backbone(HandNet(), tmp_path)


@pytest.mark.parametrize("manifest", ["{", "[]", '{"a": 1}', '[{"weights": []}]'])
def test_refuses_another_network(manifest: str, tmp_path: Path) -> None:
    (tmp_path / "ssd_mobilenetv1_model.bin").write_bytes(b"")
    (tmp_path / "ssd_mobilenetv1_model-weights_manifest.json").write_text(manifest)
    with pytest.raises(FileError, match="another network"):
        load_backbone(HandNet(), tmp_path)


def test_refuses_half_a_file(package: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    for whole in package[0].iterdir():
        half = tmp_path / whole.name
        half.write_bytes(whole.read_bytes()[: 2**20])
    with pytest.raises(FileError, match="another network"):
        load_backbone(HandNet(), tmp_path)
