"""The training loop, resumable and reproducible on one machine, and its loss."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.utils.data import DataLoader

from handcal.core.errors import FileError
from handcal.hand.detect import decode, letterbox, points
from handcal.lab.evaluate.annotations import Photo
from handcal.lab.evaluate.detector import EVALUATED, ImageResult, summary
from handcal.train.model import HandNet
from handcal.train.samples import Samples, SampleSettings, collate

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


_CHECKPOINT = "checkpoint.pt"
_BACKBONE_RATE = 3e-4  # peak learning rate of the pretrained layers
_RISE = 0.03  # first share of the steps, over which rates rise
_GRADIENT_MAX = 10.0  # norm to which longer gradients are clipped


@dataclass(frozen=True, slots=True)
class TrainSettings:
    """Settings of the training."""

    seed: int = 1
    steps: int = 60_000
    batch: int = 4
    rate: float = 1e-3
    """Peak learning rate of AdamW for the new layers; rates rise over the first steps and fall
    linearly to 0 over the last share `fall`."""
    fall: float = 0.8
    weight_decay: float = 0.03
    average: float = 0.998
    """Decay per step of the running mean of the weights, which is evaluated."""
    settled: int = 300
    """Batches for the final moments of batch normalisation with the averaged weights."""
    validated: float = 0.1
    """Share of the photographs held out for evaluation."""
    samples: SampleSettings = field(default_factory=SampleSettings)


@dataclass(frozen=True, slots=True)
class Pace:
    """Intervals of saving and logging, and the computing device."""

    checkpoint_s: float = 180.0
    validate_steps: int = 2000
    threads: int = 1
    workers: int = 1
    """Threads of the network, and processes that prepare samples."""
    bfloat16: bool = False
    """Compute gradients with 16-bit numbers on a processor, as always on CUDA devices."""


class Training:
    """A network in training, with everything needed to resume.

    Parameters
    ----------
    net : HandNet
        With a loaded backbone.
    folder : Path
        Holds ``checkpoint.pt`` and ``log.jsonl``; training resumes from there.
    settings : TrainSettings
    pace : Pace
    """

    def __init__(self, net: HandNet, folder: Path, settings: TrainSettings, pace: Pace) -> None:
        torch.set_num_threads(pace.threads)
        torch.manual_seed(settings.seed)
        self._device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self._net = net.to(self._device)
        self._net.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._average = torch.optim.swa_utils.AveragedModel(
            self._net, multi_avg_fn=_ema(settings.average), use_buffers=True
        )
        self._optimizer = torch.optim.AdamW(
            _groups(self._net, settings), weight_decay=settings.weight_decay, fused=True
        )
        self._step = 0
        self._folder = folder
        self._settings = settings
        self._pace = pace
        self._checkpoint = folder / _CHECKPOINT
        if self._checkpoint.exists():
            self._restore()

    def run(self, photos: Sequence[Photo], hands: Path) -> nn.Module:
        """Complete the training and return the averaged network.

        Parameters
        ----------
        photos : sequence of Photo
        hands : Path
            Folder written by `render_hands`.
        """
        trained, validated = split(photos, self._settings.validated)
        saved_s = time.monotonic()
        losses: list[list[float]] = []
        samples = Samples(trained, hands, self._settings.samples, self._settings.seed)
        for images, targets in self._batches(samples, self._step, self._settings.steps):
            losses.append(self._learn(images, targets))
            if self._step % 50 == 0:
                self._log(losses=np.mean(losses, 0).round(4).tolist())
                losses.clear()
            if time.monotonic() - saved_s > self._pace.checkpoint_s:
                self._save()
                saved_s = time.monotonic()
            if self._step % self._pace.validate_steps == 0 and self._step < self._settings.steps:
                self._log(**self.validate(validated))
        self._settle(samples)
        self._save()
        self._log(**self.validate(validated))
        return self._average.module

    def validate(self, photos: Sequence[Photo]) -> dict[str, float | None]:
        """Return the averaged network's average precisions on whole photographs."""
        net = self._average.module.eval()
        results = []
        for photo in photos:
            canvas, scale = letterbox(photo.read(), EVALUATED.pixels)
            image = torch.from_numpy(canvas).to(self._device).permute(2, 0, 1)[None].float()
            with torch.inference_mode():
                raw = net(image)[0].float().cpu().numpy()
            boxes, scores = decode(raw, canvas.shape[:2], EVALUATED)
            results.append(ImageResult(boxes / scale, scores, photo.boxes))
        return summary(photos, results)

    def _batches(
        self, samples: Samples, first: int, end: int
    ) -> Iterator[tuple[Tensor, list[Tensor]]]:
        batch = self._settings.batch
        loader = DataLoader(
            samples,
            batch_size=batch,
            sampler=range(first * batch, end * batch),
            num_workers=self._pace.workers,
            collate_fn=collate,
            worker_init_fn=_quiet_worker,
        )
        yield from loader

    def _learn(self, images: Tensor, targets: list[Tensor]) -> list[float]:
        """Take one step; return the losses of scores and boxes."""
        self._set_rates()
        self._net.train()
        images = images.to(self._device).float()
        kind = self._device.type
        with torch.autocast(kind, torch.bfloat16, enabled=kind == "cuda" or self._pace.bfloat16):
            raw = self._net(images)
        grid = _grid(images.shape[2], images.shape[3], self._device)
        hands = [target.to(self._device) for target in targets]
        score_loss, box_loss = detection_loss(raw.float(), hands, grid)
        self._optimizer.zero_grad()
        (score_loss + box_loss).backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self._net.parameters(), _GRADIENT_MAX)
        self._optimizer.step()
        self._average.update_parameters(self._net)
        self._step += 1
        return [score_loss.item(), box_loss.item()]

    def _settle(self, samples: Samples) -> None:
        """Compute the moments of the averaged weights, which differ from the averaged moments."""
        end = self._settings.steps
        batches = self._batches(samples, end, end + self._settings.settled)
        images = (images.to(self._device).float() for images, _ in batches)
        torch.optim.swa_utils.update_bn(images, self._average.module)

    def _set_rates(self) -> None:
        settings = self._settings
        done = (self._step + 1) / settings.steps
        factor = min(1.0, done / _RISE, (1.0 - done) / settings.fall + 1e-3)
        for group in self._optimizer.param_groups:
            group["lr"] = factor * group["highest"]

    def _save(self) -> None:
        state = {
            "step": self._step,
            "net": self._net.state_dict(),
            "average": self._average.state_dict(),
            "optimizer": self._optimizer.state_dict(),
        }
        temporary = self._checkpoint.with_suffix(".new")
        torch.save(state, temporary)
        temporary.replace(self._checkpoint)

    def _restore(self) -> None:
        state = torch.load(self._checkpoint, map_location=self._device, weights_only=True)
        self._step = state["step"]
        self._net.load_state_dict(state["net"])
        self._average.load_state_dict(state["average"])
        self._optimizer.load_state_dict(state["optimizer"])

    def _log(self, **values: Any) -> None:
        line = json.dumps({"step": self._step, "time": time.strftime("%H:%M:%S"), **values})
        with (self._folder / "log.jsonl").open("a") as file:
            file.write(line + "\n")


