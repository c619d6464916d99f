"""Batch normalisation put into a trained network that had none, or only folded into its weights.

Without it training kills the backbone: at rates that suit the new layers ever more channels come to
be 0 or 6 whatever they see.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from handcal.train.model import HandNet


def fold_in(normalisation: nn.BatchNorm2d, gain: Tensor, bias: Tensor) -> None:
    """Let a layer multiply by `gain` (C,) and add `bias` (C,), nothing being known of its input."""
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
    """Give normalisation the moments of images, so that the network computes what it did.

    Parameters
    ----------
    net : HandNet
    images : (B, 3, H, W) tensor
        Like those to be trained on.
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
