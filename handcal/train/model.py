"""The detector's network: MobileNetV1, a small feature pyramid, one anchor-free head.

Howard et al. 2017 (MobileNet), Lin et al. 2017 (FPN), Tian et al. 2019 (FCOS).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import torch
from torch import Tensor, nn
from torch.nn import functional

from handcal.hand.detect import STRIDES

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
