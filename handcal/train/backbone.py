"""The pretrained backbone: an SSD-MobileNetV1 trained to detect faces.

It is part of the npm package `@vladmandic/face-api` (MIT), quantised to 8 bits.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from handcal.core.errors import FileError
from handcal.core.types import Float32
from handcal.io.files import read_limited
from handcal.train.model import HandNet
from handcal.train.moments import fold_in

_Tensors = dict[str, Float32]

_ROOT = "MobilenetV1/Conv2d_"
_NAME = "ssd_mobilenetv1_model"
_EPSILON = 0.001
_MOST_BYTES = 2**25


def load_backbone(net: HandNet, folder: Path) -> None:
    """Fill the network's stem and blocks from the package's folder `model`, in place.

    A block with fewer channels than the package's takes those with the largest product of standard
    deviation and weight in the next block. `take_moments` must follow.

    Raises
    ------
    FileError
        If the files are missing or not from the package.
    """
    try:
        tensors = _read(folder)
        blocks = [list(block.children()) for block in net.blocks]
        kept = [_kept(tensors, number, depthwise) for number, (depthwise, _) in enumerate(blocks)]
        kept.append(np.arange(_outputs(blocks[-1][1])))
        _fill(net.stem, *_stem(tensors), kept[0], np.arange(3))
        for number, (depthwise, pointwise) in enumerate(blocks):
            _fill(depthwise, *_depthwise(tensors, number), kept[number], np.arange(1))
            _fill(pointwise, *_pointwise(tensors, number), kept[number + 1], kept[number])
    except (LookupError, TypeError, ValueError, RuntimeError) as error:
        raise FileError(f"{folder} holds another network: {error!r}") from error


def _read(folder: Path) -> _Tensors:
    """Return the package's tensors by name, dequantised."""
    data = read_limited(folder / f"{_NAME}.bin", _MOST_BYTES)
    manifest = json.loads(read_limited(folder / f"{_NAME}-weights_manifest.json", _MOST_BYTES))
    tensors, offset = {}, 0
    for entry in manifest[0]["weights"]:
        count = int(np.prod(entry["shape"]))
        if "quantization" not in entry:
            break  # the last: a constant of the face detector's post-processing
        values = np.frombuffer(data, np.uint8, count, offset).astype(np.float32)
        scale: dict[str, Any] = entry["quantization"]
        tensors[entry["name"]] = (values * scale["scale"] + scale["min"]).reshape(entry["shape"])
        offset += count
    return tensors


def _stem(tensors: _Tensors) -> tuple[Float32, Float32]:
    """Return weights, with axes in PyTorch's order, and biases."""
    weights = tensors[f"{_ROOT}0_pointwise/weights"].transpose(3, 2, 0, 1)
    return weights, tensors[f"{_ROOT}0_pointwise/convolution_bn_offset"]


def _depthwise(tensors: _Tensors, number: int) -> tuple[Float32, Float32]:
    """Return weights and biases, batch normalisation folded in."""
    layer = f"{_ROOT}{number + 1}_depthwise"
    gamma, beta, mean, variance = (
        tensors[f"{layer}/BatchNorm/{name}"]
        for name in ("gamma", "beta", "moving_mean", "moving_variance")
    )
    factor = (gamma / np.sqrt(variance + _EPSILON)).astype(np.float32)  # as it is already
    weights = tensors[f"{layer}/depthwise_weights"].transpose(2, 3, 0, 1)
    return weights * factor[:, None, None, None], beta - mean * factor


def _pointwise(tensors: _Tensors, number: int) -> tuple[Float32, Float32]:
    layer = f"{_ROOT}{number + 1}_pointwise"
    weights = tensors[f"{layer}/weights"].transpose(3, 2, 0, 1)
    return weights, tensors[f"{layer}/convolution_bn_offset"]


def _kept(tensors: _Tensors, number: int, depthwise: nn.Module) -> NDArray[np.intp]:
    """Return the channels that a block takes."""
    deviation = tensors[f"{_ROOT}{number + 1}_depthwise/BatchNorm/gamma"]
    taken = np.square(deviation) * np.square(_pointwise(tensors, number)[0]).sum((0, 2, 3))
    order = np.argsort(-taken, kind="stable")
    return np.sort(order[: _outputs(depthwise)])


def _fill(
    layer: nn.Module,
    weight: Float32,
    bias: Float32,
    outputs: NDArray[np.intp],
    inputs: NDArray[np.intp],
) -> None:
    convolution, normalisation, *_ = layer.children()
    state = {"weight": torch.from_numpy(weight[outputs][:, inputs])}
    if isinstance(normalisation, nn.BatchNorm2d):
        fold_in(normalisation, torch.ones(len(outputs)), torch.from_numpy(bias[outputs]))
    else:
        state["bias"] = torch.from_numpy(bias[outputs])
    convolution.load_state_dict(state)


def _outputs(layer: nn.Module) -> int:
    return len(layer.get_parameter("0.weight"))
