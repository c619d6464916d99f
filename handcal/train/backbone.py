"""The pretrained backbone: an SSD-MobileNetV1 that was trained to find faces.

It ships in the npm package `@vladmandic/face-api` (MIT), quantised to 8 bits.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from handcal.errors import FileError
from handcal.files import read_limited
from handcal.train.model import HandNet

_NAME = "ssd_mobilenetv1_model"
_EPSILON = 0.001
_MOST_BYTES = 2**25


def load_backbone(net: HandNet, folder: Path) -> None:
    """Fill the network's stem and blocks from the package's folder `model`, in place.

    Raises
    ------
    FileError
        If the files are missing or not those of the package.
    """
    try:
        state = _state(_read(folder), len(net.blocks))
        net.load_state_dict({name: torch.from_numpy(value) for name, value in state.items()}, False)
    except (LookupError, TypeError, ValueError, RuntimeError) as error:
        raise FileError(f"{folder} holds another network: {error!r}") from error


def _read(folder: Path) -> dict[str, NDArray[np.float32]]:
    """Return the package's tensors by name, dequantised."""
    data = read_limited(folder / f"{_NAME}.bin", _MOST_BYTES)
    manifest = json.loads(read_limited(folder / f"{_NAME}-weights_manifest.json", _MOST_BYTES))
    tensors, offset = {}, 0
    for entry in manifest[0]["weights"]:
        count = int(np.prod(entry["shape"]))
        if "quantization" not in entry:
            break  # a constant of the face detector's own post-processing, the last
        values = np.frombuffer(data, np.uint8, count, offset).astype(np.float32)
        scale: dict[str, Any] = entry["quantization"]
        tensors[entry["name"]] = (values * scale["scale"] + scale["min"]).reshape(entry["shape"])
        offset += count
    return tensors


def _state(tensors: dict[str, NDArray[np.float32]], blocks: int) -> dict[str, NDArray[np.float32]]:
    """Return the network's parameters: axes in PyTorch's order, batch normalisation folded in."""
    root = "MobilenetV1/Conv2d_"
    state = {
        "stem.0.weight": tensors[f"{root}0_pointwise/weights"].transpose(3, 2, 0, 1),
        "stem.0.bias": tensors[f"{root}0_pointwise/convolution_bn_offset"],
    }
    for block in range(blocks):
        depthwise, pointwise = f"{root}{block + 1}_depthwise", f"{root}{block + 1}_pointwise"
        gamma, beta, mean, variance = (
            tensors[f"{depthwise}/BatchNorm/{name}"]
            for name in ("gamma", "beta", "moving_mean", "moving_variance")
        )
        factor = gamma / np.sqrt(variance + _EPSILON)
        weights = tensors[f"{depthwise}/depthwise_weights"].transpose(2, 3, 0, 1)
        state |= {
            f"blocks.{block}.depthwise.weight": weights * factor[:, None, None, None],
            f"blocks.{block}.depthwise.bias": beta - mean * factor,
            f"blocks.{block}.pointwise.weight": tensors[f"{pointwise}/weights"].transpose(
                3, 2, 0, 1
            ),
            f"blocks.{block}.pointwise.bias": tensors[f"{pointwise}/convolution_bn_offset"],
        }
    return {name: np.ascontiguousarray(value) for name, value in state.items()}
