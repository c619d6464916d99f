import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")
import torch
from torch.nn import functional

from handcal.errors import FileError
from handcal.train.backbone import load_backbone
from handcal.train.model import HandNet

EPSILON = 0.001


def shapes() -> dict[str, tuple[int, ...]]:
    """Return the package's tensors, in TensorFlow's order of axes."""
    root = "MobilenetV1/Conv2d_"
    found: dict[str, tuple[int, ...]] = {
        f"{root}0_pointwise/weights": (3, 3, 3, 32),
        f"{root}0_pointwise/convolution_bn_offset": (32,),
    }
    parameters = dict(HandNet().named_parameters())
    for number in range(1, 14):
        outputs, inputs = parameters[f"blocks.{number - 1}.pointwise.weight"].shape[:2]
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


def test_a_block_computes_what_the_packages_layers_do(
    package: tuple[Path, dict[str, Any]],
) -> None:
    folder, tensors = package
    net = HandNet()
    load_backbone(net, folder)
    root = "MobilenetV1/Conv2d_2_"
    depthwise, offset, gamma, beta, mean, variance, pointwise = (
        torch.tensor(tensors[root + name], dtype=torch.float32)
        for name in (
            "depthwise/depthwise_weights",
            "pointwise/convolution_bn_offset",
            "depthwise/BatchNorm/gamma",
            "depthwise/BatchNorm/beta",
            "depthwise/BatchNorm/moving_mean",
            "depthwise/BatchNorm/moving_variance",
            "pointwise/weights",
        )
    )
    features = torch.rand(1, 64, 9, 9)
    kernel = depthwise.permute(2, 3, 0, 1)
    expected = functional.conv2d(features, kernel, stride=2, padding=1, groups=64)
    expected = functional.batch_norm(expected, mean, variance, gamma, beta, eps=EPSILON)
    expected = functional.relu6(expected)
    expected = functional.relu6(functional.conv2d(expected, pointwise.permute(3, 2, 0, 1), offset))
    loaded = net.blocks[1].state_dict()  # as it is, not rounded
    computed = functional.relu6(
        functional.conv2d(
            features, loaded["depthwise.weight"], loaded["depthwise.bias"], 2, 1, groups=64
        )
    )
    computed = functional.relu6(
        functional.conv2d(computed, loaded["pointwise.weight"], loaded["pointwise.bias"])
    )
    assert computed.numpy() == pytest.approx(expected.numpy(), abs=1e-4)


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
