"""Train the hand detector: ``python -m handcal.train --data DIR --backbone DIR``."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from handcal.evaluate.annotations import read_annotations
from handcal.files import make_folder
from handcal.train.backbone import load_backbone
from handcal.train.loop import Pace, Training, TrainSettings
from handcal.train.model import HandNet
from handcal.train.simulated import render_hands

_SIMULATED = 1800


def main() -> None:
    """Prepare, train or resume, and log to ``log.jsonl``."""
    parser = argparse.ArgumentParser(prog="python -m handcal.train", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="oxford_hands: train and val")
    parser.add_argument(
        "--backbone",
        type=Path,
        required=True,
        help="folder 'model' of the npm package @vladmandic/face-api",
    )
    parser.add_argument("--folder", type=Path, default=Path(".training"), help="working files")
    parser.add_argument("--steps", type=int, default=TrainSettings().steps)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()

    hands = make_folder(arguments.folder) / "hands"
    render_hands(hands, _SIMULATED)
    net = HandNet()
    load_backbone(net, arguments.backbone)
    train = arguments.data / "train"
    photos = read_annotations(train, train / "annotations.json")
    settings = replace(TrainSettings(), steps=arguments.steps)
    pace = Pace(threads=arguments.threads, workers=arguments.workers)
    Training(net, arguments.folder, settings, pace).run(photos, hands)


if __name__ == "__main__":
    main()
