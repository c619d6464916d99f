"""Train the hand detector: ``python -m handcal.train --data DIR --backbone DIR | --model FILE``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from handcal.cli.terminal import Parser, errors_in_one_line, number
from handcal.io.files import make_folder
from handcal.lab.evaluate.annotations import read_annotations
from handcal.train.loop import Pace, Training, TrainSettings, split
from handcal.train.model import HandNet, load_backbone, load_exported, take_moments
from handcal.train.samples import Samples, SampleSettings, collate
from handcal.train.simulated import render_hands

_SIMULATED = 1800
_MOMENTS = 80

# Weights already trained on hands learn from larger crops, closer to the detector's input.
_FURTHER = TrainSettings(
    seed=7,
    steps=28_000,
    rate=5e-4,
    fall=0.95,
    samples=SampleSettings(side_px=320, zoomed=0.4, simulated=0.13, disturbed=0.7),
)


@errors_in_one_line()
def main() -> None:
    """Prepare, start or resume training, and log to ``log.jsonl``."""
    parser = Parser(prog="python -m handcal.train", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="oxford_hands: train and val")
    count = number(int, 1, 64)
    start = parser.add_mutually_exclusive_group(required=True)
    start.add_argument(
        "--backbone",
        type=Path,
        help="start from this folder 'model' of the npm package @vladmandic/face-api",
    )
    start.add_argument(
        "--model", type=Path, help="continue training this exported float model (ONNX)"
    )
    parser.add_argument("--folder", type=Path, default=Path(".training"), help="working files")
    parser.add_argument(
        "--steps", type=number(int, 1, 10_000_000), help="number of steps; default: the recipe's"
    )
    parser.add_argument("--threads", type=count, default=1)
    parser.add_argument("--workers", type=count, default=1)
    parser.add_argument(
        "--bfloat16",
        action="store_true",
        help="faster on processors with AVX-512 BF16; CUDA devices always do so",
    )
    arguments = parser.parse_args()

    train = arguments.data / "train"
    photos = read_annotations(train, train / "annotations.json")
    settings = TrainSettings() if arguments.backbone else _FURTHER
    if arguments.steps is not None:
        settings = replace(settings, steps=arguments.steps)
    net = HandNet()
    if arguments.backbone:
        load_backbone(net, arguments.backbone)
    else:
        load_exported(net, arguments.model)
    hands = make_folder(arguments.folder) / "hands"
    render_hands(hands, _SIMULATED)
    trained, _ = split(photos, settings.validated)
    samples = Samples(trained, hands, settings.samples, settings.seed)
    take_moments(net, collate([samples[index] for index in range(_MOMENTS)])[0])
    pace = Pace(threads=arguments.threads, workers=arguments.workers, bfloat16=arguments.bfloat16)
    Training(net, arguments.folder, settings, pace).run(photos, hands)


if __name__ == "__main__":
    main()
