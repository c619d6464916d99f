"""The detector's network, and the trained weights from which its training starts.

MobileNetV1, a small feature pyramid, one anchor-free head: Howard et al. 2017 (MobileNet), Lin et
al. 2017 (FPN), Tian et al. 2019 (FCOS).
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from google.protobuf.message import DecodeError
from numpy.typing import NDArray
from onnx import numpy_helper
from torch import Tensor, nn
from torch.nn import functional

from handcal.core.errors import FileError
from handcal.core.types import Float32
from handcal.hand.detect import STRIDES
from handcal.io.files import read_limited

# Channels in, channels out and stride of the thirteen separable convolutions: those of MobileNetV1,
# but fewer where few are useful: at the stem, where 14 of 32 pretrained ones are all zero, and from
# the seventh on.
_BLOCKS = (
    (16, 64, 1),
    (64, 128, 2),
    (128, 128, 1),
    (128, 256, 2),
    (256, 256, 1),
    (256, 512, 2),
    (512, 384, 1),
    (384, 256, 1),
    *((256, 256, 1),) * 3,
    (256, 512, 2),
    (512, 512, 1),
)
# The blocks whose outputs have the strides 8, 16 and 32.
_TAPS = (5, 11, 13)
_WIDTH = 96
_FROZEN_BLOCKS = 3
_PRIOR = 0.01


class _Conv(nn.Conv2d):
    """A convolution with weights of 7 bits, one scale per output channel, as in the integer export.

    Gradients ignore the rounding (Jacob et al. 2018).
    """

    _is_baked = False

    def forward(self, features: Tensor) -> Tensor:
        """Return the convolved features."""
        return self._conv_forward(features, self._rounded(), self.bias)

    def bake(self) -> None:
        """Round the weights permanently."""
        self.weight.data = self._rounded().data
        self._is_baked = True

    def _rounded(self) -> Tensor:
        if self._is_baked:
            return self.weight
        weight = self.weight.detach()
        scale = weight.abs().amax((1, 2, 3), keepdim=True).clamp_min(1e-9) / 64.0
        return self.weight + ((weight / scale).round() * scale - weight)


def _normalised(
    inputs: int, outputs: int, size: int = 1, groups: int = 1, stride: int = 1
) -> nn.Sequential:
    return nn.Sequential(
        _Conv(inputs, outputs, size, stride, size // 2, groups=groups, bias=False),
        nn.BatchNorm2d(outputs, momentum=0.03),
        nn.ReLU6(inplace=True),
    )


def _folded(
    inputs: int, outputs: int, size: int = 1, groups: int = 1, stride: int = 1
) -> nn.Sequential:
    """Return a convolution with folded batch normalisation; it is not trained."""
    return nn.Sequential(
        _Conv(inputs, outputs, size, stride, size // 2, groups=groups), nn.ReLU6(inplace=True)
    ).requires_grad_(False)


def _blocks() -> list[nn.Sequential]:
    """Return the separable convolutions; the first are not trained."""
    blocks = []
    for number, (inputs, outputs, stride) in enumerate(_BLOCKS):
        kind = _folded if number < _FROZEN_BLOCKS else _normalised
        depthwise = kind(inputs, inputs, 3, inputs, stride)
        blocks.append(nn.Sequential(depthwise, kind(inputs, outputs)))
    return blocks


def _tower() -> nn.Sequential:
    """Return two separable convolutions of 5x5."""
    layers = []
    for _ in range(2):
        layers += [_normalised(_WIDTH, _WIDTH, 5, _WIDTH), _normalised(_WIDTH, _WIDTH)]
    return nn.Sequential(*layers)


def _share_convolutions(tower: nn.Sequential, other: nn.Sequential) -> None:
    """Share the convolutions of two levels, but not their normalisation."""
    for layer, other_layer in zip(tower.children(), other.children(), strict=True):
        (convolution, *_), (other_convolution, *_) = layer.children(), other_layer.children()
        other_convolution.weight = convolution.weight


class HandNet(nn.Module):
    """Maps (B, 3, H, W) RGB of 0 to 255, H and W multiples of 32, to (B, 5, N) raw predictions.

    N is the number of points of all strides, rows first. The five values are the logit of the score
    and the logarithms of the distances, in strides, from the point to the box's left, top, right
    and bottom. The first blocks, and the convolution before them, are not trained.
    """

    def __init__(self) -> None:
        super().__init__()
        self.stem = _folded(3, _BLOCKS[0][0], 3, stride=2)
        self.blocks = nn.ModuleList(_blocks())
        self.lateral = nn.ModuleList(_normalised(_BLOCKS[tap - 1][1], _WIDTH) for tap in _TAPS)
        towers = [_tower() for _ in _TAPS]
        for tower in towers[1:]:
            _share_convolutions(towers[0], tower)
        self.towers = nn.ModuleList(towers)
        self.predict = nn.Conv2d(_WIDTH, 5, 1)
        nn.init.normal_(self.predict.weight, std=0.01)
        # Initially points are rarely hands, and boxes are four strides wide.
        first_bias = [-math.log(1.0 / _PRIOR - 1.0)] + [math.log(2.0)] * 4
        self.predict.bias = nn.Parameter(torch.tensor(first_bias))

    def normalised(self) -> Iterator[tuple[str, nn.Conv2d, nn.BatchNorm2d]]:
        """Yield the normalised convolutions with their normalising layers and names."""
        for name, module in self.named_modules():
            if isinstance(module, nn.Sequential):
                convolution, normalisation, *_ = module
                if isinstance(convolution, nn.Conv2d) and isinstance(normalisation, nn.BatchNorm2d):
                    yield name, convolution, normalisation

    def bake(self) -> None:
        """Round the weights permanently, as in training; for export."""
        for module in self.modules():
            if isinstance(module, _Conv):
                module.bake()

    def forward(self, images: Tensor) -> Tensor:
        """Return the raw predictions."""
        features = self.stem(images * (1.0 / 127.5) - 1.0)
        taps = []
        for number, block in enumerate(self.blocks, 1):
            features = block(features)
            if number in _TAPS:
                taps.append(features)
        pyramid = [lateral(tap) for lateral, tap in zip(self.lateral, taps, strict=True)]
        for level in (1, 0):
            pyramid[level] = pyramid[level] + functional.interpolate(
                pyramid[level + 1], scale_factor=2.0, mode="nearest"
            )
        return torch.cat(
            [
                self.predict(tower(level)).flatten(2)
                for tower, level in zip(self.towers, pyramid, strict=True)
            ],
            2,
        )


assert len(_TAPS) == len(STRIDES)


# Insertion of batch normalisation into a trained network that has none, or has it folded in.
#
# Without it training destroys the backbone: at the learning rates of the new layers more and more
# channels become constant at 0 or 6.


def fold_in(normalisation: nn.BatchNorm2d, gain: Tensor, bias: Tensor) -> None:
    """Set a layer to multiply by `gain` (C,) and add `bias` (C,), with unknown input moments."""
    normalisation.load_state_dict(
        {
            "weight": gain,
            "bias": bias,
            "running_mean": torch.zeros_like(bias),
            "running_var": torch.full_like(bias, 1.0 - normalisation.eps),
            "num_batches_tracked": torch.tensor(0),
        }
    )


def take_moments(net: HandNet, images: Tensor) -> None:
    """Set the moments of normalisation from images; the network's function is unchanged.

    Parameters
    ----------
    net : HandNet
    images : (B, 3, H, W) tensor
        Similar to the training images.
    """
    hooks = [
        normalisation.register_forward_pre_hook(_take) for _, _, normalisation in net.normalised()
    ]
    with torch.no_grad():
        net.eval()(images.float())
    for hook in hooks:
        hook.remove()


def _take(normalisation: nn.Module, inputs: tuple[Tensor]) -> None:
    assert isinstance(normalisation, nn.BatchNorm2d)
    features = inputs[0].double()
    mean, variance = features.mean((0, 2, 3)), features.var((0, 2, 3), correction=0)
    values = normalisation.state_dict()
    gain = values["weight"] / (values["running_var"] + normalisation.eps).sqrt()
    normalisation.load_state_dict(
        values
        | {
            "weight": gain * (variance + normalisation.eps).sqrt(),
            "bias": values["bias"] + gain * (mean - values["running_mean"]),
            "running_mean": mean,
            "running_var": variance,
        }
    )


# The pretrained backbone: an SSD-MobileNetV1 trained to detect faces.
#
# It is part of the npm package `@vladmandic/face-api` (MIT), quantised to 8 bits.

_Tensors = dict[str, Float32]

_ROOT = "MobilenetV1/Conv2d_"
_NAME = "ssd_mobilenetv1_model"
_EPSILON = 0.001
# Loading of an exported float model (ONNX), to continue its training.
#
# Batch normalisation is folded into the exported convolutions and separated again here.

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


# Norm of each channel's weights, which normalisation makes arbitrary: about that of the backbone,
# so that the same learning rates apply.
_LENGTH = 1.5


def load_exported(net: HandNet, path: Path) -> None:
    """Fill a network with the weights of a model written by `export_float`, in place.

    It then computes the same as the model; `take_moments` must follow before training.

    Raises
    ------
    FileError
        If the file is missing or holds another network.
    """
    try:
        model = onnx.load_from_string(read_limited(path, _MOST_BYTES))
        _fill_from_graph(net, model.graph)
    except (DecodeError, LookupError, TypeError, ValueError, RuntimeError) as error:
        raise FileError(f"{path} holds another network: {error!r}") from error


def _fill_from_graph(net: HandNet, graph: onnx.GraphProto) -> None:
    """Set all weights so that the network computes the same as the graph, with moments 0 and 1."""
    values = {
        tensor.name: torch.from_numpy(numpy_helper.to_array(tensor).copy())
        for tensor in graph.initializer
    }
    own = {name.removeprefix("_net."): value for name, value in values.items()}
    net.load_state_dict({name: own[name] for name in net.state_dict() if name in own}, strict=False)
    folded = {
        node.name: [values[name] for name in node.input[1:]]
        for node in graph.node
        if node.op_type == "Conv"
    }
    units = list(net.normalised())
    with torch.no_grad():
        for name, convolution, _ in units:
            weight, _ = folded[_node(name)]
            length = weight.flatten(1).norm(dim=1).clamp_min(1e-9)
            convolution.weight.copy_(_LENGTH * weight / length[:, None, None, None])
        for name, convolution, normalisation in units:
            # Levels that share a convolution differ only by a factor for each channel.
            weight, bias = folded[_node(name)]
            gain = (weight * convolution.weight).sum((1, 2, 3)) / _LENGTH**2
            fold_in(normalisation, gain, bias)


def _node(name: str) -> str:
    """Return the exporter's name of a layer's convolution: a.0/a.0.1/a.0.1.0 for a.0.1."""
    parts = name.split(".")
    scopes = [".".join(parts[:end]) for end in range(2, len(parts) + 1)]
    return "/".join(["/_net", *scopes, f"{name}.0", "Conv"])
