"""A network to export, shared by the tests of writing and reading it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from handcal.core.types import UInt8

if TYPE_CHECKING:
    from handcal.train.model import HandNet


@pytest.fixture(scope="session")
def noise() -> UInt8:
    """Return images (2, H, W, 3)."""
    image: UInt8 = np.random.default_rng(0).integers(0, 256, (2, 96, 64, 3), np.uint8)
    return image


@pytest.fixture(scope="session")
def net(noise: UInt8) -> HandNet:
    """Return a network that responds to its input, unlike an untrained one.

    Every layer has weights, moments and signs of its own.
    """
    import torch

    from handcal.train.model import HandNet

    torch.manual_seed(0)
    net = HandNet()
    for module in net.modules():
        if isinstance(module, torch.nn.Conv2d):
            torch.nn.init.kaiming_normal_(module.weight)
        if isinstance(module, torch.nn.BatchNorm2d):
            module.momentum = None  # the moments of these images
            torch.nn.init.normal_(module.weight)
            torch.nn.init.normal_(module.bias)
    net.train()(torch.from_numpy(noise).permute(0, 3, 1, 2).float())
    net.bake()
    return net.eval()


@pytest.fixture(scope="session")
def float_model(net: HandNet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file that `export_float` writes of the network."""
    from handcal.train.export import export_float

    path = tmp_path_factory.mktemp("models") / "float.onnx"
    export_float(net, path)
    return path
