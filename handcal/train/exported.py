"""Loading of an exported float model (ONNX), to continue its training.

Batch normalisation is folded into the exported convolutions and separated again here.
"""

from __future__ import annotations

from pathlib import Path

import onnx
import torch
from google.protobuf.message import DecodeError
from onnx import numpy_helper

from handcal.core.errors import FileError
from handcal.io.files import read_limited
from handcal.train.model import HandNet
from handcal.train.moments import fold_in

_MOST_BYTES = 2**25
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
        _fill(net, model.graph)
    except (DecodeError, LookupError, TypeError, ValueError, RuntimeError) as error:
        raise FileError(f"{path} holds another network: {error!r}") from error


def _fill(net: HandNet, graph: onnx.GraphProto) -> None:
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
