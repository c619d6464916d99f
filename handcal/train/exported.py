"""The network that an exported model of floats (ONNX) holds, to be trained further.

Batch normalisation is folded into the exported convolutions; it is taken apart again here.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import onnx
import torch
from google.protobuf.message import DecodeError
from onnx import numpy_helper
from torch import Tensor, nn

from handcal.errors import FileError
from handcal.files import read_limited
from handcal.train.model import HandNet

_MOST_BYTES = 2**25


def load_exported(net: HandNet, path: Path, batches: Iterable[Tensor]) -> None:
    """Fill a network with the weights of a model that `export_float` wrote, in place.

    Parameters
    ----------
    net : HandNet
    path : Path
    batches : iterable of (B, 3, H, W) tensor
        Images like those to be trained on, over which normalisation takes its moments.

    Raises
    ------
    FileError
        If the file is missing or holds another network.
    """
    try:
        model = onnx.load_from_string(read_limited(path, _MOST_BYTES))
        _fill(net, model.graph)
    except (DecodeError, LookupError, TypeError, ValueError, RuntimeError) as error:
        raise FileError(f"{path} holds another network: {error!r}") from error
    _take_moments(net, batches)


def _fill(net: HandNet, graph: onnx.GraphProto) -> None:
    """Set all weights so that the network computes what the graph does, its moments 0 and 1."""
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
    units = [
        (convolution, normalisation, *folded[f"/_net/{name}.0/Conv"])
        for name, (convolution, normalisation) in _normalised(net).items()
    ]
    with torch.no_grad():
        for convolution, _, weight, _ in units:
            length = weight.flatten(1).norm(dim=1).clamp_min(1e-9)
            convolution.weight.copy_(weight / length[:, None, None, None])
        for convolution, normalisation, weight, bias in units:
            # Levels that share a convolution differ by a factor of each channel only.
            normalisation.weight.copy_((weight * convolution.weight).sum((1, 2, 3)))
            normalisation.bias.copy_(bias)
            normalisation.running_mean.zero_()
            normalisation.running_var.fill_(1.0 - normalisation.eps)


def _take_moments(net: HandNet, batches: Iterable[Tensor]) -> None:
    """Give normalisation the moments of these images, so that the network computes what it did."""
    layers = [normalisation for _, normalisation in _normalised(net).values()]
    moments: dict[nn.Module, list[Tensor]] = {layer: [] for layer in layers}

    def note(layer: nn.Module, inputs: tuple[Tensor]) -> None:
        features = inputs[0].double()
        moments[layer].append(torch.stack([features, features.square()]).mean((1, 3, 4)))

    hooks = [layer.register_forward_pre_hook(note) for layer in layers]
    with torch.inference_mode():
        for images in batches:
            net.eval()(images.float())
    for hook in hooks:
        hook.remove()
    for layer in layers:
        mean, square = torch.stack(moments[layer]).mean(0)
        variance = (square - mean.square()).clamp_min(0.0)
        with torch.no_grad():
            layer.bias.add_(layer.weight * mean)
            layer.weight.mul_((variance + layer.eps).sqrt())
            layer.running_mean.copy_(mean)
            layer.running_var.copy_(variance)


def _normalised(net: HandNet) -> dict[str, tuple[nn.Conv2d, nn.BatchNorm2d]]:
    """Return the convolutions that are followed by batch normalisation, by exported name."""
    found = {}
    for name, module in net.named_modules():
        if isinstance(module, nn.Sequential) and len(module) == 3:
            convolution, normalisation, _ = module
            if isinstance(normalisation, nn.BatchNorm2d):
                parts = name.split(".")
                exported = "/".join(".".join(parts[:n]) for n in range(2, len(parts) + 1))
                found[f"{exported}/{name}"] = convolution, normalisation
    return found
