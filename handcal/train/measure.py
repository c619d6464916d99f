"""The figures of the model card: ``python -m handcal.train.measure --data DIR``."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from handcal.cli.terminal import Parser, errors_in_one_line, number
from handcal.core.types import UInt8
from handcal.hand.detect import Detections, HandDetector, overlaps
from handcal.hand.shipped import FLOAT_MODEL, INTEGER_MODEL
from handcal.io.resources import resource_path
from handcal.lab.bench.speed import following_ms, simulated_frame
from handcal.lab.evaluate.annotations import read_annotations
from handcal.lab.evaluate.detector import EVALUATED, MATCH_OVERLAP, detect_all, summary
from handcal.sim.hand import HandSettings
from handcal.sim.raster import D415
from handcal.sim.room import make_room
from handcal.train.simulated import Picture, picture

# Luminance of the skin in even light at the limits of three groups of similar size.
_TONES = {"dark": 0.0, "medium": 136.0, "light": 180.0}
# Factors on red, green and blue for each light.
_LIGHTS = {"dim": (0.3, 0.3, 0.3), "warm": (1.0, 0.75, 0.45), "cold": (0.6, 0.8, 1.0)}
_RUNS = 50


@errors_in_one_line()
def main() -> None:
    """Measure both models and print JSON."""
    parser = Parser(prog="python -m handcal.train.measure", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="oxford_hands: train and val")
    parser.add_argument(
        "--seeds", type=number(int, 1, 10_000), default=200, help="simulated frames"
    )
    arguments = parser.parse_args()
    pictures = list(simulated_pictures(arguments.seeds))
    for model in (FLOAT_MODEL, INTEGER_MODEL):
        path = resource_path(model)
        figures = {
            "model": model,
            "photographs": photographed(HandDetector(path, EVALUATED), arguments.data / "val"),
            "lights": {
                light: photographed(_InLight(path, gains), arguments.data / "val")
                for light, gains in _LIGHTS.items()
            },
            "simulated": simulated(HandDetector(path), pictures),
            "median_ms": latency_ms(HandDetector(path), pictures[0].color),
            "following_ms": following_ms(HandDetector(path), simulated_frame()),
        }
        print(json.dumps(figures))  # noqa: T201


class _InLight(HandDetector):
    """A detector for which every image is first dimmed or tinted."""

    def __init__(self, model: Path, gains: tuple[float, float, float]) -> None:
        super().__init__(model, EVALUATED)
        self._gains = np.array(gains)

    def detect(self, color: UInt8, pixels: int | None = None) -> Detections:
        """Find the hands in an image under the given light."""
        return super().detect((color * self._gains).astype(np.uint8), pixels)


def photographed(detector: HandDetector, folder: Path) -> dict[str, float | None]:
    """Return the average precisions on a folder of annotated photographs."""
    photos = read_annotations(folder, folder / "annotations.json")
    return summary(photos, detect_all(photos, detector))


def simulated_pictures(seeds: int) -> Iterator[Picture]:
    """Yield a D415's image of a hand, wholly in view, and a room for each seed."""
    for seed in range(seeds):
        room = make_room(seed)
        attempt = 0
        while _shown(found := picture(seed + 10_000 * attempt, room, D415, HandSettings())) < 1.0:
            attempt += 1
        yield found


def simulated(detector: HandDetector, pictures: list[Picture]) -> dict[str, Any]:
    """Return the share of simulated hands found, over all and by skin tone.

    A hand is found if the best detection overlaps its box by half.
    """
    tones: dict[str, list[bool]] = {tone: [] for tone in _TONES}
    for drawn in pictures:
        boxes = detector.detect(drawn.color).boxes_px[:1]
        found = bool((overlaps(boxes, drawn.box[None]) >= MATCH_OVERLAP).any())
        luminance = drawn.skin @ [0.299, 0.587, 0.114]
        tone = [name for name, least in _TONES.items() if luminance >= least][-1]
        tones[tone].append(found)
    everything = [found for group in tones.values() for found in group]
    return {
        "found": np.mean(everything),
        **{
            tone: {"found": np.mean(group), "frames": len(group)}
            for tone, group in tones.items()
            if group
        },
    }


def latency_ms(detector: HandDetector, color: UInt8) -> float:
    """Return the median processor time of one detection, from the camera's image to boxes."""
    times_ms = []
    for _ in range(_RUNS):
        started_s = time.thread_time()
        detector.detect(color)
        times_ms.append(1e3 * (time.thread_time() - started_s))
    return float(np.median(times_ms))


def _shown(drawn: Picture) -> float:
    """Return the share of a hand's box within the image."""
    height, width = drawn.color.shape[:2]
    cut = drawn.box.clip(0.0, [width, height, width, height])
    whole, shown = (np.prod(box[2:] - box[:2]) for box in (drawn.box, cut))
    return float(shown / whole)


if __name__ == "__main__":
    main()