def read_average(folder: Path) -> HandNet:
    """Return the averaged network of the checkpoint in a folder, with rounded weights.

    Raises
    ------
    FileError
        If there is none.
    """
    path = folder / _CHECKPOINT
    if not path.exists():
        raise FileError(f"{path} is missing", "train first")
    average = torch.load(path, map_location="cpu", weights_only=True)["average"]
    net = HandNet()
    net.load_state_dict(
        {
            name.removeprefix("module."): value
            for name, value in average.items()
            if name.startswith("module.")
        }
    )
    net.bake()
    return net.eval()


def split(photos: Sequence[Photo], validated: float) -> tuple[list[Photo], list[Photo]]:
    """Return the photographs for training, and those held out."""
    order = np.random.default_rng(0).permutation(len(photos))
    aside = set(order[: round(validated * len(photos))].tolist())
    return (
        [photo for i, photo in enumerate(photos) if i not in aside],
        [photo for i, photo in enumerate(photos) if i in aside],
    )


def _groups(net: HandNet, settings: TrainSettings) -> list[dict[str, Any]]:
    """Return all parameters with their peak rates; biases and scales do not decay."""
    groups = []
    for pretrained, rate in ((True, _BACKBONE_RATE), (False, settings.rate)):
        named = [
            parameter
            for name, parameter in net.named_parameters()
            if name.startswith("blocks.") == pretrained
        ]
        groups += [
            {"params": [p for p in named if p.ndim > 1], "highest": rate},
            {"params": [p for p in named if p.ndim == 1], "highest": rate, "weight_decay": 0.0},
        ]
    return groups


def _ema(decay: float) -> Any:
    """Return the averaging function for `AveragedModel`, faster over the first steps."""

    def update(averages: list[Tensor], values: list[Tensor], averaged: Tensor) -> None:
        weight = 1.0 - min(decay, (1.0 + float(averaged)) / (10.0 + float(averaged)))
        for average, value in zip(averages, values, strict=True):
            if average.is_floating_point():
                average.lerp_(value, weight)
            else:
                average.copy_(value)

    return update


def _grid(height: int, width: int, device: torch.device) -> Grid:
    places, strides = points(height, width)
    return Grid(torch.tensor(places, device=device), torch.tensor(strides, device=device))


def _quiet_worker(_: int) -> None:
    cv2.setNumThreads(0)
    torch.set_num_threads(1)
