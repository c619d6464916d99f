"""The training loss: assignment of points to hands, and their errors."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

_BOX_WEIGHT = 2.0
_CENTER_STRIDES = 2.5
_CANDIDATES = 10


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """The network's points: (N, 2) in pixels, and their strides (N,)."""

    points: Tensor
    strides: Tensor

    def boxes(self, raw: Tensor) -> Tensor:
        """Return the boxes (..., N, 4) of raw predictions (..., 4, N)."""
        left, top, right, bottom = (raw.clamp(-6.0, 6.0).exp() * self.strides).unbind(-2)
        x, y = self.points.T
        return torch.stack([x - left, y - top, x + right, y + bottom], -1)


def detection_loss(raw: Tensor, targets: list[Tensor], grid: Grid) -> tuple[Tensor, Tensor]:
    """Return the losses of the scores and of the boxes.

    Scores are trained to the overlap of the point's box with its hand (quality focal loss, Li et
    al. 2020), boxes to the generalised intersection over union (Rezatofighi et al. 2019).

    Parameters
    ----------
    raw : (B, 5, N) float
    targets : list of B (M, 5) float
        Box of each hand in pixels, and 1 if it is ignored: neither right nor wrong.
    grid : Grid
    """
    logits = raw[:, 0]
    boxes = grid.boxes(raw[:, 1:])
    quality = torch.zeros_like(logits)
    counts = torch.ones_like(logits)
    box_losses = []
    for image, target in enumerate(targets):
        hands, left_out = target[target[:, 4] == 0, :4], target[target[:, 4] == 1, :4]
        counts[image, _inside(grid.points, left_out).any(1)] = 0.0
        if not len(hands):
            continue
        points, chosen = _assign(logits[image].detach(), boxes[image].detach(), hands, grid)
        overlap, generalised = _overlaps(boxes[image, points], hands[chosen])
        quality[image, points] = overlap.detach().clamp_min(0.0)
        counts[image, points] = 1.0
        box_losses.append(1.0 - generalised)
    positives = max(1, sum(map(len, box_losses)))
    error = (logits.sigmoid() - quality).square()
    cross = functional.binary_cross_entropy_with_logits(logits, quality, reduction="none")
    box_loss = torch.cat(box_losses).sum() if box_losses else boxes.sum() * 0.0
    return (counts * error * cross).sum() / positives, _BOX_WEIGHT * box_loss / positives


def _inside(points: Tensor, boxes: Tensor) -> Tensor:
    """Return whether each point is in each box, (N, M)."""
    offsets = torch.cat([points[:, None] - boxes[:, :2], boxes[:, 2:] - points[:, None]], -1)
    return offsets.amin(-1) > 0


def _assign(logits: Tensor, boxes: Tensor, hands: Tensor, grid: Grid) -> tuple[Tensor, Tensor]:
    """Assign points to hands (SimOTA: Ge et al. 2021, YOLOX)."""
    center = (hands[:, :2] + hands[:, 2:]) / 2
    away = (grid.points[:, None] - center).abs().amax(-1) / grid.strides[:, None]
    central = away < _CENTER_STRIDES
    # A hand smaller than the grid may contain no point.
    fitting = central & (_inside(grid.points, hands) | (away < 1.0))
    rows = fitting.any(1).nonzero()[:, 0]
    pairs = fitting[rows]
    overlap, _ = _overlaps(boxes[rows, None], hands[None])
    overlap = overlap.clamp(1e-6)
    wrong_score = functional.binary_cross_entropy_with_logits(
        logits[rows, None].expand_as(overlap), overlap, reduction="none"
    )
    unsure = (logits[rows, None].sigmoid() - overlap).square()
    cost = unsure * wrong_score - 3.0 * overlap.log() + 1e5 * ~pairs

    answers = torch.zeros_like(pairs)
    most = min(_CANDIDATES, len(rows))
    wanted = (overlap * pairs).topk(most, 0).values.sum(0).int().clamp(1)
    for hand in range(len(hands)):
        best = cost[:, hand].topk(min(int(wanted[hand]), most), largest=False).indices
        answers[best, hand] = True
    answers &= pairs
    chosen = torch.where(answers, cost, torch.inf).argmin(1)
    answering = answers.any(1)
    return rows[answering], chosen[answering]


def _overlaps(boxes: Tensor, others: Tensor) -> tuple[Tensor, Tensor]:
    """Return intersection over union of boxes (..., 4), plain and generalised."""
    low, high = (
        torch.maximum(boxes[..., :2], others[..., :2]),
        torch.minimum(boxes[..., 2:], others[..., 2:]),
    )
    shared = (high - low).clamp_min(0.0).prod(-1)
    union = _area(boxes) + _area(others) - shared
    hull = (
        torch.maximum(boxes[..., 2:], others[..., 2:])
        - torch.minimum(boxes[..., :2], others[..., :2])
    ).prod(-1)
    overlap = shared / union.clamp_min(1e-6)
    return overlap, overlap - (hull - union) / hull.clamp_min(1e-6)


def _area(boxes: Tensor) -> Tensor:
    return (boxes[..., 2:] - boxes[..., :2]).prod(-1)
