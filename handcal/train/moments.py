"""Insertion of batch normalisation into a trained network that has none, or has it folded in.

Without it training destroys the backbone: at the learning rates of the new layers more and more
channels become constant at 0 or 6.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from handcal.train.model import HandNet


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
